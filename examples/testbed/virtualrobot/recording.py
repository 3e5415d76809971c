"""A recording: what the hand did, and what the rover, its arm and the force did, frame by frame.

A rover is moved by the hand alone, so the recorded hand moves it again by the same bits, on the same machine with the same versions:

    python -m virtualrobot.recording FILE
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any, TextIO

import forceserver as fs
import mujoco  # type: ignore[import-untyped]
import numpy as np

from .ground import BadTerrain
from .manipulator import Manipulator
from .robot import Robot
from .world import World


modes = ("drive", "map", "arm")
versions = {"mujoco": mujoco.__version__, "forceserver": fs.__version__}


def make_robot(scene: fs.Scene, world: World, mode: str) -> Robot | Manipulator:
    return Manipulator(scene, world) if mode == "arm" else Robot(scene, world, mode)


def _of_hand(hand: fs.Hand) -> dict[str, Any]:
    """What moves the rover; m, in its scene."""
    places = {"hand": hand.state.pose.position, "proxy": hand.response.proxy.position}
    return {"flags": int(hand.state.flags), "hand_time": float(hand.state.time)} | {name: [float(x) for x in place] for name, place in places.items()}


def _of_world(world: World) -> dict[str, Any]:
    return {"rover": [*world.position.tolist(), *world.orientation.tolist()], "joints": world.data.qpos[7:].tolist()}


class Recorder:
    """A line for each frame, as JSON, which keeps every bit of a number."""

    def __init__(self, file: TextIO, mode: str, terrain: Path) -> None:
        self.file = file
        self._write({"mode": mode, "terrain": str(terrain.resolve())} | versions)

    def add(self, hand: fs.Hand, time: float, world: World) -> None:
        """After the frame. force: N, what the device got when the frame began."""
        force = [float(x) for x in hand.sent.force]
        self._write({"time": time} | _of_hand(hand) | {"force": force} | _of_world(world))

    def _write(self, line: dict[str, Any]) -> None:
        self.file.write(json.dumps(line) + "\n")


def replay(path: Path) -> tuple[int, int | None]:
    """Moves a rover by the recorded hand. Gives the number of frames, and the first that differs, if any does."""
    with path.open() as file, fs.Scene() as scene:
        head = json.loads(file.readline())
        for name, version in versions.items():
            if head[name] != version:
                print(f"it was recorded with {name} {head[name]}; this is {version}", file=sys.stderr)
        if head["mode"] not in modes:
            raise ValueError(f"the mode is {head['mode']!r}")
        world = World(Path(head["terrain"]))
        robot = make_robot(scene, world, head["mode"])
        count = 0
        for line in file:
            if not line.endswith("\n"):
                break  # the program was killed while it wrote
            frame = json.loads(line)
            if not np.isfinite([*frame["hand"], *frame["proxy"], frame["hand_time"], frame["time"]]).all():
                raise ValueError(f"the hand of frame {count} is nowhere")
            state = fs.State(pose=fs.Pose(position=frame["hand"]), time=frame["hand_time"], flags=frame["flags"])
            hand = fs.Hand(state, fs.Response(proxy=fs.Pose(position=frame["proxy"])), fs.Wrench())
            robot.frame(hand, frame["time"])
            if _of_world(world) != {name: frame[name] for name in ("rover", "joints")}:
                return count, count
            count += 1
    return count, None


def main() -> int:
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        print("usage: python -m virtualrobot.recording FILE", file=sys.stderr)
        return 2
    try:
        count, differs = replay(Path(sys.argv[1]))
    except (OSError, ValueError, KeyError, TypeError, OverflowError, RecursionError, BadTerrain) as failure:
        print(f"{sys.argv[1]}: this is no recording: {failure}", file=sys.stderr)
        return 1
    print(f"{count} frames, all with the same bits" if differs is None else f"frame {differs} differs")
    return 0 if differs is None else 1


if __name__ == "__main__":
    sys.exit(main())
