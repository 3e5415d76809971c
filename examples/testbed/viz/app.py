"""VIZ as a client: the ground and the hazards as force-objects, and the picture of what all clients give."""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import Any

import forceserver as fs
import numpy as np
from virtualrobot.ground import Array, Ground
from virtualrobot.robot import joystick_scale, map_scale

from .hazards import BadBorder, Hazards, prefix, width_of
from .picture import Picture, colours, transform

period = 0.04  # s, of the moves while VIZ follows a rover
push, most = 400.0, 5.0  # N/m and N at the hand: of the ground
parts_of_arm = ("shoulder", "elbow", "wrist", "tip")
own_colour = "#ffd92f"
shown_time = 20.0  # s, of the forces in the chart


class Viz:
    """scene: VIZ's own. watched: where all clients are seen, in most cases the same. follow: the client whose point "pose" stays in
    the middle, for a rover in mode drive; None: the whole map. arm: the client whose arm is shown, for a rover in mode arm: the hand
    is where it is for that client, and the ground is not felt, as that client gives it."""

    def __init__(
        self,
        scene: fs.Scene,
        watched: fs.Scene,
        ground: Ground,
        name: str = "viz",
        follow: str | None = None,
        arm: str | None = None,
    ) -> None:
        self.scene, self.watched, self.ground, self.name, self.follow = scene, watched, ground, name, follow
        self.arm = arm
        self.hazards = Hazards(scene, ground)
        self.middle = np.zeros(3)  # of the scene, on the map
        self.scale = map_scale if follow is None else joystick_scale
        self.others: dict[str, tuple[int, Array]] = {}  # borders of other clients: revision, points on the map
        self.trail: deque[Array] = deque(maxlen=2000)  # places of the rover on the map, 0.3 m apart
        self.history: deque[tuple[float, dict[str, float]]] = deque(maxlen=2000)  # s; N of each client
        self.rocks: set[str] = set()  # that are drawn
        self._ends = threading.Event()
        scene.set_frame(fs.Frame(scale=self.scale))
        below = fs.LinearIncreasing(push / self.scale, limit=most)
        scene["ground"] = fs.Mesh(*ground.mesh(), back=below, enabled=arm is None)
        self._follower = threading.Thread(target=self._go_on_following, name="viz-follow", daemon=True)
        if follow is not None:
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
            if event.kind == fs.EventKind.EDITED and event.name.startswith(prefix):
                if event.name in self.scene:
                    profile = self.scene[event.name].front
                    self.say(f"{event.name} was edited by {event.text}: {width_of(profile):.1f} m wide, {profile.limit:.1f} N")
                else:
                    self.say(f"{event.name} was removed by {event.text}")
            if event.kind == fs.EventKind.DEVICE:
                is_ready = event.status == 0
                self.say(f"the device {event.name} is ready" if is_ready else f"no force from {event.name}: {event.text}")

    # -------------------------------------------------------------------------------------------------------- following

    def _go_on_following(self) -> None:
        while not self._ends.wait(period):
            try:
                self.follow_once()
            except (fs.Error, ConnectionError):
                return  # the server has gone, which the events tell

    def follow_once(self) -> bool:
        """Moves ground and hazards so that the rover stays in the middle; whether there is a rover."""
        motions = self.watched.get_motions(None)
        found = motions[motions["name"] == f"{self.follow}/pose"]
        if len(found) == 0:
            return False
        rover = found[0]
        self.middle = np.array(rover["pose"]["position"])
        twist = fs.Twist(linear=-np.array(rover["twist"]["linear"]))
        pose = fs.Pose(position=-self.middle)
        with self.scene.change():
            for name in ("ground", *self.hazards.names()):
                self.scene.object_move(name, pose, twist, float(rover["time"]))
        return True

    def draw_hazard(self, name: str | None, nodes: Array) -> str | None:
        """A border that was closed on the map, or changed; its name, or None where it cannot be one."""
        try:
            named = name or self.hazards.new_name()
            self.hazards.put(named, nodes, -self.middle if self.follow else None)
        except BadBorder as failure:
            self.say(f"no hazard: {failure}")
            return None
        self.say(f"{named} has {len(nodes)} nodes")
        return named

    # ---------------------------------------------------------------------------------------------------------- picture

    def show(self, picture: Picture) -> None:
        """Brings the picture up to date."""
        hand = self.scene.hand()
        is_there = bool(hand.state.flags & fs.StateFlags.READY)
        motions = self.watched.get_motions(None)
        places = {str(motion["name"]): motion["pose"] for motion in motions}
        place = self._hand_on_map(np.asarray(hand.state.pose.position), places) if is_there else None
        picture.show_hand(place)
        rover = next((name for name in places if name.endswith("/pose")), None)
        if rover is not None:
            at = np.array(places[rover]["position"])
            picture.show_rover((at, np.array(places[rover]["orientation"])))
            if self.follow or self.arm:
                picture.look_at(at)
            if not self.trail or np.linalg.norm(at - self.trail[-1]) > 0.3:
                self.trail.append(at)
                picture.show_trail(np.array(self.trail))
        else:
            picture.show_rover(None)
        arm = [places[name]["position"] for part in parts_of_arm if rover and (name := f"{rover[:-5]}/{part}") in places]
        picture.show_arm(np.array(arm))
        self._show_rocks(picture, places)
        self._show_forces(picture, place, hand)
        self._show_borders(picture, motions)

    def _hand_on_map(self, hand: Array, places: dict[str, Any]) -> Array:
        """Where the hand is for the client whose arm is shown, or for VIZ."""
        of_arm = self._arm_on_map(places)
        if self.arm is None or of_arm is None:
            return hand + self.middle
        try:
            frame = self.watched.get_view(self.arm).frame
        except fs.Error:
            return hand + self.middle  # the rover has just gone
        turn = transform(np.zeros(3), np.asarray(frame.pose.orientation))[:3, :3]
        at_arm = frame.scale * ((hand / self.scale - np.asarray(frame.pose.position)) @ turn)
        return of_arm[:3, 3] + of_arm[:3, :3] @ at_arm

    def _arm_on_map(self, places: dict[str, Any]) -> Array | None:
        """From the arm's axes to the map; None: there is no arm."""
        rover, shoulder = places.get(f"{self.arm}/pose"), places.get(f"{self.arm}/shoulder")
        if rover is None or shoulder is None:
            return None
        return transform(np.array(shoulder["position"]), np.array(rover["orientation"]))

    def _show_rocks(self, picture: Picture, places: dict[str, Any]) -> None:
        """Those that the client of the arm gives; they lie still on the map."""
        of_arm = self._arm_on_map(places)
        if of_arm is None:
            return
        for name in places:
            if not name.startswith(f"{self.arm}/rock") or name in self.rocks:
                continue
            try:
                shape = self.watched.object_get(name).shape
            except fs.Error:
                continue
            triangles = shape.get_triangles() if shape else None
            if shape is None or triangles is None:
                continue
            pose = places[name]
            at_arm = transform(np.array(pose["position"]), np.array(pose["orientation"]))
            whole = of_arm @ at_arm
            picture.show_rock(name, np.asarray(shape.get_points()) @ whole[:3, :3].T + whole[:3, 3], np.asarray(triangles))
            self.rocks.add(name)

    def _show_forces(self, picture: Picture, place: Array | None, hand: fs.Hand) -> None:
        if self.watched is self.scene and self.scene._client is None:
            forces = {self.name: np.asarray(hand.response.wrench.force)}
        else:
            forces = {str(client["name"]): np.array(client["wrench"]["force"]) for client in self.watched.get_clients()}
        picture.show_forces(place, forces)
        now = time.monotonic()
        self.history.append((now, {name: float(np.linalg.norm(force)) for name, force in forces.items()}))
        while self.history[0][0] < now - shown_time:
            self.history.popleft()
        times = np.array([then - now for then, _ in self.history])
        names = {name for _, newtons in self.history for name, value in newtons.items() if value > 0.02}
        sizes = {name: np.array([newtons.get(name, 0.0) for _, newtons in self.history]) for name in sorted(names)}
        picture.show_history(times, sizes)
        felt = [f"{name} {np.linalg.norm(force):.1f} N" for name, force in forces.items() if np.linalg.norm(force) > 0.02]
        sent = np.linalg.norm(np.asarray(hand.sent.force))
        picture.show_words(f"the hand gets {sent:.1f} N: {', '.join(felt) or 'none'}" if place is not None else "no hand")

    def _show_borders(self, picture: Picture, motions: Any) -> None:
        seen = set()
        for motion in motions[motions["primitive"] == fs.Primitive.POLYLINE]:
            name, revision = str(motion["name"]), int(motion["revision"])
            seen.add(name)
            if self.others.get(name, (None,))[0] == revision:
                continue
            is_own = "/" not in name or name.startswith(f"{self.name}/")
            points = self._on_map(name)
            if points is None:
                continue
            self.others[name] = (revision, points)
            picture.show_line(name, points, own_colour if is_own else colours[len(seen) % len(colours)])
        for name in self.others.keys() - seen:
            del self.others[name]
            picture.show_line(name, None, "")

    def _on_map(self, name: str) -> Array | None:
        """The points of a border of any client."""
        try:
            its = self.watched.object_get(name)
            owner = name.split("/")[0] if "/" in name else None
            frame = self.watched.get_view(owner).frame if owner else self.scene.frame
        except fs.Error:
            return None  # it has just gone
        assert its.shape is not None
        points = np.asarray(its.shape.get_points()) + (0 if self.follow else np.asarray(its.pose.position))
        return points * (self.scale / frame.scale) if frame.scale != self.scale else points


def wait_for_frame(begin: float) -> None:
    """The rest of a frame of the picture."""
    time.sleep(max(0.0, begin + period - time.monotonic()))
