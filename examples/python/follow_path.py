"""A path to follow: a polyline draws the hand towards it. Without the path this hand would go straight, up to 30 mm
away from the polyline; with it, the hand stays within 9 mm."""

import numpy as np

import forceserver as fs

i = np.arange(51)
points = np.column_stack([-0.1 + 0.004 * i, 0.03 * np.sin(i * 0.125), np.zeros(51)])  # a wave, 0.2 m long
scene = fs.Scene()
scene["path"] = fs.Polyline(points, front=fs.LinearIncreasing(400, limit=8))  # 400 N/m, 8 N at most
with fs.Servo(scene, fs.Device("sim:?path=sweep"), mode="virtual") as servo:  # time advances only when we step
    for _ in range(8):
        servo.step(500)
        print(f"the hand is {1e3 * scene['path'].report.distance:.1f} mm beside the path")
