"""Force-objects and their profiles, made by one call each."""

from __future__ import annotations

import copyreg
from collections.abc import Callable
from os import PathLike
from typing import TYPE_CHECKING, Any, Literal, Unpack

import numpy as np

from . import _core
from ._core import Curve, Object, Primitive, Profile, ProfileKind, Shape

__all__ = [
    "Constant",
    "Custom",
    "Gaussian",
    "Inverse",
    "LinearDecreasing",
    "LinearIncreasing",
    "Mesh",
    "Plane",
    "Point",
    "Polyline",
    "Quadratic",
    "Wall",
    "intensity",
    "law",
]

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ._core import Array, ObjectFields, Rotation

    Sense = int | Literal["attractive", "repulsive"]

    class Common(ObjectFields, total=False):
        """What every kind of object has: the fields of Object, and those of its pose."""

        position: ArrayLike  # m, in the scene
        orientation: ArrayLike | Rotation  # object to scene: (w, x, y, z), or scipy's Rotation (scipy's order: x, y, z, w)


# ------------------------------------------------------------------------------------------------------------- pickles


def remake(made_as: Any, base: Any, fields: dict[str, Any]) -> Any:
    """What pickle makes a struct with."""
    made = made_as.__new__(made_as)
    base.__init__(made, **fields)
    return made


def _reduce_shape(shape: Shape) -> tuple[Any, ...]:
    points, triangles = shape.get_points(), shape.get_triangles()
    if triangles is None:
        return _core.shape_create_polyline, (points, shape.get_info().closed)
    return _core.shape_create_mesh, (points, triangles)


def _reduce_curve(curve: Curve) -> tuple[Any, ...]:
    if (text := curve.get_expression()) is not None:
        return _core.curve_create_expression, (text,)
    table, step = curve.get_table()
    assert table is not None
    return _core.curve_create_table, (table, step)


copyreg.pickle(Shape, _reduce_shape)
copyreg.pickle(Curve, _reduce_curve)


# ------------------------------------------------------------------------------------------------------------ profiles


class Constant(Profile):
    """gain (N) at every distance."""

    __slots__ = ()

    def __init__(self, gain: float, *, limit: float, sense: Sense = "attractive", reach: float = 0) -> None:
        super().__init__(kind=ProfileKind.CONSTANT, gain=gain, limit=limit, sense=sense, reach=reach)


class _GainAndOffset(Profile):
    __slots__ = ()
    _kind: ProfileKind

    def __init__(
        self, gain: float, offset: float = 0, *, limit: float, sense: Sense = "attractive", reach: float = 0
    ) -> None:
        super().__init__(kind=self._kind, gain=gain, offset=offset, limit=limit, sense=sense, reach=reach)


class LinearIncreasing(_GainAndOffset):
    """gain*d + offset (N/m, >= 0; N)."""

    __slots__ = ()
    _kind = ProfileKind.LINEAR_INCREASING


class LinearDecreasing(_GainAndOffset):
    """gain*d + offset (N/m, <= 0; N)."""

    __slots__ = ()
    _kind = ProfileKind.LINEAR_DECREASING


class Quadratic(_GainAndOffset):
    """gain*d^2 + offset (N/m^2; N)."""

    __slots__ = ()
    _kind = ProfileKind.QUADRATIC


class Inverse(_GainAndOffset):
    """gain/d + offset (N m, >= 0; N)."""

    __slots__ = ()
    _kind = ProfileKind.INVERSE


class Gaussian(Profile):
    """gain*exp(-(d/width)^2/2) (N, >= 0; m, > 0)."""

    __slots__ = ()

    def __init__(
        self, gain: float, width: float, *, limit: float, sense: Sense = "attractive", reach: float = 0
    ) -> None:
        super().__init__(kind=ProfileKind.GAUSSIAN, gain=gain, width=width, limit=limit, sense=sense, reach=reach)


