"""measure.py: what the testbed in Python costs, and how much the force changes from tick to tick. Not a test: it prints figures.

    build/testbed/bin/python -B tests/examples/testbed/measure.py
"""

from __future__ import annotations

import functools
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from unittest.mock import patch

import forceserver as fs
import numpy as np
import rig
import virtualrobot.manipulator
import virtualrobot.robot
from rig import Rig
from test_arm import at_device
from virtualrobot.ground import Ground
from virtualrobot.manipulator import Manipulator
from virtualrobot.robot import Robot, period
from viz.app import Viz
from viz.picture import Picture
from viz.show import Show

curve: list[tuple[float, float, float, float]] = [
    (0, 0, 0, 0), (1, 0.03, 0.01, 0), (4, 0.04, 0.02, 0), (8, 0.03, -0.02, 0), (12, -0.02, 0.01, 0), (16, 0.03, 0, 0),
]  # fmt: skip


def spread(values: list[float]) -> str:
    v = np.array(values)
    return f"p50 {np.quantile(v, 0.5):.2f}, p99 {np.quantile(v, 0.99):.2f}, max {v.max():.2f}"


def steps_of(path: list[tuple[float, float, float, float]], mode: str, blend: float, seconds: float) -> str:
    with tempfile.TemporaryDirectory() as folder, Rig(Path(folder), path, mode, blend=blend) as one:
        felt = [one.felt() for _ in one.run(seconds)]
    force = np.concatenate(felt)[500:]
    step = np.linalg.norm(np.diff(force, axis=0), axis=1)
    return f"p99.9 {np.quantile(step, 0.999):.4f} N, max {step.max():.4f} N, {np.sum(step > 0.05)} of {len(step)} above 0.05 N"


def without_twist(*_: object) -> fs.Twist:
    return fs.Twist()


class Switched(Manipulator):
    """The ground is there only while MuJoCo has a contact at the tip."""

    def frame(self, hand: fs.Hand, time: float) -> str | None:
        said = super().frame(hand, time)
        tip = self.world.model.geom("tip").id
        touches = any(tip in self.world.data.contact[i].geom for i in range(self.world.data.ncon))
        if self.scene["ground"].enabled != touches:
            self.scene["ground"].enabled = touches
        return said


def over_ground() -> list[tuple[float, float, float, float]]:
    """The tip goes down to the ground, along it, up and down again."""
    arm = virtualrobot.manipulator.Arm(rig.World())
    path = []
    for t, x, y, above in ((0, 0.6, 0, 0.3), (1, 0.7, -0.2, 0.1), (2, 0.7, -0.2, -0.01), (4, 0.65, 0.1, -0.01),
                           (5, 0.65, 0.1, 0.05), (6, 0.65, 0.1, -0.02), (8, 0.75, -0.2, 0.0), (9, 0.6, 0, 0.3)):  # fmt: skip
        path.append((t, *at_device(arm.ground_below(x, y) + [0, 0, above])))
    return path


def measure_steps() -> None:
    print("steps of the force from tick to tick")
    path = over_ground()
    for name, blend in (("", 0.0), (" without blend", -1.0)):
        print(f"  wheels, pose and twist{name}: {steps_of(curve, 'drive', blend, 16)}")
        with patch.object(virtualrobot.robot, "twist_between", without_twist):
            print(f"  wheels, pose only{name}: {steps_of(curve, 'drive', blend, 16)}")
        print(f"  ground always there{name}: {steps_of(path, 'arm', blend, 9)}")
        with patch.object(rig, "Manipulator", Switched):
            print(f"  ground switched{name}: {steps_of(path, 'arm', blend, 9)}")


