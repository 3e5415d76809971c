"""What is refused, by which error and in which words; and what must not be."""

import inspect
import os
import re

import numpy as np
import pytest

import forceserver as fs

REFUSED = [
    (lambda s: fs.Wall((0, 0, 0), (0, 0, 0), 1, 1), ValueError, r"normal is \(0, 0, 0\); it needs a length above 0"),
    (lambda s: fs.Plane(normal=[0, 0, 0]), ValueError, "normal is"),
    (lambda s: fs.Constant(1, limit=1, sense="atractive"), ValueError, "sense 'atractive' is unknown; use 'attractive' or 'repulsive'"),
    (lambda s: fs.Contact(keep="frnt"), ValueError, "keep 'frnt' is unknown; use 'none', 'front', 'back' or 'either'"),
    (lambda s: fs.Servo(s, mode="virtal"), ValueError, "mode 'virtal' is unknown; use 'thread', 'caller' or 'virtual'"),
    (lambda s: fs.Object(primitive="\ud800"), ValueError, "is unknown"),
    (lambda s: fs.Custom(lambda d: d, limit=1), ValueError, "give until=, the distance"),
    (lambda s: fs.Custom(lambda d: None, limit=1, until=1), TypeError, "the function returned None at d = 0; it must return a number"),
    (lambda s: fs.Custom(lambda d: 1 / d if d else float("inf"), limit=1, until=1), ValueError, "returned inf at d = 0"),
    (lambda s: fs.Custom(lambda d: float("nan") if d > 0.5 else 1, limit=1, until=1), ValueError, "returned nan at d = 0.501"),
    (lambda s: fs.Custom([1, float("nan")], limit=1, step=1), ValueError, "entry 1 of the table is nan"),
    (lambda s: fs.Custom([1, 2], limit=1), TypeError, "a table needs step=, metres between its entries"),
    (lambda s: fs.Custom("d", limit=1, step=1), TypeError, "step= is for a table"),
    (lambda s: fs.Custom("d", limit=1, until=1), TypeError, "until= and samples= are for a Python function"),
    (lambda s: fs.Custom([1, 2], limit=1, step=1, until=1), TypeError, "until="),
    (lambda s: fs.Custom(lambda d: d, limit=1, until=1, step=1), TypeError, "step="),
    (lambda s: fs.Mesh(fs.Mesh(np.eye(3), [[0, 1, 2]]).shape, scale=2), TypeError, "scale="),
    (lambda s: fs.Mesh("t.obj", [[0, 1, 2]]), TypeError, "triangles belong to points"),
    (lambda s: fs.Polyline(fs.Polyline(np.eye(3)).shape, closed=True), TypeError, "closed="),
    (lambda s: fs.Point(pose=fs.Pose(), position=(0, 0, 0)), TypeError, "either pose or position"),
    (lambda s: fs.Plane(pose=fs.Pose(), normal=(0, 0, 1)), TypeError, "either normal"),
    (lambda s: fs.Wall((0, 0, 0), (0, 0, 1), 1, 1, position=(0, 0, 1)), TypeError, "takes no position"),
    (lambda s: fs.Tool(s).evaluate(None), TypeError, "state must be a State or an array of shape .n,. of State.dtype, not NoneType"),
    (lambda s: s.evaluate(np.eye(3), np.zeros((3, 6))[:, ::2]), TypeError, "must be a C-contiguous, writable array"),
    (lambda s: s.next_event(), TypeError, r"next_event\(\) needs 'timeout'"),
    (lambda s: s.next_event(1, 2), TypeError, r"next_event\(\) takes 1 arguments, not 2"),
    (lambda s: s.next_event(tiemout=1), TypeError, r"next_event\(\) has no argument 'tiemout'"),
    (lambda s: fs.shape_load("a", 1, scale=1), TypeError, r"shape_load\(\)"),
    (lambda s: fs.Contact("front", 500, 5), TypeError, "Contact takes its fields by name: keep, stiffness"),
    (lambda s: fs.Contact(kep="front"), TypeError, "Contact has no field 'kep'; it has keep"),
    (lambda s: fs.Servo(fs.Device(), s), TypeError, "scene must be a Scene, not Device"),
    (lambda s: fs.Servo(s, s), TypeError, "device must be a Device, not Scene"),
    (lambda s: fs.Server(s, "shm:x"), TypeError, "servo must be a Servo, not Scene"),
    (lambda s: fs.Object(tool_points=True), TypeError, "tool_points must be an int, not bool"),
    (lambda s: fs.Object(name="a\0b"), ValueError, "name holds a NUL character"),
    (lambda s: s.get_clients(), NotImplementedError, "fs.connect"),
    (lambda s: s.get_views(), NotImplementedError, "fs.connect"),
    (lambda s: s.load("nowhere.json"), FileNotFoundError, "nowhere.json"),
    (lambda s: fs.Mesh("nowhere.obj"), FileNotFoundError, "nowhere.obj"),
    (lambda s: fs.driver_load("nowhere.so"), OSError, "nowhere.so"),
    (lambda s: fs.curve_create_expression("3*("), ValueError, "column"),
    (lambda s: s.object_change(fs.Object(name="a"), "psoe"), ValueError, "parts 'psoe' is unknown"),
    (lambda s: s.evaluate(np.zeros(0, fs.State.dtype)), TypeError, "positions must be floats"),
    (lambda s: fs.Polyline(np.zeros(0, fs.Pose.dtype)), TypeError, "points must be floats"),
    (lambda s: fs.curve_create_table(np.zeros(0, fs.Pose.dtype), 1), TypeError, "forces must be floats"),
    (lambda s: fs.Mesh(np.zeros((3, 3)), np.zeros(0, fs.Pose.dtype)), TypeError, "triangles must be integers"),
    (lambda s: s.evaluate(np.zeros((0, 3), "U3")), TypeError, "positions must be floats"),
    (lambda s: s.evaluate(np.eye(3), out=np.zeros(3)), TypeError, r"out must be a C-contiguous, .*shape \(3, 3\): it has shape \(3,\)"),
    (lambda s: s.evaluate(np.zeros((4, 4, 2))), TypeError, r"positions must be floats of shape \(.., 3\), not float64 of shape \(4, 4, 2\)"),
    (lambda s: s.evaluate(3.0), TypeError, r"positions must be floats of shape \(.., 3\), not float64 of shape \(\)"),
    (lambda s: fs.intensity(fs.Constant(1, limit=1), [0, 1], out=[1]), TypeError, "out must be"),
    (lambda s: fs.intensity(fs.Constant(1, limit=1), [0, 1], 1, t=1), TypeError, "either time or t"),
    (lambda s: s.evaluate_field(None, 0, np.eye(3), out=None, forces=None), TypeError, r"evaluate_field\(\) has no argument 'forces'"),
    (lambda s: fs.LinearIncreasing(200), TypeError, r"^LinearIncreasing.__init__\(\) missing .*'limit'"),
    (lambda s: fs.Inverse(1), TypeError, r"^Inverse.__init__\(\) missing .*'limit'"),
    (lambda s: fs.Point(fornt=3), TypeError, "Point has no field 'fornt'; it has back, contact, damping, .*, front, .*, position, .*twist$"),
    (lambda s: fs.Point(copy=3), TypeError, "Point has no field 'copy'; it has"),
    (lambda s: fs.Plane(normal=[1, 2]), TypeError, r"^normal must be numbers of shape \(3,\), not int64 of shape \(2,\)"),
    (lambda s: fs.Plane(normal=[1, 2, np.nan]), ValueError, r"^normal is \(1, 2, nan\); it must be finite"),
    (lambda s: fs.Wall([1, 2], (0, 0, 1), 1, 1), TypeError, r"^point must be numbers of shape \(3,\)"),
    (lambda s: fs.Wall((0, 0, 0), (0, 0, 1), "1", 1), TypeError, "^stiffness must be a number, not str"),
    (lambda s: fs.Custom([[1, 2]], limit=1, step=1), TypeError, r"^a table is forces of shape \(n,\), not of shape \(1, 2\)"),
    (lambda s: fs.Mesh(3), TypeError, "points must be points with triangles=, .* a surface of trimesh, PyVista or meshio, not int"),
    (lambda s: fs.Mesh(np.eye(3)), TypeError, "a mesh of points needs triangles="),
    (lambda s: fs.table(3), TypeError, r"rows must be an array of structs, such as scene.get_reports\(\), not int"),
]


