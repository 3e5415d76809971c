"""The options of forceserver-editor, and of examples/editor/run, which looks at them before it builds anything: this file
needs nothing but Python."""

from __future__ import annotations

import argparse
from pathlib import Path

ABOUT = "Serves the page that shows and edits what can be felt at a force-server."
EPILOG = """The address that it prints has a random token in it: who has the address can push the hand. It listens at
127.0.0.1 alone unless --host says otherwise. The editor's own objects fade out when it ends; a recovery file keeps
them, and the next editor offers it."""
ABOUT_RUN = """Starts a force-server with a simulated hand and a small scene, and the editor beside it; when one of them ends,
or with Ctrl-C, both end. Before that it makes an environment of its own in build/editor, which takes some minutes the
first time."""


def options(arguments: list[str] | None = None, is_run: bool = False) -> argparse.Namespace:
    """is_run: those of examples/editor/run."""
    if is_run:
        parser = argparse.ArgumentParser("examples/editor/run", description=ABOUT_RUN, epilog=EPILOG, allow_abbrev=False)
        parser.add_argument("--prepare", action="store_true", help="only make the environment; start nothing")
    else:
        parser = argparse.ArgumentParser("forceserver-editor", description=ABOUT, epilog=EPILOG)
        parser.add_argument("server", help="the force-server, such as shm:lab; lab alone means the same")
    parser.add_argument("--name", help="of the editor as a client of the server (editor)")
    parser.add_argument("--port", type=int, default=0, help="of the page; 0: any that is free")
    parser.add_argument("--host", default="127.0.0.1", help="address to listen at; others than 127.0.0.1 are reachable "
                        "from other machines")  # fmt: skip
    parser.add_argument("--folder", type=Path, default=Path(), help="where scenes are saved and loaded (here)")
    parser.add_argument("--view", action="store_true", help="only show: no change is possible")
    parser.add_argument("--no-browser", action="store_true", help="do not open a browser")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    options(is_run=True)
