"""Recordings that are cut short, changed, or none."""

from __future__ import annotations

import io
import json
import os
import random
import signal
import sys
import threading
import zlib
from pathlib import Path

import forceserver as fs
import numpy as np
import pytest
from rig import hand_at
from virtualrobot.ground import terrain_file
from virtualrobot.recording import Recorder, main, make_robot
from virtualrobot.robot import period
from virtualrobot.world import World


@pytest.fixture(scope="module")
def lines(tmp_path_factory) -> list[str]:
    """Of a recording of 40 frames."""
    path = tmp_path_factory.mktemp("recording") / "whole.jsonl"
    world = World()
    robot = make_robot(fs.Scene(), world, "drive")
    with path.open("w") as file:
        recorder = Recorder(file, "drive", terrain_file, world.ground)
        for k in range(40):
            hand, time = hand_at([0.6, 0.1, 0], k * period), k * period
            robot.frame(hand, time)
            recorder.add(hand, time, world)
        recorder.end()
    return path.read_text().splitlines()


@pytest.fixture
def replayed(tmp_path, monkeypatch, capsys):
    """Gives the exit status and what is said of a file with these lines."""

    def replay(lines: list[str], path: Path = tmp_path / "recording.jsonl") -> tuple[int, str]:
        path.write_text("".join(line + "\n" for line in lines))
        monkeypatch.setattr(sys, "argv", ["recording", str(path)])
        code = main()
        said = capsys.readouterr()
        return code, said.out + said.err

    return replay


def with_end(lines: list[str]) -> list[str]:
    """The last line as it would have been written after these."""
    checksum = zlib.crc32("".join(line + "\n" for line in lines).encode())
    return [*lines, json.dumps({"frames": len(lines) - 1, "checksum": checksum})]


def test_a_whole_one(lines, replayed):
    assert replayed(lines) == (0, "40 frames, all with the same bits\n")
    assert with_end(lines[:-1]) == lines
    assert json.loads(lines[0])["terrain"] == "examples/quickstart_source/jacksboro_fault.asc"  # in any folder


def test_signals_come_between_lines() -> None:
    """The program ends by them, wherever they find it; what it has written is whole all the same."""
    world = World()
    hand = hand_at([0.6, 0.1, 0], 0)

    class Ended(Exception):
        pass

    def end(*_: object) -> None:
        raise Ended

    before = signal.signal(signal.SIGTERM, end)
    delay = random.Random(1)
    try:
        for _ in range(200):
            file = io.StringIO()
            recorder = Recorder(file, "drive", terrain_file, world.ground)
            timer = threading.Timer(delay.uniform(0, 2e-3), os.kill, (os.getpid(), signal.SIGTERM))
            with pytest.raises(Ended):
                timer.start()
                while True:
                    recorder.add(hand, 0, world)
            recorder.end()
            written = file.getvalue().splitlines()
            assert with_end(written[:-1]) == written
    finally:
        signal.signal(signal.SIGTERM, before)


def test_cut_short_or_changed(lines, replayed):
    code, said = replayed(lines[:31])
    assert code == 1 and "cut short after frame 30;" in said
    code, said = replayed([*lines[:20], lines[20].replace('"force": [0.0', '"force": [0.1'), *lines[21:]])
    assert code == 1 and "changed after it was recorded" in said
    code, said = replayed([*lines[:20], *lines[21:]])
    assert code == 1 and "changed after it was recorded" in said
    code, said = replayed(with_end(lines[:1]))
    assert code == 1 and "no frame" in said


@pytest.mark.parametrize(("line", "changes", "words"), [
    (0, {"mode": "fly"}, "the mode is 'fly'"),
    (0, {"mode": ["drive"]}, "the mode is ['drive']"),
    (0, {"mode": None}, "no mode"),
    (0, {"terrain": "none.asc"}, "none.asc"),
    (0, {"terrain": 1}, "terrain"),
    (0, {"heights": "0"}, "are not those of the recording"),
    (9, {"proxy": None}, "frame 9: it has no 'proxy'"),
    (9, {"hand": [np.nan, 0, 0]}, "frame 9: NaN is no number"),
    (9, {"hand": [1e300, 0, 0]}, "frame 9: the hand is nowhere"),
    (9, {"hand": [10**400, 0, 0]}, "frame 9: "),
    (9, {"hand": [0, 0]}, "frame 9: "),
    (9, {"hand": 1}, "frame 9: "),
    (9, {"time": "soon"}, "frame 9: "),
    (9, {"flags": 2**70}, "frame 9: "),
    (9, {"rover": [0] * 7}, "frame 9: the rover differs"),
    (9, {"joints": []}, "frame 9: the joints differ"),
])  # fmt: skip
def test_odd_values(lines, replayed, line, changes, words):
    """A value of None takes the key away."""
    values = {name: value for name, value in (json.loads(lines[line]) | changes).items() if value is not None}
    code, said = replayed(with_end([*lines[:line], json.dumps(values), *lines[line + 1 : -1]]))
    assert code == 1 and words in said


@pytest.mark.parametrize(("text", "words"), [("[" * 100_000, "frame 9: "), ("1", "frame 9: "), ("nothing", "frame 9: ")])
def test_lines_that_are_none(lines, replayed, text, words):
    code, said = replayed([*lines[:9], text, *lines[10:]])
    assert code == 1 and words in said
    code, said = replayed([text])
    assert code == 1 and "the first line: " in said


def test_files_that_are_none(replayed, tmp_path, monkeypatch, capsys):
    code, said = replayed([])
    assert code == 1 and "this is no recording" in said
    monkeypatch.setattr(sys, "argv", ["recording", str(tmp_path / "none.jsonl")])
    assert main() == 1 and capsys.readouterr().err == f"{tmp_path / 'none.jsonl'}: No such file or directory\n"
