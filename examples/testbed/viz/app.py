"""VIZ as a client: the ground and the hazards as force-objects."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

import forceserver as fs
import numpy as np
from virtualrobot.ground import Array, Ground
from virtualrobot.robot import joystick_scale, map_scale

from .hazards import BadBorder, Hazards, prefix, width_of

period = 0.04  # s, of the moves while VIZ follows a rover
push, most = 400.0, 5.0  # N/m and N at the hand: of the ground


class Viz:
    """scene: VIZ's own. follow: the client whose point "pose" stays in the middle of the scene, for a rover in mode drive; None: the
    middle is that of the map. is_felt: whether there are ground and hazards; not beside an arm, whose client gives what is below it.
    """

    def __init__(self, scene: fs.Scene, ground: Ground, name: str = "viz", follow: str | None = None, is_felt: bool = True) -> None:
        self.scene, self.ground, self.name, self.follow, self.is_felt = scene, ground, name, follow, is_felt
        self.hazards = Hazards(scene, ground)
        self.hazards.say = self.say
        self.offset = np.zeros(3)  # m: where the middle of the scene is on the map
        self.scale = map_scale if follow is None else joystick_scale
        self.removed: Callable[[str], None] = lambda name: None  # is told the hazards that other clients remove
        self.watched = scene  # where the rover is looked for
        self.hazards.is_following = follow is not None
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
        print(f"{self.name}: {text}", flush=True)

    def tell_events(self) -> None:
        """Prints what happens; ConnectionError when the server has gone."""
        for event in self.scene.events(0):
            if event.kind == fs.EventKind.DISCONNECTED:
                raise ConnectionError("the server has gone")
            if event.kind == fs.EventKind.REFUSED:
                self.say(f"the server does not take {event.name}: {event.text}")
            if event.kind == fs.EventKind.EDITED:
                self._tell_edit(event.name, event.text)
            if event.kind == fs.EventKind.DEVICE:
                is_ready = event.status == 0
                self.say(f"the device {event.name} is ready" if is_ready else f"no force from {event.name}: {event.text}")

    def _tell_edit(self, name: str, by: str) -> None:
        if name not in self.scene:
            self.say(f"{name} was removed by {by}")
            if name.startswith(prefix):
                self.removed(name)
                self.hazards.forget(name)
        elif name.startswith(prefix):
            profile = self.scene[name].front
            self.say(f"{name} was edited by {by}: {width_of(profile):.1f} m wide, {profile.limit:.1f} N")
            self.hazards.save()
        else:
            self.say(f"{name} was edited by {by}")

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

    def change_newest(self) -> None:
        """It gets the width and the force that are set for the next."""
        newest = self.hazards.newest
        if newest:
            self._try(lambda: self.hazards.change(newest, self.hazards.width, self.hazards.newtons))

    def remove_newest(self) -> None:
        newest = self.hazards.newest
        if newest and self._try(lambda: self.hazards.remove(newest)):
            self.removed(newest)

    def _try(self, does: Callable[[], None]) -> bool:
        try:
            does()
        except fs.Error as failure:
            self.say(str(failure))
            return False
        return True

    def keep_hazards_in(self, path: Path) -> None:
        """Loads the hazards of a scene file, if it is there, and saves them from now on after each change."""
        if path.exists():
            self.hazards.load(path)
        self.hazards.path = path
