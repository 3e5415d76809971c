"""Hazards: closed borders on the ground, which keep the hand away. They are objects of VIZ's scene, named "hazard 1" and so on."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import forceserver as fs
import numpy as np
import shapely
from virtualrobot.ground import Array, Ground

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


def width_of(profile: fs.Profile) -> float:
    """m, up to where a hazard pushes."""
    table, step = profile.curve.get_table() if profile.curve else (None, 0.0)
    return float(step) * (len(table) - 1) if table is not None else 0.0


class Hazards:
    """Those of one scene."""

    def __init__(self, scene: fs.Scene, ground: Ground) -> None:
        self.scene, self.ground = scene, ground
        self.width, self.newtons = 3.0, 3.0  # m on the map; N at the hand: of what is drawn next
        self.order: list[str] = []  # as they were drawn or loaded
        self.path: Path | None = None  # of the scene file in which they are kept
        self.in_file: set[str] = set()  # those that were loaded from it or saved there; what else is in it belongs to others
        self.is_unsaved = False  # the file lacks a change
        self.say: Callable[[str], None] = lambda text: None  # is told what goes wrong with the file
        self.is_following = False  # they move against a rover, and stand still on the map

    def names(self) -> list[str]:
        return [name for name in self.scene if name.startswith(prefix)]

    def new_name(self) -> str:
        numbers = [int(number) for name in self.names() if (number := name.removeprefix(prefix)).isdecimal()]
        return f"{prefix}{max(numbers, default=0) + 1}"

    @property
    def newest(self) -> str | None:
        """The one that was drawn or loaded last."""
        names = set(self.names())
        return next((name for name in reversed(self.order) if name in names), None)

    def put(self, name: str, nodes: Array, position: Array | None = None) -> Array:
        """Sets a hazard to these nodes; one that is there keeps its force. position: where the middle of the map is in the scene. Gives the
        line on the ground."""
        line = drape(self.ground, nodes)
        shape = fs.shape_create_polyline(line, True)
        place = np.zeros(3) if position is None else position
        if name in self.scene:
            self.scene[name].change(shape=shape, position=place, orientation=(1, 0, 0, 0))
        else:
            front = force(self.width, self.newtons)
            self.scene[name] = fs.Polyline(shape, position=place, front=front)
            self.order.append(name)
        self.save()
        return line

    def change(self, name: str, width: float, newtons: float) -> None:
        self.scene[name].front = force(width, newtons)
        self.save()

    def nodes(self, name: str) -> Array:
        """x, y of each, m on the map."""
        shape = self.scene[name].shape
        return nodes_of(np.asarray(shape.get_points())) if shape else np.zeros((0, 2))

    def remove(self, name: str) -> None:
        if name in self.scene:
            self.scene[name].remove()
        self.forget(name)

    def forget(self, name: str) -> None:
        """It is no longer in the scene."""
        self.order = [one for one in self.order if one != name]
        self.save()

    def load(self, path: Path) -> None:
        """The hazards of a scene file; what else is in it stays there."""
        with fs.Scene() as file, self.scene.change():
            file.load(str(path))
            for name in sorted(one for one in file if one.startswith(prefix)):
                self.scene[name] = file[name]
                self.order.append(name)
                self.in_file.add(name)

    def save(self) -> None:
        """Where it fails all goes on, and it is tried again with the next change."""
        if self.path is None:
            return
        try:
            self._save(self.path)
        except (fs.Error, OSError) as failure:
            if not self.is_unsaved:
                self.say(f"the hazards are not saved, until the next change: {failure}")
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
            file.save(str(path.resolve()))
        self.in_file = set(names)
