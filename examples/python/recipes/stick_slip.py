"""A table that sticks and slips: the hand pushes with 1 N on it, 2 mm deep, and is drawn aside, back, and aside again."""

from recipe import finish, rounded

import forceserver as fs

scene = fs.Scene()
scene["table"] = fs.Plane(
    contact=fs.Contact(keep="front", stiffness=500, limit=5),
    surface=fs.surface(static_friction=0.8, dynamic_friction=0.4, slip_distance=2e-3),
)
tool = fs.Tool(scene)
state, felt = fs.State(), fs.Response()
state.pose.position = (0, 0, 1e-3)  # from above
tool.evaluate(state, out=felt)
x = 0
for stop in (0, 10, 16, 20, 40, 80, 70, 64, 75, 90):  # 0.1 mm
    while True:  # in small steps, as a hand goes
        x += (x < stop) - (x > stop)
        state.pose.position = (1e-4 * x, 0, -2e-3)
        tool.evaluate(state, out=felt)
        if x == stop:
            break
    force = ", ".join(f"{rounded(value):5.2f}" for value in felt.wrench.force)
    print(f"{'on the table':26} ({0.1 * x:5.1f}, {0:5.1f}, {-2:5.1f}) mm   ({force}) N")
finish(scene)
