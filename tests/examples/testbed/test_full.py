"""The whole testbed with VirtualRobot and VIZ."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

root = Path(__file__).parents[3]
built = root / "build" / "release"


@pytest.mark.parametrize("mode", ["map", "arm"])
@pytest.mark.skipif(not (built / "examples" / "testbed" / "account").exists(), reason="the programs are not built")
def test_a_short_tour(mode):
    """It checks by itself that each client was felt, that VIZ was told of an edit, and that nothing is left."""
    environment = {**os.environ, "DISPLAY": "", "WAYLAND_DISPLAY": ""}
    image = root / "build" / "testbed.png"
    image.unlink(missing_ok=True)
    command = [root / "examples" / "testbed" / "run", "--full", "--mode", mode, "--seconds", "6", "--built", built]
    run = subprocess.run(command, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL)
    assert run.returncode == 0, run.stdout
    assert f"mode {mode}" in run.stdout and "frames, " in run.stdout
    assert image.read_bytes().startswith(b"\x89PNG")
