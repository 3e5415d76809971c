"""Hazards: closed borders on the ground, which keep the hand away. They are objects of VIZ's scene, named "hazard 1" and so on."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import forceserver as fs
import numpy as np
import shapely
from virtualrobot.ground import Array, Ground
from virtualrobot.robot import map_scale

from .picture import transform

prefix = "hazard "
# Of the newtons, at distances in sixths of the width: nothing on the border itself, where the force would turn at once, and nothing
# from the width on.
shape_of_force = np.array([0, 0.73, 1, 0.8, 0.4, 0.1, 0])
apart = 0.01  # of the map's width, between two points of a draped border


class BadBorder(ValueError):
    """What was drawn is no border."""


def drape(ground: Ground, nodes: Array) -> Array:
    """A border of nodes (x, y of each, m) as a line on the ground, with a point at each node and each 1 % of the map's width."""
    nodes = np.asarray(nodes, float)[:, :2]
    if not np.isfinite(nodes).all():
        raise BadBorder("a node is nowhere")
    nodes = nodes[(np.abs(nodes - np.roll(nodes, 1, axis=0)) > 1e-6).any(axis=1)]
    if len(nodes) < 3:
        raise BadBorder(f"a border has three nodes at least; this one has {len(nodes)}")
    if (np.abs(nodes) > ground.half).any():
        raise BadBorder("a node is off the map")
    if not shapely.LinearRing(nodes).is_simple:
        raise BadBorder("the border crosses itself")
    step = apart * 2 * float(ground.half[0])
    places = []
    for a, b in zip(nodes, np.roll(nodes, -1, axis=0), strict=True):
        count = max(1, math.ceil(float(np.linalg.norm(b - a)) / step))
        places += [a + (b - a) * k / count for k in range(count)]
    return np.array([[x, y, ground.height(x, y)] for x, y in places])


def nodes_of(line: Array) -> Array:
    """The nodes (x, y) of a draped border: between two of them it is straight, seen from above."""
    places = line[:, :2]
    a, b = places - np.roll(places, 1, axis=0), np.roll(places, -1, axis=0) - places
    turn = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return np.array(places[np.abs(turn) > 1e-9 * np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)])


def force(width: float, newtons: float) -> fs.Profile:
    """width: m on the map, up to where it pushes. newtons: at most."""
    return fs.Custom(shape_of_force, gain=newtons, step=width / (len(shape_of_force) - 1), limit=newtons, sense="repulsive")


def settings_of(profile: fs.Profile) -> tuple[float, float]:
    """The width and the newtons of a hazard; 0 where another client has given it another profile."""
    table, step = profile.curve.get_table() if profile.curve else (None, 0.0)
    if table is None:
        return 0.0, 0.0
    return float(step) * (len(table) - 1), min(profile.gain * float(np.max(table)), profile.limit)


def points_on_map(hazard: fs.Object) -> Array:
    """Its points where they are, m; none: it is no polyline."""
    if hazard.shape is None or hazard.primitive != fs.Primitive.POLYLINE:
        return np.zeros((0, 3))
    place = transform(np.asarray(hazard.pose.position), np.asarray(hazard.pose.orientation))
    return np.asarray(np.asarray(hazard.shape.get_points()) @ place[:3, :3].T + place[:3, 3])


def number_of(name: str) -> int:
    """Of a hazard; 0: its name has none."""
    word = name.removeprefix(prefix)
    return int(word) if word.isdecimal() else 0


