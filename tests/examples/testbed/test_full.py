"""The whole testbed with VirtualRobot and VIZ."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import forceserver as fs
import numpy as np
import pytest
import pyvista
from rig import eventually, patience, testbed

root = Path(__file__).parents[3]
built = root / "build" / "release"


needs_programs = pytest.mark.skipif(not (built / "examples" / "testbed" / "account").exists(), reason="the programs are not built")


@pytest.mark.parametrize("mode", ["map", "arm"])
@needs_programs
def test_a_short_tour(mode):
    """It checks by itself that each client was felt, that VIZ was told of an edit, and that nothing is left."""
    environment = {**os.environ, "DISPLAY": "", "WAYLAND_DISPLAY": ""}
    image = root / "build" / "testbed.png"
    image.unlink(missing_ok=True)
    command = [root / "examples" / "testbed" / "run", "--full", "--mode", mode, "--seconds", "6", "--built", built]
    run = subprocess.run(command, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL)
    assert run.returncode == 0, run.stdout
    assert f"mode {mode}" in run.stdout and "frames, " in run.stdout
    assert len(np.unique(np.asarray(pyvista.read(image).point_data.active_scalars), axis=0)) > 1000  # colours


@needs_programs
def test_ctrl_c_at_the_begin(tmp_path):
    """It reaches all programs of the terminal, some before they listen to it. Nothing has failed, and nothing is left."""
    for _ in range(5):
        command, environment = [testbed / "run", "--built", built], {**os.environ, "TMPDIR": str(tmp_path)}
        run = subprocess.Popen(command, env=environment, text=True, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                               stderr=subprocess.STDOUT, start_new_session=True,
                               preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler))  # fmt: skip
        eventually(lambda: list(tmp_path.glob("*/server")))
        os.killpg(run.pid, signal.SIGINT)
        output, _ = run.communicate(timeout=patience)
        assert run.returncode == 0 and "FAILED" not in output and "interrupted" in output, output
        assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("command", "words"), [
    (["run", "--built", "/nonexistent"], "no programs of the testbed in /nonexistent"),
    (["run", "--built", built, "--device", "nope:"], "the device 'nope:'"),
    (["virtualrobot/run", "--device", "nope:"], "the device 'nope:'"),
    (["virtualrobot/run", "--device"], "--device needs"),
    (["virtualrobot/run", "--mode", "fly"], "invalid choice: 'fly'"),
])  # fmt: skip
@needs_programs
def test_wrong_options(command, words):
    """They are told before anything is built or started."""
    run = subprocess.run([testbed / command[0], *command[1:]], text=True, stdin=subprocess.DEVNULL, capture_output=True)
    assert run.returncode == 2 and words in run.stderr and not run.stdout, run
    assert "preparing" not in run.stderr


@needs_programs
def test_each_is_killed_in_turn(tmp_path):
    """What the others give goes on. What the killed one gave fades, and comes back as softly: the force never jumps. Without the server
    each ends, with a sentence."""
    server, endpoint = Path(sys.executable).with_name("forceserver"), f"testbed-test-{os.getpid()}"
    hazards = tmp_path / "hazards.json"
    shutil.copy(testbed / "hazards.json", hazards)
    python = [sys.executable, "-B", "-W", "ignore", "-m"]
    at = f"shm:{endpoint}"
    commands = {
        "server": [server, "run", "--listen", endpoint, "--device", "sim:?hold=-0.05,0.0475,0.0075&hand_stiffness=3000&hand_damping=60"],  # by a hazard
        "viewer": [*python, "viz", at, "--name", "viewer", "--hazards", hazards, "--off-screen", tmp_path / "viz.png"],
        "rover": [*python, "virtualrobot", at, "--mode", "map"],
        "editor": [built / "examples" / "testbed" / "editor", endpoint],
    }
    processes: dict[str, subprocess.Popen[str]] = {}

    def start(who: str) -> None:
        processes[who] = subprocess.Popen(commands[who], cwd=testbed, text=True, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                          stderr=subprocess.STDOUT)  # fmt: skip

    def end_of(who: str) -> str:
        return processes.pop(who).communicate(timeout=patience)[0]

    try:
        start("server")
        with fs.connect(f"{at}?timeout={patience}", "watcher") as watcher:
            for who in ("viewer", "rover", "editor"):
                start(who)

            def felt() -> set[str]:
                return {str(client["name"]) for client in watcher.get_clients() if np.linalg.norm(client["wrench"]["force"]) > 0.01}

            steps: list[float] = []
            last = 0

            def look() -> None:
                nonlocal last
                ticks = watcher.get_record(last)
                if len(ticks) > 1:
                    force = np.asarray(ticks["tick"]["response"]["wrench"]["force"])
                    follows = np.diff(ticks["number"]) == 1
                    steps.extend(np.linalg.norm(np.diff(force, axis=0), axis=1)[follows])
                if len(ticks):
                    last = int(ticks["number"][-1])

            eventually(lambda: look() or {"viewer", "editor", "rover"} <= felt())
            for who in ("rover", "viewer", "editor"):
                processes[who].kill()
                end_of(who)
                eventually(lambda who=who: look() or (who not in felt() and felt() >= {"viewer", "editor"} - {who}))
                assert all(process.poll() is None for process in processes.values())
                start(who)
                eventually(lambda who=who: look() or who in felt())
            assert len(steps) > 2000 and max(steps) < 0.05, (len(steps), max(steps))
            # Both wait for a server that hangs.
            processes["server"].send_signal(signal.SIGSTOP)
            time.sleep(4)
            processes["server"].send_signal(signal.SIGCONT)
            time.sleep(2)
            assert {"viewer", "rover"} <= {str(client["name"]) for client in watcher.get_clients()}
        processes["server"].kill()
        end_of("server")
        for who in ("viewer", "rover", "editor"):
            process = processes[who]
            output = end_of(who)
            assert process.returncode == 1 and "server" in output.splitlines()[-1] and "Traceback" not in output, output
            assert {"viewer": "has not answered", "rover": "nothing is heard", "editor": ""}[who] in output, output
    finally:
        for process in processes.values():
            process.kill()
            process.communicate()
