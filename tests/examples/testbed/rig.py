"""What the tests of VirtualRobot share: the robot, the hand and the servo in one process, in virtual time."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import forceserver as fs
import numpy as np

testbed = Path(__file__).parents[3] / "examples" / "testbed"
patience = 90  # s: nothing here is a measure of time, this only ends what would never come
sys.path.insert(0, str(testbed))

from virtualrobot.manipulator import Manipulator  # noqa: E402
from virtualrobot.robot import Robot, period  # noqa: E402
from virtualrobot.world import World  # noqa: E402


def eventually(f: Callable[[], object]) -> object:
    """Waits until f() is true, and returns it."""
    end = time.monotonic() + patience
    while not (value := f()):
        assert time.monotonic() < end, "it never came"
        time.sleep(0.02)
    return value


def hand_at(position, time: float, *, flags: int = fs.StateFlags.READY) -> fs.Hand:
    """A hand in the scene at a time (s), without a device."""
    pose = fs.Pose(position=position)
    return fs.Hand(fs.State(pose=pose, time=time, flags=flags), fs.Response(proxy=pose), fs.Wrench())


class Rig:
    """A simulated hand on a path (t, x, y, z: s, m at the device), and what it feels of the robot."""

    def __init__(self, folder: Path, path: list[tuple[float, float, float, float]], mode: str, *, hand: str = "firm", blend: float = 0,
                 place: tuple[float, float, float] = (0, 0, 0)) -> None:  # fmt: skip
        file = folder / "path.txt"
        file.write_text("".join(f"{t} {x} {y} {z}\n" for t, x, y, z in path))
        self.world = World()
        if any(place):
            self.world.put(*place)
        self.scene = fs.Scene()
        self.robot = Manipulator(self.scene, self.world) if mode == "arm" else Robot(self.scene, self.world, mode)
        self.device = fs.Device(f"sim:?hand={hand}&friction=0&encoder=ideal&path={file}")
        self.servo = fs.Servo(self.scene, self.device, mode="virtual", blend=blend)
        self.servo.step(1)
        self.said: list[str] = []
        self.last = 0

    def __enter__(self) -> Rig:
        return self

    def __exit__(self, *_: object) -> None:
        self.servo.close()
        self.device.close()

    def run(self, seconds: float, every: float = period) -> Iterator[fs.Hand]:
        """Frame after frame; the hand after each. every: s, from frame to frame, on a busy machine more than the period."""
        for _ in range(round(seconds / every)):
            said = self.robot.frame(self.scene.hand(), self.scene.time)
            if said:
                self.said.append(said)
            self.servo.step(round(1000 * every))
            yield self.scene.hand()

    def felt(self) -> np.ndarray:
        """The forces of the scene at each tick since the last call, N at the device, shape (n, 3)."""
        ticks = self.scene.get_record(self.last)
        self.last = int(ticks["number"][-1]) if len(ticks) else self.last
        return np.array(np.asarray(ticks["tick"]["response"]["wrench"]["force"]), dtype=float).reshape(len(ticks), -1)


def angle_between(a: np.ndarray, b: np.ndarray) -> float:
    """Degrees."""
    return math.degrees(math.atan2(np.linalg.norm(np.cross(a, b)), a @ b))
