"""A recording: what the hand did, and what the rover, its arm and the force did, frame by frame.

A rover is moved by the hand alone, so the recorded hand moves it again by the same bits, on the same machine with the same
versions:

    python -m virtualrobot.recording FILE

The force is not computed again, as that needs the device; a checksum tells whether a line was changed.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import signal
import sys
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple, NoReturn, TextIO

import forceserver as fs
import mujoco  # type: ignore[import-untyped]
import numpy as np

from .ground import BadTerrain, Ground
from .manipulator import Manipulator
from .options import modes
from .robot import Robot
from .world import World


versions = {"mujoco": mujoco.__version__, "forceserver": fs.__version__}
root = Path(__file__).resolve().parents[3]  # of the repository
farthest = 1e6  # m or s: no hand and no clock is beyond


class BadRecording(Exception):
    """It cannot be replayed."""


def make_robot(scene: fs.Scene, world: World, mode: str) -> Robot | Manipulator:
    return Manipulator(scene, world) if mode == "arm" else Robot(scene, world, mode)


def _of_hand(hand: fs.Hand) -> dict[str, Any]:
    """What moves the rover; m, in its scene."""
    hand_at, proxy_at = ([float(x) for x in place] for place in (hand.state.pose.position, hand.response.proxy.position))
    return {"flags": int(hand.state.flags), "hand_time": float(hand.state.time), "hand": hand_at, "proxy": proxy_at}


def _of_world(world: World) -> dict[str, Any]:
    return {"rover": [*world.position.tolist(), *world.orientation.tolist()], "joints": world.data.qpos[7:].tolist()}


def _of_ground(ground: Ground) -> str:
    """What tells its heights from others."""
    return hashlib.sha256(ground.half.tobytes() + ground.grid.tobytes()).hexdigest()


@contextlib.contextmanager
def _uninterrupted() -> Iterator[None]:
    """Ctrl-C and SIGTERM, which end the program, come before or after: a line is counted if it is written. A mask of signals would not
    hold for other threads, such as those of VTK."""
    came: list[int] = []
    before: dict[int, Any] = {}
    try:
        for number in (signal.SIGINT, signal.SIGTERM):
            before[number] = signal.getsignal(number)
            signal.signal(number, lambda number, _: came.append(number))
        yield
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)
    for each in came:
        signal.raise_signal(each)


class Recorder:
    """A line for each frame, as JSON, which keeps every bit of a number. The last has the number of frames and a checksum."""

    def __init__(self, file: TextIO, mode: str, terrain: Path, ground: Ground) -> None:
        self.file = file
        self.frames = self.checksum = 0
        path = terrain.resolve()
        within = path.relative_to(root) if path.is_relative_to(root) else path
        self._write({"mode": mode, "terrain": str(within), "heights": _of_ground(ground)} | versions)

    def add(self, hand: fs.Hand, time: float, world: World) -> None:
        """After the frame. force: N, what the device got when the frame began."""
        force = [float(x) for x in hand.sent.force]
        line = {"time": time} | _of_hand(hand) | {"force": force} | _of_world(world)
        with _uninterrupted():
            self._write(line)
            self.frames += 1

    def end(self) -> None:
        with _uninterrupted():
            self._write({"frames": self.frames, "checksum": self.checksum})

    def _write(self, line: dict[str, Any]) -> None:
        text = json.dumps(line) + "\n"
        self.checksum = zlib.crc32(text.encode(), self.checksum)
        self.file.write(text)


class Recording(NamedTuple):
    head: dict[str, Any]
    frames: list[dict[str, Any]]
    is_whole: bool  # the program was not killed while it recorded


def _parsed(line: bytes, where: str) -> dict[str, Any]:
    def refuse(number: str) -> NoReturn:
        raise ValueError(f"{number} is no number")

    try:
        out = json.loads(line, parse_constant=refuse)
    except (ValueError, RecursionError) as failure:
        raise BadRecording(f"{where}: {failure}") from None
    if not isinstance(out, dict):
        raise BadRecording(f"{where}: it is no object of JSON")
    return out


def read(path: Path) -> Recording:
    with path.open("rb") as file:
        lines = [line for line in file if line.endswith(b"\n")]  # without one that was not written to its end
    if not lines:
        raise BadRecording("this is no recording: it has no line")
    head, *rest = [_parsed(line, f"frame {k}" if k else "the first line") for k, line in enumerate(lines)]
    missing = {"mode", "terrain", "heights", *versions} - head.keys()
    if missing:
        raise BadRecording(f"this is no recording: its first line has no {' and no '.join(sorted(missing))}")
    is_whole = bool(rest) and "checksum" in rest[-1]
    if is_whole and rest.pop() != {"frames": len(rest), "checksum": zlib.crc32(b"".join(lines[:-1]))}:
        raise BadRecording("it was changed after it was recorded: the number of its frames or their checksum is another")
    return Recording(head, rest, is_whole)


def _hand_of(frame: dict[str, Any]) -> fs.Hand:
    if not (np.abs([*frame["hand"], *frame["proxy"], frame["hand_time"], frame["time"]]) < farthest).all():
        raise ValueError("the hand is nowhere")
    state = fs.State(pose=fs.Pose(position=frame["hand"]), time=frame["hand_time"], flags=frame["flags"])
    return fs.Hand(state, fs.Response(proxy=fs.Pose(position=frame["proxy"])), fs.Wrench())


def _world_of(head: dict[str, Any]) -> World:
    for name, version in versions.items():
        if head[name] != version:
            print(f"it was recorded with {name} {head[name]}; this is {version}", file=sys.stderr)
    if head["mode"] not in modes:
        raise BadRecording(f"the mode is {head['mode']!r}, which is none of {', '.join(modes)}")
    if not isinstance(head["terrain"], str):
        raise BadRecording("the terrain is no name of a file")
    world = World(root / head["terrain"])
    if head["heights"] != _of_ground(world.ground):
        raise BadRecording(f"the heights in {head['terrain']} are not those of the recording")
    return world


def replay(recording: Recording) -> str | None:
    """Moves a rover by the recorded hand. Gives the first frame that differs and in what, if any does."""
    world = _world_of(recording.head)
    with fs.Scene() as scene:
        robot = make_robot(scene, world, recording.head["mode"])
        for number, frame in enumerate(recording.frames, 1):
            try:
                robot.frame(_hand_of(frame), frame["time"])
                differing = [name for name, value in _of_world(world).items() if value != frame[name]]
            except KeyError as missing:
                raise BadRecording(f"frame {number}: it has no {missing}") from None
            except (ValueError, TypeError, OverflowError) as failure:
                raise BadRecording(f"frame {number}: {failure}") from None
            if differing:
                return f"frame {number}: the {' and the '.join(differing)} differ{'s' if differing == ['rover'] else ''}"
    return None


def main() -> int:
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        print("usage: python -m virtualrobot.recording FILE", file=sys.stderr)
        return 2
    try:
        recording = read(Path(sys.argv[1]))
        count = len(recording.frames)
        if count == 0:
            raise BadRecording("there is no frame in it")
        differs = replay(recording)
    except OSError as failure:
        print(f"{sys.argv[1]}: {failure.strerror}", file=sys.stderr)
        return 1
    except (BadRecording, BadTerrain) as failure:
        print(f"{sys.argv[1]}: {failure}", file=sys.stderr)
        return 1
    if differs is not None:
        print(differs)
    elif recording.is_whole:
        print(f"{count} frames, all with the same bits")
    else:
        print(f"the recording is cut short after frame {count}; up to there all frames have the same bits")
    return 0 if differs is None and recording.is_whole else 1


if __name__ == "__main__":
    sys.exit(main())