@pytest.mark.parametrize("call, error, sentence", REFUSED, ids=[sentence for _, _, sentence in REFUSED])
def test_a_refusal_says_why(scene, call, error, sentence):
    with pytest.raises(error, match=sentence):
        call(scene)


def test_the_older_names_of_arguments_are_taken(scene, spring):
    scene["a"] = spring
    forces, distances = np.zeros((3, 3)), [0, 0.01, 0.02]
    assert scene.evaluate_field(None, 0, np.eye(3) * 0.01, forces=forces) is forces and forces.any()
    numbers = np.zeros(3)
    assert fs.profile_evaluate(spring.front, 0, 0, distances, forces=numbers) is numbers and numbers.tolist() == [0, 2, 4]
    pulse = fs.Custom("t", limit=9)
    for late in (fs.intensity(pulse, distances, 3), fs.intensity(pulse, distances, time=3), fs.intensity(pulse, distances, t=3)):
        assert late.tolist() == [3, 3, 3]
    thing = fs.Point(name="a", front=pulse)
    assert fs.law(thing, [0.1], time=3)[0] == fs.law(thing, [0.1], t=3)[0] == -3


def test_a_grid_need_not_be_reshaped(scene, spring):
    scene["a"] = spring
    grid = np.random.default_rng(5).uniform(-0.01, 0.01, (4, 5, 3))
    wanted = scene.evaluate(grid.reshape(-1, 3)).reshape(4, 5, 3)
    room = np.empty((4, 5, 3))
    assert scene.evaluate(grid, out=room) is room and (room == wanted).all() and (scene.evaluate(grid) == wanted).all()
    assert (scene.evaluate(grid.swapaxes(0, 1)) == wanted.swapaxes(0, 1)).all()
    assert (scene.evaluate(grid[1, 2]) == wanted[1, 2]).all() and scene.evaluate([]).shape == (0, 3)
    assert scene.evaluate(np.zeros((2, 0, 3))).shape == (2, 0, 3)
    assert fs.intensity(spring.front, grid[..., 0] ** 2).shape == (4, 5) and fs.intensity(spring.front, 0.01) == 2


