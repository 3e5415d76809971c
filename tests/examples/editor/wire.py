"""A browser's connection to the editor, by hand: what it fetches, the states that it gets and the commands that it sends."""

from __future__ import annotations

import asyncio
import concurrent.futures
import json
import pathlib
import re
import resource
import socket
import struct
import urllib.error
import urllib.request
from collections.abc import Callable, Coroutine
from typing import Any

import numpy as np
from websockets.asyncio.client import connect

from conftest import PATIENCE, Editor


def fetch(address: str, **headers: str) -> tuple[int, bytes]:
    try:
        with urllib.request.urlopen(urllib.request.Request(address, headers=headers)) as answer:
            return answer.status, answer.read()
    except urllib.error.HTTPError as error:
        return error.code, error.read()


class Socket:
    """A browser's connection, by hand."""

    def __init__(self, socket: Any) -> None:
        self.socket = socket
        self.told: dict[str, Any] = {}
        self.objects: dict[str, Any] = {}
        self.poses: dict[int, Any] = {}
        self.felt: dict[int, Any] = {}
        self.samples: list[Any] = []
        self.states = 0
        self._n = 0

    def _take(self, message: bytes) -> None:
        (size,) = struct.unpack_from("<I", message)
        told = json.loads(message[4 : 4 + size])
        count, start = told["rows"], -(-(4 + size) // 8) * 8
        poses = np.frombuffer(message, float, 7 * count, start).reshape(-1, 7)
        self.samples += np.frombuffer(message, float, 4 * told["samples"], start + poses.nbytes).reshape(-1, 4).tolist()
        felt = np.frombuffer(message, np.float32, offset=start + poses.nbytes + 32 * told["samples"]).reshape(-1, 12)
        self.told |= told
        if told.get("fresh"):
            self.objects, self.poses, self.felt = {}, {}, {}
        for one in told.get("objects", []):
            self.objects[one["name"]] = one
        gone = set(told.get("gone", []))
        self.objects = {name: one for name, one in self.objects.items() if one["id"] not in gone}
        ids = felt.view(np.uint32)[:, 0].tolist()
        self.poses |= dict(zip(ids, poses, strict=True))
        self.felt |= dict(zip(ids, felt, strict=True))
        self.states += 1

    async def state(self) -> None:
        """The next state."""
        while not isinstance(message := await self.socket.recv(), bytes):
            pass
        self._take(message)
        await self.socket.send(json.dumps({"took": self.told["serial"]}))

    async def until(self, is_so: Callable[[Socket], Any]) -> None:
        for _ in range(600):
            await self.state()
            if is_so(self):
                return
        raise AssertionError("it never came")

    async def ask(self, what: str, /, **fields: Any) -> Any:
        """The answer, or the refusal with its "status"."""
        self._n += 1
        await self.socket.send(json.dumps({"n": self._n, "do": what, **fields}))
        while True:
            message = await self.socket.recv()
            if isinstance(message, bytes):
                self._take(message)
                await self.socket.send(json.dumps({"took": self.told["serial"]}))
                continue
            answer = json.loads(message)
            assert answer["n"] == self._n
            return answer["ok"] if "ok" in answer else answer["refused"]


def run(work: Coroutine[Any, Any, Any]) -> Any:
    """In a thread of its own, as playwright has a loop in this one."""
    with concurrent.futures.ThreadPoolExecutor(1) as thread:
        return thread.submit(asyncio.run, asyncio.wait_for(work, PATIENCE)).result()


def with_socket(editor: Editor, journey: Callable[[Socket], Any], **options: Any) -> Any:
    async def meet() -> Any:
        origin = f"http://127.0.0.1:{editor.port}"
        async with connect(f"ws://127.0.0.1:{editor.port}/{editor.token}/socket", origin=origin, max_size=None, close_timeout=1, **options) as socket:  # type: ignore[arg-type]
            return await journey(Socket(socket))

    return run(meet())


POINT = {"front.kind": "gaussian", "front.gain": 1, "front.width": 0.01, "front.limit": 2}


class RawSocket:
    """A connection that is read only when it is told to, so that it can be as bad as it likes."""

    def __init__(self, editor: Any) -> None:
        self.socket = socket.create_connection(("127.0.0.1", editor.port))
        host = f"127.0.0.1:{editor.port}"
        request = [f"GET /{editor.token}/socket HTTP/1.1", f"Host: {host}", f"Origin: http://{host}", "Upgrade: websocket", "Connection: Upgrade",
                   "Sec-WebSocket-Version: 13", "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==", "", ""]  # fmt: skip
        self.socket.sendall("\r\n".join(request).encode())
        answer = b""
        while not answer.endswith(b"\r\n\r\n"):
            answer += self.socket.recv(1)
        assert answer.startswith(b"HTTP/1.1 101 "), answer

    def send(self, data: bytes) -> bool:
        """Whether it is still connected."""
        try:
            self.socket.sendall(data)
        except OSError:
            return False
        return True

    def receive(self) -> bytes:
        """The next message, whatever it is."""
        head = self._exactly(2)
        size = head[1]
        if size == 126:
            (size,) = struct.unpack(">H", self._exactly(2))
        elif size == 127:
            (size,) = struct.unpack(">Q", self._exactly(8))
        return self._exactly(size)

    def _exactly(self, count: int) -> bytes:
        data = bytearray()
        while len(data) < count:
            piece = self.socket.recv(count - len(data))
            assert piece, "the server has closed the connection"
            data += piece
        return bytes(data)

    def close(self) -> None:
        self.socket.close()


def framed(text: str) -> bytes:
    """A message of less than 64 kB as the protocol has it; the mask is zeros."""
    data = text.encode()
    head = bytes([0x81, 0x80 | len(data)]) if len(data) < 126 else bytes([0x81, 0xFE]) + struct.pack(">H", len(data))
    return head + bytes(4) + data


def resident(editor: Editor) -> float:
    """MB of memory that the editor's server has."""
    pages = int(pathlib.Path(f"/proc/{editor.process.pid}/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def peak(editor: Editor) -> float:
    """MB of memory that the editor's server has had, at most."""
    found = re.search(r"VmHWM:\s+(\d+) kB", pathlib.Path(f"/proc/{editor.process.pid}/status").read_text())
    assert found
    return int(found[1]) / 1e3
