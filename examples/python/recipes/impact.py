"""A wooden table that knocks: the hand comes down at three speeds, and stops as it touches, 0.1 mm below the surface."""

from recipe import finish, rounded

import forceserver as fs

scene = fs.Scene()
scene["table"] = fs.Plane(
    contact=fs.Contact(keep="front", stiffness=500, limit=5),
    surface=fs.surface(impact="medium"),  # wood: 8 N s/m, 100 Hz, 80/s
)
tool = fs.Tool(scene)
state, felt = fs.State(time=1), fs.Response()


def go_to(z, speed):
    state.time += 5e-4
    state.pose.position = (0, 0, z)
    state.twist.linear = (0, 0, -speed)
    tool.evaluate(state, out=felt)


def show(speed, when):
    place = ", ".join(f"{1e3 * value:5.1f}" for value in state.pose.position)
    force = ", ".join(f"{rounded(value):5.2f}" for value in felt.wrench.force)
    print(f"{speed:4.2f} m/s, {when:16} ({place}) mm   ({force}) N")


for speed in (0.2, 0.1, 0.01):
    z, way = 0.02, 5e-4 * speed  # m
    for _ in range(401):  # 0.2 s, in which the last knock fades
        go_to(z, 0)
    show(speed, "above")
    while (z := z - way) > way / 2:
        go_to(z, speed)
    for i in range(16):
        go_to(-1e-4, speed if i == 0 else 0)
        if i % 5 == 0:
            show(speed, f"after {0.5 * i:3.1f} ms")
finish(scene)