def test_errors_of_a_value_are_its_own():
    class Odd:
        def __float__(self):
            raise ZeroDivisionError

        def __index__(self):
            raise ZeroDivisionError

    for wrong in (lambda: fs.Profile(gain=Odd()), lambda: fs.Object(tool_points=Odd())):
        with pytest.raises(ZeroDivisionError):
            wrong()


def test_what_numpy_has_no_memory_for(scene):
    huge = np.broadcast_to(np.zeros(1), (10**12, 3))
    for call in (
        lambda: scene.set_tool(huge),
        lambda: fs.Polyline(huge),
        lambda: fs.Tool(scene, huge),
        lambda: fs.curve_create_table(huge[:, 0], 1),
        lambda: fs.Mesh(np.zeros((3, 3)), np.broadcast_to(np.zeros(1, np.uint32), (10**12, 3))),
    ):
        with pytest.raises(MemoryError):
            call()


def test_results_do_not_overlap_what_is_read(scene, spring):
    scene["a"] = spring
    numbers = np.random.default_rng(5).uniform(-0.01, 0.01, (101, 3))
    wanted = scene.evaluate(numbers[:100])
    with pytest.raises(ValueError, match="positions and out overlap"):
        scene.evaluate(numbers[:100], out=numbers[1:])
    assert (scene.evaluate(numbers[:100].copy(), out=numbers[1:]) == wanted).all()
    numbers[:100] = scene.evaluate(numbers[:100])  # this is right
    same = np.random.default_rng(5).uniform(-0.01, 0.01, (101, 3))[:100].copy()
    assert (scene.evaluate(same, out=same) == wanted).all()
    distances = np.linspace(0, 1, 11)
    with pytest.raises(ValueError, match="overlap"):
        fs.intensity(spring.front, distances[:10], 0, distances[1:])
    room = np.zeros(10 * max(fs.State.dtype.itemsize, fs.Response.dtype.itemsize), np.uint8)
    states = room[: 10 * fs.State.dtype.itemsize].view(fs.State.dtype)
    with pytest.raises(ValueError, match="state and out overlap"):
        fs.Tool(scene).evaluate(states, room[: 10 * fs.Response.dtype.itemsize].view(fs.Response.dtype))


