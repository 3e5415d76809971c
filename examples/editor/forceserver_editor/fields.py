"""The fields that the page sends, put into force-objects. Their names are those of the headers, such as "front.gain"."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import forceserver as fs
import numpy as np

from .frames import standing, unit
from .plain import PART_OF, SURFACE_FIELDS, Refused, refusal


def make_curve(value: Any) -> fs.Curve | None:
    if value is None:
        return None
    if not isinstance(value, dict):
        raise Refused("a curve is an expression or a table", "curve")
    try:
        if "expression" in value:
            return fs.curve_create_expression(str(value["expression"]))
        return fs.curve_create_table([float(force) for force in value["table"]], float(value["step"]))
    except fs.Error as error:
        raise refusal(error, "curve") from None
    except (TypeError, ValueError, KeyError):
        raise Refused("a table has forces (N) and the step between them (m)", "curve") from None


def make_shape(value: Any) -> fs.Shape:
    try:
        points = np.array(value["points"], dtype=float).reshape(-1, 3)
        return fs.shape_create_polyline(points, bool(value.get("closed")))
    except fs.Error as error:
        raise refusal(error, "shape") from None
    except (TypeError, ValueError, KeyError, AttributeError):
        raise Refused("a polyline is a list of points", "shape") from None


def make_surface(settings: fs.SurfaceSettings, heights: Any) -> fs.Surface | None:
    """None where it would do nothing."""
    if heights is not None:
        return fs.surface_create_texture(settings, heights)
    return fs.surface_create(settings) if settings.static_friction != 0 or settings.impact_gain != 0 else None


def put_surface(target: fs.Object, name: str, value: Any) -> None:
    """One setting of the surface, or "impact" with a name of fs.Impact; the texture stays.

    The dynamic coefficient goes along with the static one, and with these the contact needs none. A gain without a frequency gets
    the frequency and decay of wood."""
    heights = target.surface.get_heights() if target.surface is not None else None
    settings = target.surface.get_settings() if target.surface is not None else fs.SurfaceSettings()
    if name == "impact":
        fs.surface_set_impact(settings, str(value))  # type: ignore[arg-type]
    elif name in SURFACE_FIELDS:
        setattr(settings, name, float(value))
    else:
        raise Refused(f"surface has no field {name}")
    if name == "static_friction":
        most = settings.static_friction
        known = settings.dynamic_friction if settings.dynamic_friction > 0 else most
        settings.dynamic_friction = min(max(known, most / 10), most)
    if name == "impact_gain" and (settings.impact_gain == 0 or settings.impact_frequency == 0):
        gain = settings.impact_gain
        fs.surface_set_impact(settings, "none" if gain == 0 else "medium")
        settings.impact_gain = gain
    try:
        target.surface = make_surface(settings, heights)
    except fs.Error as error:
        raise refusal(error, "surface") from None
    if settings.static_friction != 0:
        contact = target.contact.copy()
        contact.friction = 0
        target.contact = contact


def put(target: fs.Object, fields: Mapping[str, Any], now: float) -> int:
    """Puts fields such as "front.gain" or "pose.position" into the object. Returns the fs_part bits of what they change.

    now: on the clock of the scene. Who moves an object ends its motion, and a motion begins where the object is now.
    """
    parts = 0
    if any(path.startswith(("pose", "twist")) for path in fields):
        target.pose = standing(target, now)
        if not any(path.startswith("twist") for path in fields):
            target.twist = fs.Twist()
        target.time = 0
    for path, value in fields.items():
        first, _, rest = path.partition(".")
        if first not in PART_OF:
            raise Refused(f"{path} is no field that can be changed", path)
        parts |= PART_OF[first]
        try:
            _put_one(target, first, rest, value)
        except Refused as error:
            error.field = path
            raise
        except (TypeError, ValueError, KeyError, AttributeError, OverflowError) as error:
            raise Refused(str(error) or f"{path} is not valid", path) from None
    if "primitive" in fields:
        parts |= _fit(target)
    return parts


def _fit(target: fs.Object) -> int:
    """Takes away what the primitive cannot have, and gives a polyline the points that it needs."""
    kind = target.primitive
    has = target.shape.get_info().primitive if target.shape is not None else None
    if kind in (fs.Primitive.POINT, fs.Primitive.PLANE):
        target.shape = None
    elif kind != has:
        if kind == fs.Primitive.MESH:
            raise Refused("a mesh needs a file", "primitive")
        target.shape = fs.shape_create_polyline(np.array([[0, 0, 0], [0.05, 0, 0]], float), False)
    if kind in (fs.Primitive.PLANE, fs.Primitive.MESH):
        return int(fs.Part.SHAPE)
    target.back, target.contact, target.surface = fs.Profile(), fs.Contact(), None
    return int(fs.Part.SHAPE | fs.Part.PROFILES | fs.Part.CONTACT)


def _put_one(target: fs.Object, first: str, rest: str, value: Any) -> None:
    if first == "shape":
        target.shape = value if isinstance(value, fs.Shape) else make_shape(value)
    elif first == "surface":
        put_surface(target, rest, value)
    elif first == "primitive":
        target.primitive = fs.Primitive[str(value).upper()]
    elif first == "enabled":
        target.enabled = bool(value)
    elif first == "tool_points":
        target.tool_points = int(value)
    elif not rest:
        setattr(target, first, float(value))
    else:
        section = getattr(target, first).copy()
        if rest == "curve":
            section.curve = make_curve(value)
        elif rest in ("kind", "sense", "keep"):
            setattr(section, rest, str(value))
        elif rest.split(".")[0] in ("position", "orientation", "linear", "angular"):
            name, _, axis = rest.partition(".")
            setattr(section, name, vector(getattr(section, name), axis, value))
        elif isinstance(getattr(section, rest), float):
            setattr(section, rest, float(value))
        else:
            raise Refused(f"{first} has no field {rest}")
        setattr(target, first, section)


def vector(before: Any, axis: str, value: Any) -> list[float]:
    """A vector or quaternion of which one component has changed, or all ("")."""
    made = [float(x) for x in (before if axis else value)]
    if axis:
        made[list("wxyz"[4 - len(made) :]).index(axis)] = float(value)
    return unit(made) if len(before) == 4 else made
