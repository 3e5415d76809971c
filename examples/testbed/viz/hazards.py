"""Hazards: closed borders on the ground, which keep the hand away. They are objects of VIZ's scene, named "hazard 1" and so on."""

from __future__ import annotations

import math

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

    def names(self) -> list[str]:
        return [name for name in self.scene if name.startswith(prefix)]

    def new_name(self) -> str:
        taken = set(self.names())
        return next(name for i in range(1, 10_000) if (name := f"{prefix}{i}") not in taken)

    def put(self, name: str, nodes: Array, position: Array | None = None) -> Array:
        """Sets a hazard to these nodes; one that is there keeps its place and its force. Gives the line on the ground."""
        line = drape(self.ground, nodes)
        shape = fs.shape_create_polyline(line, True)
        if name in self.scene:
            self.scene[name].shape = shape
        else:
            front = force(self.width, self.newtons)
            place = np.zeros(3) if position is None else position
            self.scene[name] = fs.Polyline(shape, position=place, front=front)
        return line

    def change(self, name: str, width: float, newtons: float) -> None:
        self.scene[name].front = force(width, newtons)

    def remove(self, name: str) -> None:
        if name in self.scene:
            self.scene[name].remove()
