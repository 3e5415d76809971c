"""Force-objects and their profiles, made by one call each."""

from __future__ import annotations

import copyreg
from collections.abc import Callable
from numbers import Real
from os import PathLike
from typing import TYPE_CHECKING, Any, Literal, Protocol, Unpack

import numpy as np

from . import _core
from ._core import Axis, Curve, Object, Primitive, Profile, ProfileKind, Shape, Surface, SurfaceSettings

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
    "surface",
]

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ._core import Array, ObjectFields, Rotation

    Sense = int | Literal["attractive", "repulsive"]
    _ImpactName = Literal["none", "soft", "medium", "hard"]

    class _HasVertices(Protocol):  # trimesh.Trimesh
        @property
        def vertices(self) -> Any: ...
        @property
        def faces(self) -> Any: ...

    class _HasPoints(Protocol):  # pyvista.PolyData, meshio.Mesh
        @property
        def points(self) -> Any: ...

    SurfaceMesh = _HasVertices | _HasPoints

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


def _reduce_surface(surface: Surface) -> tuple[Any, ...]:
    if (heights := surface.get_heights()) is not None:
        return _core.surface_create_texture, (surface.get_settings(), heights)
    return _core.surface_create, (surface.get_settings(),)


copyreg.pickle(Shape, _reduce_shape)
copyreg.pickle(Curve, _reduce_curve)
copyreg.pickle(Surface, _reduce_surface)


# ------------------------------------------------------------------------------------------------------------ profiles


class Constant(Profile):
    """gain (N) at every distance.

    sense: "attractive", the default, draws the hand to the object; "repulsive" drives it away, which a hazard needs.
    """

    __slots__ = ()

    def __init__(self, gain: float, *, limit: float, sense: Sense = "attractive", reach: float = 0) -> None:
        super().__init__(kind=ProfileKind.CONSTANT, gain=gain, limit=limit, sense=sense, reach=reach)


class LinearIncreasing(Profile):
    """gain*d + offset (N/m, >= 0; N).

    sense: "attractive", the default, draws the hand to the object; "repulsive" drives it away, which a hazard needs.
    """

    __slots__ = ()

    def __init__(
        self, gain: float, offset: float = 0, *, limit: float, sense: Sense = "attractive", reach: float = 0
    ) -> None:
        super().__init__(
            kind=ProfileKind.LINEAR_INCREASING, gain=gain, offset=offset, limit=limit, sense=sense, reach=reach
        )


class LinearDecreasing(Profile):
    """gain*d + offset (N/m, <= 0; N).

    sense: "attractive", the default, draws the hand to the object; "repulsive" drives it away, which a hazard needs.
    """

    __slots__ = ()

    def __init__(
        self, gain: float, offset: float = 0, *, limit: float, sense: Sense = "attractive", reach: float = 0
    ) -> None:
        super().__init__(
            kind=ProfileKind.LINEAR_DECREASING, gain=gain, offset=offset, limit=limit, sense=sense, reach=reach
        )


class Quadratic(Profile):
    """gain*d^2 + offset (N/m^2; N).

    sense: "attractive", the default, draws the hand to the object; "repulsive" drives it away, which a hazard needs.
    """

    __slots__ = ()

    def __init__(
        self, gain: float, offset: float = 0, *, limit: float, sense: Sense = "attractive", reach: float = 0
    ) -> None:
        super().__init__(
            kind=ProfileKind.QUADRATIC, gain=gain, offset=offset, limit=limit, sense=sense, reach=reach
        )


class Inverse(Profile):
    """gain/d + offset (N m, >= 0; N).

    sense: "attractive", the default, draws the hand to the object; "repulsive" drives it away, which a hazard needs.
    """

    __slots__ = ()

    def __init__(
        self, gain: float, offset: float = 0, *, limit: float, sense: Sense = "attractive", reach: float = 0
    ) -> None:
        super().__init__(
            kind=ProfileKind.INVERSE, gain=gain, offset=offset, limit=limit, sense=sense, reach=reach
        )


class Gaussian(Profile):
    """gain*exp(-(d/width)^2/2) (N, >= 0; m, > 0).

    sense: "attractive", the default, draws the hand to the object; "repulsive" drives it away, which a hazard needs.
    """

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

    sense: "attractive", the default, draws the hand to the object; "repulsive" drives it away, which a hazard needs.
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
            if table.ndim != 1:
                raise TypeError(f"a table is forces of shape (n,), not of shape {table.shape}")
            curve = _core.curve_create_table(table, step)
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


def the_time(time: float, t: float | None) -> float:
    """`t` is the older name of the argument `time`."""
    if t is None:
        return time
    if time != 0:
        raise TypeError("either time or t, which is its older name")
    return t


