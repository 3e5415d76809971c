"""The editor's server without a browser: who gets in, what a socket gets, and what it may ask for."""

from __future__ import annotations

import asyncio
import io
import json
import math
import pathlib
import struct
import subprocess
import sys
import time
import urllib.parse
import zipfile
from typing import Any

import forceserver as fs
import numpy as np
import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from forceserver_editor.keep import Keep, copy_at_most
from forceserver_editor.plain import Refused


from conftest import Editor, Lab, Second, eventually
from wire import POINT, Socket, fetch, peak, run, with_socket


def test_token_host_and_origin(started: Any) -> None:
    lab = started(Lab)
    editor = started(Editor, lab.endpoint)
    base = f"http://127.0.0.1:{editor.port}"
    status, page = fetch(editor.address)
    assert status == 200 and b"Force editor" in page
    for path in ("", "/", f"/{editor.token[:-1]}/", "/wrong/", "/shapes/x", "/editor.js"):
        assert fetch(base + path)[0] == 403, path
    assert fetch(editor.address + "editor.js")[0] == 200
    assert fetch(editor.address + "shapes/none")[0] == 404
    assert fetch(editor.address + "../../etc/passwd")[0] in (403, 404)
    for host in ("evil.example", f"evil.example:{editor.port}", "127.0.0.1:1"):
        assert fetch(editor.address, Host=host)[0] == 403, host
    assert fetch(editor.address, Host=f"localhost:{editor.port}")[0] == 200
    assert fetch(editor.address, Origin="http://evil.example")[0] == 403

    async def knock(origin: str | None, token: str) -> int:
        try:
            async with connect(f"ws://127.0.0.1:{editor.port}/{token}/socket", origin=origin):  # type: ignore[arg-type]
                return 101
        except InvalidStatus as refused:
            return refused.response.status_code

    assert run(knock(base, editor.token)) == 101
    assert run(knock("http://evil.example", editor.token)) == 403
    assert run(knock("null", editor.token)) == 403
    assert run(knock(base, "wrong")) == 403
    assert run(knock(None, editor.token)) == 400  # what is no browser must still say where it comes from


