"""Pictures of profiles and of the field of a scene, by matplotlib."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._core import Profile, Scene
from ._objects import intensity

__all__ = ["plot"]


def plot(
    what: Profile | Scene,
    axes: Any = None,
    *,
    extent: float = 0.1,
    samples: int = 0,
    z: float = 0,
    t: float = 0,
    **style: Any,
) -> Any:
    """Draws a profile (force over distance) or the field of a scene (arrows in the plane z); gives the axes.

    extent: m; a profile from 0 to it, a field within it on both sides of the origin. samples: along an axis. style: for
    the line or the arrows. It needs matplotlib.
    """
    if axes is None:
        try:
            from matplotlib import pyplot  # type: ignore[import-not-found, unused-ignore]
        except ImportError as error:
            raise ImportError("fs.plot needs matplotlib, which is not installed: pip install matplotlib") from error
        _, axes = pyplot.subplots()
    if isinstance(what, Profile):
        distances = np.linspace(0, extent, samples or 501)
        axes.plot(1e3 * distances, intensity(what, distances, t), **style)
        axes.set(xlabel="distance, mm", ylabel="force, N")
        return axes
    side = np.linspace(-extent, extent, samples or 21)
    x, y = (grid.ravel() for grid in np.meshgrid(side, side))
    forces = what.evaluate_field(None, t, np.column_stack([x, y, np.full_like(x, z)]))
    axes.quiver(1e3 * x, 1e3 * y, forces[:, 0], forces[:, 1], **style)
    axes.set(xlabel="x, mm", ylabel="y, mm", aspect="equal")
    return axes
