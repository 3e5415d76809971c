"""Carries out what a browser asks for, one command at a time, in a thread of its own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import forceserver as fs
import numpy as np

from .fields import put, vector
from .frames import in_frame, standing, unit
from .history import History, get_setting, settle
from .keep import Keep
from .look import Look
from .plain import ALL_PARTS, Plain, Refused, parts_of, refusal, twist

QUESTIONS = {"curve", "files", "twist"}  # what a browser with `--view` may ask for
NO_EDITS = QUESTIONS | {"save", "discard"}  # what leaves the scene as it is


class Edit:
    def __init__(self, look: Look, keep: Keep, view_only: bool) -> None:
        self.look, self.keep, self.view_only = look, keep, view_only
        self.history = History(look.shapes)
        self._connection = 0
        self._event = 0

    def do(self, who: str, command: Plain, upload: Path | None) -> Plain:
        """Returns the answer. Raises Refused."""
        name = str(command.get("do"))
        call: Callable[..., Plain | None] | None = getattr(self, "_" + name, None) if name in COMMANDS else None
        if call is None:
            raise Refused(f"there is no command {name!r}")
        if self.view_only and name not in QUESTIONS:
            raise Refused("this editor only shows: it was started with --view", status="DENIED")
        scene = self.look.scene
        if scene is None:
            raise Refused(self.look.seen.error, status="DISCONNECTED")
        if self._connection != self.look.connection:  # the scene that the steps were about is gone
            self._connection = self.look.connection
            self.history.clear()
        events = self.look.seen.events
        for event in events:
            if event["serial"] > self._event and event["kind"] == "edited":
                self.history.editors[event["name"]] = event["text"]
        self._event = max([self._event, *(event["serial"] for event in events)])
        self._who, self._gesture, self._upload = who, str(command.get("gesture", "")), upload
        self._upload_name = str(command.get("file") or "the uploaded file") if upload else ""
        taken = ("do", "n", "gesture", "file") if upload else ("do", "n", "gesture")
        arguments = {key: value for key, value in command.items() if key not in taken}
        try:
            answer = self._call(call, scene, arguments) or {}
        except Refused as refused:
            if upload is not None:  # it has a name of its own here, which the person does not know
                refused.text = refused.text.replace(str(upload), self._upload_name).replace(upload.name, self._upload_name)
            raise
        if name not in NO_EDITS:
            self.keep.note_change(self._connection)
        return answer

    @staticmethod
    def _call(call: Callable[..., Plain | None], scene: fs.Scene, arguments: Plain) -> Plain | None:
        """All that can go wrong becomes a sentence."""
        try:
            return call(scene, **arguments)
        except fs.Error as error:
            raise refusal(error) from None
        except OSError as error:
            raise Refused(str(error), status="IO") from None
        except (TypeError, ValueError, LookupError, AttributeError, ArithmeticError) as error:
            raise Refused(f"the command is not as it should be: {error}") from None

    # ---- Objects

    def _note(self, text: str, name: str, before: fs.Object | None, after: fs.Object | None, parts: int) -> None:
        self.history.note(self._who, self._gesture, text, name, before, after, parts)
        self.look.fetch_again(name)

    def _add(self, scene: fs.Scene, name: str, primitive: str, fields: Plain, scale: float = 1.0) -> Plain:
        made = fs.Object(primitive=fs.Primitive[primitive.upper()])
        made.name = self._free_name(scene, name)
        if primitive == "mesh":
            if self._upload is None:
                raise Refused("a mesh needs a file", "shape")
            made.shape = fs.shape_load(self._upload, float(scale))
        put(made, fields, 0)
        scene.object_set(made)
        settle(scene)
        self._note(f"add {made.name}", made.name, None, scene.object_get(made.name), ALL_PARTS)
        return {"name": made.name}

    def _free_name(self, scene: fs.Scene, name: str) -> str:
        if name not in scene:
            return name
        return next(free for i in range(2, 100000) if (free := f"{name} {i}") not in scene)

    def _change(self, scene: fs.Scene, names: list[str], fields: Plain | list[Plain], scale: float = 1.0) -> None:
        """Changes these fields of the objects, or of each the ones that are listed for it: of all, or of none. With a file
        they become meshes of that shape."""
        _require_names(names)
        each = fields if isinstance(fields, list) else [fields] * len(names)
        if self._upload is not None:
            mesh = {"shape": fs.shape_load(self._upload, float(scale)), "primitive": "mesh"}
            each = [mesh | one for one in each]
        made, now = [], scene.get_time()
        for name, one in zip(names, each, strict=True):
            before = scene.object_get(name)
            changed = before.copy()
            made.append((name, before, changed, put(changed, one, now)))
        with scene.change():
            for name, _, changed, parts in made:
                changed.name = name
                scene.object_change(changed, parts)
        settle(scene)
        text = f"change {_fields(each)} of {_listed(names)}"
        for name, before, _, parts in made:
            self._note(text, name, before, scene.object_get(name), parts)

    def _move(self, scene: fs.Scene, moves: list[Plain]) -> None:
        """All of them are felt from one tick on, or none."""
        _require_names([one["name"] for one in moves])
        before = {one["name"]: scene.object_get(one["name"]) for one in moves}
        with scene.change():
            for one in moves:
                pose = fs.Pose(position=[float(x) for x in one["position"]], orientation=unit(one["orientation"]))
                scene.object_move(one["name"], pose, fs.Twist(), 0)
        settle(scene)
        for name, was in before.items():
            self._note(f"move {_listed(list(before))}", name, was, scene.object_get(name), int(fs.Part.POSE))

    def _remove(self, scene: fs.Scene, names: list[str]) -> None:
        _require_names(names)
        if any("/" in name for name in names):
            raise Refused("another client's object cannot be removed, as it could not be made again: disable it")
        before = {name: scene.object_get(name) for name in names}
        with scene.change():
            for name in names:
                scene.object_remove(name)
        settle(scene)
        for name in names:
            self._note(f"remove {_listed(names)}", name, before[name], None, ALL_PARTS)

    def _rename(self, scene: fs.Scene, name: str, to: str) -> Plain:
        before, to = scene.object_get(name), to.strip()  # a name of blanks cannot be seen
        if "/" in name:
            raise Refused("another client's object keeps its name", "name")
        if to == name:
            return {"name": to}
        if to in scene:
            raise Refused(f"name is {to!r}: there is an object of this name", "name")
        renamed = before.copy()
        renamed.name = to
        with scene.change():
            scene.object_set(renamed)
            scene.object_remove(name)
        settle(scene)
        self._gesture = self._gesture or f"rename {name}"
        self._note(f"rename {name}", name, before, None, ALL_PARTS)
        self._note(f"rename {name}", to, None, scene.object_get(to), ALL_PARTS)
        return {"name": to}

    def _adopt(self, scene: fs.Scene, name: str) -> Plain:
        """A copy of another client's object in the own scene, where it feels the same in the same place."""
        client, _, short = name.rpartition("/")
        before = scene.object_get(name)
        copied = before.copy()
        copied.pose = standing(before, scene.get_time())
        if client:
            copied = in_frame(copied, scene.get_frame(client), scene.get_frame(None))
        copied.name = self._free_name(scene, short)
        copied.twist, copied.time = fs.Twist(), 0
        scene.object_set(copied)
        settle(scene)
        self._note(f"copy {name}", copied.name, None, scene.object_get(copied.name), ALL_PARTS)
        return {"name": copied.name}

    # ---- The editor's own scene

    def _set(self, scene: fs.Scene, what: str, change: Callable[[], None]) -> None:
        before = get_setting(scene, what)
        change()
        settle(scene)  # to release the clutch moves the frame
        text = f"change the {what} of the scene"
        self.history.note_setting(self._who, self._gesture, text, what, before, get_setting(scene, what))

    def _frame(self, scene: fs.Scene, fields: Plain) -> None:
        made = scene.get_frame(None)
        pose = made.pose.copy()
        for path, value in fields.items():
            first, _, axis = path.partition(".")
            if first in ("position", "orientation"):
                setattr(pose, first, vector(getattr(pose, first), axis, value))
            elif first in ("scale", "force_scale"):
                setattr(made, first, float(value))
            else:
                raise Refused(f"{path} is no field of a frame", path)
        made.pose = pose
        self._set(scene, "frame", lambda: scene.set_frame(made))

    def _tool(self, scene: fs.Scene, points: list[list[float]]) -> None:
        made = np.array(points, dtype=float).reshape(-1, 3)
        self._set(scene, "tool", lambda: scene.set_tool(made))

    def _clutch(self, scene: fs.Scene, held: bool) -> None:
        self._set(scene, "clutch", lambda: scene.set_clutch(bool(held)))

    def stop_force(self) -> None:
        """At once, whatever else is being done: this alone may be called from any thread. Raises Refused."""
        scene = self.look.scene
        if self.view_only:
            raise Refused("this editor only shows: it was started with --view", status="DENIED")
        if scene is None:
            raise Refused(self.look.seen.error, status="DISCONNECTED")
        try:
            scene.stop_force()
        except fs.Error as error:
            raise refusal(error) from None
        self.look.look_at_stats()

    # ---- History and files

    def _undo(self, scene: fs.Scene) -> Plain:
        return self._told(self.history.undo(scene))

    def _redo(self, scene: fs.Scene) -> Plain:
        return self._told(self.history.redo(scene))

    def _told(self, step: Any) -> Plain:
        for name in step.changes:
            self.look.fetch_again(name)
        told: Plain = step.plain()
        return told

    def _files(self, scene: fs.Scene) -> Plain:
        return {"folder": str(self.keep.folder), "files": self.keep.files()}

    def _save(self, scene: fs.Scene, file: str) -> Plain:
        return {"file": self.keep.save(scene, file)}

    def _load(self, scene: fs.Scene, file: str = "") -> None:
        self._replace(scene, f"load {self._upload_name or file}", lambda: self.keep.load(scene, file, self._upload))

    def _recover(self, scene: fs.Scene) -> None:
        self._replace(scene, "restore the scene", lambda: self.keep.recover(scene))
        self.keep.discard()  # only now: the server may have refused it

    def _discard(self, scene: fs.Scene) -> None:
        self.keep.discard()

    def _replace(self, scene: fs.Scene, text: str, load: Callable[[], None]) -> None:
        before = {name: scene.object_get(name) for name in scene}
        settings = {what: get_setting(scene, what) for what in ("frame", "tool")}  # a file has them too
        load()
        settle(scene)
        self._gesture = self._gesture or f"load {self.look.seen.serial}"
        for what, was in settings.items():
            if not np.array_equal(np.asarray(is_now := get_setting(scene, what)), np.asarray(was)):
                self.history.note_setting(self._who, self._gesture, text, what, was, is_now)
        for name in scene:
            after = scene.object_get(name)
            old = before.get(name)
            if old is None or parts_of(old, ALL_PARTS, self.look.shapes) != parts_of(
                after, ALL_PARTS, self.look.shapes
            ):
                self._note(text, name, old, after, ALL_PARTS)

    # ---- What the states do not have

    def _twist(self, scene: fs.Scene, name: str) -> Plain:
        return twist(scene.object_get(name).twist)

    def _curve(self, scene: fs.Scene, name: str, until: float, count: int = 400) -> Plain:
        """f(d) of both sides, for the plot: raw, and with its slopes limited to what the servo lets the object have."""
        until = float(until)
        if not np.isfinite(until):
            raise Refused(f"until is {until}, must be finite")
        found, report = scene.object_get(name), scene.get_report(name)
        frame = scene.get_frame(name.rpartition("/")[0] or None)
        distances = np.linspace(0, until, max(2, min(int(count), 4000)))
        t = max(0.0, scene.get_time() - found.start) if found.start else 0.0
        steepest = report.stiffness_applied / (frame.scale * frame.force_scale) if frame.force_scale else 0.0
        is_capped = report.stiffness_applied < report.stiffness_wanted and 0 < steepest < np.inf
        out: Plain = {"t": t, "distances": distances.tolist(), "steepest": steepest if is_capped else None}
        for side, at in (("front", distances), ("back", -distances)):
            out[side] = fs.intensity(getattr(found, side), distances, t).tolist()
            out[side + "_capped"] = np.abs(fs.law(found, at, t, max_stiffness=steepest)).tolist() if is_capped else None
        return out


def _require_names(names: Any) -> None:
    if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
        raise Refused("names are a list of one name or more")
    if len(set(names)) < len(names):
        raise Refused("an object is named twice")


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} more"


def _fields(each: list[Plain]) -> str:
    """What is changed, in few words: the field, or of several fields the parts of the object that they are in."""
    paths = sorted({path for one in each for path in one})
    return paths[0] if len(paths) == 1 else ", ".join(sorted({path.partition(".")[0] for path in paths}))


COMMANDS = {
    "add", "change", "move", "remove", "rename", "adopt", "frame", "tool", "clutch", "undo", "redo", "files",
    "save", "load", "recover", "discard", "curve", "twist",
}  # fmt: skip
