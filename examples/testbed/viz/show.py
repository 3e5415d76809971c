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
from .hazards import settings_of
from .picture import Picture, transform

parts_of_arm = ("shoulder", "elbow", "wrist", "tip")
own_colour = "#ffd92f"
shown_time = 20.0  # s, of the forces in the chart
deep = 0.1  # m: from here on the hand is below the ground
small = 0.05  # N: what is not worth a word


def place_of(pose: Any) -> Array:
    """The transform of a pose of a motion."""
    return transform(np.array(pose["position"]), np.array(pose["orientation"]))


class Show:
    """arm_client: the client whose arm is shown; the hand is then where it is for that client."""

    def __init__(self, viz: Viz, picture: Picture, arm_client: str | None = None) -> None:
        self.viz, self.picture, self.arm_client = viz, picture, arm_client
        self.own = viz.name if viz.watched is viz.scene else "server"  # the client that is VIZ
        self.borders: dict[str, int] = {}  # the revisions of those that are drawn
        self.reaches: dict[str, tuple[int, bytes]] = {}  # revision and place of those whose reach is drawn
        self.rocks: set[str] = set()  # that are drawn
        self.trail: deque[Array] = deque(maxlen=2000)  # places of the rover on the map, 0.3 m apart
        self.history: deque[tuple[float, dict[str, float]]] = deque()  # s; N of each client
        self.is_waiting = False  # for the client that is followed, or whose arm is shown

    def update(self) -> None:
        hand = self.viz.scene.hand()
        motions = self.viz.watched.get_motions(None)
        poses = {str(motion["name"]): motion["pose"] for motion in motions}
        self._show_rover(poses)
        arm_to_map = self._arm_to_map(poses)
        self._wait(poses, arm_to_map)
        device_to_map = self._device_to_map(arm_to_map)
        place = None
        if device_to_map is not None and hand.state.flags & fs.StateFlags.READY:
            place = self._on_map(device_to_map, np.asarray(hand.state.pose.position))
        self.picture.show_hand(place)
        self._show_rocks(poses, arm_to_map)
        sizes = self._show_forces(place, hand, device_to_map)
        self._show_borders(motions, device_to_map)
        self._show_words(hand, place, sizes)

    def _show_rover(self, poses: dict[str, Any]) -> None:
        wanted = self.viz.follow or self.arm_client
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

    def _wait(self, poses: dict[str, Any], arm_to_map: Array | None) -> None:
        was_waiting = self.is_waiting
        if self.arm_client is not None:
            self.is_waiting = arm_to_map is None
        elif self.viz.follow is not None:
            self.is_waiting = f"{self.viz.follow}/pose" not in poses
        if self.is_waiting and not was_waiting:
            self.viz.say(self._waits_for())

    def _waits_for(self) -> str:
        if self.arm_client is not None:
            return f"waits for the client '{self.arm_client}' and its arm"
        return f"waits for the client '{self.viz.follow}' and its rover"

    def _arm_to_map(self, poses: dict[str, Any]) -> Array | None:
        """From the scene of the arm to the map; None: there is no arm."""
        rover, shoulder = poses.get(f"{self.arm_client}/pose"), poses.get(f"{self.arm_client}/shoulder")
        if rover is None or shoulder is None:
            return None
        return transform(np.array(shoulder["position"]), np.array(rover["orientation"]))

    def _device_to_map(self, arm_to_map: Array | None) -> Array | None:
        """None: that is known when there is an arm."""
        if self.arm_client is None:
            frame, scene_to_map = self._frame_of(None), transform(self.viz.offset, np.array([1.0, 0, 0, 0]))
        elif arm_to_map is not None:
            frame, scene_to_map = self._frame_of(self.arm_client), arm_to_map
        else:
            return None
        return None if frame is None else np.asarray(scene_to_map @ np.linalg.inv(frame))

    def _on_map(self, device_to_map: Array, place: Array) -> Array | None:
        """place: in VIZ's scene."""
        frame = self._frame_of(None)
        return None if frame is None else np.asarray((device_to_map @ frame @ [*place, 1])[:3])

    def _frame_of(self, client: str | None) -> Array | None:
        """From a client's scene to the device; None: it has just gone. client: None: VIZ."""
        try:
            frame = self.viz.scene.frame if client is None else self.viz.watched.get_view(client).frame
        except TimeoutError:
            raise
        except fs.Error:
            return None
        out = transform(np.asarray(frame.pose.position), np.asarray(frame.pose.orientation))
        out[:3, :3] /= frame.scale
        return out

    def _show_rocks(self, poses: dict[str, Any], arm_to_map: Array | None) -> None:
        """Those that the client of the arm gives; they lie still on the map."""
        names = {name for name in poses if name.startswith(f"{self.arm_client}/rock")}
        for name in self.rocks - names:
            self.picture.remove(name)
        self.rocks &= names
        if arm_to_map is None:
            return
        for name in names - self.rocks:
            shape = self._shape_of(name)
            triangles = shape.get_triangles() if shape else None
            if shape is None or triangles is None:
                continue
            whole = arm_to_map @ place_of(poses[name])
            self.picture.show_rock(name, np.asarray(shape.get_points()) @ whole[:3, :3].T + whole[:3, 3], np.asarray(triangles))
            self.rocks.add(name)

    def _shape_of(self, name: str) -> fs.Shape | None:
        try:
            return self.viz.watched.object_get(name).shape
        except TimeoutError:
            raise
        except fs.Error:
            return None  # it has just gone

    def _show_forces(self, place: Array | None, hand: fs.Hand, device_to_map: Array | None) -> dict[str, float]:
        """N of each client."""
        try:
            forces = {str(client["name"]): np.array(client["wrench"]["force"]) for client in self.viz.watched.get_clients()}
        except fs.UnsupportedError:  # the scene is in this process, and nobody else is let in
            forces = {self.viz.name: np.asarray(hand.response.wrench.force)}
        turn = np.eye(3) if device_to_map is None else device_to_map[:3, :3] / np.linalg.norm(device_to_map[:3, 0])
        self.picture.show_forces(place, {name: turn @ force for name, force in forces.items()})
        sizes = {name: float(np.linalg.norm(force)) for name, force in forces.items()}
        now = time.monotonic()
        self.history.append((now, sizes))
        while self.history[0][0] < now - shown_time:
            self.history.popleft()
        felt = sorted({name for _, newtons in self.history for name, value in newtons.items() if value > 0.02})
        times = np.array([then - now for then, _ in self.history])
        self.picture.show_history(times, {name: np.array([newtons.get(name, 0.0) for _, newtons in self.history]) for name in felt})
        return sizes

    def _show_words(self, hand: fs.Hand, place: Array | None, sizes: dict[str, float]) -> None:
        sent = float(np.linalg.norm(np.asarray(hand.sent.force)))
        parts = ", ".join(f"{name} {size:.1f} N" for name, size in sizes.items() if size >= small)
        why = self.viz.what_stopped() or parts or ("the servo's damping" if sent >= small else "")
        is_ready = hand.state.flags & fs.StateFlags.READY
        lines = [(f"the hand gets {sent:.1f} N" if is_ready else "no hand") + (f": {why}" if why else "")]
        if self.is_waiting:
            lines.append(self._waits_for())
        ground = self.viz.ground
        if place is not None and (np.abs(place[:2]) <= ground.half).all() and place[2] < ground.height(place[0], place[1]) - deep:
            lines.append("the hand is below the ground")
        lines += [text for text in self.viz.news() if text not in lines]
        self.picture.show_words("\n".join(lines))

    def _show_borders(self, motions: Any, device_to_map: Array | None) -> None:
        seen = set()
        frames: dict[str | None, Array | None] = {}
        for motion in motions[motions["primitive"] == fs.Primitive.POLYLINE]:
            name = str(motion["name"])
            client = name.split("/")[0] if "/" in name else None
            is_own = client is None or client == self.own
            revision = int(motion["revision"])
            place = np.eye(4)
            if not is_own or self.viz.follow is None:  # VIZ's own stay where they are on the map while it follows a rover
                owner = None if is_own else client
                if owner not in frames:
                    frames[owner] = self._frame_of(owner)
                frame = frames[owner]
                if frame is None or device_to_map is None:
                    continue
                place = device_to_map @ frame @ place_of(motion["pose"])
            if self.borders.get(name) != revision:
                shape = self._shape_of(name)
                if shape is None:
                    continue
                self.picture.show_line(name, line_of(shape), own_colour if is_own else self.picture.colour_of(client or ""))
                self.borders[name] = revision
            self.picture.place_line(name, place)
            if is_own and self.reaches.get(name) != (revision, place.tobytes()):
                self.picture.show_reach(name, self._reach_of(name, place))
                self.reaches[name] = revision, place.tobytes()
            seen.add(name)
        for name in self.borders.keys() - seen:
            del self.borders[name]
            self.reaches.pop(name, None)
            self.picture.remove_line(name)
            self.picture.show_reach(name, [])

    def _reach_of(self, name: str, place: Array) -> list[Array]:
        """How far one of VIZ's own borders pushes, to both sides: closed lines on the ground. place: from it to the map."""
        try:
            its = self.viz.watched.object_get(name)
        except TimeoutError:
            raise
        except fs.Error:
            return []  # it has just gone
        width, _ = settings_of(its.front)
        if width <= 0 or its.shape is None:
            return []
        line = line_of(its.shape) @ place[:3, :3].T + place[:3, 3]
        area = shapely.LineString(line[:, :2]).buffer(width).segmentize(0.6)
        half, ground = self.viz.ground.half, self.viz.ground
        rings = [np.clip(shapely.get_coordinates(ring), -half, half) for ring in (area.exterior, *area.interiors)]
        return [np.array([[x, y, ground.height(x, y)] for x, y in ring]) for ring in rings]


def line_of(shape: fs.Shape) -> Array:
    """Its points; of a closed one the first again at its end."""
    points = np.asarray(shape.get_points())
    return np.concatenate([points, points[:1]]) if shape.get_info().closed else points
