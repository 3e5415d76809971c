"""Hello: a wall that the hand feels. A simulated hand wants to be 20 mm behind the wall, for two seconds. It comes to
rest 4.4 mm deep, where the wall pushes back with 500 N/m * 4.4 mm = 2.2 N, as hard as the hand does."""

import forceserver as fs

scene = fs.Scene()
scene["wall"] = fs.Wall((0, 0, 0), (0, 0, 1), stiffness=500, limit=10)  # free above z = 0; 500 N/m, 10 N at most
device = fs.Device("sim:?hold=0,0,-0.02")
with fs.Servo(scene, device, mode="virtual") as servo:  # time advances when we step; the default is a real-time thread
    for i in range(1, 9):
        servo.step(250)
        hand = scene.hand()
        depth, force = hand.state.pose.position[2], hand.sent.force[2]
        print(f"{i * 0.25:.2f} s: the hand is at {1e3 * depth:6.2f} mm and feels {force:.2f} N")
assert depth > -0.005 and force > 2
