"""Carries out what a browser asks for, one command at a time, in a thread of its own."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import forceserver as fs
import numpy as np

from . import plain as plain_
from .history import History
from .keep import Keep
from .look import Look
from .plain import ALL_PARTS, Plain, Refused

# What a browser with `--view` may ask for.
HARMLESS = {"curve", "files", "evaluate"}


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
        if self.view_only and name not in HARMLESS:
            raise Refused("this editor only shows: it was started with --view", status="DENIED")
        scene = self.look.scene
        if scene is None:
            raise Refused(self.look.seen.error, status="DISCONNECTED")
        if self._connection != self.look.seen.connection:  # the scene that the steps were about is gone
            self._connection = self.look.seen.connection
            self.history.clear()
        for event in self.look.seen.events:
            if event["serial"] > self._event and event["kind"] == "edited":
                self.history.editors[event["name"]] = event["text"]
        self._event = max([self._event, *(event["serial"] for event in self.look.seen.events)])
        self._who, self._gesture, self._upload = who, str(command.get("gesture", "")), upload
        arguments = {key: value for key, value in command.items() if key not in ("do", "n", "gesture")}
        try:
            answer = call(scene, **arguments) or {}
        except fs.Error as error:
            raise plain_.refusal(error) from None
        except OSError as error:
            raise Refused(str(error), status="IO") from None
        except (TypeError, ValueError, LookupError, AttributeError, OverflowError, zipfile.BadZipFile) as error:
            raise Refused(f"the command {name} is not as it should be: {error}") from None
        if name not in HARMLESS:
            self.keep.note_change()
        return answer

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
        plain_.put(made, fields)
        scene.object_set(made)
        self._note(f"add {made.name}", made.name, None, scene.object_get(made.name), ALL_PARTS)
        return {"name": made.name}

    def _free_name(self, scene: fs.Scene, name: str) -> str:
        if name not in scene:
            return name
        return next(free for i in range(2, 100000) if (free := f"{name} {i}") not in scene)

    def _change(self, scene: fs.Scene, names: list[str], fields: Plain) -> None:
        """Changes these fields of the objects: of all, or of none."""
        made = []
        for name in names:
            before = scene.object_get(name)
            changed = before.copy()
            parts = plain_.put(changed, fields)
            made.append((name, before, changed, parts))
        with scene.change():
            for name, _, changed, parts in made:
                changed.name = name
                scene.object_change(changed, parts)
        for name, before, _, parts in made:
            self._note(f"change {name}", name, before, scene.object_get(name), parts)

    def _move(self, scene: fs.Scene, name: str, position: list[float], orientation: list[float]) -> None:
        before = scene.object_get(name)
        pose = fs.Pose(position=[float(x) for x in position], orientation=plain_.unit(orientation))
        scene.object_move(name, pose, fs.Twist(), 0)
        self._note(f"move {name}", name, before, scene.object_get(name), int(fs.Part.POSE))

    def _remove(self, scene: fs.Scene, names: list[str]) -> None:
        if any("/" in name for name in names):
            raise Refused("another client's object cannot be removed, as it could not be made again: disable it")
        before = {name: scene.object_get(name) for name in names}
        with scene.change():
            for name in names:
                scene.object_remove(name)
        for name in names:
            self._note(f"remove {name}", name, before[name], None, ALL_PARTS)

    def _rename(self, scene: fs.Scene, name: str, to: str) -> Plain:
        before = scene.object_get(name)
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
        self._gesture = self._gesture or f"rename {name}"
        self._note(f"rename {name}", name, before, None, ALL_PARTS)
        self._note(f"rename {name}", to, None, scene.object_get(to), ALL_PARTS)
        return {"name": to}

    def _adopt(self, scene: fs.Scene, name: str) -> Plain:
        """A copy of another client's object in the own scene, where it is felt in the same place."""
        client, _, short = name.rpartition("/")
        copied = scene.object_get(name)
        theirs, own = scene.get_frame(client or None), scene.get_frame(None)
        if theirs.scale != own.scale:
            raise Refused(
                f"the scene of {client} has {theirs.scale:g} m per device metre, that of the editor {own.scale:g}: "
                "give the editor's scene the same scale first"
            )
        if client:
            copied.pose = _through(copied.pose, theirs, own)
        copied.name = self._free_name(scene, short)
        copied.twist, copied.time = fs.Twist(), 0
        scene.object_set(copied)
        self._note(f"copy {name}", copied.name, None, scene.object_get(copied.name), ALL_PARTS)
        return {"name": copied.name}

    # ---- The editor's own scene

    def _frame(self, scene: fs.Scene, fields: Plain) -> None:
        made = scene.get_frame(None)
        pose = made.pose.copy()
        if "position" in fields:
            pose.position = [float(x) for x in fields["position"]]
        if "orientation" in fields:
            pose.orientation = plain_.unit(fields["orientation"])
        made.pose = pose
        made.scale = float(fields.get("scale", made.scale))
        made.force_scale = float(fields.get("force_scale", made.force_scale))
        scene.set_frame(made)

    def _tool(self, scene: fs.Scene, points: list[list[float]]) -> None:
        scene.set_tool(np.array(points, dtype=float).reshape(-1, 3))

    def _clutch(self, scene: fs.Scene, held: bool) -> None:
        scene.set_clutch(bool(held))

    def _stop(self, scene: fs.Scene) -> None:
        scene.stop_force()

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
        self._replace(scene, lambda: self.keep.load(scene, file, self._upload))

    def _recover(self, scene: fs.Scene) -> None:
        self._replace(scene, lambda: self.keep.recover(scene))

    def _discard(self, scene: fs.Scene) -> None:
        self.keep.discard()

    def _replace(self, scene: fs.Scene, load: Callable[[], None]) -> None:
        before = {name: scene.object_get(name) for name in scene}
        load()
        self._gesture = self._gesture or f"load {self.look.seen.serial}"
        for name in scene:
            after = scene.object_get(name)
            old = before.get(name)
            if old is None or plain_.parts_of(old, ALL_PARTS, self.look.shapes) != plain_.parts_of(
                after, ALL_PARTS, self.look.shapes
            ):
                self._note("load", name, old, after, ALL_PARTS)

    # ---- Curves

    def _curve(self, scene: fs.Scene, name: str, until: float, count: int = 400) -> Plain:
        """f(d) of both sides, raw and capped, for the plot."""
        found = scene.object_get(name)
        distances = np.linspace(0, float(until), max(2, min(int(count), 4000)))
        t = max(0.0, scene.get_time() - found.start) if found.start else 0.0
        report = scene.get_report(name)
        out: Plain = {"t": t, "distances": distances.tolist()}
        for side in ("front", "back"):
            profile = getattr(found, side)
            out[side] = fs.intensity(profile, distances, t).tolist()
            out[side + "_capped"] = None
            if report.stiffness_applied < report.stiffness_wanted and np.isfinite(report.stiffness_applied):
                try:
                    capped = fs.profile_evaluate(profile, report.stiffness_applied, t, distances)
                    out[side + "_capped"] = capped.tolist()
                except fs.UnsupportedError:
                    pass
        return out


COMMANDS = {
    "add", "change", "move", "remove", "rename", "adopt", "frame", "tool", "clutch", "stop", "undo", "redo", "files",
    "save", "load", "recover", "discard", "curve",
}  # fmt: skip


def _rotate(q: Any, v: Any) -> Any:
    u = np.asarray(q[1:])
    return v + 2 * np.cross(u, np.cross(u, v) + q[0] * np.asarray(v))


def _times(a: Any, b: Any) -> Any:
    return np.concatenate(
        [[a[0] * b[0] - np.dot(a[1:], b[1:])], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])]
    )


def _through(pose: fs.Pose, theirs: fs.Frame, own: fs.Frame) -> fs.Pose:
    """The same place in the own scene as `pose` in another client's: from there to the device, and back."""
    if bytes(np.asarray(theirs.pose).tobytes()) == bytes(np.asarray(own.pose).tobytes()):
        return pose.copy()
    out, back = theirs.pose, own.pose.orientation * np.array([1, -1, -1, -1])
    at_device = out.position + _rotate(out.orientation, pose.position / theirs.scale)
    turned = _times(back, _times(out.orientation, pose.orientation))
    return fs.Pose(position=own.scale * _rotate(back, at_device - own.pose.position), orientation=plain_.unit(turned))
