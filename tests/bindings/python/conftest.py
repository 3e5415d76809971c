import pathlib
import signal
import subprocess
import sys
import textwrap

import pytest

import forceserver as fs

ROOT = pathlib.Path(__file__).resolve().parents[3]


def pytest_addoption(parser):
    parser.addoption("--all", action="store_true", help="the slow tests in full")


@pytest.fixture
def scene():
    with fs.Scene() as made:
        yield made


@pytest.fixture
def spring():
    return fs.Point(front=fs.LinearIncreasing(200, limit=5))


@pytest.fixture
def run():
    """Runs Python lines in a process of their own and gives what they print; they must end well. Ctrl-C ends it, also where
    these tests run in the background, which ignores it."""

    def lines(code, *, status=0, timeout=60, **options):
        done = subprocess.run(
            [sys.executable, "-c", textwrap.dedent(code)], capture_output=True, text=True, timeout=timeout,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler), **options
        )
        assert done.returncode == status, done.stdout + done.stderr
        return done.stdout.strip()

    return lines
