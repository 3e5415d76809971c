"""A wall: no force above z = 0; below, 500 N/m push the hand out, 10 N at most."""

from recipe import feel, finish

import forceserver as fs

scene = fs.Scene()
scene["wall"] = fs.Wall((0, 0, 0), (0, 0, 1), 500, 10)  # the normal points to where the hand is free
feel(scene, "in front", 0, 0, 0.01)
feel(scene, "10 mm deep", 0, 0, -0.01)
feel(scene, "10 mm deep, elsewhere", 0.04, 0.03, -0.01)
feel(scene, "50 mm deep: the limit", 0, 0, -0.05)
finish(scene)