def test_the_browser_is_opened_without_the_token(started: Any, tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All users of a machine can read the arguments of its programs."""
    arguments = tmp_path / "arguments"
    browser = tmp_path / "browser"
    browser.write_text(f'#!/bin/sh\necho "$@" > {arguments}.new\nmv {arguments}.new {arguments}\n')
    browser.chmod(0o700)
    monkeypatch.setenv("BROWSER", str(browser))
    for runtime in (tmp_path / "runtime", None):  # a session without XDG_RUNTIME_DIR has the state folder
        monkeypatch.setenv("XDG_RUNTIME_DIR", str(runtime or ""))
        lab = started(Lab)
        editor = started(Editor, lab.endpoint, opens=True)
        eventually(arguments.exists, "the browser")
        told = arguments.read_text().strip()
        assert editor.token not in told and told.startswith("file://")
        file = pathlib.Path(urllib.parse.unquote(urllib.parse.urlsplit(told).path))
        assert file.is_relative_to(runtime or editor.folder / ".state")
        assert file.stat().st_mode & 0o777 == 0o600 and file.parent.stat().st_mode & 0o777 == 0o700
        text = file.read_text()
        assert f"url={editor.address}" in text and f'href="{editor.address}"' in text
        editor.close()
        assert not file.parent.exists()
        arguments.unlink()


def test_states_and_shapes(started: Any) -> None:
    lab = started(Lab)
    rover = lab.join("rover")
    points = np.array([[4.1e6, 0, 0], [4.1e6 + 1, 0, 0], [4.1e6, 1, 0]], dtype=float)
    rover["land"] = fs.Mesh(points, [[0, 1, 2]])
    rover["line"] = fs.Polyline([(0, 0, 0), (0.1, 0.2, 0.30000000000000004)])
    rover.set_frame(fs.Frame(scale=150_000))
    editor = started(Editor, lab.endpoint)

    async def journey(s: Socket) -> None:
        await s.until(lambda s: len(s.objects) == 2 and len(s.poses) == 2)
        shape = s.objects["rover/land"]["shape"]
        assert shape["centre"] == [4.1e6 + 0.5, 0.5, 0] and shape["triangles"] == 1
        data = fetch(editor.address + "shapes/" + shape["hash"])[1]
        assert np.allclose(np.frombuffer(data, "<f4", 9).reshape(3, 3), points - shape["centre"], atol=0)
        assert np.frombuffer(data, "<u4", 3, 36).tolist() == [0, 1, 2]
        line = fetch(editor.address + "shapes/" + s.objects["rover/line"]["shape"]["hash"])[1]
        assert np.frombuffer(line).tolist() == [0, 0, 0, 0.1, 0.2, 0.30000000000000004]  # bit for bit
        client = next(c for c in s.told["clients"] if c["name"] == "rover")
        assert client["frame"]["scale"] == 150_000 and not client["locked"]
        rover["line"].move(position=(0.25, 0, 0))
        await s.until(lambda s: s.poses[s.objects["rover/line"]["id"]][0] == 0.25)
        del rover["land"]
        await s.until(lambda s: list(s.objects) == ["rover/line"])
        await s.until(lambda s: len(s.samples) > 50)
        assert math.hypot(*s.samples[-1][1:]) < 1e-6

    with_socket(editor, journey)


def test_commands_history_and_refusals(started: Any) -> None:
    lab = started(Lab)
    rover = lab.join("rover")
    rover["hazard"] = fs.Point(position=(0.05, 0, 0), front=fs.Gaussian(1, 0.01, limit=2))
    editor = started(Editor, lab.endpoint)
    second = started(Second, lab.endpoint)

    async def journey(s: Socket) -> None:
        assert (await s.ask("add", name="a", primitive="point", fields=POINT)) == {"name": "a"}
        assert (await s.ask("add", name="a", primitive="point", fields=POINT)) == {"name": "a 2"}
        assert second.get("editor/a")["front"]["gain"] == 1
        bad = await s.ask("change", names=["a"], fields={"front.gain": -1})
        assert bad["status"] == "INVALID" and bad["field"] == "front.gain" and "must be >= 0" in bad["text"]
        bad = await s.ask("change", names=["a"], fields={"front.kind": "custom", "front.width": 0, "front.curve": {"expression": "3*("}})
        assert bad["field"] == "front.curve" and "column 3" in bad["text"]
        for odd in ({"front.gain": "x"}, {"front.gain": None}, {"front.nothing": 1}, {"nothing": 1}, {"shape": 3}, {"pose.position": [1]},
                    {"tool_points": -1}, {"pose.orientation": [0, 0, 0, 0]}, {"primitive": "mesh"}, {"front.kind": "odd"}):  # fmt: skip
            assert "text" in await s.ask("change", names=["a"], fields=odd), odd
        assert "text" in await s.ask("nothing")
        assert "text" in await s.ask("change", names=["a"])
        for odd in (["a", "a"], {"a": 1}, [], "a", [1]):
            for what in ("change", "remove"):
                fields = {"fields": {"front.gain": 1.5}} if what == "change" else {}
                assert "names" in (told := (await s.ask(what, names=odd, **fields))["text"]) or "named twice" in told
        assert s.objects["a"]["front"]["gain"] == 1 and second.get("editor/a")["front"]["gain"] == 1
        for name, fields in [("change", {"names": 3, "fields": {}}), ("change", {"names": ["a"], "fields": [1]}), ("move", {"name": "a"}),
                             ("move", {"moves": [{"name": "a"}]}), ("move", {"moves": 3}),
                             ("frame", {"fields": 3}), ("frame", {"fields": {"scale": "x"}}), ("tool", {"points": [[1]]}), ("curve", {"name": 5}),
                             ("curve", {"name": "a", "until": "x"}), ("adopt", {"name": {}}), ("load", {"file": 7}), ("add", {"name": "x"}),
                             ("tool", {"points": [[1, 2, 3]] * 40}), ("add", {"name": "b", "primitive": "mesh", "fields": {}}), ("__init__", {})]:  # fmt: skip
            assert "text" in await s.ask(name, **fields), (name, fields)
        assert (await s.ask("change", names=["nobody"], fields={"damping": 1}))["status"] == "NOTFOUND"
        # Many changes with one gesture are one step.
        for gain in (1.5, 1.6, 1.7):
            assert await s.ask("change", names=["a", "rover/hazard"], fields={"front.gain": gain}, gesture="g1") == {}
        assert second.get("rover/hazard")["front"]["gain"] == 1.7
        rover["hazard"].move(position=(0.06, 0, 0))
        assert (await s.ask("undo"))["text"].startswith("change")
        assert second.get("rover/hazard")["front"]["gain"] == second.get("editor/a")["front"]["gain"] == 1
        assert second.get("rover/hazard")["position"] == [0.06, 0, 0]  # the owner's moves stay
        assert (await s.ask("redo"))["text"] == "change front.gain of a and 1 more"
        assert second.get("rover/hazard")["front"]["gain"] == 1.7
        # Somebody else changed the same part since.
        assert second.ask("gain rover/hazard 3") == "FS_OK"
        refused = await s.ask("undo")
        assert refused["status"] == "INVALID" and "rover" in refused["text"] and second.get("rover/hazard")["front"]["gain"] == 3
        assert second.get("editor/a")["front"]["gain"] == 1.7  # all of the step, or none
        assert "cannot be removed" in (await s.ask("remove", names=["rover/hazard"]))["text"]
        assert (await s.ask("adopt", name="rover/hazard")) == {"name": "hazard"}
        assert second.get("editor/hazard")["position"] == [0.06, 0, 0]
        assert await s.ask("remove", names=["a", "hazard"], gesture="g2") == {}
        assert second.get("editor/a")["status"] == "FS_ERROR_NOT_FOUND"
        assert (await s.ask("undo"))["who"] == "browser 1"
        assert second.get("editor/a")["front"]["gain"] == 1.7
        assert (await s.ask("rename", name="a", to='<b>"x"<b>')) == {"name": '<b>"x"<b>'}
        await s.until(lambda s: '<b>"x"<b>' in s.objects)
        assert "bytes long" in (await s.ask("rename", name='<b>"x"<b>', to="x" * 70))["text"]

    with_socket(editor, journey)


def test_files_stay_in_the_folder(started: Any) -> None:
    lab = started(Lab)
    editor = started(Editor, lab.endpoint)
    (editor.folder.parent / "outside.json").write_text('{"forceserver": "scene", "version": 1, "objects": []}')

    async def journey(s: Socket) -> None:
        await s.ask("add", name="a", primitive="point", fields=POINT | {"pose.position": [0.1, 0.2, 0.30000000000000004]})
        for file in ("../outside.json", "/tmp/x.json", "", ".hidden", "a/b/c"):
            for name in ("save", "load"):
                assert "text" in await s.ask(name, file=file), (name, file)
        assert await s.ask("save", file="room") == {"file": "room.json"}
        assert (await s.ask("files"))["files"] == ["room.json"]
        zipped = zipfile.ZipFile(io.BytesIO(fetch(editor.address + "scene.zip")[1]))
        assert zipped.namelist() == ["scene.json"]
        assert json.loads(zipped.read("scene.json"))["objects"] == json.loads((editor.folder / "room.json").read_text())["objects"]
        await s.ask("remove", names=["a"])
        assert await s.ask("load", file="room.json") == {}
        await s.until(lambda s: "a" in s.objects and s.poses[s.objects["a"]["id"]][2] == 0.30000000000000004)
        bad = io.BytesIO()
        with zipfile.ZipFile(bad, "w") as archive:
            archive.writestr("../evil.json", "{}")
        assert await s.ask("upload", size=len(bad.getvalue()), file="x.zip") == {}
        await s.socket.send(bad.getvalue())
        assert "outside" in (await s.ask("load", upload=True))["text"]
        assert "none of" in (await s.ask("upload", size=3, file="x.exe"))["text"]
        assert "bytes" in (await s.ask("upload", size=10**12, file="x.zip"))["text"]
        assert "as a whole" in (await s.ask("load", upload=True))["text"]

    with_socket(editor, journey)


async def upload(s: Socket, data: bytes, file: str, do: str, **fields: Any) -> Any:
    """What the command says that uses this file."""
    assert await s.ask("upload", size=len(data), file=file) == {}
    for at in range(0, len(data), 1 << 18):
        await s.socket.send(data[at : at + (1 << 18)])
    return await s.ask(do, upload=True, file=file, **fields)


def zipped(files: dict[str, bytes], claims: int | None = None, compression: int = zipfile.ZIP_DEFLATED) -> bytes:
    """claims: how large the directory says that each of them is."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", compression, compresslevel=1) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    made = bytearray(out.getvalue())
    at = made.find(b"PK\1\2")
    while claims is not None and at >= 0:
        struct.pack_into("<I", made, at + 24, claims)
        at = made.find(b"PK\1\2", at + 1)
    return bytes(made)


