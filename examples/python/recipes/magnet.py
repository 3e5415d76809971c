"""A magnet with a battery: it draws the hand from all sides, most strongly 10 mm away, with 3 N. The gain is the charge
of the battery, 0 to 1, and may change at any time while the magnet is felt."""

from recipe import feel, finish

import forceserver as fs

pull = fs.Custom("3 * d/0.01 * exp(0.5 - (d/0.01)^2/2)", limit=3)  # d: m; N
scene = fs.Scene()
scene["magnet"] = fs.Point(front=pull)
feel(scene, "at the magnet", 0, 0, 0)
feel(scene, "20 mm above it", 0, 0, 0.02)
for charge in (100, 75, 50, 25, 0):
    pull.gain = charge / 100
    scene["magnet"].change(front=pull)  # not the pose: another client may move it
    feel(scene, f"10 mm above it, at {charge} %", 0, 0, 0.01)
finish(scene)
