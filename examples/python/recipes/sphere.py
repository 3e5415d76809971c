"""A ball with a radius of 30 mm: no force outside; inside, 500 N/m push the hand out, away from the centre. No mesh is
needed: the force of a point can fall with the distance d, as 500 N/m * (30 mm - d), and is 0 from 30 mm on."""

from recipe import feel, finish

import forceserver as fs

stiffness, radius = 500, 0.03  # N/m, m
scene = fs.Scene()
scene["ball"] = fs.Point(front=fs.LinearDecreasing(-stiffness, stiffness * radius, limit=10, sense="repulsive"))
feel(scene, "outside", 0, 0.04, 0)
feel(scene, "on the surface", 0, 0.03, 0)
feel(scene, "10 mm deep", 0, 0.02, 0)
feel(scene, "10 mm deep, elsewhere", 0.012, 0, -0.016)
feel(scene, "25 mm deep: the limit", 0, 0, 0.005)
finish(scene)