SCENE = b'{"forceserver": "scene", "version": 1, "objects": [{"name": "a", "primitive": "point"}]}'


def test_a_zip_file_that_is_too_large(started: Any) -> None:
    """It is refused before it is read: the library would need several times its size."""
    lab = started(Lab)
    editor = started(Editor, lab.endpoint)
    spaces = bytes(b" " * (129 << 20))

    async def journey(s: Socket) -> None:
        before = peak(editor)
        refused = await upload(s, zipped({"scene.json": spaces}), "room.zip", "load")
        assert refused["status"] == "FULL" and "'scene.json'" in refused["text"] and "32 MiB" in refused["text"], refused
        assert peak(editor) < before + 60, "MB"
        # What the directory claims is enough to refuse it, for one and for all together.
        refused = await upload(s, zipped({"scene.json": SCENE, "a.ply": b"x"}, 513 << 20), "room.zip", "load")
        assert refused["status"] == "FULL", refused
        refused = await upload(s, zipped({f"{i}.ply": b"x" for i in range(3)}, 400 << 20), "room.zip", "load")
        assert refused["status"] == "FULL" and "1024 MiB" in refused["text"], refused
        # More comes out than it claims; a password; a compression that can grow without bound.
        refused = await upload(s, zipped({"scene.json": SCENE}, 10), "room.zip", "load")
        assert "cannot be read" in refused["text"], refused
        locked = bytearray(zipped({"scene.json": SCENE}))
        locked[locked.find(b"PK\1\2") + 8] |= 1
        assert "password" in (await upload(s, bytes(locked), "room.zip", "load"))["text"]
        refused = await upload(s, zipped({"scene.json": SCENE}, compression=zipfile.ZIP_LZMA), "room.zip", "load")
        assert refused["status"] == "UNSUPPORTED", refused
        # A name that stands for a scene all the same; too many files.
        refused = await upload(s, zipped({"scene.json/.": spaces}), "room.zip", "load")
        assert refused["status"] == "FULL" and "32 MiB" in refused["text"], refused
        refused = await upload(s, zipped({"scene.json": SCENE} | {f"{i}.ply": b"" for i in range(5000)}), "room.zip", "load")
        assert refused["status"] == "FULL" and "5001 files" in refused["text"], refused
        # A bare scene.
        assert "32 MiB" in (await upload(s, spaces, "room.json", "load"))["text"]
        assert await upload(s, zipped({"scene.json": SCENE}), "room.zip", "load") == {}
        await s.until(lambda s: "a" in s.objects)

    with_socket(editor, journey)
    with pytest.raises(Refused, match="too large"):
        copy_at_most(io.BytesIO(bytes(5 << 20)), io.BytesIO(), 4 << 20, "what really comes out")


