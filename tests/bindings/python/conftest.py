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
def slow_driver(tmp_path):
    """A driver whose device never opens."""
    source, library = tmp_path / "slow.c", tmp_path / "slow.so"
    source.write_text("""
#include <unistd.h>
#include <forceserver/driver.h>
static fs_status open_device(const char *address, void **self) { (void)address, (void)self; for (;;) pause(); }
static void close_device(void *self) { (void)self; }
static fs_status get_info(void *self, fs_device_info *out) { (void)self, (void)out; return FS_ERROR_IO; }
static fs_status read_device(void *self, fs_state *out) { (void)self, (void)out; return FS_ERROR_IO; }
static fs_status write_device(void *self, const fs_wrench *wrench) { (void)self, (void)wrench; return FS_ERROR_IO; }
const fs_driver *fs_driver_entry(void)
{
  static const fs_driver driver = {sizeof driver, 0, "slow", NULL, open_device, close_device, get_info, read_device,
                                   write_device, NULL, NULL};
  return &driver;
}
""")
    subprocess.run(["cc", "-shared", "-fPIC", f"-I{ROOT}/include", source, "-o", library], check=True)
    return library


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
