"""Gravity: the weight of 0.2 kg, downwards and the same everywhere. The force of a plane is along its normal: its front
draws the hand to the plane, its back drives it away from the plane, and both are downwards."""

from recipe import feel, finish

import forceserver as fs

weight = 0.2 * 9.81  # N
scene = fs.Scene()
scene["gravity"] = fs.Plane(
    front=fs.Constant(weight, limit=weight), back=fs.Constant(weight, limit=weight, sense="repulsive")
)
feel(scene, "above the plane", 0, 0, 0.05)
feel(scene, "in the plane", 0, 0, 0)
feel(scene, "below the plane", 0, 0, -0.05)
feel(scene, "far to the side", 0.09, -0.07, 0.02)
finish(scene)
