"""Profiles of your own: an expression in the distance d and the time t, a table of measured values, and a Python
function, which is sampled into a table. The program prints the force of each at some distances."""

import math

import forceserver as fs

pulse = fs.Custom("3*(1+sin(12*t))*exp(-d/0.01)", sense="repulsive", limit=5)
click = fs.Custom([2, 2.4, 2.6, 1.5, 0.4, 0.1, 0], step=0.001, sense="repulsive", limit=5)  # a push-button, N each mm
bump = fs.Custom(lambda d: 2 * math.sin(500 * d) ** 2, until=0.006, sense="repulsive", limit=5)
print("bump:", bump.sampled)

distances = [0, 0.0015, 0.003, 0.0045, 0.006]  # m
columns = [
    fs.intensity(pulse, distances),
    fs.intensity(pulse, distances, t=0.13),
    fs.intensity(click, distances),
    fs.intensity(bump, distances),
]
print("distance   pulse, t = 0 s   t = 0.13 s     click      bump")
for d, at_start, later, table, function in zip(distances, *columns):
    print(f"{1e3 * d:5.1f} mm {at_start:14.2f} N {later:10.2f} N {table:7.2f} N {function:7.2f} N")
