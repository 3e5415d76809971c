"""A peg in a hole: a tool of six points, and a plate with a hole that is 0.4 mm wider all around and 3 degrees askew. The
tip presses against one wall of the hole, and the upper points come to rest on the rim on the other side: the peg jams.
Each point has a proxy and a force of its own. The forces act beside the handle's origin, so they make a torque, which
turns the peg towards the direction of the hole. On a device that gives torques the peg then slips in."""

import math
import sys

import numpy as np

import forceserver as fs

sides = 48  # of the hole
askew = 3  # degrees, about y
top, tip = -0.02, -0.05  # m: the height of the hole's mouth; where the tip is below the handle


def rounded(value, unit):
    return 0 if abs(value) < unit / 2 else value  # no "-0.0"


def plate():
    """A round plate with a round hole, as a closed mesh: a rectangle that goes round the z axis."""
    angle = 2 * np.pi * np.arange(sides) / sides
    rectangle = [(0.0084, -0.06), (0.05, -0.06), (0.05, 0), (0.0084, 0)]  # m: radius, height
    corners = [[r * np.cos(a), r * np.sin(a), z] for a in angle for r, z in rectangle]
    faces = []
    for a in range(4 * sides):
        b = a - a % 4 + (a + 1) % 4
        c, d = (a + 4) % (4 * sides), (b + 4) % (4 * sides)
        faces += [[a, c, b], [b, c, d]]  # counter-clockwise as seen from outside: that is the front
    half = math.radians(askew / 2)
    return fs.Mesh(
        corners,
        faces,
        pose=fs.Pose(position=[0, 0, top], orientation=[math.cos(half), 0, math.sin(half), 0]),
        # Stiffness and damping are for each point, whose forces add; the limit is for all points together.
        contact=fs.Contact(keep="front", stiffness=2000, damping=10, limit=20),
    )


def push(device):
    """Pushes the peg down for a second, and prints what the hand feels. Returns the depth (mm) and tilt (degrees) at the
    end, all forces upwards (N) and all torques about y (N m)."""
    # Three points around the tip; three 30 mm higher, between them.
    points = [
        [0.008 * math.cos(i * math.pi / 3), 0.008 * math.sin(i * math.pi / 3), tip + 0.03 if i % 2 else tip]
        for i in range(6)
    ]
    scene = fs.Scene()
    scene.set_tool(points)
    scene["plate"] = plate()
    forces, torques = [], []
    print("   time      depth      tilt   force: sideways, up     torque")
    # Time advances only when we step. Felt in full from the first tick on: no person holds this handle.
    with fs.Servo(scene, device, mode="virtual", fade=-1, ramp=-1, max_stiffness=-1) as servo:
        for i in range(1, 1001):
            servo.step(1)
            hand = scene.hand()
            w, x, y, z = hand.state.pose.orientation
            peg_x, peg_z = 2 * (x * z + w * y), 1 - 2 * (x * x + y * y)  # the direction of the peg
            tilt = askew - math.degrees(math.atan2(peg_x, peg_z))
            depth = 1e3 * (top - hand.state.pose.position[2] - tip * peg_z)
            sideways, _, up = hand.response.wrench.force
            torque = hand.response.wrench.torque[1]
            forces.append(up)
            torques.append(torque)
            if i >= 400 and i % 50 == 0:
                print(
                    f"{i * 1e-3:5.2f} s  {depth:6.1f} mm  {tilt:4.1f} deg     {rounded(sideways, 0.1):4.1f} N   "
                    f"{rounded(up, 0.1):4.1f} N   {rounded(torque, 0.001):6.3f} N m"
                )
    return depth, tilt, forces, torques


failures = 0


def expect(holds, sentence):
    global failures
    print(f"{'yes' if holds else 'NO'}: {sentence}")
    failures += not holds


print("a handle that does not turn")  # a passive wrist: no torque comes from the device
depth, tilt, forces, torques = push("sim:?hand=firm&path=touch&wrist=passive")
print("\na handle that turns")
depth_2, tilt_2, forces_2, torques_2 = push("sim:?hand=firm&path=touch&wrist=active")
print()
expect(30 < depth < 36 and max(forces) > 5, "the peg that does not turn jams, 30 mm deep")
expect(max(torques) > 0.05 and min(torques) > -0.005, "its torque always points to where the hole does")
expect(tilt_2 < 2.2 and min(torques_2) > -0.01, "this torque turns the other peg, until it fits")
expect(depth_2 > 50, "so it slips in")
sys.exit(failures > 0)