def measure_frames() -> None:
    for mode in ("drive", "map", "arm"):
        scene, world = fs.Scene(), rig.World()
        begin = time.perf_counter()
        robot = Manipulator(scene, world) if mode == "arm" else Robot(scene, world, mode)
        first = time.perf_counter() - begin
        spent = []
        for k in range(500):
            place = [8, 3, 0] if mode == "map" else [0.6, 0.1, 0.1]
            begin = time.process_time()
            robot.frame(rig.hand_at(place, (k + 1) * period), (k + 1) * period)
            spent.append(1e3 * (time.process_time() - begin))
        print(f"a frame in mode {mode}: {spread(spent)} ms of processor time; made in {first:.2f} s")


def measure_delay() -> None:
    """From the hand to the tip: how much later the tip is where the hand was, while that moves steadily."""
    path = [(0, *at_device((0.6, -0.3, 0))), (1, *at_device((0.6, -0.3, 0))), (5, *at_device((0.6, 0.3, 0)))]
    with tempfile.TemporaryDirectory() as folder, Rig(Path(folder), path, "arm") as one:
        times, hands, tips = [], [], []
        assert isinstance(one.robot, Manipulator)
        for hand in one.run(5):
            times.append(one.scene.time)
            hands.append(hand.state.pose.position[1])
            tips.append(one.robot.arm.place[1])
    t, h, p = map(np.array, (times, hands, tips))
    moving = t > 1.5
    t, h, p = t[moving], h[moving], p[moving]
    middle = (p > -0.15) & (p < 0.15)
    print(f"from hand to tip: {1e3 * np.mean(t[middle] - np.interp(p[middle], h, t)):.0f} ms")


def measure_viz() -> None:
    ground = Ground()
    picture = Picture(ground, off_screen=True)
    with fs.Scene() as scene, fs.Servo(scene, "sim:?path=figure8"):
        viz = Viz(scene, ground)
        show = Show(viz, picture)
        viz.draw_hazard(None, np.array([(-10, -8), (6, -9), (5, 6), (-4, 7)]))
        spent = []
        for k in range(30):
            picture.plotter.camera.azimuth = k
            begin = time.perf_counter()
            show.update()
            picture.plotter.render()
            spent.append(1e3 * (time.perf_counter() - begin))
        viz.close()
    picture.close()
    print(f"a picture of {picture.ground.n_cells} triangles: {spread(spent)} ms")


def is_felt(watcher: fs.Scene, name: str) -> bool:
    return any(client["name"] == name and np.linalg.norm(client["wrench"]["force"]) > 0.01 for client in watcher.get_clients())


def measure_start() -> None:
    """From the start of a program to the first force that the hand feels of it, beside a server that runs."""
    endpoint, folder = f"testbed-measure-{os.getpid()}", rig.testbed
    device = "sim:?hold=-0.05,0.0425,0.006"  # beside a hazard
    server = subprocess.Popen([Path(sys.executable).with_name("forceserver"), "run", "--listen", endpoint, "--device", device],
                              stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)  # fmt: skip
    with fs.connect(f"shm:{endpoint}?timeout=30", "watcher") as watcher, tempfile.TemporaryDirectory() as out:
        hazards = Path(out) / "hazards.json"
        shutil.copy(folder / "hazards.json", hazards)
        of_viz = ["viz", "--hazards", hazards, "--off-screen", f"{out}/viz.png"]
        for name, words in (("rover", ["virtualrobot", "--mode", "map"]), ("viz", of_viz)):
            seconds = []
            for _ in range(3):
                begin = time.perf_counter()
                command = [sys.executable, "-B", "-W", "ignore", "-m", words[0], f"shm:{endpoint}", *words[1:]]
                process = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL)
                rig.eventually(functools.partial(is_felt, watcher, name))
                seconds.append(time.perf_counter() - begin)
                process.terminate()
                process.wait()
            print(f"from the start of {words[0]} to its first force: {spread(seconds)} s")
    server.terminate()
    server.wait()


if __name__ == "__main__":
    measure_frames()
    measure_delay()
    measure_viz()
    measure_start()
    measure_steps()