def test_what_is_wrong_with_an_upload_names_its_file(started: Any) -> None:
    lab = started(Lab)
    editor = started(Editor, lab.endpoint)
    meshed = (
        b'{"forceserver": "scene", "version": 1, "shapes": {"p": {"file": "%s"}}, '
        b'"objects": [{"name": "m", "primitive": "mesh", "shape": "p"}]}'
    )

    async def journey(s: Socket) -> None:
        await s.ask("add", name="a", primitive="plane", fields=POINT)
        for do, fields in (("add", {"name": "m", "primitive": "mesh", "fields": {}}), ("change", {"names": ["a"], "fields": {}})):
            refused = await upload(s, b"v 0 0\nf 1 2 3\n", "my part.obj", do, **fields)
            assert refused["text"].startswith("my part.obj, line 1: "), refused
        refused = await upload(s, b"{", "my room.json", "load")
        assert refused["text"].startswith("my room.json, line 1"), refused
        refused = await upload(s, zipped({"in/scene.json": meshed % b"part.obj", "in/part.obj": b"v 0\n"}), "my room.zip", "load")
        assert refused["text"].startswith("in/scene.json, ") and "in/part.obj, line 1" in refused["text"], refused
        refused = await upload(s, zipped({"scene.json": meshed % b"none.obj"}), "my room.zip", "load")
        assert "none.obj" in refused["text"], refused
        clash = await upload(s, zipped({"scene.json": SCENE, "scene.json/a.ply": b""}), "my room.zip", "load")
        for each in (refused, clash):
            assert "/tmp" not in each["text"], each

    with_socket(editor, journey)


