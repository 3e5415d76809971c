"""A fingertip: the tool's point is a ball with a radius of 8 mm. A floor and a wall hold it at its skin, and a post that pushes
everything away within 10 mm is felt 8 mm earlier."""

from recipe import finish, rounded

import forceserver as fs

contact = fs.Contact(keep="front", stiffness=500, limit=10)
scene = fs.Scene()
scene.tool_radius = 0.008
scene["floor"] = fs.Plane(contact=contact)
scene["wall"] = fs.Plane(normal=(1, 0, 0), contact=contact)
scene["post"] = fs.Point(
    position=(0.04, 0, 0.008), front=fs.LinearDecreasing(-100, 1, limit=10, sense="repulsive")
)
tool = fs.Tool(scene)
at = [0.02, 0, 0.03]  # m


def go_to(where, x, z):
    start = tuple(at)
    for i in range(1, 51):
        at[0] = start[0] + (x - start[0]) * i / 50
        at[2] = start[2] + (z - start[2]) * i / 50
        felt = tool.evaluate(fs.State(pose=fs.Pose(position=at)))
    place = ", ".join(f"{1e3 * value:5.1f}" for value in at)
    force = ", ".join(f"{rounded(value):5.2f}" for value in felt.wrench.force)
    print(f"{where:26} ({place}) mm   ({force}) N")


go_to("above", 0.02, 0.02)
go_to("it touches the floor", 0.02, 0.008)
go_to("2 mm into the floor", 0.02, 0.006)
go_to("1 mm into the wall, too", 0.007, 0.006)
go_to("6 mm from the post", 0.026, 0.008)
go_to("touches the post", 0.032, 0.008)
finish(scene)
