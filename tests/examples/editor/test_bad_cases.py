"""What may go wrong at the editor's server: floods, sockets that are not read, huge and tiny meshes.

FORCESERVER_EDITOR_SECONDS: how long a flood and a socket that is not read last (3; 60 is what a person may do).
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any

import forceserver as fs
import numpy as np

from conftest import Editor, Lab, Second, eventually, terrain
from wire import RawSocket, Socket, fetch, framed, resident, with_socket

SECONDS = float(os.environ.get("FORCESERVER_EDITOR_SECONDS", "3"))


@contextlib.contextmanager
def running(work: Any) -> Iterator[threading.Event]:
    """Does something in a thread meanwhile; it stops when the event is set."""
    ends = threading.Event()
    thread = threading.Thread(target=work, args=(ends,))
    thread.start()
    try:
        yield ends
    finally:
        ends.set()
        thread.join()


class Sink:
    """A program that takes what floods the editor and throws it away: what remains is what the floods themselves cost."""

    PROGRAM = r"""
import socket, threading
door = socket.create_server(("127.0.0.1", 0))
print(door.getsockname()[1], flush=True)
def take(one):
    one.recv(65536)
    one.sendall(b"HTTP/1.1 101 \r\n\r\n")
    while one.recv(65536)[:2] not in (b"", b"\x81\xff"):
        pass
    one.close()
while True:
    threading.Thread(target=take, args=door.accept()[:1], daemon=True).start()
