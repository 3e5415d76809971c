"""python -m forceserver: the program forceserver, which the package brings."""

import os
import pathlib
import sys


def main() -> None:
    program = pathlib.Path(__file__).parent / "bin" / "forceserver"
    if not program.exists():
        sys.exit("forceserver: the program was not built, as CLI11 was missing (Debian: libcli11-dev)")
    os.execv(program, ["forceserver", *sys.argv[1:]])


if __name__ == "__main__":
    main()
