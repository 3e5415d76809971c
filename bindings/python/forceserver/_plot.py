"""Pictures of profiles and of the field of a scene, by matplotlib."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._core import Profile, Scene
from ._objects import intensity, the_time

__all__ = ["plot"]


def plot(
    what: Profile | Scene,
    axes: Any = None,
    *,
    extent: float = 0.1,
    samples: int = 0,
    z: float = 0,
    time: float = 0,
    t: float | None = None,
    **style: Any,
) -> Any:
    """Draws a profile (force over distance) or the field of a scene (arrows in the plane z); gives the axes.

    extent: m; a profile from 0 to it, a field within it on both sides of the origin. samples: along an axis. time: for a
    profile s after the object's start, for a field s on the scene's clock (0: now); t is its older name. style: for the
    line or the arrows; without a scale of its own the longest arrow is nearly as long as the way to the next one. It needs
    matplotlib.
    """
    time = the_time(time, t)
    if axes is None:
        try:
            from matplotlib import pyplot  # type: ignore[import-not-found, unused-ignore]
        except ImportError as error:
            raise ImportError("fs.plot needs matplotlib, which is not installed: pip install matplotlib") from error
        _, axes = pyplot.subplots()
    if isinstance(what, Profile):
        distances = np.linspace(0, extent, samples or 501)
        axes.plot(1e3 * distances, intensity(what, distances, time), **style)
        axes.set(xlabel="distance, mm", ylabel="force, N")
        return axes
    side = np.linspace(-extent, extent, samples or 21)
    x, y = (grid.ravel() for grid in np.meshgrid(side, side))
    forces = what.evaluate_field(None, time, np.column_stack([x, y, np.full_like(x, z)]))
    if not style.keys() & {"scale", "scale_units", "angles"}:
        strongest = np.hypot(forces[:, 0], forces[:, 1]).max()
        step = 1e3 * (side[1] - side[0]) if len(side) > 1 else 1e3 * extent
        style |= {"angles": "xy", "scale_units": "xy", "scale": strongest / (0.9 * step) if strongest > 0 else 1}
    axes.quiver(1e3 * x, 1e3 * y, forces[:, 0], forces[:, 1], **style)
    axes.set(xlabel="x, mm", ylabel="y, mm", aspect="equal")
    return axes