"""
    token = "sink"

    def __init__(self) -> None:
        self._process = subprocess.Popen([sys.executable, "-c", self.PROGRAM], stdout=subprocess.PIPE, text=True)
        assert self._process.stdout
        self.port = int(self._process.stdout.readline())

    def close(self) -> None:
        self._process.kill()
        self._process.wait()


def crowd(client: fs.Scene, count: int) -> None:
    with client.change():
        for i in range(count):
            client[f"p{i}"] = fs.Point(position=(0.001 * (i % 64), 0.001 * (i // 64), -0.03))


def moving(client: fs.Scene, count: int) -> Any:
    """Moves all of them, so that each state has all rows."""

    def work(ends: threading.Event) -> None:
        step = 0
        while not ends.wait(1 / 30):
            step += 1
            with client.change():
                for i in range(count):
                    pose = fs.Pose(position=(0.001 * (i % 64), 0.001 * (i // 64), -0.03 - 1e-5 * (step % 2)))
                    client.object_move(f"p{i}", pose, fs.Twist(), 0)

    return work


def test_a_socket_that_says_it_takes_all_and_reads_nothing(started: Any) -> None:
    """Its states and answers do not queue: neither in the memory of the server, nor when it reads again."""
    lab = started(Lab)
    editor = started(Editor, lab.endpoint)
    rover = lab.join("rover")
    count = 2000  # a state has 200 kB
    crowd(rover, count)

    async def wait(s: Socket) -> None:
        await s.until(lambda s: len(s.objects) == count and len(s.poses) == count)

    with_socket(editor, wait)
    bad, worse = RawSocket(editor), RawSocket(editor)  # the second also asks and does not read the answers
    with running(moving(rover, count)), contextlib.closing(bad), contextlib.closing(worse):
        time.sleep(1)  # what a state needs is there
        before, ends = resident(editor), time.monotonic() + SECONDS
        took, asks = framed('{"took": 0}'), framed('{"n": 1, "do": "files"}')
        worse.socket.settimeout(0.01)
        while time.monotonic() < ends:
            assert bad.send(took)
            worse.send(took + 20 * asks)
            time.sleep(0.005)
        grown = resident(editor) - before
        print(f"memory grew by {grown:.1f} MB in {SECONDS:.0f} s; a state of 300 kB was due {30 * SECONDS:.0f} times")
        assert grown < 25
        # Another browser beside it gets its states. When it reads again it first gets what the system's buffers held.
        newest = 0

        async def look(s: Socket) -> None:
            nonlocal newest
            for _ in range(10):
                await s.state()
            newest = s.told["serial"]

        with_socket(editor, look)
        old = -1
        told = 0
        while told < newest:
            message = bad.receive()
            if message[4:13] == b'{"serial"':
                old, told = old + 1, json.loads(message[4 : 4 + struct.unpack_from("<I", message)[0]])["serial"]
        print(f"{old} old states came first")
        assert old < 30


def test_floods(started: Any) -> None:
    """10,000 commands a second and messages of 100 MB: a browser beside them gets its states. How late the servo is is printed."""
    lab = started(Lab)
    editor = started(Editor, lab.endpoint)
    second = started(Second, lab.endpoint)
    rover = lab.join("rover")
    crowd(rover, 200)
    sent = {"commands": 0, "messages": 0}
    target: Editor | Sink = editor

    def commands(ends: threading.Event) -> None:
        socket = RawSocket(target)
        text = json.dumps({"n": 1, "do": "change", "names": ["nobody"], "fields": {"damping": 1}})
        hundred = 100 * framed(text)
        drain = threading.Thread(target=lambda: [None for _ in iter(lambda: received(socket), b"")])
        drain.start()
        at = time.monotonic()
        while not ends.is_set() and socket.send(hundred):
            sent["commands"] += 100
            at += 0.01
            time.sleep(max(0.0, at - time.monotonic()))
        socket.socket.shutdown(2)
        drain.join()
        socket.close()

    def messages(ends: threading.Event) -> None:
        piece = bytes(1 << 20)
        while not ends.is_set():
            socket = RawSocket(target)
            if socket.send(bytes([0x81, 0xFF]) + struct.pack(">Q", 100_000_000) + bytes(4)):
                for _ in range(100):
                    if not socket.send(piece):
                        break
            sent["messages"] += 1
            socket.close()
            ends.wait(0.2)

    def received(socket: RawSocket) -> bytes:
        try:
            return socket.socket.recv(1 << 16)
        except OSError:
            return b""

    async def beside(s: Socket) -> float:
        await s.until(lambda s: len(s.poses) == 200)
        before, serial, at = s.states, s.told["serial"], time.monotonic()
        while time.monotonic() < at + SECONDS or s.states < before + 30:
            await s.state()
        assert s.told["serial"] > serial
        return (s.states - before) / (time.monotonic() - at)

    def late() -> float:
        return 1e6 * float(second.ask("stats")["late_p99"])  # of the last 10 s

    with running(moving(rover, 200)):
        calm = with_socket(editor, beside)
        late_calm = late()
        target = started(Sink)
        with running(commands), running(messages):
            with_socket(editor, beside)
            late_sink = late()
        target, before = editor, resident(editor)
        with_socket(editor, beside)  # calm again
        sent = dict.fromkeys(sent, 0)
        with running(commands), running(messages):
            flooded = with_socket(editor, beside)
            late_flooded, grown = late(), resident(editor) - before
    print(f"states a second beside the flood: {flooded:.1f}, calm {calm:.1f}; {sent['commands']} commands and {sent['messages']} messages of "
          f"100 MB were sent; memory grew by {grown:.1f} MB; servo late p99: {late_flooded:.0f} us, {late_flooded / late_calm:.2f} times that of "
          f"calm and {late_flooded / late_sink:.2f} times that of the same flood into a program that throws it away")  # fmt: skip
    assert sent["commands"] > 0 and sent["messages"] > 0 and grown < 60

    async def answers(s: Socket) -> None:
        assert await s.ask("add", name="a", primitive="point", fields={}) == {"name": "a"}

    with_socket(editor, answers)
    assert second.get("editor/a")["status"] == "FS_OK"


def ply(mesh: fs.Mesh) -> bytes:
    points, triangles = mesh.shape.get_points(), mesh.shape.get_triangles()
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n" + "".join(f"property double {axis}\n" for axis in "xyz")
    head += f"element face {len(triangles)}\nproperty list uchar uint vertex_indices\nend_header\n"
    faces = np.zeros(len(triangles), [("count", "u1"), ("corners", "<u4", 3)])
    faces["count"], faces["corners"] = 3, triangles
    return head.encode() + points.astype("<f8").tobytes() + faces.tobytes()


def test_meshes_of_one_and_of_a_million_triangles_uploaded(started: Any) -> None:
    lab = started(Lab)
    editor, second = started(Editor, lab.endpoint), started(Second, lab.endpoint)
    large = terrain(709)

    async def journey(s: Socket) -> None:
        for name, data, count in (("large", ply(large), 1_002_528), ("one", b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
                                  b"property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", 1)):  # fmt: skip
            assert await s.ask("upload", size=len(data), file="part.ply") == {}
            for at in range(0, len(data), 1 << 18):
                await s.socket.send(data[at : at + (1 << 18)])
            asked = asyncio.get_running_loop().time()
            assert await s.ask("add", name=name, primitive="mesh", upload=True, fields={"contact.keep": "front", "contact.limit": 5}) == {"name": name}
            print(f"{count} triangles were taken after {asyncio.get_running_loop().time() - asked:.1f} s")
            await s.until(lambda s, name=name: name in s.objects and s.felt[s.objects[name]["id"]][1] == 1)  # felt
            told = s.objects[name]["shape"]
            assert told["triangles"] == count
            content = await asyncio.to_thread(fetch, editor.address + "shapes/" + told["hash"])
            assert content[0] == 200 and len(content[1]) == 12 * told["points"] + 12 * count
            found = second.get(f"editor/{name}")
            assert found["triangles"] == count and found["keep"] == 1
        await s.ask("undo")
        await s.ask("undo")
        await s.until(lambda s: not s.objects)
        await s.ask("redo")
        await s.until(lambda s: "large" in s.objects)
        eventually(lambda: second.get("editor/large").get("triangles") == 1_002_528)

    with_socket(editor, journey)


def test_the_stop_does_not_wait(started: Any) -> None:
    """All force ends at once, also while a browser has a large mesh loaded and others' commands wait for it."""
    lab = started(Lab)
    editor = started(Editor, lab.endpoint)
    second = started(Second, lab.endpoint)
    mesh = ply(terrain(709))

    async def journey(s: Socket) -> None:
        assert await s.ask("upload", size=len(mesh), file="terrain.ply") == {}
        for at in range(0, len(mesh), 1 << 18):
            await s.socket.send(mesh[at : at + (1 << 18)])
        await s.socket.send(json.dumps({"n": 1000, "do": "add", "name": "terrain", "primitive": "mesh", "upload": True, "fields": {}}))
        await s.socket.send(json.dumps({"n": 1001, "do": "stop"}))
        answers: list[int] = []
        while len(answers) < 2:
            message = await s.socket.recv()
            if isinstance(message, bytes):
                await s.socket.send(json.dumps({"took": 0}))
            else:
                answers.append(json.loads(message)["n"])
        assert answers == [1001, 1000]
        assert second.ask("stats")["enabled"] == 0

    with_socket(editor, journey)
