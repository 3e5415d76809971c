"""Say what should be felt; a servo makes it felt, a thousand times a second and more.

    import forceserver as fs
    scene = fs.Scene()                                     # or fs.connect("shm:lab", "rover")
    scene["rock"] = fs.Mesh("rock.ply", front=fs.Gaussian(5, 0.01, limit=5, sense="repulsive"))
    with fs.Servo(scene, fs.Device("sim:?path=figure8")) as servo:
        with scene.change():                               # several changes, felt from one tick on
            scene["rock"].move(position=(0, 0, 0.1))
            scene["wall"] = fs.Wall(point=(0, 0, 0), normal=(0, 0, 1), stiffness=500, limit=10)

Units are SI. Quaternions are (w, x, y, z); scipy's order is x, y, z, w, so give its Rotation itself, which is
converted, not the array of its as_quat().

Ctrl-C ends the calls that wait: for events, sync, a server, a device, a group of another thread, the steps of a servo,
and a mesh that is loaded or built. Any other call ends first. That takes long only where an object is set, or a scene
loaded, with a mesh that was not built (1 s for a million triangles), and where a great many places are evaluated.

This layer is written by hand and small. Below it, `forceserver._core` has every function, struct, enum and handle of
the C headers, whose comments are the docstrings: `scene.get_reports()` is fs_scene_get_reports.
"""


def _refuse_subinterpreter() -> None:
    """pybind11 cannot be loaded there: in Python 3.11 the import would never end."""
    try:
        import _interpreters as interpreters  # type: ignore[import-not-found, unused-ignore]  # Python 3.13
    except ImportError:
        try:
            import _xxsubinterpreters as interpreters  # type: ignore[import-not-found, unused-ignore, no-redef]
        except ImportError:
            return
    if interpreters.get_current() != interpreters.get_main():
        raise ImportError("forceserver cannot be imported in a sub-interpreter: import it in the main one")


_refuse_subinterpreter()
del _refuse_subinterpreter

from . import _core  # noqa: E402
from ._core import *  # noqa: E402, F403
from ._core import Curve, Shape, version  # noqa: E402
from ._objects import (  # noqa: E402
    Constant,
    Custom,
    Gaussian,
    Inverse,
    LinearDecreasing,
    LinearIncreasing,
    Mesh,
    Plane,
    Point,
    Polyline,
    Quadratic,
    Wall,
    intensity,
    law,
)
from ._plot import plot  # noqa: E402
from ._scene import Device, Hand, Scene, SceneObject, Server, Servo, Tool, connect, devices  # noqa: E402

__version__ = version()
__all__ = [
    "Constant",
    "Curve",
    "Custom",
    "Device",
    "Gaussian",
    "Hand",
    "Inverse",
    "LinearDecreasing",
    "LinearIncreasing",
    "Mesh",
    "Plane",
    "Point",
    "Polyline",
    "Quadratic",
    "Scene",
    "SceneObject",
    "Server",
    "Servo",
    "Shape",
    "Tool",
    "Wall",
    "connect",
    "devices",
    "intensity",
    "law",
    "plot",
]
__all__ += _core.__all__
