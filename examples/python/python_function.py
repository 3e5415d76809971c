"""A profile from a Python function: it is not called at the servo's rate, but sampled into a table when it is made."""

import math

import forceserver as fs

bump = fs.Custom(lambda d: 2 * math.sin(500 * d) ** 2, until=0.006, sense="repulsive", limit=5)
print(bump.sampled)
distances = [0, 0.0015, 0.003, 0.0045, 0.006]  # m
for d, force in zip(distances, fs.intensity(bump, distances)):
    print(f"{1e3 * d:5.1f} mm {force:7.2f} N")
