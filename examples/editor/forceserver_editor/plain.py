"""Force-objects as plain data: what the page shows of them.

The names are those of the headers. A number that is not finite is null, as JSON cannot express it.
"""

from __future__ import annotations

import hashlib
import math
import re
import threading
from collections.abc import Iterable
from typing import Any

import forceserver as fs
import numpy as np

Plain = dict[str, Any]

# The fs_part bits of the fields as the page names them.
PART_FIELDS = {
    int(fs.Part.POSE): ("pose", "twist"),
    int(fs.Part.PROFILES): ("front", "back", "damping", "start"),
    int(fs.Part.CONTACT): ("contact", "surface"),
    int(fs.Part.SHAPE): ("primitive", "shape"),
    int(fs.Part.OTHER): ("lifetime", "tool_points", "enabled"),
}
# The settings of a surface as the page names them.
SURFACE_FIELDS = ("static_friction", "dynamic_friction", "slip_distance", "impact_gain", "impact_frequency", "impact_decay")
PART_OF = {field: bit for bit, fields in PART_FIELDS.items() for field in fields}
ALL_PARTS = sum(PART_FIELDS)


class Refused(Exception):
    """What the editor or the library refuses: a sentence, and the field it is about ("" if it is about none)."""

    def __init__(self, text: str, field: str = "", status: str = "INVALID") -> None:
        super().__init__(text)
        self.text, self.field, self.status = text, field, status


def number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def numbers(values: Iterable[float]) -> list[float | None]:
    return [number(float(value)) for value in values]


def curve(value: fs.Curve | None) -> Plain | None:
    if value is None:
        return None
    expression = value.get_expression()
    if expression is not None:
        return {"expression": expression}
    table, step = value.get_table()
    # A force that is not finite counts as 0, and JSON has only numbers.
    return {"table": [] if table is None else np.nan_to_num(table, nan=0, posinf=0, neginf=0).tolist(), "step": step}


def profile(value: fs.Profile) -> Plain:
    return {
        "kind": value.kind.name.lower(),
        "sense": value.sense.name.lower(),
        "gain": number(value.gain),
        "offset": number(value.offset),
        "width": number(value.width),
        "limit": number(value.limit),
        "reach": number(value.reach),
        "curve": curve(value.curve),
    }


def contact(value: fs.Contact) -> Plain:
    names = ("stiffness", "limit", "damping", "friction")
    return {"keep": value.keep.name.lower()} | {name: number(getattr(value, name)) for name in names}


def surface(value: fs.Surface | None) -> Plain:
    settings = value.get_settings() if value is not None else fs.SurfaceSettings()
    return {"impact": impact(settings)} | {name: getattr(settings, name) for name in SURFACE_FIELDS}


def impact(settings: fs.SurfaceSettings) -> str:
    """The name of the impact that a surface has, or "own" for other figures."""
    for preset in fs.Impact:
        other = settings.copy()
        fs.surface_set_impact(other, preset)
        if other == settings:
            return preset.name.lower()
    return "own"


def pose(value: fs.Pose) -> Plain:
    return {"position": value.position.tolist(), "orientation": value.orientation.tolist()}


def twist(value: fs.Twist) -> Plain:
    return {"linear": value.linear.tolist(), "angular": value.angular.tolist()}


class Shapes:
    """The shapes of the objects that the page can see, by a hash of their content: the page fetches each of them once.
    Any thread may use them."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._by_address: dict[int, tuple[fs.Shape, str]] = {}
        self._by_hash: dict[str, tuple[fs.Shape, Plain]] = {}

    def describe(self, value: fs.Object) -> Plain | None:
        """What the page is told of the shape of an object."""
        if value.shape is None:
            return None
        address = int(np.asarray(value)["shape"])
        with self._lock:
            known = self._by_address.get(address)
            if known is not None:
                return self._by_hash[known[1]][1]
        shape, name = value.shape, _hash(value.shape)
        outline = _outline(shape, name)
        with self._lock:
            self._by_address[address] = shape, name
            return self._by_hash.setdefault(name, (shape, outline))[1]

    def content(self, name: str) -> bytes | None:
        """A polyline: its points as float64. A mesh: points as float32 from its centre, then indices as uint32."""
        known = self._by_hash.get(name)
        if known is None:
            return None
        shape, outline = known
        points, triangles = shape.get_points(), shape.get_triangles()
        assert points is not None
        if outline["triangles"] == 0 or triangles is None:
            return bytes(points)
        return bytes((points - outline["centre"]).astype("<f4")) + bytes(triangles.astype("<u4"))

    def keep(self, used: set[str]) -> None:
        """Forgets the others, once they are many."""
        with self._lock:
            if len(self._by_hash) <= 2 * len(used) + 16 and len(self._by_address) <= 4 * len(used) + 64:
                return
            self._by_hash = {name: kept for name, kept in self._by_hash.items() if name in used}
            self._by_address = {a: kept for a, kept in self._by_address.items() if kept[1] in used}


def _hash(shape: fs.Shape) -> str:
    text = hashlib.sha256(b"closed" if shape.get_info().closed else b"open")
    for part in (shape.get_points(), shape.get_triangles()):
        if part is not None:
            text.update(np.ascontiguousarray(part).tobytes())
    return text.hexdigest()[:32]


def _outline(shape: fs.Shape, name: str) -> Plain:
    info, points, triangles = shape.get_info(), shape.get_points(), shape.get_triangles()
    centre = (np.asarray(info.lower) + info.upper) / 2
    return {
        "hash": name,
        "points": 0 if points is None else len(points),
        "triangles": 0 if triangles is None else len(triangles),
        "closed": bool(info.closed),
        "centre": centre.tolist(),
        "radius": float(np.linalg.norm(np.asarray(info.upper) - info.lower) / 2),
    }


def plain(value: fs.Object, shapes: Shapes) -> Plain:
    """An object without what changes as it moves: that comes with every state."""
    return {
        "primitive": value.primitive.name.lower(),
        "start": value.start,
        "lifetime": value.lifetime,
        "front": profile(value.front),
        "back": profile(value.back),
        "damping": number(value.damping),
        "contact": contact(value.contact),
        "surface": surface(value.surface),
        "shape": shapes.describe(value),
        "tool_points": value.tool_points,
        "enabled": value.enabled,
    }


def parts_of(value: fs.Object, parts: int, shapes: Shapes) -> Plain:
    """These parts alone, to find out whether two objects agree in them."""
    everything = plain(value, shapes) | {"pose": pose(value.pose), "twist": twist(value.twist)}
    return {field: everything[field] for bit, fields in PART_FIELDS.items() if parts & bit for field in fields}


def refusal(error: fs.Error, field: str = "") -> Refused:
    """What the library says, at the field that it names: "object 'a': front.gain is -1, must be .."."""
    text = str(error.args[0]) if error.args else str(error)
    text = re.sub(r"^object '.*': ", "", text)
    named = re.match(r"([a-z_.]+) is ", text)
    if not field and named:
        field = named[1]
    return Refused(text, field, type(error).__name__.removesuffix("Error").upper())
