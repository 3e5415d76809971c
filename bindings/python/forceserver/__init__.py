"""Say what should be felt; a servo makes it felt, a thousand times a second and more.

    import forceserver as fs
    scene = fs.Scene()                                     # or fs.connect("shm:lab", "rover")
    scene["rock"] = fs.Mesh("rock.ply", front=fs.Gaussian(5, 0.01, limit=5, sense="repulsive"))
    with fs.Servo(scene, fs.Device("sim:?path=figure8")) as servo:
        with scene.change():                               # several changes, felt from one tick on
            scene["rock"].move(position=(0, 0, 0.1))       # it stands still there
            scene["wall"] = fs.Wall(point=(0, 0, 0), normal=(0, 0, 1), stiffness=500, limit=10)

Units are SI. Quaternions are (w, x, y, z); scipy's order is x, y, z, w, so give its Rotation itself, which is
converted, not the array of its as_quat().

scene["rock"].move(..) puts an object somewhere, where it stands still; scene["rock"].stream(..) is one of a stream of
moves, from which its motion is worked out. Its fields can be read and set: scene["rock"].enabled = False.

fs.table(scene.get_reports()) is a dict of flat columns, as pandas.DataFrame takes it.

Ctrl-C ends the long waits: for events, sync, a connection, a device, the steps of a servo, and a mesh that is loaded or
built. Any other call ends first: one that asks a server within about 1 s. That takes longer only where an object is set, or
a scene loaded, with a mesh that was not built (1 s for a million triangles), and where a great many places are evaluated.

This layer is written by hand and small. Below it, `forceserver._core` has the functions, structs, enums and handles of
the C headers, whose comments are the docstrings (what gives a handle back is its close()): `scene.get_reports()` is fs_scene_get_reports.
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

from . import _core, _objects, _plot, _scene, _table  # noqa: E402
from ._core import *  # noqa: E402, F403
from ._core import Curve, Shape, Surface, version  # noqa: E402
from ._objects import *  # noqa: E402, F403
from ._plot import *  # noqa: E402, F403
from ._scene import *  # noqa: E402, F403
from ._table import *  # noqa: E402, F403

__version__ = version()
__all__ = ["Curve", "Shape", "Surface"]
__all__ += _core.__all__
__all__ += _objects.__all__
__all__ += _plot.__all__
__all__ += _scene.__all__
__all__ += _table.__all__