def test_locked_server_and_view_only(started: Any) -> None:
    lab = started(Lab, locked=True, no_stop=True)
    lab.base["floor"] = fs.Wall((0, 0, -0.05), (0, 0, 1), 100, 5)
    editor = started(Editor, lab.endpoint)
    viewer = started(Editor, lab.endpoint, "--view", "--name", "viewer")

    async def journey(s: Socket) -> None:
        await s.until(lambda s: "server/floor" in s.objects)
        assert all(client["locked"] for client in s.told["clients"])
        refused = await s.ask("change", names=["server/floor"], fields={"enabled": False})
        assert refused["status"] == "DENIED"
        assert (await s.ask("stop"))["status"] == "DENIED"
        assert lab.servo.stats.enabled == 1

    with_socket(editor, journey)

    async def look(s: Socket) -> None:
        await s.until(lambda s: "server/floor" in s.objects)
        assert s.told["view_only"]
        for name in ("add", "change", "move", "remove", "stop", "undo", "save", "load", "clutch", "frame", "recover"):
            assert (await s.ask(name))["status"] == "DENIED", name

    with_socket(viewer, look)


def test_stop(started: Any) -> None:
    lab = started(Lab)
    editor = started(Editor, lab.endpoint)

    async def journey(s: Socket) -> None:
        assert await s.ask("stop") == {}
        eventually(lambda: lab.servo.stats.enabled == 0)
        await s.until(lambda s: s.told["stats"]["enabled"] == 0)
        lab.servo.set_enabled(True)
        await s.until(lambda s: s.told["stats"]["enabled"] == 1)

    with_socket(editor, journey)