class Custom(Profile):
    """gain (a factor) times a function of one's own.

    function is one of
    - an expression in the distance d (m) and the time t (s): "3*(1+sin(12*t))*exp(-d/0.01)";
    - a table of forces (N) at the distances 0, step, 2 step ..;
    - a Curve;
    - a Python function of the distance. It is not called at the servo's rate: it is sampled now, at `samples` distances
      from 0 to `until` (m; without it `reach`), into a table, and the attribute `sampled` says how well that fits.
    """

    __slots__ = ("sampled",)
    sampled: str | None

    def __init__(
        self,
        function: str | Curve | Callable[[float], float] | ArrayLike,
        *,
        limit: float,
        gain: float = 1,
        sense: Sense = "attractive",
        reach: float = 0,
        step: float | None = None,
        until: float | None = None,
        samples: int | None = None,
    ) -> None:
        self.sampled = None
        is_table = not callable(function) and not isinstance(function, (Curve, str))
        if step is not None and not is_table:
            raise TypeError("step= is for a table only")
        if not callable(function) and (until is not None or samples is not None):
            raise TypeError("until= and samples= are for a Python function only")
        if isinstance(function, Curve):
            curve = function
        elif isinstance(function, str):
            curve = _core.curve_create_expression(function)
        elif callable(function):
            curve, self.sampled = _sample(function, reach if until is None else until, 1001 if samples is None else samples)
        else:
            if step is None:
                raise TypeError("a table needs step=, metres between its entries")
            table = np.asarray(function)
            if table.dtype.kind == "f" and not np.isfinite(table).all():
                first = int(np.argmin(np.isfinite(table).ravel()))
                raise ValueError(f"entry {first} of the table is {table.ravel()[first]}; it must be finite")
            curve = _core.curve_create_table(function, step)
        super().__init__(kind=ProfileKind.CUSTOM, gain=gain, limit=limit, sense=sense, reach=reach, curve=curve)

    def __repr__(self) -> str:
        return super().__repr__()[:-1] + (f", sampled={self.sampled!r})" if self.sampled else ")")


def _sample(function: Callable[[float], float], end: float, samples: int) -> tuple[Curve, str]:
    """A table of a Python function, and how well it fits."""
    if not end > 0:
        raise ValueError("give until=, the distance (m) up to which the function is sampled; it must be > 0")
    if samples < 2:
        raise ValueError("samples is at least 2")

    def force(d: float) -> float:
        value = function(d)
        try:
            number = float(value)
        except TypeError:
            raise TypeError(f"the function returned {value!r} at d = {d:g}; it must return a number (N)") from None
        if not np.isfinite(number):
            raise ValueError(f"the function returned {number} at d = {d:g}; it must be finite (N)")
        return number

    step = end / (samples - 1)
    curve = _core.curve_create_table(np.array([force(i * step) for i in range(samples)]), step)
    between = np.arange(samples - 1) * step + step / 2
    fitted = intensity(Profile(kind=ProfileKind.CUSTOM, gain=1, limit=1e9, curve=curve), between)
    exact = np.maximum([force(d) for d in between.tolist()], 0)
    return curve, (
        f"a table of {samples} samples, one each {step:g} m up to {end:g} m; half-way between two "
        f"it differs from the function by {np.abs(fitted - exact).max():.2g} N at most"
    )


def intensity(
    profile: Profile, distances: ArrayLike, t: float = 0, out: Array | None = None, *, max_stiffness: float = 0
) -> Array:
    """What a profile gives at distances (m, >= 0; shape (n,)) and t s after the object's start, in N.

    max_stiffness: N/m, what its slopes are limited to; 0: no limit. See fs_profile_evaluate.
    """
    return _core.profile_evaluate(profile, max_stiffness, t, distances, out)


def law(
    object: Object, distances: ArrayLike, t: float = 0, out: Array | None = None, *, max_stiffness: float = 0
) -> Array:
    """What both sides of an object give at signed distances (m, > 0 in front; shape (n,)), in N towards the front.

    t: s after the object's start; max_stiffness: N/m, what the slopes are limited to; 0: no limit. See
    fs_object_evaluate_law.
    """
    return _core.object_evaluate_law(object, max_stiffness, t, distances, out)


# ---------------------------------------------------------------------------------------------------------- primitives


def _put(made: Object, common: Common) -> None:
    """Fields of Object, and those of its pose."""
    for name in ("position", "orientation"):
        if "pose" in common and name in common:
            raise TypeError(f"either pose or {name}")
    for name, value in common.items():
        if name not in ("position", "orientation") and not hasattr(made, name):
            raise TypeError(f"{type(made).__name__} has no field {name!r}")
        setattr(made.pose if name in ("position", "orientation") else made, name, value)


