"""The rover as a process beside a server."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import forceserver as fs
import numpy as np
import pytest
from rig import eventually, patience, testbed


@pytest.fixture
def server(request) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """A test may give another device."""
    name, device = f"rover-test-{os.getpid()}", getattr(request, "param", "sim:?hold=0.03,0.002,0")
    program = Path(sys.executable).with_name("forceserver")
    process = subprocess.Popen([program, "run", "--listen", name, "--device", device], text=True,
                               stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)  # fmt: skip
    yield f"shm:{name}?timeout=30", process
    process.terminate()
    process.communicate(timeout=patience)


def start(endpoint: str, *more: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-B", "-m", "virtualrobot", endpoint, *more]
    # It takes Ctrl-C also where these tests run in the background of a shell, which has it ignored.
    return subprocess.Popen(command, cwd=testbed, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler))  # fmt: skip


def place(scene: fs.Scene) -> list[float] | None:
    motions = scene.get_motions(None)
    found = motions[motions["name"] == "rover/pose"]
    return found[0]["pose"]["position"].tolist() if len(found) else None


def test_it_drives_and_ends(server):
    rover = start(server[0])
    with fs.connect(server[0], "watcher") as scene:
        begin = eventually(lambda: place(scene))
        eventually(lambda: (now := place(scene)) and abs(now[0] - begin[0]) > 0.3)
        # A frame is not of the future, where its twist would not count yet.
        found = (m for m in scene.get_motions(None) if m["name"] == "rover/pose")
        ages = [scene.time - float(next(found)["time"])]
        for _ in range(40):
            time.sleep(0.013)
            ages += [scene.time - float(m["time"]) for m in scene.get_motions(None) if m["name"] == "rover/pose"]
        assert np.median(ages) > 0, ages
        assert any(row.name == "rover/wheels" and row.distance < 1 for row in scene.get_reports())
        # Others edit what it has, spoil it and remove it: it says so, and goes on.
        scene["rover/wheels"].change(primitive=fs.Primitive.POINT, front=fs.Constant(1, limit=1), back=fs.Profile())
        scene["rover/elbow"].change(lifetime=0.5)
        del scene["rover/wrist"]
        begin = place(scene)
        eventually(lambda: (now := place(scene)) and abs(now[0] - begin[0]) > 0.3)
        rover.send_signal(signal.SIGTERM)
        output, _ = rover.communicate(timeout=patience)
        assert rover.returncode == 0, output
        assert "mode drive" in output and "frames, " in output
        for words in ("wheels was edited", "elbow was edited", "wrist was removed"):
            assert f"{words} by watcher" in output, output
        eventually(lambda: place(scene) is None)


@pytest.mark.parametrize("mode", ["drive", "arm"])
def test_a_recording_is_replayed_bit_for_bit(server, mode, tmp_path):
    file = tmp_path / "recording.jsonl"
    rover = start(server[0], "--mode", mode, "--record", str(file))
    eventually(lambda: file.exists() and len(file.read_text().splitlines()) > 60)
    rover.send_signal(signal.SIGTERM)
    rover.communicate(timeout=patience)

    def replayed() -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-B", "-m", "virtualrobot.recording", str(file)]
        return subprocess.run(command, cwd=testbed, text=True, capture_output=True)

    one = replayed()
    assert one.returncode == 0 and "all with the same bits" in one.stdout, one
    # Another hand in the middle gives another way from there on. A program that is killed writes no last line, but half of one.
    lines = file.read_text().splitlines()
    frame = json.loads(lines[30])
    frame["hand"][0] += 0.3
    frame["proxy"][0] += 0.3
    file.write_text("\n".join([*lines[:30], json.dumps(frame), *lines[31:-1], "{"]))
    other = replayed()
    assert other.returncode == 1 and re.fullmatch(r"frame 3\d: the (rover and the )?joints differ\n", other.stdout), other


def of_readme(number: int, endpoint: str) -> list[str]:
    """A command that runs a program of the README at this server."""
    programs = re.findall(r"```python\n(.*?)```", (testbed / "virtualrobot" / "README.md").read_text(), re.DOTALL)
    return [sys.executable, "-B", "-c", re.sub(r"shm:lab[^\"]*", endpoint, programs[number])]


@pytest.mark.parametrize("server", ["sim:?hand=released"], indirect=True)
def test_the_guide_of_the_readme(server):
    rover = start(server[0], "--mode", "map")
    guide = subprocess.Popen(of_readme(0, server[0]), text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                             preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler))  # fmt: skip
    with fs.connect(server[0], "watcher") as scene:
        begin = eventually(lambda: place(scene))
        eventually(lambda: np.linalg.norm(np.subtract(place(scene), begin)) > 3)
    guide.send_signal(signal.SIGINT)
    output, _ = guide.communicate(timeout=patience)
    assert guide.returncode == 0 and output == ""
    rover.terminate()
    rover.communicate(timeout=patience)


def test_the_tip_of_the_readme(server):
    rover = start(server[0], "--mode", "arm")
    with fs.connect(server[0], "watcher") as scene:
        eventually(lambda: place(scene))
        time.sleep(3)  # the tip comes to the hand
        output = subprocess.run(of_readme(1, server[0]), text=True, capture_output=True, check=True).stdout
        tip, hand = (np.array(text.split(), float) for text in re.findall(r"\[(.*?)\]", output))
        assert np.linalg.norm(tip - hand) < 0.02 and hand[0] > 0.5, output  # m of the arm
    rover.terminate()
    rover.communicate(timeout=patience)


@pytest.mark.parametrize("mode", ["map", "arm"])
def test_it_is_killed(server, mode):
    rover = start(server[0], "--mode", mode)
    with fs.connect(server[0], "watcher") as scene:
        eventually(lambda: place(scene))
        rover.kill()
        rover.communicate(timeout=patience)
        eventually(lambda: place(scene) is None)
        again = start(server[0], "--mode", mode)
        eventually(lambda: place(scene))
        again.send_signal(signal.SIGINT)
        assert again.wait(patience) == 0


def test_the_server_is_killed(server):
    rover = start(server[0])
    with fs.connect(server[0], "watcher") as scene:
        eventually(lambda: place(scene))
    server[1].kill()
    output, _ = rover.communicate(timeout=patience)
    assert rover.returncode == 1 and output.splitlines()[-1] == "virtualrobot: the server has gone", output


@pytest.mark.parametrize(("arguments", "words"), [
    (["shm:nobody-is-there"], "nobody-is-there"),
    (["shm:a", "--terrain", "none.asc"], "none.asc"),
    (["shm:a", "--mode", "fly"], "invalid choice"),
    ([], "ENDPOINT"),
])  # fmt: skip
def test_wrong_words(arguments, words):
    rover = start(*arguments) if arguments else subprocess.Popen(
        [sys.executable, "-B", "-m", "virtualrobot"], cwd=testbed, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)  # fmt: skip
    output, _ = rover.communicate(timeout=patience)
    assert rover.returncode in (1, 2) and words in output and "Traceback" not in output, output
