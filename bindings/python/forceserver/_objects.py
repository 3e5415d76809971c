"""Force-objects and their profiles, made by one call each."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from . import _core
from ._core import Curve, Object, Primitive, Profile, ProfileKind, Shape

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ._core import Array, ObjectFields, Rotation

    class Common(ObjectFields, total=False):
        """What every kind of object has: the fields of Object, and those of its pose."""

        position: ArrayLike  # m, in the scene
        orientation: ArrayLike | Rotation  # object to scene: (w, x, y, z), or scipy's Rotation (scipy's order: x, y, z, w)


# ------------------------------------------------------------------------------------------------------------ profiles


class Constant(Profile):
    """gain (N) at every distance."""

    __slots__ = ()

    def __init__(self, gain: float, *, limit: float, sense: int | str = "attractive", reach: float = 0) -> None:
        super().__init__(kind=ProfileKind.CONSTANT, gain=gain, limit=limit, sense=sense, reach=reach)


class LinearIncreasing(Profile):
    """gain*d + offset (N/m, >= 0; N)."""

    __slots__ = ()

    def __init__(
        self, gain: float, offset: float = 0, *, limit: float, sense: int | str = "attractive", reach: float = 0
    ) -> None:
        super().__init__(
            kind=ProfileKind.LINEAR_INCREASING, gain=gain, offset=offset, limit=limit, sense=sense, reach=reach
        )


class LinearDecreasing(Profile):
    """gain*d + offset (N/m, <= 0; N)."""

    __slots__ = ()

    def __init__(
        self, gain: float, offset: float = 0, *, limit: float, sense: int | str = "attractive", reach: float = 0
    ) -> None:
        super().__init__(
            kind=ProfileKind.LINEAR_DECREASING, gain=gain, offset=offset, limit=limit, sense=sense, reach=reach
        )


class Gaussian(Profile):
    """gain*exp(-(d/width)^2/2) (N, >= 0; m, > 0)."""

    __slots__ = ()

    def __init__(
        self, gain: float, width: float, *, limit: float, sense: int | str = "attractive", reach: float = 0
    ) -> None:
        super().__init__(kind=ProfileKind.GAUSSIAN, gain=gain, width=width, limit=limit, sense=sense, reach=reach)


class Quadratic(Profile):
    """gain*d^2 + offset (N/m^2; N)."""

    __slots__ = ()

    def __init__(
        self, gain: float, offset: float = 0, *, limit: float, sense: int | str = "attractive", reach: float = 0
    ) -> None:
        super().__init__(kind=ProfileKind.QUADRATIC, gain=gain, offset=offset, limit=limit, sense=sense, reach=reach)


class Inverse(Profile):
    """gain/d + offset (N m, >= 0; N)."""

    __slots__ = ()

    def __init__(
        self, gain: float, offset: float = 0, *, limit: float, sense: int | str = "attractive", reach: float = 0
    ) -> None:
        super().__init__(kind=ProfileKind.INVERSE, gain=gain, offset=offset, limit=limit, sense=sense, reach=reach)


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
        sense: int | str = "attractive",
        reach: float = 0,
        step: float | None = None,
        until: float | None = None,
        samples: int = 1001,
    ) -> None:
        self.sampled = None
        if isinstance(function, Curve):
            curve = function
        elif isinstance(function, str):
            curve = _core.curve_create_expression(function)
        elif callable(function):
            end = until or reach
            if not end > 0:
                raise ValueError("a Python function is sampled: until (m) says to which distance, or reach does")
            if samples < 2:
                raise ValueError("samples is at least 2")
            step = end / (samples - 1)
            table = np.array([function(i * step) for i in range(samples)], dtype=float)
            curve = _core.curve_create_table(table, step)
            between = np.arange(samples - 1) * step + step / 2
            fitted = intensity(Profile(kind=ProfileKind.CUSTOM, gain=1, limit=1e9, curve=curve), between)
            exact = np.maximum([function(d) for d in between], 0)
            self.sampled = (
                f"a table of {samples} samples, one each {step:g} m up to {end:g} m; half-way between two "
                f"it differs from the function by {np.abs(fitted - exact).max():.2g} N at most"
            )
        else:
            if step is None:
                raise TypeError("a table wants its step (m)")
            curve = _core.curve_create_table(function, step)
        super().__init__(kind=ProfileKind.CUSTOM, gain=gain, limit=limit, sense=sense, reach=reach, curve=curve)

    def __repr__(self) -> str:
        return super().__repr__()[:-1] + (f", sampled={self.sampled!r})" if self.sampled else ")")


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
        shape = points if isinstance(points, Shape) else _core.shape_create_polyline(points, closed)
        super().__init__(primitive=Primitive.POLYLINE, shape=shape)
        _put(self, common)


class Plane(Object):
    """The plane through `position`; its front is where `normal` points (any length > 0)."""

    __slots__ = ()

    def __init__(self, *, normal: ArrayLike | None = None, **common: Unpack[Common]) -> None:
        super().__init__(primitive=Primitive.PLANE)
        _put(self, common)
        if normal is not None:
            if "orientation" in common:
                raise TypeError("either normal or orientation")
            self.pose = _core.pose_from_z(self.pose.position, normal)


class Mesh(Object):
    """A surface of triangles, its front where they run counter-clockwise.

    points: m, in the frame of the object, shape (n, 3), with triangles: three indices each, shape (m, 3). Or points is
    the path of a file (.obj, .ply, .stl, .off), scale being metres a unit of it. Or a Shape.
    """

    __slots__ = ()

    def __init__(
        self,
        points: ArrayLike | str | PathLike[str] | Shape,
        triangles: ArrayLike | None = None,
        *,
        scale: float = 1,
        **common: Unpack[Common],
    ) -> None:
        if isinstance(points, Shape):
            shape = points
        elif isinstance(points, (str, PathLike)):
            shape = _core.shape_load(points, scale)
        elif triangles is not None:
            shape = _core.shape_create_mesh(points, triangles)
        else:
            raise TypeError("a mesh of points wants triangles")
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
            pose=_core.pose_from_z(point, normal),
            back=LinearIncreasing(stiffness, limit=limit),
        )
        _put(self, common)


def fields_of(changes: dict[str, Any]) -> int:
    """The fs_part bits of the fields that are to be changed."""
    bits = 0
    for name in changes:
        field = "pose" if name in ("position", "orientation") else name
        if field not in _core.PARTS:
            raise TypeError(f"an object has no field {name!r} that can be changed")
        bits |= _core.PARTS[field]
    return bits
