"""Corduroy: cords along y, 4 mm apart, 0.4 mm high. The hand comes from above, pushes 3 mm deep, and goes across a cord."""

import numpy as np
from recipe import finish, rounded

import forceserver as fs

heights = -0.0002 * (1 - np.cos(2 * np.pi * np.arange(16) / 16))  # of one cord, from its top to the next
scene = fs.Scene()
scene["cloth"] = fs.Plane(
    contact=fs.Contact(keep="front", stiffness=500, limit=5),
    surface=fs.surface(heights=[heights], width=0.004 / 16, repeats=True),
)
tool = fs.Tool(scene)
state, felt = fs.State(), fs.Response()
for i in range(-1, 9):
    x, z = (0, 1) if i < 0 else (0.5 * i, -3)
    state.pose.position = (1e-3 * x, 0, 1e-3 * z)
    tool.evaluate(state, out=felt)
    where = "above" if i < 0 else "on the cloth"
    force = ", ".join(f"{rounded(value):5.2f}" for value in felt.wrench.force)
    print(f"{where:26} ({x:5.1f}, {0:5.1f}, {z:5.1f}) mm   ({force}) N")
finish(scene)