def intensity(
    profile: Profile,
    distances: ArrayLike,
    time: float = 0,
    out: Array | None = None,
    *,
    max_stiffness: float = 0,
    t: float | None = None,
) -> Array:
    """What a profile gives at distances (m, >= 0; an array of any shape), in N.

    time: s after the object's start. max_stiffness: N/m, what its slopes are limited to; 0: no limit. See
    fs_profile_evaluate. t: the older name of `time`.
    """
    return _core.profile_evaluate(profile, max_stiffness, the_time(time, t), distances, out)


def law(
    object: Object,
    distances: ArrayLike,
    time: float = 0,
    out: Array | None = None,
    *,
    max_stiffness: float = 0,
    t: float | None = None,
) -> Array:
    """What both sides of an object give at signed distances (m, > 0 in front; an array of any shape), in N towards the
    front.

    time: s after the object's start. max_stiffness: N/m, what the slopes are limited to; 0: no limit. See
    fs_object_evaluate_law. t: the older name of `time`.
    """
    return _core.object_evaluate_law(object, max_stiffness, the_time(time, t), distances, out)


# ------------------------------------------------------------------------------------------------------------ surfaces


def _put_impact(settings: SurfaceSettings, impact: int | _ImpactName | tuple[float, float, float]) -> None:
    if isinstance(impact, (int, str)):
        _core.surface_set_impact(settings, impact)
        return
    try:
        gain, frequency, decay = impact
    except (TypeError, ValueError):
        raise TypeError(f"impact is {impact!r}, must be a name such as 'soft', or (gain, frequency, decay)") from None
    settings.impact_gain, settings.impact_frequency, settings.impact_decay = gain, frequency, decay


def surface(
    *,
    static_friction: float = 0,
    dynamic_friction: float | None = None,
    slip_distance: float = 0,
    impact: int | _ImpactName | tuple[float, float, float] = "none",
    heights: ArrayLike | str | None = None,
    count: tuple[int, int] | None = None,
    width: float | tuple[float, float] | None = None,
    first: tuple[float, float] | None = None,
    axis: Axis | Literal["x", "y", "z"] | None = None,
    repeats: bool | None = None,
) -> Surface:
    """What the surface of a solid object does: `surface=` of a Plane or Mesh.

    static_friction, dynamic_friction: the Coulomb coefficient while it sticks and while it slips, 0..2; without the second both
    are equal. slip_distance: m, over which the one becomes the other.

    impact: what a tool point feels when it hits the surface: "soft" as rubber, "medium" as wood, "hard" as metal, or (gain,
    frequency, decay) in N s/m, Hz and 1/s.

    heights: a texture, m, -1..0, an array of shape (rows, columns) that is projected along `axis`: with "z" the columns go along
    x and the rows along y, with "x" along y and z, with "y" along z and x. Or an expression in x, y and z (m); count is then how
    many columns and rows of it are worked out. width: m, from one height to the next, or those of columns and rows. first: m, the
    place of the first height. repeats: the grid is repeated without end. See fs_surface_settings.
    """
    settings = SurfaceSettings(
        static_friction=static_friction,
        dynamic_friction=static_friction if dynamic_friction is None else dynamic_friction,
        slip_distance=slip_distance,
    )
    _put_impact(settings, impact)
    if heights is None:
        if any(given is not None for given in (count, width, first, axis, repeats)):
            raise TypeError("count, width, first, axis and repeats are those of heights, which are missing")
        return _core.surface_create(settings)
    settings.column_width, settings.row_width = np.broadcast_to(0 if width is None else width, 2)
    settings.first_column, settings.first_row = (0, 0) if first is None else first
    settings.axis = "z" if axis is None else axis
    settings.repeats = bool(repeats)
    if isinstance(heights, str):
        settings.columns, settings.rows = (0, 0) if count is None else count
        return _core.surface_create_expression(settings, heights)
    if count is not None:
        raise TypeError("count is that of heights by an expression; an array has its own")
    grid = np.asarray(heights, dtype=float)
    if grid.ndim != 2:
        raise TypeError(f"heights have the shape {grid.shape}, must have (rows, columns)")
    settings.rows, settings.columns = grid.shape
    return _core.surface_create_texture(settings, grid.ravel())


# ---------------------------------------------------------------------------------------------------------- primitives


_FIELDS = sorted({"name", "position", "orientation", *_core.PARTS})


def _put(made: Object, common: Common) -> None:
    """Fields of Object, and those of its pose."""
    for name in ("position", "orientation"):
        if "pose" in common and name in common:
            raise TypeError(f"either pose or {name}")
    for name, value in common.items():
        if name not in _FIELDS:
            raise TypeError(f"{type(made).__name__} has no field {name!r}; it has {', '.join(_FIELDS)}")
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


