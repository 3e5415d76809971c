"""VIZ as a client: the ground and the hazards as force-objects."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path

import forceserver as fs
import numpy as np
from virtualrobot.ground import Array, Ground
from virtualrobot.robot import joystick_scale, map_scale

from .drawing import Drawing
from .hazards import BadBorder, Hazards, prefix
from .picture import Picture

period = 0.04  # s, of the moves while VIZ follows a rover
push, most = 400.0, 5.0  # N/m and N at the hand: of the ground
shown_time = 8.0  # s, of what is said, in the window


class Viz:
    """scene: VIZ's own. follow: the client whose point "pose" stays in the middle of the scene, for a rover in mode drive; None: the
    middle is that of the map. is_felt: whether there are ground and hazards; not beside an arm, whose client gives what is below it.
    watched: a connected scene, in which all clients are seen; None: VIZ's own.
    """

    def __init__(self, scene: fs.Scene, ground: Ground, name: str = "viz", follow: str | None = None, is_felt: bool = True,
                 watched: fs.Scene | None = None) -> None:  # fmt: skip
        self.scene, self.ground, self.name, self.follow, self.is_felt = scene, ground, name, follow, is_felt
        self.watched = watched or scene
        self.hazards = Hazards(scene, ground, self.say, is_following=follow is not None)
        self.drawing: Drawing | None = None
        self.said: deque[tuple[float, str]] = deque(maxlen=5)  # when (s), and what
        self.events: deque[fs.Event] = deque()  # that are still to be told
        self.stopped_by = ""  # the client that has stopped the force
        self.offset = np.zeros(3)  # m: where the middle of the scene is on the map
        self.scale = map_scale if follow is None else joystick_scale
        self._ends = threading.Event()
        scene.set_frame(fs.Frame(scale=self.scale))
        if is_felt:
            # Solid: with a profile the force would jump where another triangle is the nearest, by more than a newton.
            solid = fs.Contact(keep="front", stiffness=push / self.scale, limit=most)
            scene["ground"] = fs.Mesh(*ground.mesh(), contact=solid)
        self._follower = threading.Thread(target=self._go_on_following, name="viz-follow", daemon=True)

    def begin_to_follow(self) -> None:
        if self.follow is not None:
            self._follower.start()

    def close(self) -> None:
        self._ends.set()
        if self._follower.is_alive():
            self._follower.join()

    def say(self, text: str) -> None:
        """On the terminal, and for some seconds in the window."""
        print(f"{self.name}: {text}", flush=True)
        self.said.append((time.monotonic(), text))

    def news(self) -> list[str]:
        """What was said in the last seconds."""
        return [text for then, text in list(self.said) if then > time.monotonic() - shown_time]

    def draw_in(self, picture: Picture) -> Drawing:
        """From now on hazards are drawn with the mouse."""
        self.drawing = Drawing(picture, self.draw_hazard, self.say)
        return self.drawing

    def tell_events(self) -> None:
        """Says what happens; ConnectionError when the server has gone. TimeoutError: it does not answer, so the event stays for the
        next time."""
        self.events.extend(self.scene.events(0))
        while self.events:
            self._tell_event(self.events[0])
            self.events.popleft()

    def _tell_event(self, event: fs.Event) -> None:
        if event.kind == fs.EventKind.DISCONNECTED:
            raise ConnectionError("the server has gone")
        if event.kind == fs.EventKind.REFUSED:
            self.say(f"the server does not take {event.name}: {event.text}")
        if event.kind == fs.EventKind.EDITED:
            self._tell_edit(event.name, event.text)
        if event.kind == fs.EventKind.DEVICE:
            is_ready = event.status == 0
            self.say(f"the device {event.name} is ready" if is_ready else f"no force from {event.name}: {event.text}")
        if event.kind == fs.EventKind.CLIENT and "force" in event.text:  # embedded, clients also come and go
            self.say(f"{event.name} {event.text}")
            self.stopped_by = event.name

    def what_stopped(self) -> str:
        """That the force is stopped, and by whom; "": it is not."""
        if self.scene.get_servo_stats().enabled:
            self.stopped_by = ""
            return ""
        by = f"{self.stopped_by} has stopped the force" if self.stopped_by else "the force is stopped"
        return f"{by}; `forceserver resume` lets it return"

    def _tell_edit(self, name: str, by: str) -> None:
        if name not in self.scene:
            self.say(f"{name} was removed by {by}")
            if name.startswith(prefix):
                self._take_away(name)
                self.hazards.forget(name)
        elif name.startswith(prefix):
            self.say(f"{name} was edited by {by}{self._look_of(name)}")
            self.hazards.save()
            self._show_nodes(name)
        else:
            self.say(f"{name} was edited by {by}")

    def _look_of(self, name: str) -> str:
        try:
            width, newtons = self.hazards.settings(name)
        except KeyError:
            return ""  # it has just been removed
        return f": {width:.1f} m wide, {newtons:.1f} N" if width > 0 else ""

    def _show_nodes(self, name: str) -> None:
        """The pen shows them where the hazard has them now."""
        try:
            nodes = self.hazards.nodes(name)
        except KeyError:
            return  # it has just been removed
        if len(nodes) == 0:
            self._take_away(name)
        elif self.drawing:
            self.drawing.show(name, np.array([[x, y, self.ground.height(x, y)] for x, y in nodes]))

    def _take_away(self, name: str) -> None:
        if self.drawing:
            self.drawing.take_away(name)

    def _go_on_following(self) -> None:
        said = ""
        while not self._ends.wait(period):
            try:
                self.follow_once()
                said = ""
            except ConnectionError:
                return  # the server has gone, which the events tell
            except fs.Error as failure:
                if str(failure) != said:
                    said = str(failure)
                    self.say(f"it cannot follow: {said}")

    def follow_once(self) -> bool:
        """Moves ground and hazards so that the rover stays in the middle; whether there is a rover."""
        motions = self.watched.get_motions(None)
        found = motions[motions["name"] == f"{self.follow}/pose"]
        if len(found) == 0:
            return False
        rover = found[0]
        self.offset = np.array(rover["pose"]["position"])
        twist = fs.Twist(linear=-np.array(rover["twist"]["linear"]))
        pose = fs.Pose(position=-self.offset)
        with self.scene.change():
            for name in self.scene:
                try:
                    self.scene.object_move(name, pose, twist, float(rover["time"]))
                except KeyError:
                    continue  # it has just been removed
        return True

    def draw_hazard(self, name: str | None, nodes: Array) -> str | None:
        """A border that was closed on the map, or changed; its name, or None where it cannot be one."""
        try:
            named = name or self.hazards.new_name()
            self.hazards.put(named, nodes, -self.offset)
        except (BadBorder, fs.Error) as failure:
            self.say(f"no hazard: {failure}")
            return None
        self.say(f"{named} has {len(nodes)} nodes")
        return named

    def change_newest(self, width: float | None = None, newtons: float | None = None) -> None:
        """None: that stays. What is drawn next gets it, too."""
        self.hazards.width, self.hazards.newtons = width or self.hazards.width, newtons or self.hazards.newtons
        newest = self.hazards.newest
        if newest:
            self._try(lambda: self.hazards.change(newest, width, newtons))

    def remove_newest(self) -> None:
        newest = self.hazards.newest
        if newest and self._try(lambda: self.hazards.remove(newest)):
            self._take_away(newest)
            self.say(f"{newest} is removed")

    def _try(self, does: Callable[[], None]) -> bool:
        try:
            does()
        except fs.Error as failure:
            self.say(str(failure))
            return False
        return True

    def keep_hazards_in(self, path: Path) -> None:
        """Loads the hazards of a scene file, if it is there, and saves them from now on after each change."""
        self.hazards.keep_in(path)
        count = len(self.hazards.order)
        self.say(f"{count} hazard{'' if count == 1 else 's'} loaded from {path}")
        for name in self.hazards.order:
            self._show_nodes(name)