def test_states_are_any_array_of_them(scene, spring):
    scene["a"] = spring
    states = np.zeros(5, fs.State.dtype)
    states["pose"]["position"][:, 0] = np.arange(5) * 1e-3
    wanted = fs.Tool(scene).evaluate(states)
    assert (fs.Tool(scene).evaluate(states.astype(fs.State.dtype.newbyteorder(">"))) == wanted).all()
    listed = [fs.State(pose=fs.Pose(position=(i * 1e-3, 0, 0))) for i in range(5)]
    assert (fs.Tool(scene).evaluate(listed) == wanted).all()


def test_scale_is_of_points_too():
    assert fs.Mesh(np.eye(3) * 1000, [[0, 1, 2]], scale=1e-3).shape.get_points().tolist() == np.eye(3).tolist()


def test_mappings_do_what_they_promise(scene, spring):
    from collections.abc import MutableMapping

    scene["a"] = spring
    assert not [name for name in dir(MutableMapping) if not name.startswith("_") and not hasattr(scene, name)]
    assert "a\0b" not in scene and "\ud800" not in scene and scene.get("a\0b") is None and scene.get("x", 3) == 3
    assert scene.keys() == {"a"} and "a" in scene.keys() and len(scene.keys()) == 1
    taken = scene.pop("a")
    assert taken.name == "a" and taken.front.gain == 200 and list(scene) == []
    assert scene.pop("a", 3) == 3
    with pytest.raises(KeyError):
        scene.pop("a")
    with pytest.raises(KeyError):
        scene.popitem()
    assert scene.setdefault("b", taken).name == "b" and scene.setdefault("b", fs.Point()).front.gain == 200
    scene.update(c=spring)
    scene.update([("d", spring)], e=spring)
    assert list(scene) == ["b", "c", "d", "e"]
    assert scene.popitem()[0] == "b" and list(scene) == ["c", "d", "e"]


def test_events_end_and_a_repr_never_fails(scene):
    endpoint = f"shm:refusals-{os.getpid()}"
    servo = fs.Servo(scene)
    server = fs.Server(servo, endpoint)
    client = fs.connect(endpoint, "me")
    assert repr(client) == f"<forceserver.Scene of 'me' at '{endpoint}'>"
    client["a"] = fs.Point()
    assert list(client) == ["a"]
    assert repr(server) == f"<forceserver.Server at '{endpoint}'>" and "sim:" in repr(servo)
    server.close()
    servo.close()
    assert [event.kind for event in client.events(timeout=30)][-1] == fs.EventKind.DISCONNECTED
    assert repr(client).startswith("<forceserver.Scene of 'me'")
    with pytest.raises(ConnectionError):
        client.get_reports()
    assert repr(fs.Mesh(np.eye(3), [[0, 1, 2]]).shape) == "<forceserver.Shape of 3 points, 1 triangle>"
    assert repr(fs.Custom("3*d", limit=1).curve) == "<forceserver.Curve '3*d'>"
    assert "2 forces" in repr(fs.Custom([1, 2], step=0.5, limit=1).curve)
    client.close()
    assert repr(client) == "<closed forceserver.Scene>" and repr(servo).startswith("<closed forceserver.Servo")


def test_signatures():
    assert str(inspect.signature(fs.Contact)).startswith("(*, keep=Ellipsis, stiffness=")
    assert "keep" in inspect.signature(fs.Contact).parameters and "normal" in inspect.signature(fs.Plane).parameters
    assert list(inspect.signature(fs.Scene.next_event).parameters)[-1] == "timeout"


def test_docstrings_speak_python():
    core = fs._core
    for name in dir(core):
        one = getattr(core, name)
        for text in [one.__doc__ or ""] + [getattr(one, n).__doc__ or "" for n in dir(one) if not n.startswith("_")]:
            if name.startswith("_") or "In C: " not in text:
                continue
            words = text.split("In C: ")[0]
            assert "struct_size" not in words and not re.search(r"fs_(?!driver_)", words) and "FS_" not in words, words
    assert "Scene.object_set" in fs.Object.tool_points.__doc__ or "None" in fs.Object.shape.__doc__
