"""A spring to the centre, which a real-time servo renders to a simulated hand that draws an eight. The force is 5 N at
most, from 25 mm from the centre on."""

import math
import time

import forceserver as fs

scene = fs.Scene()
scene["spring"] = fs.Point(front=fs.LinearIncreasing(200, limit=5))  # at the origin: 200 N/m, 5 N at most
with fs.Servo(scene, fs.Device("sim:?path=figure8")):  # felt until the end of this block; then the force is 0 first
    for _ in range(10):
        time.sleep(0.2)
        hand = scene.hand()
        distance, force = math.hypot(*hand.state.pose.position), math.hypot(*hand.sent.force)
        print(f"the hand is {1e3 * distance:5.1f} mm from the centre and feels {force:.2f} N")
