"""forceserver-editor: serves the page that shows and edits what can be felt at a force-server."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import html
import os
import secrets
import signal
import sys
import tempfile
import threading
import webbrowser
from collections.abc import Iterator
from pathlib import Path

import forceserver as fs

from .door import PAGE, Door
from .edit import Edit
from .keep import Keep, recovery_folder
from .look import Look
from .options import options


@contextlib.contextmanager
def leading_to(address: str) -> Iterator[Path]:
    """A file that leads a browser to the page, and that nobody else can read. All users of a machine see the arguments of
    its programs, so the address with the token must not be among those of the browser."""
    folder = Path(os.environ.get("XDG_RUNTIME_DIR") or recovery_folder())
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    with tempfile.TemporaryDirectory(prefix="forceserver-editor-", dir=folder) as name:  # of mode 0700
        file = Path(name) / "open.html"
        file.touch(mode=0o600)
        shown = html.escape(address)
        file.write_text(
            f'<!doctype html>\n<meta charset="utf-8">\n<meta http-equiv="refresh" content="0; url={shown}">\n'
            f'<title>Force editor</title>\n<p><a href="{shown}">The force editor is here.</a></p>\n'
        )
        yield file.absolute()


async def serve(given: argparse.Namespace) -> None:
    loop = asyncio.get_running_loop()
    endpoint = given.server if ":" in given.server else f"shm:{given.server}"
    name = given.name or "editor"
    door: Door | None = None

    def told() -> None:
        if door is not None:
            with contextlib.suppress(RuntimeError):  # the loop has ended
                loop.call_soon_threadsafe(door.tell)

    look = Look(endpoint, name, given.name is not None, told)
    look.connect()
    keep = Keep(given.folder, recovery_folder(), endpoint, look.me)
    edit = Edit(look, keep, given.view)
    door = Door(look, edit, given.host, given.port, secrets.token_urlsafe(16))
    ready: asyncio.Future[str] = loop.create_future()
    serving = asyncio.create_task(door.run(ready))
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, serving.cancel)
    serving.add_done_callback(lambda done: ready.done() or ready.cancel())
    try:
        address = await ready
    except asyncio.CancelledError:  # it could not listen
        look.close()
        return await serving
    look.start()
    if given.host not in ("127.0.0.1", "localhost", "::1"):
        print(f"WARNING: other machines can reach this editor at {given.host}. The connection is not encrypted: whoever "
              "reads the address on its way can push the hand.", file=sys.stderr)  # fmt: skip
    print(address, flush=True)
    with contextlib.ExitStack() as until_the_end:
        if not given.no_browser:
            try:
                file = until_the_end.enter_context(leading_to(address)).as_uri()
                # In a thread, as some browsers are waited for.
                threading.Thread(target=webbrowser.open, args=(file,), daemon=True).start()
            except OSError as error:  # a folder that cannot be written
                print(f"no browser was opened: {error}", file=sys.stderr)
        with contextlib.suppress(asyncio.CancelledError):
            await serving
    door.write_recovery_at_once()
    look.close()


def main() -> None:
    given = options()
    if not (PAGE / "index.html").exists():
        sys.exit("forceserver-editor: the page was not built; pip install ./examples/editor builds it")
    if not given.folder.is_dir():
        sys.exit(f"forceserver-editor: there is no folder {given.folder}")
    try:
        asyncio.run(serve(given))
    except fs.Error as error:
        sys.exit(f"forceserver-editor: {error.args[0] if error.args else error}")
    except OSError as error:
        sys.exit(f"forceserver-editor: cannot listen at {given.host}:{given.port}: {error.strerror or error}")


if __name__ == "__main__":
    main()
