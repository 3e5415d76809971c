"""The options of the rover, which examples/testbed/virtualrobot/run looks at before it builds anything: this file needs
nothing but Python."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

about = "The rover as a client of a force-server, until Ctrl-C."
modes = ("drive", "map", "arm")


def options(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="virtualrobot", description=about)
    parser.add_argument("endpoint", metavar="ENDPOINT", help="of the server, such as shm:lab")
    of_mode = "what the hand is: a joystick; the place on the map where the rover shall go; the tip of the arm"
    parser.add_argument("--mode", choices=modes, default="drive", help=of_mode)
    parser.add_argument("--name", default="rover", help="of the client (%(default)s)")
    parser.add_argument("--record", type=Path, metavar="FILE", help="writes what the hand and the rover do (recording.py)")
    of_terrain = "heights, an Esri ASCII grid; without it those of the quickstart"
    parser.add_argument("--terrain", type=Path, metavar="FILE", help=of_terrain)
    return parser.parse_args(arguments)


if __name__ == "__main__":
    options(sys.argv[1:])
