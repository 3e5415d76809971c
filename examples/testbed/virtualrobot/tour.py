"""python -m virtualrobot.tour drive|arm SECONDS LEAD FILE: writes the path of a simulated hand (sim:?path=FILE).

It begins after LEAD s. drive: straight ahead, a turn against the plane to either side, back. arm: out of reach and back, down to
the ground and along it, onto a rock, and up.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from .arm import Arm
from .ground import Array
from .manipulator import arm_scale, home
from .world import World

drive_stops = np.array([[0, 0, 0], [0.04, 0, 0], [0.04, 0, 0], [0.035, 0.02, 0], [0.035, 0.02, 0], [0.03, -0.02, 0],
                        [-0.03, 0, 0], [0, 0, 0]])  # fmt: skip


def arm_stops() -> Array:
    """m, at the device."""
    world = World()
    arm = Arm(world)

    def above(x: float, y: float, height: float) -> Array:
        return arm.ground_below(x, y) + [0, 0, height]

    rock = arm.to_arm(world.data.geom_xpos[world.rocks[0]])
    stops = [
        np.array(home), np.array([1.3, 0.2, 0.3]), np.array([0.7, 0.2, 0.1]),
        above(0.6, -0.2, 0.15), above(0.6, -0.2, -0.02), above(0.7, 0.1, -0.02), above(0.6, 0, 0.2),
        rock + [0, 0, 0.3], rock + [0, 0, 0.05], rock + [0, 0, 0.35], np.array(home),
    ]  # fmt: skip
    return (np.array(stops) - home) / arm_scale


def path(stops: Array, seconds: float, lead: float) -> Array:
    """Rows of t, x, y, z: from stop to stop in equal times, slowly at both ends."""
    t = np.arange(0, seconds, 0.02)
    way = t / seconds * (len(stops) - 1)
    leg = way.astype(int)
    part = way - leg
    part = part * part * (3 - 2 * part)
    places = stops[leg] + part[:, None] * (stops[leg + 1] - stops[leg])
    rows = np.column_stack([t + lead, places])
    return np.concatenate([[[0, *stops[0]]], rows[rows[:, 0] > 0], [[seconds + lead, *stops[-1]]]])


def main() -> int:
    if len(sys.argv) != 5 or sys.argv[1] not in ("drive", "arm"):
        print(f"usage: {__doc__.splitlines()[0] if __doc__ else ''}", file=sys.stderr)
        return 2
    try:
        mode, seconds, lead, file = sys.argv[1], float(sys.argv[2]), float(sys.argv[3]), Path(sys.argv[4])
    except ValueError as failure:
        print(f"virtualrobot.tour: {failure}", file=sys.stderr)
        return 2
    rows = path(drive_stops if mode == "drive" else arm_stops(), seconds, lead)
    file.write_text("".join(f"{t:.3f} {x:.9g} {y:.9g} {z:.9g}\n" for t, x, y, z in rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