def _vector(value: ArrayLike, name: str) -> Array:
    """Three finite numbers, which the caller's user knows by this name."""
    numbers = np.asarray(value)
    if numbers.shape != (3,) or numbers.dtype.kind not in "fiu":
        raise TypeError(f"{name} must be numbers of shape (3,), not {numbers.dtype} of shape {numbers.shape}")
    if not np.isfinite(numbers).all():
        raise _core.InvalidError(f"{name} is {_listed(numbers)}; it must be finite")
    return numbers


def _listed(numbers: Array) -> str:
    return f"({', '.join(f'{x:g}' for x in numbers)})"


def pose_along(position: ArrayLike, normal: ArrayLike) -> _core.Pose:
    """The pose of a plane at a position (m) with a normal."""
    direction = _vector(normal, "normal")
    if not direction.any():
        raise _core.InvalidError(f"normal is {_listed(direction)}; it needs a length above 0")
    return _core.pose_from_z(position, direction)


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
    the path of a file (.obj, .ply, .stl, .off); or a mesh of trimesh, PyVista or meshio, of which the triangles are
    taken. scale: metres a unit of these points or of the file. Or points is a Shape.
    """

    __slots__ = ()

    def __init__(
        self,
        points: ArrayLike | str | PathLike[str] | Shape | SurfaceMesh,
        triangles: ArrayLike | None = None,
        *,
        scale: float | None = None,
        **common: Unpack[Common],
    ) -> None:
        of_points = not isinstance(points, (Shape, str, PathLike))
        if triangles is None and of_points and not isinstance(points, (np.ndarray, list, tuple)):
            points, triangles = _of_library(points)
        if triangles is not None and not of_points:
            raise TypeError("triangles belong to points, not to a file or a Shape")
        if isinstance(points, Shape):
            if scale is not None:
                raise TypeError("scale= is for a file or points: this Shape is made already")
            shape = points
        elif isinstance(points, (str, PathLike)):
            shape = _core.shape_load(points, 1 if scale is None else scale)
        elif triangles is not None:
            if scale is not None:
                points = np.asarray(points) * np.full(1, scale)  # in double precision, whatever the points have
            shape = _core.shape_create_mesh(points, triangles)  # type: ignore[arg-type]
        else:
            raise TypeError("a mesh of points needs triangles=")
        super().__init__(primitive=Primitive.MESH, shape=shape)
        _put(self, common)


def _of_library(mesh: Any) -> tuple[Any, Any]:
    """Points and triangles of a mesh of trimesh (vertices, faces), PyVista (points, faces) or meshio (points, cells)."""
    name = type(mesh).__name__
    if hasattr(mesh, "vertices") and hasattr(mesh, "faces"):
        return np.asarray(mesh.vertices), np.asarray(mesh.faces)
    if hasattr(mesh, "points") and hasattr(mesh, "faces"):
        faces = np.asarray(mesh.faces)  # of each its number of corners, then these
        if faces.size % 4 or (faces[::4] != 3).any():
            if not hasattr(mesh, "triangulate"):
                raise TypeError(f"not all faces of this {name} are triangles")
            mesh = mesh.triangulate()
            faces = np.asarray(mesh.faces)
        return np.asarray(mesh.points), faces.reshape(-1, 4)[:, 1:]
    if hasattr(mesh, "points") and isinstance(getattr(mesh, "cells", None), list):
        kinds = [cells.type for cells in mesh.cells]
        other = sorted({kind for kind in kinds if kind.startswith(("quad", "polygon", "triangle")) and kind != "triangle"})
        if other or "triangle" not in kinds:
            raise TypeError(f"this {name} has cells of type {', '.join(other or kinds) or 'none'}; a surface of triangles is needed")
        return np.asarray(mesh.points), np.concatenate([cells.data for cells in mesh.cells if cells.type == "triangle"])
    raise TypeError(
        f"points must be points with triangles=, the path of a file, a Shape, or a surface of trimesh, PyVista or meshio, not {name}"
    )


class Wall(Object):
    """A plane that is free in front, and pushes out with min(stiffness*depth, limit) what is behind it.

    point: any of it (m); normal: towards the free side; stiffness: N/m; limit: N.
    """

    __slots__ = ()

    def __init__(
        self, point: ArrayLike, normal: ArrayLike, stiffness: float, limit: float, **common: Unpack[Common]
    ) -> None:
        if not isinstance(stiffness, Real):
            raise TypeError(f"stiffness must be a number, not {type(stiffness).__name__}")
        super().__init__(
            primitive=Primitive.PLANE,
            pose=pose_along(_vector(point, "point"), normal),
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
