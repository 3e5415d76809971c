"""Objects in other frames and at other times: where one stands by now, and what it is in another client's scene."""

from __future__ import annotations

import math
import re
from typing import Any

import forceserver as fs
import numpy as np

from .plain import Refused

HORIZON = 0.1  # s for which the twist of an object is used, at most
LONGEST = 255  # bytes of an expression


def standing(value: fs.Object, now: float) -> fs.Pose:
    """Where an object is now: its pose, moved on by its twist as the library does."""
    return fs.motion_at(fs.Motion(pose=value.pose, twist=value.twist, time=value.time, horizon=HORIZON), now)


def in_frame(value: fs.Object, theirs: fs.Frame, own: fs.Frame) -> fs.Object:
    """What feels the same in the scene of the frame `own` as `value` does in that of the frame `theirs`."""
    made = value.copy()
    made.pose = _through(value.pose, theirs, own)
    size, is_equal = own.scale / theirs.scale, own.force_scale == theirs.force_scale
    if own.force_scale == 0 and not is_equal:
        raise Refused("nothing is felt of the editor's scene: its force scale is 0")
    force = 1.0 if is_equal else theirs.force_scale / own.force_scale
    if size == 1 and force == 1:
        return made
    made.front, made.back = _profile(value.front, size, force), _profile(value.back, size, force)
    made.damping = value.damping * force / size
    solid = value.contact.copy()
    solid.stiffness, solid.limit, solid.damping = solid.stiffness * force / size, solid.limit * force, solid.damping * force / size
    made.contact = solid
    if value.surface is not None:
        made.surface = _surface(value.surface, size, force)
    if value.shape is not None and size != 1:
        points, triangles = np.asarray(value.shape.get_points()), value.shape.get_triangles()
        if triangles is None:
            made.shape = fs.shape_create_polyline(points * size, value.shape.get_info().closed)
        else:
            made.shape = fs.shape_create_mesh(points * size, triangles)
    return made


def _surface(value: fs.Surface, size: float, force: float) -> fs.Surface:
    settings, heights = value.get_settings(), value.get_heights()
    for name in ("slip_distance", "column_width", "row_width", "first_column", "first_row"):
        setattr(settings, name, getattr(settings, name) * size)
    settings.impact_gain *= force / size
    return fs.surface_create(settings) if heights is None else fs.surface_create_texture(settings, heights * size)


def _profile(value: fs.Profile, size: float, force: float) -> fs.Profile:
    """The same force of the device at the same place of the device: lengths become `size` times, forces `force` times."""
    power = {"LINEAR_INCREASING": -1, "LINEAR_DECREASING": -1, "QUADRATIC": -2, "INVERSE": 1}.get(value.kind.name, 0)
    made = value.copy()
    made.gain = value.gain * force * size**power
    made.offset, made.limit = value.offset * force, value.limit * force
    made.width, made.reach = value.width * size, value.reach * size
    if value.curve is not None and size != 1:
        made.curve = _curve(value.curve, size)
    return made


def _curve(value: fs.Curve, size: float) -> fs.Curve:
    expression = value.get_expression()
    if expression is None:
        table, step = value.get_table()
        return fs.curve_create_table(np.asarray(table), step * size)
    text = re.sub(r"\bd\b", f"(d/{size!r})", expression)
    if len(text) > LONGEST:
        raise Refused(f"the expression would have {len(text)} characters in the editor's scale, may have {LONGEST}", "curve")
    return fs.curve_create_expression(text)


def _through(pose: fs.Pose, theirs: fs.Frame, own: fs.Frame) -> fs.Pose:
    """The same place in the own scene as `pose` in another client's: from there to the device, and back."""
    if np.asarray(theirs.pose).tobytes() == np.asarray(own.pose).tobytes():
        return fs.Pose(position=pose.position * (own.scale / theirs.scale), orientation=pose.orientation)
    return fs.frame_to_scene(own, fs.frame_to_device(theirs, pose))


def unit(value: Any) -> list[float]:
    """The quaternion of unit length along this one."""
    numbers = [float(x) for x in value]
    length = math.hypot(*numbers)
    if len(numbers) != 4 or not 0 < length < math.inf:
        raise Refused("an orientation is a quaternion w, x, y, z that is not zero")
    return [x / length for x in numbers]