class Hazards:
    """Those of one scene. say: is told what goes wrong with the file. is_following: the scene moves against a rover, so that the
    hazards stand still on the map."""

    def __init__(self, scene: fs.Scene, ground: Ground, say: Callable[[str], None] = print,
                 is_following: bool = False) -> None:  # fmt: skip
        self.scene, self.ground, self.say, self.is_following = scene, ground, say, is_following
        self.width, self.newtons = 3.0, 3.0  # m on the map; N at the hand: of what is drawn next
        self.order: list[str] = []  # as they were drawn or loaded
        self.path: Path | None = None  # of the scene file in which they are kept
        self.in_file: set[str] = set()  # those that were loaded from it or saved there; what else is in it belongs to others
        self.is_unsaved = False  # the file lacks a change

    def names(self) -> list[str]:
        return [name for name in self.scene if name.startswith(prefix)]

    def new_name(self) -> str:
        return f"{prefix}{max(map(number_of, self.names()), default=0) + 1}"

    @property
    def newest(self) -> str | None:
        """The one that was drawn or loaded last."""
        names = set(self.names())
        return next((name for name in reversed(self.order) if name in names), None)

    def put(self, name: str, nodes: Array, position: Array | None = None) -> None:
        """Sets a hazard to these nodes; one that is there keeps its force. position: of the middle of the map in the scene."""
        shape = fs.shape_create_polyline(drape(self.ground, nodes), True)
        place = np.zeros(3) if position is None else position
        if name in self.scene:
            self.scene[name].change(shape=shape, position=place, orientation=(1, 0, 0, 0))
        else:
            front = force(self.width, self.newtons)
            self.scene[name] = fs.Polyline(shape, position=place, front=front)
            self.order.append(name)
        self.save()

    def settings(self, name: str) -> tuple[float, float]:
        return settings_of(self.scene[name].front)

    def take_newest(self) -> tuple[str, float, float] | None:
        """The newest hazard, its width and its newtons, which the next one gets, too; None: there is none."""
        newest = self.newest
        if newest is None:
            return None
        width, newtons = self.settings(newest)
        self.width, self.newtons = width or self.width, newtons or self.newtons
        return newest, width, newtons

    def change(self, name: str, width: float | None = None, newtons: float | None = None) -> None:
        """None: that stays."""
        old_width, old_newtons = self.settings(name)
        self.scene[name].front = force(width or old_width or self.width, newtons or old_newtons or self.newtons)
        self.save()

    def nodes(self, name: str) -> Array:
        """x, y of each, m on the map; none: it is no border."""
        hazard = self.scene[name].object
        if self.is_following:
            hazard.pose = fs.Pose()
        nodes = nodes_of(points_on_map(hazard))
        return nodes if len(nodes) >= 3 else nodes[:0]

    def remove(self, name: str) -> None:
        if name in self.scene:
            self.scene[name].remove()
        self.forget(name)

    def forget(self, name: str) -> None:
        """It is no longer in the scene."""
        self.order = [one for one in self.order if one != name]
        self.save()

    def keep_in(self, path: Path) -> None:
        """Loads the hazards of a scene file, if it is there, and saves them from now on after each change. What else is in it
        stays there."""
        if path.exists():
            with fs.Scene() as file, self.scene.change():
                file.load(str(path))
                for name in sorted((one for one in file if one.startswith(prefix)), key=lambda one: (number_of(one), one)):
                    hazard = file[name].object
                    if hazard.shape is not None and hazard.primitive == fs.Primitive.POLYLINE:
                        # Where another client has moved it counts for good: while it follows, VIZ sets the pose itself.
                        hazard.shape = fs.shape_create_polyline(points_on_map(hazard), hazard.shape.get_info().closed)
                        hazard.pose = fs.Pose()
                    self.scene[name] = hazard
                    self.order.append(name)
                    self.in_file.add(name)
        self.path = path

    def save(self) -> None:
        """Where it fails all goes on, and it is tried again with the next change."""
        if self.path is None:
            return
        try:
            self._save(self.path)
        except (fs.Error, OSError) as failure:
            if not self.is_unsaved:
                self.say(f"the hazards could not be saved (the next change tries again): {failure}")
            self.is_unsaved = True
            return
        if self.is_unsaved:
            self.say("the hazards are saved again")
        self.is_unsaved = False

    def _save(self, path: Path) -> None:
        names = self.names()
        with fs.Scene() as file:
            if path.exists():
                file.load(str(path))
            for name in self.in_file - set(names):
                if name in file:
                    del file[name]
            for name in names:
                one = self.scene[name].object
                if self.is_following:
                    one.pose, one.twist = fs.Pose(), fs.Twist()
                file[name] = one
            if all(name.startswith(prefix) for name in file):  # else it is the frame of something else, too
                file.frame = fs.Frame(scale=map_scale)
            file.save(str(path.resolve()))
        self.in_file = set(names)