def test_too_large_and_too_many(started: Any) -> None:
    lab = started(Lab)
    editor = started(Editor, lab.endpoint)

    async def large(s: Socket) -> None:
        with pytest.raises(ConnectionClosed):
            await s.socket.send(["x" * 1_000_000] * 100)  # one message, in pieces
            while True:
                await s.socket.recv()

    with_socket(editor, large)

    async def nonsense(s: Socket) -> None:
        with pytest.raises(ConnectionClosed):
            await s.socket.send("[1, 2")
            while True:
                await s.socket.recv()

    with_socket(editor, nonsense)

    async def two(s: Socket) -> None:
        """While one asks as fast as it can, the other gets its states."""
        origin = f"http://127.0.0.1:{editor.port}"
        async with connect(f"ws://127.0.0.1:{editor.port}/{editor.token}/socket", origin=origin, max_size=None) as other:  # type: ignore[arg-type]

            async def flood() -> None:
                for n in range(5_000):
                    await other.send(json.dumps({"n": n, "do": "change", "names": ["nobody"], "fields": {"damping": 1}}))

            async def drop() -> None:
                while True:
                    await other.recv()

            tasks = [asyncio.create_task(flood()), asyncio.create_task(drop())]
            for _ in range(60):
                await s.state()  # they come
            for task in tasks:
                task.cancel()

    with_socket(editor, two)


def test_a_socket_that_is_not_read(started: Any) -> None:
    """Nothing queues for it: when it reads again, it gets one old state and then the newest."""
    lab = started(Lab)
    editor = started(Editor, lab.endpoint)

    async def journey(s: Socket) -> None:
        await s.state()
        last = s.told["serial"]
        await s.socket.recv()  # one is under way, and is not answered: no other follows
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(s.socket.recv(), 1)
        await s.socket.send(json.dumps({"took": 0}))
        await s.state()
        assert s.told["serial"] > last + 1

    with_socket(editor, journey)


def test_an_edit_just_before_the_server_ends(tmp_path: Any) -> None:
    """The scene of the next server, which is empty, is not written in its name."""
    keep = Keep(tmp_path, tmp_path / "state", "shm:lab", "editor")
    with fs.Scene() as scene, fs.Scene() as empty:
        scene["a"] = fs.Point()
        keep.note_change(1)
        keep.write_recovery(scene, 1, True)
        keep.note_change(1)
        keep.offer_again()
        keep.write_recovery(empty, 2, True)
    (only,) = (tmp_path / "state").rglob("scene.json")
    assert '"a"' in only.read_text() and keep.on_offer


def test_a_stop_overtakes_what_waits(started: Any) -> None:
    lab = started(Lab)
    editor = started(Editor, lab.endpoint)

    async def journey(s: Socket) -> None:
        for n in range(100):
            await s.socket.send(json.dumps({"n": n, "do": "files"}))
        await s.socket.send(json.dumps({"n": 100, "do": "stop"}))
        order: list[int] = []
        refused = 0
        while len(order) < 101:
            message = await s.socket.recv()
            if isinstance(message, str):
                answer = json.loads(message)
                order.append(answer["n"])
                refused += answer.get("refused", {}).get("status") == "FULL"
        assert sorted(order) == list(range(101))  # each is answered, also those that are too many
        assert refused > 0 and order.index(100) < 90, (refused, order)
        assert lab.servo.stats.enabled == 0

    with_socket(editor, journey)


def test_a_calm_scene_is_told_of_seldom(started: Any) -> None:
    """Where nothing changes but the time, there are a few states a second; what changes is told at once."""
    lab = started(Lab)
    editor = started(Editor, lab.endpoint)
    rover = lab.join("rover")
    rover["a"] = fs.Point(position=(0.3, 0, 0))

    async def journey(s: Socket) -> None:
        await s.until(lambda s: "rover/a" in s.objects and s.felt[s.objects["rover/a"]["id"]][1] == 1)  # felt
        before, samples, at = s.states, len(s.samples), time.monotonic()
        while time.monotonic() < at + 2:
            await s.state()
        assert s.states - before < 30  # 4 a second, and the statistics of the servo
        assert len(s.samples) > samples + 50  # no force is left out
        for x in (0.4, 0.5, 0.6):
            rover.object_move("a", fs.Pose(position=(x, 0, 0)), fs.Twist(), 0)
            before = s.states
            await s.until(lambda s, x=x: s.poses[s.objects["rover/a"]["id"]][0] == x)  # type: ignore[misc]
            assert s.states - before < 30

    with_socket(editor, journey)


