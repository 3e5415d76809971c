"""A box of 60 mm x 60 mm x 40 mm: no force outside; inside, 500 N/m push the hand to the nearest face, 10 N at most."""

from recipe import feel, finish

import forceserver as fs

faces = [  # counter-clockwise as seen from outside, so the front is outside
    *[[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4]],
    *[[2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]],
]
corners = [[x, y, z] for z in (-0.02, 0.02) for y in (-0.03, 0.03) for x in (-0.03, 0.03)]
scene = fs.Scene()
scene["box"] = fs.Mesh(corners, faces, back=fs.LinearIncreasing(500, limit=10))
feel(scene, "above the box", 0, 0, 0.03)
feel(scene, "5 mm below the top", 0, 0, 0.015)
feel(scene, "5 mm from the right face", 0.025, 0, 0)
feel(scene, "beside a corner, outside", 0.031, 0.031, 0.021)
finish(scene)
