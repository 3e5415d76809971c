"""A hazard: a border, here a circle with a radius of 40 mm, that keeps the hand away on both sides, most strongly 10 mm
away, with 3 N. On the border itself there is no force, so the force does not jump when the hand is pushed across it;
from 30 mm on there is none either."""

import numpy as np
from recipe import feel, finish

import forceserver as fs

newtons = [0, 2.2, 3, 2.4, 1.2, 0.3, 0]  # every 5 mm
angle = np.radians(np.arange(360) + 0.5)  # with so many the force hardly jumps where, inside, two edges are equally near
border = np.column_stack([0.04 * np.cos(angle), 0.04 * np.sin(angle), np.zeros(360)])
scene = fs.Scene()
scene["hazard"] = fs.Polyline(border, closed=True, front=fs.Custom(newtons, step=0.005, limit=3, sense="repulsive"))
feel(scene, "on the border", 0.04, 0, 0)
feel(scene, "10 mm outside", 0.05, 0, 0)
feel(scene, "10 mm inside", 0.03, 0, 0)
feel(scene, "10 mm above the border", 0.04, 0, 0.01)
feel(scene, "in the middle", 0, 0, 0)
finish(scene)
