"""One browser: sends it the newest state whenever it has taken the last one, and carries out its commands.

A message to the browser is: the length of its JSON (uint32), the JSON, zeros up to a multiple of 8 bytes; then, of the
objects that moved or are felt differently, the poses (float64), the forces of the ticks since the last message (float64),
and how those objects are felt (float32). Only what is new to this browser is in it, and never more than one message is
under way: nothing queues for a slow browser.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import contextlib
import json
import struct
import tempfile
import time
import traceback
from pathlib import Path
from typing import Any

import numpy as np
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from .edit import Edit
from .look import Look, Rows, Seen
from .plain import Plain, Refused

COMMANDS_A_SECOND = 200
MOST_WAITING = 64  # commands that were read and are not done yet
CALM_RATE = 4  # states a second while nothing changes but the time
MOST_UPLOAD = 512 << 20  # bytes

JSON = json.JSONEncoder(allow_nan=False, separators=(",", ":")).encode


class Browser:
    def __init__(self, socket: ServerConnection, who: str, look: Look, edit: Edit, worker: concurrent.futures.Executor):
        self.who = who
        self._socket, self._look, self._edit, self._worker = socket, look, edit, worker
        self._is_taken = True  # the last message
        self._serial = -1  # of the state that was looked at last
        self._may_send = asyncio.Event()
        self._forget()
        self._waiting: asyncio.Queue[Plain] = asyncio.Queue(MOST_WAITING)
        self._upload: Any = None
        self._upload_left = 0

    def _forget(self) -> None:
        self._connection, self._version, self._event, self._sample_count = -1, -1, -1, -1
        self._sent_ids: set[int] = set()
        self._told: Plain = {}
        self._sent, self._force = 0.0, np.zeros(3)  # when a message was sent, and the last force in it
        self._rows: Rows | None = None

    async def run(self) -> None:
        tasks = [asyncio.create_task(part) for part in (self._listen(), self._stream(), self._work())]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)  # each ends with the connection
        finally:
            for task in tasks:
                task.cancel()
            self._drop_upload()

    # ---- States

    def tell(self) -> None:
        """There is a new state, or there may be one."""
        if self._is_taken and self._look.seen.serial != self._serial:
            self._may_send.set()

    async def _stream(self) -> None:
        try:
            while True:
                await self._may_send.wait()
                self._may_send.clear()
                message = self._message(self._look.seen)
                if message is None:
                    self._look.is_awaited.set()
                else:
                    self._is_taken = False
                    await self._socket.send(message)
        except ConnectionClosed:
            pass
        except Exception:  # a bug of the editor: a page that stands still would not tell
            traceback.print_exc()
            await self._socket.close(1011, "the editor failed")

    def _message(self, seen: Seen) -> bytes | None:
        """What is new to the browser. None: only the time is new, and a message went out less than 1/CALM_RATE s ago."""
        self._serial = seen.serial
        told: Plain = {"serial": seen.serial, "error": seen.error, "connection": seen.connection} | seen.plain
        told |= {"who": self.who, "view_only": self._edit.view_only, "endpoint": self._look.endpoint}
        told |= {"history": self._edit.history.told, "recovery": self._edit.keep.on_offer}
        if seen.connection != self._connection:
            self._forget()
            self._connection, told["fresh"] = seen.connection, True
        told = {name: value for name, value in told.items() if name not in self._told or self._told[name] != value}
        self._told |= told
        if seen.version != self._version:
            changed = [known.told for known in seen.objects.values() if known.version > self._version]
            told["objects"] = changed
            told["gone"] = list(self._sent_ids - seen.objects.keys())
            self._sent_ids = set(seen.objects)
            self._version = seen.version
        newest = seen.events[-1]["serial"] if seen.events else 0
        if 0 <= self._event < newest:  # not those from before it came
            told["events"] = [event for event in seen.events if event["serial"] > self._event]
        self._event = newest
        rows, self._rows = seen.rows.new_since(self._rows), seen.rows
        new = len(seen.samples) if self._sample_count < 0 else min(seen.sample_count - self._sample_count, len(seen.samples))
        samples = seen.samples[len(seen.samples) - max(new, 0) :]
        now = time.monotonic()
        is_calm = not (told.keys() - {"serial", "time"} or len(rows.felt) or np.any(samples[:, 1:] != self._force))
        if is_calm and now < self._sent + 1 / CALM_RATE:
            return None
        self._sent = now
        if len(samples):
            self._force = samples[-1, 1:]
        self._sample_count = seen.sample_count
        told |= {"rows": len(rows.felt), "samples": len(samples)}
        text = JSON(told).encode()
        head = struct.pack("<I", len(text)) + text
        if seen.error:  # the page forgets all
            self._forget()
        return b"".join((head, bytes(-len(head) % 8), bytes(rows.poses), bytes(samples), bytes(rows.felt)))

    # ---- Commands

    async def _listen(self) -> None:
        """Takes the messages of the browser. Commands wait for their turn. What needs no turn: word that the browser has
        taken a state, the pieces of a file, and the stop of all force."""
        stops: set[asyncio.Task[None]] = set()
        with contextlib.suppress(ConnectionClosed):
            async for message in self._socket:
                if isinstance(message, bytes):
                    self._take_piece(message)
                    continue
                try:
                    command = json.loads(message)
                except (ValueError, RecursionError):
                    command = None
                if not isinstance(command, dict):
                    await self._socket.close(1003, "a command is a JSON object")
                    return
                if "took" in command:
                    self._is_taken = True
                    self._look.is_awaited.set()
                    self.tell()
                elif command.get("do") == "stop":
                    if len(stops) >= 8:
                        await asyncio.wait(stops, return_when=asyncio.FIRST_COMPLETED)
                    stops.add(task := asyncio.create_task(self._stop(_number(command))))
                    task.add_done_callback(stops.discard)
                elif self._waiting.full():
                    many = Refused("too many commands wait for their turn", status="FULL")
                    await self._socket.send(JSON({"n": _number(command)} | _refusal(many)))
                    await asyncio.sleep(1 / COMMANDS_A_SECOND)
                else:
                    self._waiting.put_nowait(command)

    async def _stop(self, number: Any) -> None:
        try:
            await asyncio.to_thread(self._edit.stop_force)
            answer: Plain = {"n": number, "ok": {}}
        except Refused as refused:
            answer = {"n": number} | _refusal(refused)
        with contextlib.suppress(ConnectionClosed):
            await self._socket.send(json.dumps(answer))

    async def _work(self) -> None:
        loop = asyncio.get_running_loop()
        next_time = 0.0
        try:
            while True:
                command = await self._waiting.get()
                next_time = max(next_time + 1 / COMMANDS_A_SECOND, loop.time() - 0.1)
                if next_time > loop.time():  # too many: the browser has to wait
                    await asyncio.sleep(next_time - loop.time())
                await self._socket.send(JSON(await self._answer(command)))
        except ConnectionClosed:
            pass
        except Exception:  # a bug of the editor
            traceback.print_exc()
            await self._socket.close(1011, "the editor failed")

    async def _answer(self, command: Plain) -> Plain:
        number = _number(command)
        try:
            if command.get("do") == "upload":
                if self._edit.view_only:
                    raise Refused("this editor only shows: it was started with --view", status="DENIED")
                self._begin_upload(command)
                return {"n": number, "ok": {}}
            upload = self._finished_upload() if command.get("upload") else None
            command.pop("upload", None)
            loop = asyncio.get_running_loop()
            return {"n": number, "ok": await loop.run_in_executor(self._worker, self._edit.do, self.who, command, upload)}
        except Refused as refused:
            return {"n": number} | _refusal(refused)

    def _begin_upload(self, command: Plain) -> None:
        self._drop_upload()
        size, name = command.get("size"), str(command.get("file", ""))
        if not isinstance(size, int) or size < 0:
            raise Refused("the command upload has no size", "file")
        if size == 0:
            raise Refused("the file is empty", "file")
        if size > MOST_UPLOAD:
            raise Refused(f"the file has {size} bytes, may have {MOST_UPLOAD}", "file", "FULL")
        ending = Path(name).suffix.lower()
        if ending not in (".obj", ".ply", ".stl", ".off", ".zip", ".json"):
            raise Refused(f"{name!r} is none of .obj .ply .stl .off .zip .json", "file", "UNSUPPORTED")
        try:
            self._upload = tempfile.NamedTemporaryFile(suffix=ending)  # noqa: SIM115  # it lives until the next one
        except OSError as error:
            raise Refused(f"there is no place for the file: {error}", "file", "IO") from None
        self._upload_left = size

    def _take_piece(self, piece: bytes) -> None:
        if self._upload is not None and len(piece) <= self._upload_left:
            try:
                self._upload.write(piece)
            except OSError as error:  # a full disk: what is not there is told when the file is asked for
                print(f"the file that a browser sends cannot be kept: {error}", flush=True)
                self._drop_upload()
                return
            self._upload_left -= len(piece)

    def _finished_upload(self) -> Path:
        if self._upload is None or self._upload_left:
            raise Refused("the file did not arrive as a whole", "file", "IO")
        try:
            self._upload.flush()
        except OSError as error:
            raise Refused(f"the file cannot be kept: {error}", "file", "IO") from None
        return Path(self._upload.name)

    def _drop_upload(self) -> None:
        if self._upload is not None:
            with contextlib.suppress(OSError):  # what is still in its buffer
                self._upload.close()
        self._upload = None


def _number(command: Plain) -> int | None:
    number = command.get("n")
    return number if isinstance(number, int) else None


def _refusal(refused: Refused) -> Plain:
    return {"refused": {"text": refused.text, "field": refused.field, "status": refused.status}}
