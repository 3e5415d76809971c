"""Brings the picture up to date: the rover, the hand, the forces and the borders of all clients."""

from __future__ import annotations

import time
from collections import deque
from typing import Any

import forceserver as fs
import numpy as np
import shapely
from virtualrobot.ground import Array

from .app import Viz
from .hazards import width_of
from .picture import Picture, transform

parts_of_arm = ("shoulder", "elbow", "wrist", "tip")
own_colour = "#ffd92f"
shown_time = 20.0  # s, of the forces in the chart


def place_of(pose: Any) -> Array:
    """The transform of a pose of a motion."""
    return transform(np.array(pose["position"]), np.array(pose["orientation"]))


class Show:
    """watched: a connected scene, where all clients are seen; None: there is none, as the library is embedded and nobody is let in. arm:
    the client whose arm is shown; the hand is then where it is for that client."""

    def __init__(self, viz: Viz, picture: Picture, watched: fs.Scene | None, arm: str | None = None) -> None:
        self.viz, self.picture, self.watched, self.arm = viz, picture, watched, arm
        self.seen = watched or viz.scene
        self.own = "server" if watched is not None and watched is not viz.scene else viz.name  # the client that is VIZ
        self.borders: dict[str, tuple[int, ...]] = {}  # the revisions of those that are drawn
        self.rocks: set[str] = set()  # that are drawn
        self.trail: deque[Array] = deque(maxlen=2000)  # places of the rover on the map, 0.3 m apart
        self.history: deque[tuple[float, dict[str, float]]] = deque()  # s; N of each client

    def update(self) -> None:
        hand = self.viz.scene.hand()
        motions = self.seen.get_motions(None)
        poses = {str(motion["name"]): motion["pose"] for motion in motions}
        self._show_rover(poses)
        arm = self._arm_on_map(poses)
        is_there = bool(hand.state.flags & fs.StateFlags.READY)
        place = self._hand_on_map(np.asarray(hand.state.pose.position), arm) if is_there else None
        self.picture.show_hand(place)
        self._show_rocks(poses, arm)
        self._show_forces(place, hand, np.eye(3) if arm is None else arm[:3, :3])
        self._show_borders(motions)

    def _show_rover(self, poses: dict[str, Any]) -> None:
        wanted = self.viz.follow or self.arm
        names = [f"{wanted}/pose"] if wanted else [name for name in poses if name.endswith("/pose")]
        name = next((name for name in names if name in poses), None)
        self.picture.show_rover(None if name is None else place_of(poses[name]))
        client = name.split("/")[0] if name else ""
        self.picture.show_arm(np.array([poses[one]["position"] for part in parts_of_arm if (one := f"{client}/{part}") in poses]))
        if name is None:
            return
        at = np.array(poses[name]["position"])
        if wanted:
            self.picture.look_at(at)
        way = float(np.linalg.norm(at - self.trail[-1])) if self.trail else 1.0
        if way > 2.0:
            self.trail.clear()  # it was put back, or is another one
        if way > 0.3:
            self.trail.append(at)
            self.picture.show_trail(np.array(self.trail))

    def _arm_on_map(self, poses: dict[str, Any]) -> Array | None:
        """From the axes of the arm's scene to the map; None: there is no arm."""
        rover, shoulder = poses.get(f"{self.arm}/pose"), poses.get(f"{self.arm}/shoulder")
        if rover is None or shoulder is None:
            return None
        return transform(np.array(shoulder["position"]), np.array(rover["orientation"]))

    def _hand_on_map(self, hand: Array, arm: Array | None) -> Array:
        """hand: in VIZ's scene."""
        frame = self._frame_of(self.arm) if arm is not None else None
        if arm is None or frame is None:
            return hand + self.viz.offset
        at_arm = np.linalg.inv(frame) @ [*(hand / self.viz.scale), 1]
        return np.asarray((arm @ at_arm)[:3])

    def _frame_of(self, client: str | None) -> Array | None:
        """From a client's scene to the device; None: it has just gone. client: None: VIZ."""
        try:
            frame = self.viz.scene.frame if client is None else self.seen.get_view(client).frame
        except fs.Error:
            return None
        out = transform(np.asarray(frame.pose.position), np.asarray(frame.pose.orientation))
        out[:3, :3] /= frame.scale
        return out

    def _show_rocks(self, poses: dict[str, Any], arm: Array | None) -> None:
        """Those that the client of the arm gives; they lie still on the map."""
        names = {name for name in poses if name.startswith(f"{self.arm}/rock")}
        for name in self.rocks - names:
            self.picture.remove(name)
        self.rocks &= names
        if arm is None:
            return
        for name in names - self.rocks:
            shape = self._shape_of(name)
            triangles = shape.get_triangles() if shape else None
            if shape is None or triangles is None:
                continue
            whole = arm @ place_of(poses[name])
            self.picture.show_rock(name, np.asarray(shape.get_points()) @ whole[:3, :3].T + whole[:3, 3], np.asarray(triangles))
            self.rocks.add(name)

    def _shape_of(self, name: str) -> fs.Shape | None:
        try:
            return self.seen.object_get(name).shape
        except fs.Error:
            return None  # it has just gone

    def _show_forces(self, place: Array | None, hand: fs.Hand, turn: Array) -> None:
        """turn: from the axes of the device to those of the map."""
        if self.watched is None:
            forces = {self.viz.name: np.asarray(hand.response.wrench.force)}
        else:
            forces = {str(client["name"]): np.array(client["wrench"]["force"]) for client in self.watched.get_clients()}
        self.picture.show_forces(place, {name: turn @ force for name, force in forces.items()})
        sizes = {name: float(np.linalg.norm(force)) for name, force in forces.items()}
        now = time.monotonic()
        self.history.append((now, sizes))
        while self.history[0][0] < now - shown_time:
            self.history.popleft()
        felt = sorted({name for _, newtons in self.history for name, value in newtons.items() if value > 0.02})
        times = np.array([then - now for then, _ in self.history])
        self.picture.show_history(times, {name: np.array([newtons.get(name, 0.0) for _, newtons in self.history]) for name in felt})
        sent = np.linalg.norm(np.asarray(hand.sent.force))
        parts = ", ".join(f"{name} {size:.1f} N" for name, size in sizes.items() if size > 0.02)
        self.picture.show_words(f"the hand gets {sent:.1f} N: {parts or 'none'}" if place is not None else "no hand")

    def _show_borders(self, motions: Any) -> None:
        seen = set()
        for motion in motions[motions["primitive"] == fs.Primitive.POLYLINE]:
            name = str(motion["name"])
            client = name.split("/")[0] if "/" in name else None
            is_own = client is None or client == self.own
            seen.add(name)
            # VIZ's own stay where they are on the map while it follows a rover.
            stays = is_own and self.viz.follow is not None
            revision = (int(motion["revision"]),) if stays else (int(motion["revision"]), int(motion["motion_revision"]))
            if self.borders.get(name) == revision:
                continue
            shape, frame = self._shape_of(name), self._frame_of(client)
            if shape is None or frame is None:
                continue
            points = np.asarray(shape.get_points())
            if not stays:
                whole = frame @ place_of(motion["pose"])
                points = self.viz.scale * (points @ whole[:3, :3].T + whole[:3, 3]) + self.viz.offset
            self.borders[name] = revision
            self.picture.show_line(name, points, own_colour if is_own else self.picture.colour_of(client or ""))
            if is_own:
                self.picture.show_reach(name, self._reach_of(name, points))
        for name in self.borders.keys() - seen:
            del self.borders[name]
            self.picture.show_line(name, None, "")
            self.picture.show_reach(name, [])

    def _reach_of(self, name: str, border: Array) -> list[Array]:
        """How far one of VIZ's own borders pushes, to both sides: closed lines on the ground. border: m on the map."""
        try:
            width = width_of(self.seen.object_get(name).front)
        except fs.Error:
            return []  # it has just gone
        if width <= 0:
            return []
        area = shapely.LinearRing(border[:, :2]).buffer(width).segmentize(0.6)
        half, ground = self.viz.ground.half, self.viz.ground
        rings = [np.clip(shapely.get_coordinates(ring), -half, half) for ring in (area.exterior, *area.interiors)]
        return [np.array([[x, y, ground.height(x, y)] for x, y in ring]) for ring in rings]
