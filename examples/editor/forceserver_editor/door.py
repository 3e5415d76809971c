"""Who may come in, and what HTTP serves: the page, the shapes, the scene as a file.

Every address begins with a random token. Another web page in the same browser could still guess ports, but not the token;
and as a second line no request passes whose Host or Origin is not this server's.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import hmac
import itertools
import mimetypes
from http import HTTPStatus
from pathlib import Path

import forceserver as fs
from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from .browser import Browser
from .edit import Edit
from .look import Look

PAGE = Path(__file__).parent / "page"
MOST_MESSAGE = 1 << 20  # bytes, from a browser: larger ones end its connection
SAFE = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; connect-src 'self'; worker-src 'self' blob:; frame-ancestors 'none'; base-uri 'none'; "
    "form-action 'none'",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Resource-Policy": "same-origin",
}


class Door:
    def __init__(self, look: Look, edit: Edit, host: str, port: int, token: str) -> None:
        self._look, self._edit, self._host, self._port, self._token = look, edit, host, port, token
        self._worker = concurrent.futures.ThreadPoolExecutor(1, "edit")
        self._browsers: set[Browser] = set()
        self._numbers = itertools.count(1)
        self._connection = 0
        self._files = {path.name: path.read_bytes() for path in PAGE.glob("*") if path.is_file()}

    async def run(self, ready: asyncio.Future[str]) -> None:
        """Serves until it is cancelled. ready: becomes the address of the page."""
        async with serve(
            self._meet,
            self._host,
            self._port,
            process_request=self._request,
            max_size=MOST_MESSAGE,
            close_timeout=0.1,  # s; the rest of a message that is too large is read for so long
            compression=None,
            ping_interval=20,
            ping_timeout=60,
            server_header=None,
        ) as server:
            self._port = next(iter(server.sockets)).getsockname()[1]
            shown = f"[{self._host}]" if ":" in self._host else self._host
            ready.set_result(f"http://{shown}:{self._port}/{self._token}/")
            while True:
                await asyncio.sleep(0.5)
                await self._keep_house()

    async def _keep_house(self) -> None:
        seen, scene = self._look.seen, self._look.scene
        if seen.connection != self._connection:
            if self._connection:
                self._edit.keep.offer_again()
            self._connection = seen.connection
        if scene is not None and not self._edit.view_only:
            await asyncio.get_running_loop().run_in_executor(self._worker, self._write_recovery, False)

    def write_recovery_at_once(self) -> None:
        """The editor ends."""
        self._worker.shutdown(wait=True)
        self._write_recovery(True)

    def _write_recovery(self, at_once: bool) -> None:
        scene, connection = self._look.scene, self._look.connection
        if scene is None:
            return
        try:
            self._edit.keep.write_recovery(scene, connection, at_once)
        except Exception as error:  # a full disk, or the server has just gone: editing goes on
            print(f"the recovery file was not written: {error}", flush=True)

    def tell(self) -> None:
        """There is a new state. From the event loop's thread."""
        for browser in self._browsers:
            browser.tell()

    # ---- Requests

    def _is_welcome(self, request: Request, path: list[str]) -> bool:
        names = {"127.0.0.1", "localhost", "[::1]", self._host.lower(), f"[{self._host.lower()}]"}
        allowed = {f"{name}:{self._port}" for name in names} | (names if self._port == 80 else set())
        if self._host in ("0.0.0.0", "::"):  # noqa: S104  # every address of this machine: the token alone decides
            allowed = set(request.headers.get_all("Host"))
        hosts, origins = request.headers.get_all("Host"), request.headers.get_all("Origin")
        is_ours = len(hosts) == 1 and hosts[0] in allowed
        is_from_here = all(origin == f"http://{hosts[0]}" for origin in origins) if is_ours else False
        return is_ours and is_from_here and hmac.compare_digest(path[0].encode(), self._token.encode())

    async def _request(self, connection: ServerConnection, request: Request) -> Response | None:
        path = request.path.partition("?")[0].removeprefix("/").split("/")
        if not self._is_welcome(request, path):
            return _answer(HTTPStatus.FORBIDDEN, b"Use the address that forceserver-editor printed.\n", "text/plain")
        if len(path) == 1:
            return _answer(HTTPStatus.FOUND, b"", "text/plain", {"Location": f"/{self._token}/"})
        wants_socket = "websocket" in " ".join(request.headers.get_all("Upgrade")).lower()
        if path[1:] == ["socket"]:
            return None if wants_socket and request.headers.get_all("Origin") else _answer(HTTPStatus.BAD_REQUEST, b"")
        loop = asyncio.get_running_loop()
        if path[1] == "shapes" and len(path) == 3:
            found = await loop.run_in_executor(None, self._look.shapes.content, path[2])
            if found is not None:
                return _answer(HTTPStatus.OK, found, headers={"Cache-Control": "max-age=31536000, immutable"})
        elif path[1:] == ["scene.zip"] and self._look.scene is not None:
            try:
                found = await loop.run_in_executor(self._worker, self._edit.keep.packed, self._look.scene)
            except (fs.Error, OSError) as error:
                return _answer(HTTPStatus.SERVICE_UNAVAILABLE, f"{error}\n".encode(), "text/plain")
            return _answer(HTTPStatus.OK, found, "application/zip", {"Content-Disposition": "attachment"})
        elif len(path) == 2 and (path[1] or "index.html") in self._files:
            name = path[1] or "index.html"
            kind = mimetypes.guess_type(name)[0] or "application/octet-stream"
            return _answer(HTTPStatus.OK, self._files[name], kind, {"Cache-Control": "no-cache"})
        return _answer(HTTPStatus.NOT_FOUND, b"There is nothing at this address.\n", "text/plain")

    async def _meet(self, socket: ServerConnection) -> None:
        browser = Browser(socket, f"browser {next(self._numbers)}", self._look, self._edit, self._worker)
        self._browsers.add(browser)
        self._look.is_awaited.set()
        browser.tell()
        try:
            await browser.run()
        finally:
            self._browsers.discard(browser)


def _answer(
    status: HTTPStatus, body: bytes, kind: str = "application/octet-stream", headers: dict[str, str] | None = None
) -> Response:
    charset = "; charset=utf-8" if kind.startswith("text/") else ""
    every = {"Content-Type": kind + charset, "Content-Length": str(len(body)), "Connection": "close"}
    return Response(status.value, status.phrase, Headers(every | SAFE | (headers or {})), body)
