"""A loop of your own: a tool gives the force at a pose. Here the application is responsible for time, device and
safety: only the objects' own limits bound the force."""

import forceserver as fs

mass, damping, dt = 0.3, 3, 0.001  # kg, N s/m, s: a ball on a damper, let go at 50 mm
x, v = 0.05, 0.0

scene = fs.Scene()
scene["magnet"] = fs.Point(front=fs.LinearIncreasing(100, limit=4))  # 100 N/m, 4 N at most
tool = fs.Tool(scene)
state, response = fs.State(), fs.Response()  # kept from tick to tick
position, force = state.pose.position, response.wrench.force  # views: they show what is in state and response now
for i in range(2000):
    position[0] = x
    tool.evaluate(state, out=response)
    v += (force[0] - damping * v) / mass * dt
    x += v * dt
    if i % 250 == 0:
        print(f"{i * dt:.2f} s: {1e3 * x:6.2f} mm, {force[0]:6.3f} N")
assert -0.001 < x < 0.001