def test_no_force_is_missed(started: Any) -> None:
    """The force of each tick is told once, as the servo recorded it; also one that lasts two or three ticks."""
    lab = started(Lab)
    editor = started(Editor, lab.endpoint)
    lab.base["pulse"] = fs.Point(position=(0.1, 0, 0), front=fs.Custom("abs(t - 0.1*rint(t/0.1)) < 0.00125 ? 3 : 0", limit=10))
    eventually(lambda: lab.base["pulse"].report.weight == 1)

    async def journey(s: Socket) -> None:
        await s.until(lambda s: len(s.samples) > 4000)
        record = np.asarray(lab.servo.record)
        wanted = np.column_stack([record["state"]["time"], record["sent"]["force"]])
        await s.until(lambda s: s.samples[-1][0] >= wanted[-1, 0])
        told = np.array(s.samples)
        assert (np.diff(told[:, 0]) > 0).all()
        inside = (told[:, 0] >= wanted[0, 0]) & (told[:, 0] <= wanted[-1, 0])
        assert np.array_equal(told[inside], wanted)
        assert np.linalg.norm(wanted[:, 1:], axis=1).max() > 2.5

    with_socket(editor, journey)


def test_server_that_ends_and_comes_again(started: Any) -> None:
    lab = started(Lab)
    editor = started(Editor, lab.endpoint)

    async def journey(s: Socket) -> None:
        await s.ask("add", name="a", primitive="point", fields=POINT)
        await s.until(lambda s: "a" in s.objects)
        eventually(lambda: list((editor.folder / ".state").rglob("scene.json")), "the recovery file")
        first = s.told["connection"]
        lab.close()
        await s.until(lambda s: s.told["error"])
        assert (await s.ask("add", name="b", primitive="point", fields=POINT))["status"] == "DISCONNECTED"
        new = started(Lab, endpoint=lab.endpoint)
        await s.until(lambda s: not s.told["error"])
        assert s.told["connection"] > first and not s.objects  # nothing pushes by itself
        await s.until(lambda s: s.told["recovery"])
        assert (await s.ask("undo"))["text"] == "there is nothing to undo"
        assert await s.ask("add", name="c", primitive="point", fields=POINT) == {"name": "c"}  # is kept beside what is on offer
        kept = lambda: [path for path in (editor.folder / ".state").rglob("scene.json") if '"c"' in path.read_text()]  # noqa: E731
        eventually(kept, "the second recovery file")
        assert await s.ask("recover") == {}
        await s.until(lambda s: "a" in s.objects and not s.told["recovery"])
        assert len(new.base) == 0

    with_socket(editor, journey)


def test_a_step_that_cannot_be_undone_bars_no_other(started: Any) -> None:
    lab = started(Lab)
    rover = lab.join("rover")
    rover["hazard"] = fs.Point()
    editor = started(Editor, lab.endpoint)

    async def journey(s: Socket) -> None:
        assert await s.ask("add", name="a", primitive="point", fields=POINT) == {"name": "a"}
        await s.until(lambda s: "rover/hazard" in s.objects)
        assert await s.ask("move", moves=[{"name": "rover/hazard", "position": [0.1, 0, 0], "orientation": [1, 0, 0, 0]}]) == {}
        rover.object_move("hazard", fs.Pose(position=(0.2, 0, 0)), fs.Twist(), 0)
        rover.sync(5)
        refused = await s.ask("undo")
        assert "is left out" in refused["text"] and "rover" in refused["text"]
        assert (await s.ask("undo"))["text"] == "add a"
        assert (await s.ask("undo"))["text"] == "there is nothing to undo"
        assert (await s.ask("redo"))["text"] == "add a"
        assert (await s.ask("redo"))["text"] == "there is nothing to do again"

    with_socket(editor, journey)


