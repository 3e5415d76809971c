"""What was edited, step by step, for all browsers together: each gesture is one step that can be undone and done again.

Own objects are remembered whole, with their shapes, curves and surfaces; of another client's object only the parts that were
touched. A step is not undone if somebody else has changed the same parts since: it is left out then. Frame, tool and
clutch of the editor's own scene are settings, which nobody else can change.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import forceserver as fs
import numpy as np

from .plain import ALL_PARTS, Plain, Refused, Shapes, parts_of, refusal

MOST_WAIT = 0.5  # s, until the server has taken a change
MOST_STEPS = 200


@dataclass
class Change:
    before: fs.Object | None  # None: it was not there
    after: fs.Object | None
    parts: int


@dataclass(eq=False)
class Step:
    who: str
    gesture: str
    text: str
    changes: dict[str, Change] = field(default_factory=dict)
    settings: dict[str, tuple[Any, Any]] = field(default_factory=dict)  # "frame", "tool", "clutch": before and after

    def plain(self) -> Plain:
        return {"who": self.who, "text": self.text}


def get_setting(scene: fs.Scene, what: str) -> Any:
    view = scene.get_view(None)
    frame: Any = view.frame.copy()
    if what == "tool":
        return np.array(view.points)[: view.point_count]
    return frame if what == "frame" else (bool(view.held), frame)  # a clutch that is released moves the frame


def set_setting(scene: fs.Scene, what: str, value: Any) -> None:
    if what == "tool":
        scene.set_tool(value)
    elif what == "frame":
        scene.set_frame(value)
    else:
        held, frame = value
        scene.set_clutch(held)
        scene.set_frame(frame)


def settle(scene: fs.Scene) -> None:
    """Waits until the server has taken the change; before, object_get gives other clients' objects as they were. Raises what
    the server refuses: then there is nothing to undo."""
    with contextlib.suppress(fs.TimeoutError):
        scene.sync(MOST_WAIT)


class History:
    def __init__(self, shapes: Shapes) -> None:
        self._shapes = shapes
        self._steps: list[Step] = []
        self._done = 0  # the steps before this one are done, the rest are undone
        self.editors: dict[str, str] = {}  # the other client that is known to have changed an own object last
        self.told: Plain = {"undo": None, "redo": None}  # for the page; other threads may read it

    def clear(self) -> None:
        self._steps = []
        self.editors.clear()
        self._reach(0)

    def _reach(self, done: int) -> None:
        self._done = done
        self.told = {
            "undo": self._steps[done - 1].plain() if done else None,
            "redo": self._steps[done].plain() if done < len(self._steps) else None,
        }

    def note(
        self, who: str, gesture: str, text: str, name: str, before: fs.Object | None, after: fs.Object | None, parts: int
    ) -> None:
        """Notes that an object was changed. Changes of one gesture are one step."""
        changes = self._step(who, gesture, text).changes
        if name in changes:
            changes[name].after = after
            changes[name].parts |= parts
        else:
            changes[name] = Change(before, after, parts)

    def note_setting(self, who: str, gesture: str, text: str, what: str, before: Any, after: Any) -> None:
        settings = self._step(who, gesture, text).settings
        settings[what] = settings[what][0] if what in settings else before, after

    def _step(self, who: str, gesture: str, text: str) -> Step:
        """The step that a change belongs to: the last one if it is of the same gesture."""
        step = self._steps[self._done - 1] if self._done else None
        if step is None or not gesture or step.gesture != gesture or step.who != who or self._done < len(self._steps):
            step = Step(who, gesture, text)
            self._steps = [*self._steps[: self._done], step][-MOST_STEPS:]
            self._reach(len(self._steps))
        return step

    def undo(self, scene: fs.Scene) -> Step:
        if not self._done:
            raise Refused("there is nothing to undo")
        step = self._steps[self._done - 1]
        changes = {name: Change(c.after, c.before, c.parts) for name, c in step.changes.items()}
        with self._dropping(step, self._done - 1):
            self._apply(scene, changes, {what: before for what, (before, _) in step.settings.items()})
        self._reach(self._done - 1)
        return step

    def redo(self, scene: fs.Scene) -> Step:
        if self._done == len(self._steps):
            raise Refused("there is nothing to do again")
        step = self._steps[self._done]
        with self._dropping(step, self._done):
            self._apply(scene, step.changes, {what: after for what, (_, after) in step.settings.items()})
        self._reach(self._done + 1)
        return step

    @contextlib.contextmanager
    def _dropping(self, step: Step, done: int) -> Iterator[None]:
        """A step that somebody else's change has made impossible is dropped, so that it does not bar those before it."""
        try:
            yield
        except (fs.TimeoutError, fs.DisconnectedError):
            raise  # it may be possible later
        except (Refused, fs.Error) as error:
            refused = refusal(error) if isinstance(error, fs.Error) else error
            self._steps.remove(step)
            self._reach(done)
            refused.text += f". The step “{step.text}” is left out from now on"
            raise refused from None

    def _apply(self, scene: fs.Scene, changes: dict[str, Change], settings: dict[str, Any]) -> None:
        """All of it, felt from one tick on, or none."""
        for name, change in changes.items():
            self._require_untouched(scene, name, change)
        with scene.change():
            for what, value in settings.items():
                set_setting(scene, what, value)
            for name, change in reversed(changes.items()):
                if change.after is None:
                    scene.object_remove(name)
                    continue
                wanted = change.after.copy()
                wanted.name, wanted.time = name, 0  # a motion begins again
                if change.before is None:
                    scene.object_set(wanted)
                else:
                    scene.object_change(wanted, change.parts)  # the rest is as this step left it
        settle(scene)

    def _require_untouched(self, scene: fs.Scene, name: str, change: Change) -> None:
        owner = name.rpartition("/")[0]
        who = self.editors.get(name, "another client") if not owner else f"{owner} or another client"
        try:
            present = scene.object_get(name)
        except fs.NotFoundError:
            if change.before is None:
                return
            raise Refused(f"{name} is gone: {who} has removed it") from None
        if change.before is None:
            raise Refused(f"there is another {name} by now")
        parts = change.parts if owner else ALL_PARTS
        is_same = parts_of(present, parts, self._shapes) == parts_of(change.before, parts, self._shapes)
        if not is_same:
            raise Refused(f"{name} is not as this step left it: {who} has changed it since")
