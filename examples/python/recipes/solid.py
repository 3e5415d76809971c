"""A solid plate, 1 mm thick: the hand comes from above and pushes 30 mm through it, and the plate still holds it."""

from recipe import finish, rounded

import forceserver as fs

faces = [  # counter-clockwise as seen from outside, so the front is outside
    *[[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4]],
    *[[2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]],
]
corners = [[x, y, z] for z in (-0.001, 0) for y in (-0.03, 0.03) for x in (-0.03, 0.03)]
scene = fs.Scene()
scene["plate"] = fs.Mesh(corners, faces, contact=fs.Contact(keep="front", stiffness=200, limit=5))
tool = fs.Tool(scene)  # it remembers where it has been
state, felt = fs.State(), fs.Response()
for i in range(10, -31, -1):
    state.pose.position[2] = 1e-3 * i
    tool.evaluate(state, out=felt)
    if i % 10 == 0:
        where = "above" if i > 0 else "on or through the plate"
        force = ", ".join(f"{rounded(value):5.2f}" for value in felt.wrench.force)
        print(f"{where:26} ({0:5.1f}, {0:5.1f}, {i:5.1f}) mm   ({force}) N")
finish(scene)