def test_what_the_library_refuses_to_undo_bars_no_other(started: Any) -> None:
    lab = started(Lab)
    rover = lab.join("rover")
    rover["wall"] = fs.Plane(back=fs.Constant(1, limit=2))
    editor = started(Editor, lab.endpoint)

    async def journey(s: Socket) -> None:
        assert await s.ask("add", name="a", primitive="point", fields=POINT) == {"name": "a"}
        await s.until(lambda s: "rover/wall" in s.objects)
        nothing = {"back.kind": "none", "back.gain": 0, "back.limit": 0}
        assert await s.ask("change", names=["rover/wall"], fields=nothing) == {}
        wall = rover.object_get("wall")
        wall.primitive = fs.Primitive.POINT  # which has no back
        rover.object_set(wall)
        rover.sync(5)
        refused = await s.ask("undo")
        assert "back.kind" in refused["text"] and "is left out" in refused["text"]
        assert (await s.ask("undo"))["text"] == "add a"

    with_socket(editor, journey)


def test_curves_of_others_that_are_not_finite(started: Any) -> None:
    lab = started(Lab)
    rover = lab.join("rover")
    table = fs.curve_create_table([1.0, math.nan, math.inf, 2.0], 0.01)
    rover["odd"] = fs.Point(front=fs.Custom(table, limit=5))
    rover["steep"] = fs.Plane(back=fs.LinearIncreasing(1e300, limit=5))
    editor = started(Editor, lab.endpoint)

    async def journey(s: Socket) -> None:
        await s.until(lambda s: len(s.objects) == 2 and len(s.felt) == 2)
        assert s.objects["rover/odd"]["front"]["curve"]["table"] == [1, 0, 0, 2]  # what is not finite counts as 0
        # A frame at the end of what a number can be.
        assert await s.ask("add", name="a", primitive="point", fields=POINT) == {"name": "a"}
        assert await s.ask("frame", fields={"scale": 1e-9, "force_scale": 1e-318}) == {}
        for name in ("a", "rover/odd", "rover/steep"):
            assert {"distances", "text"} & (await s.ask("curve", name=name, until=0.1)).keys()

    with_socket(editor, journey)


def test_names(started: Any) -> None:
    lab = started(Lab)
    rover = lab.join('<i>"r&b"<i>')
    names = ["<script>alert(1)<script>", 'a"b\'c', "ü" * 15, "שלום", "a\\b"]
    for name in names:
        rover[name] = fs.Point()
    editor = started(Editor, lab.endpoint)

    async def journey(s: Socket) -> None:
        await s.until(lambda s: len(s.objects) == len(names))
        assert {one["short"] for one in s.objects.values()} == set(names)
        for name in names:
            assert await s.ask("change", names=[f'<i>"r&b"<i>/{name}'], fields={"enabled": False}) == {}

    with_socket(editor, journey)


def test_command_line(started: Any) -> None:
    def run(*arguments: str) -> str:
        done = subprocess.run([sys.executable, "-m", "forceserver_editor", *arguments], capture_output=True, text=True, timeout=60)
        assert done.returncode == 1
        return done.stderr

    assert "listens at shm:nobody-here" in run("nobody-here", "--no-browser")
    lab = started(Lab)
    editor = started(Editor, lab.endpoint)
    assert "cannot listen" in run(lab.endpoint, "--no-browser", "--port", str(editor.port))
    other = started(Editor, lab.endpoint)  # two editors with one name
    assert {str(client["name"]) for client in lab.join("x").get_clients()} >= {"editor", "editor 2"}
    assert other.port != editor.port
    assert "'editor'" in run(lab.endpoint, "--no-browser", "--name", "editor")
    assert "WARNING" in started(Editor, lab.endpoint, "--host", "0.0.0.0", "--name", "wide").said