class Point(Object):
    """Attracts to its position, or keeps away from it."""

    __slots__ = ()

    def __init__(self, **common: Unpack[Common]) -> None:
        super().__init__(primitive=Primitive.POINT)
        _put(self, common)


class Polyline(Object):
    """Attracts to the segments between points (m, frame of the object, shape (n, 3)), or keeps away from them."""

    __slots__ = ()

    def __init__(self, points: ArrayLike | Shape, *, closed: bool = False, **common: Unpack[Common]) -> None:
        if isinstance(points, Shape):
            if closed and not points.get_info().closed:
                raise TypeError("closed= is for points: this Shape is made already, and is open")
            shape = points
        else:
            shape = _core.shape_create_polyline(points, closed)
        super().__init__(primitive=Primitive.POLYLINE, shape=shape)
        _put(self, common)


def pose_along(position: ArrayLike, normal: ArrayLike) -> _core.Pose:
    """The pose of a plane at a position (m) with a normal."""
    numbers = np.asarray(normal)
    if numbers.shape == (3,) and numbers.dtype.kind in "fiu" and not np.any(numbers):
        raise _core.InvalidError(f"normal is ({', '.join(f'{x:g}' for x in numbers)}); it needs a length above 0")
    return _core.pose_from_z(position, normal)


class Plane(Object):
    """The plane through `position`; its front is where `normal` points (any length > 0)."""

    __slots__ = ()

    def __init__(self, *, normal: ArrayLike | None = None, **common: Unpack[Common]) -> None:
        super().__init__(primitive=Primitive.PLANE)
        _put(self, common)
        if normal is not None:
            if "orientation" in common or "pose" in common:
                raise TypeError("either normal, or orientation or pose")
            self.pose = pose_along(self.pose.position, normal)


class Mesh(Object):
    """A surface of triangles, its front where they run counter-clockwise.

    points: m, in the frame of the object, shape (n, 3), with triangles: three indices each, shape (m, 3). Or points is
    the path of a file (.obj, .ply, .stl, .off). scale: metres a unit of the points or the file. Or points is a Shape.
    """

    __slots__ = ()

    def __init__(
        self,
        points: ArrayLike | str | PathLike[str] | Shape,
        triangles: ArrayLike | None = None,
        *,
        scale: float | None = None,
        **common: Unpack[Common],
    ) -> None:
        of_points = not isinstance(points, (Shape, str, PathLike))
        if triangles is not None and not of_points:
            raise TypeError("triangles belong to points, not to a file or a Shape")
        if isinstance(points, Shape):
            if scale is not None:
                raise TypeError("scale= is for a file or points: this Shape is made already")
            shape = points
        elif isinstance(points, (str, PathLike)):
            shape = _core.shape_load(points, 1 if scale is None else scale)
        elif triangles is not None:
            shape = _core.shape_create_mesh(points if scale is None else np.asarray(points) * scale, triangles)
        else:
            raise TypeError("a mesh of points needs triangles=")
        super().__init__(primitive=Primitive.MESH, shape=shape)
        _put(self, common)


class Wall(Object):
    """A plane that is free in front, and pushes out with min(stiffness*depth, limit) what is behind it.

    point: any of it (m); normal: towards the free side; stiffness: N/m; limit: N.
    """

    __slots__ = ()

    def __init__(
        self, point: ArrayLike, normal: ArrayLike, stiffness: float, limit: float, **common: Unpack[Common]
    ) -> None:
        super().__init__(
            primitive=Primitive.PLANE,
            pose=pose_along(point, normal),
            back=LinearIncreasing(stiffness, limit=limit),
        )
        for name in ("pose", "position", "orientation"):
            if name in common:
                raise TypeError(f"a wall lies at point=, across normal=: it takes no {name}")
        _put(self, common)


def fields_of(changes: dict[str, Any]) -> int:
    """The fs_part bits of the fields that are to be changed."""
    bits = 0
    for name in changes:
        field = "pose" if name in ("position", "orientation") else name
        if field not in _core.PARTS:
            raise TypeError(f"an object has no field {name!r} that can be changed; it has {', '.join(sorted(_core.PARTS))}")
        bits |= _core.PARTS[field]
    return bits
