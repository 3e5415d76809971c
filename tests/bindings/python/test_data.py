"""Structs, enums, arrays and errors of the generated layer."""

import copy
import json
import pickle

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import forceserver as fs
from conftest import ROOT
from forceserver import _core

DESCRIPTION = json.loads((ROOT / "bindings/description/forceserver.json").read_text())
GIVES_BACK = ("_destroy", "_close", "_stop", "_release", "_retain")


@pytest.mark.parametrize("function", [f["name"] for f in DESCRIPTION["functions"] if not f["for_c"]])
def test_every_function_is_there(function):
    if function.endswith(GIVES_BACK):
        return
    places = [_core] + [getattr(_core, h["name"][3:].capitalize()) for h in DESCRIPTION["handles"]]
    docs = [getattr(place, name).__doc__ or "" for place in places for name in dir(place)]
    assert any(f"In C: {function}." in doc for doc in docs)


@pytest.mark.parametrize(
    "struct",
    [s for s in DESCRIPTION["structs"] if s["name"] not in ("fs_vec3", "fs_quat", "fs_mat3") and not s["for_c"]],
    ids=lambda s: s["name"],
)
def test_every_struct_has_the_layout_of_c(struct):
    made = getattr(fs, "".join(part.capitalize() for part in struct["name"][3:].split("_")))
    assert made.dtype.itemsize == struct["size"]
    for field in struct["fields"]:
        kind, offset = made.dtype.fields[field["name"]][:2]
        assert (offset, kind.itemsize) == (field["offset"], field["size"])
    view = np.asarray(made())
    assert view.dtype == made.dtype
    if struct["growing"]:
        assert view["struct_size"] == struct["size"]


def test_constants_and_enums():
    assert fs.NAME_SIZE == 128 and fs.NOW == 0
    for item in DESCRIPTION["enums"]:
        if item["name"]:
            made = getattr(fs, "".join(part.capitalize() for part in item["name"][3:].split("_")))
            assert sorted(made) == sorted({value["value"] for value in item["values"]})
    assert fs.Status(-2) is fs.Status.NOT_FOUND and isinstance(fs.Fault.SPEED | fs.Fault.LATE, fs.Fault)
    assert fs.StateFlags.READY == 1 and fs.ResponseFlags.GUARDED == 8 and fs.OffFlags.BLEND == 64


def test_enums_print_as_their_names():
    assert str(fs.EventKind.DEVICE) == f"{fs.EventKind.DEVICE}" == "EventKind.DEVICE" and f"{fs.EventKind.DEVICE:d}" == "6"
    assert f"{fs.Sense.REPULSIVE:>17}" == "  Sense.REPULSIVE" and "%d" % fs.Status.NOT_FOUND == "-2"
    assert str(fs.Fault.SPEED | fs.Fault.LATE) == "Fault.SPEED|LATE" and json.dumps(fs.Part.SHAPE) == "8"


def test_fields():
    profile = fs.Profile(kind=fs.ProfileKind.GAUSSIAN, sense="repulsive", gain=3, limit=5)
    assert profile.kind is fs.ProfileKind.GAUSSIAN and profile.sense is fs.Sense.REPULSIVE and profile.gain == 3.0
    profile.kind = 1
    assert profile.kind is fs.ProfileKind.CONSTANT
    for value, error in ((99, ValueError), ("nix", ValueError), (1.5, TypeError), (None, TypeError), (True, TypeError)):
        with pytest.raises(error):
            profile.kind = value
    assert profile.kind is fs.ProfileKind.CONSTANT
    for value in ("3", None, 1j, [1]):
        with pytest.raises(TypeError):
            profile.gain = value
    assert profile.gain == 3
    thing = fs.Object()
    assert thing.enabled is True
    with pytest.raises(TypeError):
        thing.enabled = 1
    thing.enabled = np.False_
    assert thing.enabled is False
    thing.name = "Übung"
    assert thing.name == "Übung"
    for value, error in (("x" * 128, ValueError), ("a\0b", ValueError), (3, TypeError)):
        with pytest.raises(error):
            thing.name = value
    assert thing.name == "Übung"
    for value, error in ((-1, ValueError), (2**32, ValueError), (1.0, TypeError)):
        with pytest.raises(error):
            thing.tool_points = value
    thing.tool_points = np.int64(5)
    assert thing.tool_points == 5
    with pytest.raises(TypeError):
        fs.Object(nix=1)
    with pytest.raises(AttributeError):
        thing.nix = 1
    assert not hasattr(thing, "struct_size") and not hasattr(thing, "owner") and not hasattr(thing, "reserved")


def test_views_keep_their_owner_alive():
    position = fs.State().pose.position
    numbers = np.asarray(fs.State(time=7))
    junk = [fs.State(time=9) for _ in range(1000)]
    assert position.tolist() == [0, 0, 0] and numbers["time"] == 7 and len(junk) == 1000
    state = fs.State()
    pose = state.pose
    pose.position[1] = 2
    assert state.pose.position[1] == 2
    np.asarray(state)["pose"]["position"][2] = 3
    assert state.pose.position.tolist() == [0, 2, 3]
    other = copy.deepcopy(state)
    other.pose.position = (1, 1, 1)
    assert state.pose.position.tolist() == [0, 2, 3] and copy.copy(other).pose.position.tolist() == [1, 1, 1]
    state.pose = other.pose
    assert state.pose.position.tolist() == [1, 1, 1]
    assert fs.Response().stiffness.shape == (3, 3) and fs.View().points.shape == (32, 3)


@pytest.mark.parametrize(
    "value",
    [
        (1, 2, 3),
        [1, 2, 3],
        np.array([1, 2, 3]),
        np.float32([1, 2, 3]),
        np.arange(1, 7)[::2] * 1 + [0, -1, -2],
        memoryview(np.array([1.0, 2, 3])),
    ],
    ids=str,
)
def test_a_vector_is_any_sequence(value):
    pose = fs.Pose()
    pose.position = value
    assert pose.position.tolist() == [1, 2, 3]


@pytest.mark.parametrize(
    "value",
    [
        (1, 2),
        (1, 2, 3, 4),
        "abc",
        ("1", "2", "3"),
        None,
        5,
        (1, 2, 3j),
        [[1], [2, 3]],
        ("a", 1, 2),
        [[1, 2, 3]],
        [[1], [2], [3]],
    ],
    ids=str,
)
def test_what_is_no_vector(value):
    pose = fs.Pose(position=(7, 8, 9))
    with pytest.raises(TypeError):
        pose.position = value
    assert pose.position.tolist() == [7, 8, 9]


def test_rotations_of_scipy():
    turn = Rotation.from_euler("z", 90, degrees=True)
    pose = fs.Pose(orientation=turn)
    assert np.allclose(pose.orientation, [np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    assert np.allclose(fs.Point(orientation=turn).pose.orientation, pose.orientation)


def test_repr_has_units():
    text = repr(fs.State(time=2, pose=fs.Pose(position=(1, 2, 3))))
    assert "time=2 s" in text and "position=[1.0, 2.0, 3.0] m" in text and "rad/s" in text
    assert "force=[0.0, 0.0, 0.0] N," in repr(fs.Response())
    assert "mass=0 kg" in repr(fs.DeviceInfo()) and "torque_max=0 N m" in repr(fs.DeviceInfo())


def test_errors(scene):
    with pytest.raises(fs.NotFoundError) as caught:
        scene.get_report("nix")
    assert (
        caught.value.status is fs.Status.NOT_FOUND
        and str(caught.value) == "name is 'nix': there is no such object in the scene"
    )
    assert isinstance(caught.value, KeyError) and isinstance(caught.value, fs.Error)
    for name, base in (
        ("InvalidError", ValueError),
        ("TimeoutError", TimeoutError),
        ("MemoryError", MemoryError),
        ("IoError", OSError),
    ):
        assert issubclass(getattr(fs, name), base)
    with pytest.raises(fs.InvalidError, match="gain"):
        scene["a"] = fs.Point(front=fs.Gaussian(-1, 0.1, limit=5))
    assert list(scene) == []
    with pytest.raises(fs.ParseError):
        fs.Custom("3*(", limit=1)


def test_arrays_in(scene):
    points, triangles = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]

    class Interface:
        __array_interface__ = np.array(points, float).__array_interface__
        keep = None

    kept = np.array(points, float)
    Interface.__array_interface__ = kept.__array_interface__
    for given in (
        points,
        np.array(points),
        np.float32(points),
        np.asfortranarray(np.array(points, float)),
        Interface(),
        np.array(points, float)[::-1][::-1],
        memoryview(kept),
        np.array(points, ">f8"),
    ):
        for corners in (
            triangles,
            np.array(triangles),
            np.uint8(triangles),
            np.array(triangles, np.int64),
            np.array(triangles, ">u4"),
        ):
            shape = fs.Mesh(given, corners).shape
            assert shape.get_points().tolist() == points and shape.get_triangles().tolist() == triangles
    for wrong in (
        np.array(points, complex),
        np.array(points, str),
        np.zeros((3, 2)),
        np.zeros(9),
        np.zeros((3, 3, 1)),
        None,
        np.zeros((3, 3), bool),
        np.array(points, object),
        [[0, 0, 0], [1]],
        np.zeros(3, fs.Pose.dtype),
    ):
        with pytest.raises(TypeError):
            fs.Mesh(wrong, triangles)
    for wrong in (np.float64(triangles), np.zeros((1, 4), int), np.zeros(3, int)):
        with pytest.raises(TypeError):
            fs.Mesh(points, wrong)
    for wrong in ([[0, 1, -1]], [[0, 1, 2**32]], [[0, 1, 2**40]]):
        with pytest.raises(ValueError):
            fs.Mesh(points, np.array(wrong))
    with pytest.raises(fs.InvalidError):
        fs.Mesh(points, [[0, 1, 3]])


def test_arrays_out(scene, spring):
    scene["spring"] = spring
    positions = np.random.default_rng(1).uniform(-0.1, 0.1, (50, 3))
    forces = scene.evaluate(positions)
    assert forces.shape == (50, 3) and np.allclose(
        forces, -positions * np.minimum(200, 5 / np.linalg.norm(positions, axis=1))[:, None]
    )
    out = np.full((50, 3), 7.0)
    assert scene.evaluate(positions, out=out) is out and (out == forces).all()
    assert (scene.evaluate(positions.tolist()) == forces).all() and (
        scene.evaluate(np.asfortranarray(positions)) == forces
    ).all()
    assert np.allclose(scene["spring"].evaluate(positions), forces, rtol=1e-14)
    assert scene.evaluate(np.zeros((0, 3))).shape == (0, 3) and scene.evaluate([]).shape == (0, 3)
    wide = np.full((50, 6), 7.0)
    read_only = np.full((50, 3), 7.0)
    read_only.flags.writeable = False
    for wrong in (
        np.full((50, 3), 7, np.float32),
        np.full((49, 3), 7.0),
        np.full(150, 7.0),
        wide[:, ::2],
        np.asfortranarray(out * 0 + 7),
        read_only,
        np.full((50, 3), 7),
        [[7.0] * 3] * 50,
        np.full((50, 3), 7, ">f8"),
    ):
        with pytest.raises(TypeError):
            scene.evaluate(positions, out=wrong)
        assert np.all(np.asarray(wrong) == 7)
    with pytest.raises(TypeError):
        scene.evaluate(positions[:, :2])
    with pytest.raises(fs.InvalidError):
        scene.evaluate([[np.nan, 0, 0]])


def test_lists_and_kept_arrays(scene, spring):
    for i in range(100):
        scene[f"s{i}"] = spring
    reports = scene.get_reports()
    assert reports.dtype.names == fs.Report.dtype.names and len(reports) == 100 and reports["name"][0] == "s0"
    assert "s7" in scene.get_motions()["name"] and reports[3].name == "s3" and reports.weight.shape == (100,)
    assert (reports[0].wrench.force == 0).all() and reports[0].state == fs.ObjectState.FELT
    scene["Übung"] = spring
    assert scene.get_motions()[-1].name == "Übung" and np.allclose(scene.get_motions()["pose"]["position"], 0)
    since = scene.get_motions_since(None, 0)["motion_revision"]
    assert len(since) == 101 and (np.diff(since.astype(np.int64)) > 0).all()
    scene["s7"].move([0, 0, 0])
    assert scene.get_motions_since(None, since[-1])["name"].tolist() == ["s7"]
    assert len(scene.get_motions()) == 101 and scene.get_tool().tolist() == [[0, 0, 0]]
    assert "sim:" in fs.devices()["uri"]
    shape = fs.Polyline([[0, 0, 0], [1, 0, 0]]).shape
    points = shape.get_points()
    assert shape.get_triangles() is None
    shape.close()
    del shape
    assert points.tolist() == [[0, 0, 0], [1, 0, 0]]
    with pytest.raises(ValueError):
        points[0] = 1
    table, step = fs.Custom([1, 2, 3], step=0.1, limit=5).curve.get_table()
    assert table.tolist() == [1, 2, 3] and step == 0.1
    curve = fs.Custom("d", limit=1).curve
    assert curve.get_expression() == "d" and curve.get_table() == (None, 0)


def test_handles_inside_structs(scene):
    curve = fs.curve_create_table([1.0, 2.0], 0.1)
    profile = fs.Custom(curve, limit=5)
    thing = fs.Point(front=profile)
    curve.close()
    with pytest.raises(fs.StateError):
        curve.get_table()
    with pytest.raises(fs.StateError):
        fs.Custom(curve, limit=5)
    del profile
    scene["a"] = thing
    assert thing.front.curve == scene["a"].object.front.curve and thing.front.curve.get_table()[1] == 0.1
    view = thing.front
    del thing
    scene.clear()
    assert view.curve.get_table()[0].tolist() == [1, 2]
    view.curve = None
    assert view.curve is None
    with pytest.raises(ValueError):
        np.asarray(view)["curve"] = 1  # a pointer is not written


def test_tool_evaluates_one_and_many(scene, spring):
    scene["spring"] = spring
    with fs.Tool(scene) as tool:
        state, response = fs.State(), fs.Response()
        state.pose.position = (0.01, 0, 0)
        assert tool.evaluate(state, out=response) is response and np.isclose(response.wrench.force[0], -2)
        assert np.isclose(tool.evaluate(state).wrench.force[0], -2)
        states = np.zeros(1000, fs.State.dtype)
        states["pose"]["position"] = np.random.default_rng(2).uniform(-0.1, 0.1, (1000, 3))
        responses = tool.evaluate(states)
        out = np.zeros(1000, fs.Response.dtype)
        assert tool.evaluate(states, out) is out and (out == responses).all()
        assert (tool.evaluate(states[::2])["wrench"] == responses["wrench"][::2]).all()
        for i in (0, 500, 999):
            np.asarray(state)["pose"] = states[i]["pose"]
            assert (np.asarray(tool.evaluate(state))["wrench"] == responses[i]["wrench"]).all()
        assert len(tool.evaluate(states[:0])) == 0
        read_only = np.zeros(1000, fs.Response.dtype)
        read_only.flags.writeable = False
        for wrong in (
            np.zeros(1000, fs.State.dtype),
            np.zeros(999, fs.Response.dtype),
            np.zeros(2000, fs.Response.dtype)[::2],
            read_only,
            3,
        ):
            with pytest.raises(TypeError):
                tool.evaluate(states, out=wrong)
        for wrong in (np.zeros(1000), np.zeros((2, 3), fs.State.dtype), None, response, [3], "state"):
            with pytest.raises(TypeError):
                tool.evaluate(wrong)
        states["pose"]["position"][7] = np.inf
        with pytest.raises(fs.InvalidError, match=r"state\[7\]"):
            tool.evaluate(states)
    with fs.Tool(scene, [[0, 0, 0], [0.1, 0, 0]]) as tool:
        assert tool.evaluate(fs.State()).wrench.force[0] < 0
    with pytest.raises(TypeError):
        fs.Tool(scene, [0, 0, 0])


def test_profiles_and_custom():
    d = np.linspace(0, 0.1, 11)
    wide = {"limit": 1e6}
    for profile, formula in (
        (fs.Constant(3, **wide), 3 + 0 * d),
        (fs.LinearIncreasing(20, 1, **wide), 20 * d + 1),
        (fs.LinearDecreasing(-20, 3, **wide), 3 - 20 * d),
        (fs.Gaussian(3, 0.02, **wide), 3 * np.exp(-((d / 0.02) ** 2) / 2)),
        (fs.Quadratic(100, 1, **wide), 100 * d**2 + 1),
        (fs.Custom("exp(-d)", **wide), np.exp(-d)),
    ):
        assert np.allclose(fs.intensity(profile, d), formula)
    assert np.allclose(fs.intensity(fs.Inverse(0.1, 1, limit=1e6), d[1:]), 0.1 / d[1:] + 1)
    sampled = fs.Custom(lambda x: 3 * np.exp(-x / 0.02), limit=10, until=0.1)
    assert "1001 samples" in sampled.sampled and sampled.sampled in repr(sampled)
    assert np.allclose(fs.intensity(sampled, d), 3 * np.exp(-d / 0.02))
    for wrong in ({"until": None}, {"until": 0.1, "samples": 1}):
        with pytest.raises(ValueError):
            fs.Custom(lambda x: x, limit=1, **wrong)
    with pytest.raises(ZeroDivisionError):
        fs.Custom(lambda x: 1 / 0, limit=1, until=1)
    with pytest.raises(TypeError):
        fs.Custom([1, 2, 3], limit=1)


def test_a_call_that_changes_a_struct_changes_it_in_place():
    settings = fs.SurfaceSettings(static_friction=0.5, dynamic_friction=0.4)
    assert fs.surface_set_impact(settings, "medium") is None
    assert (settings.impact_gain, settings.impact_frequency, settings.impact_decay) == (8, 100, 80)
    assert (settings.static_friction, settings.dynamic_friction) == (0.5, 0.4)
    fs.surface_set_impact(settings, fs.Impact.NONE)
    assert settings == fs.SurfaceSettings(static_friction=0.5, dynamic_friction=0.4)
    with pytest.raises(ValueError, match="impact 'loud' is unknown; use 'none', 'soft', 'medium' or 'hard'"):
        fs.surface_set_impact(settings, "loud")
    with pytest.raises(TypeError, match="settings must be a SurfaceSettings, not .*Pose"):
        fs.surface_set_impact(fs.Pose(), "soft")
    constant = settings._constant()
    with pytest.raises(AttributeError, match="this SurfaceSettings is a copy"):
        fs.surface_set_impact(constant, "soft")
    assert constant.impact_gain == 0
    view = np.asarray(settings)
    fs.surface_set_impact(settings, "hard")
    assert view["impact_gain"] == 10  # an array of it sees the change


def test_surfaces():
    ice = fs.surface(static_friction=0.2, dynamic_friction=0.1, slip_distance=1e-3)
    assert ice.get_settings().dynamic_friction == 0.1 and ice.get_heights() is None
    assert fs.surface(static_friction=0.3).get_settings().dynamic_friction == 0.3
    heights = -1e-4 * np.arange(6.0).reshape(2, 3)
    rough = fs.surface(heights=heights, width=(1e-3, 2e-3), first=(0.1, 0.2), axis="x", repeats=True)
    settings = rough.get_settings()
    assert (settings.columns, settings.rows, settings.column_width, settings.row_width) == (3, 2, 1e-3, 2e-3)
    assert settings.axis == fs.Axis.X and settings.repeats and (settings.first_column, settings.first_row) == (0.1, 0.2)
    for surface in (ice, rough):
        again = pickle.loads(pickle.dumps(surface))
        assert again.get_settings() == surface.get_settings()
        assert np.array_equal(again.get_heights(), surface.get_heights()) if surface is rough else again.get_heights() is None
    assert rough.get_heights().tolist() == heights.ravel().tolist()
    metal, bell = fs.surface(impact="hard"), fs.surface(impact=(7.5, 123.25, 61), heights=heights, width=1e-3)
    for surface, wanted in ((ice, [0, 0, 0]), (metal, [10, 250, 60]), (bell, [7.5, 123.25, 61])):
        settings = pickle.loads(pickle.dumps(surface)).get_settings()
        assert [settings.impact_gain, settings.impact_frequency, settings.impact_decay] == wanted
    assert bell.get_heights().tolist() == heights.ravel().tolist()
    scene = fs.Scene()
    scene["slab"] = fs.Plane(contact=fs.Contact(keep="front", stiffness=1000, limit=5), surface=fs.surface(heights=[[-1e-3]]))
    with fs.Tool(scene) as tool:
        tool.evaluate(fs.State(pose=fs.Pose(position=(0, 0, 0.01))))
        state = fs.State(pose=fs.Pose(position=(0, 0, -3e-3)))
        assert tool.evaluate(state).wrench.force.tolist() == pytest.approx([0, 0, 2])  # it is carved by 1 mm
    waved = fs.surface(heights="-x - 2*y", count=(3, 2), width=(1e-3, 2e-3))
    assert np.allclose(waved.get_heights(), [0, -1e-3, -2e-3, -4e-3, -5e-3, -6e-3], atol=1e-15)
    with pytest.raises(fs.Error, match="at 'q'"):
        fs.surface(heights="-q", count=(3, 2), width=1)
    same = fs.surface(heights="-x - 2*y", count=[3, 2], width=[1e-3, 2e-3], first=[0, 0], axis=fs.Axis.Z, repeats=False)
    assert np.array_equal(same.get_heights(), waved.get_heights())
    for wrong in ({"heights": [[-1]], "count": (1, 1)}, {"count": (1, 1)}, {"heights": [1, 2]}, {"width": 1e-3}, {"repeats": True}):
        with pytest.raises(TypeError, match="heights"):
            fs.surface(**wrong)
    with pytest.raises(fs.Error, match=r"heights\[1\] is 0.001"):
        fs.surface(heights=[[0, 1e-3]], width=1e-3)
    with pytest.raises(ValueError, match="axis 'w' is unknown; use 'z', 'x' or 'y'"):
        fs.surface(heights=[[0]], axis="w")
    for impact, error, sentence in (
        ("loud", ValueError, "impact 'loud' is unknown; use 'none', 'soft', 'medium' or 'hard'"),
        (4, ValueError, "impact is 4; use 'none', 'soft', 'medium' or 'hard'"),
        (True, TypeError, "impact must be an enum, an int or a name"),
        (2.5, TypeError, r"impact is 2.5, must be a name such as 'soft', or \(gain, frequency, decay\)"),
        ((8, 100), TypeError, r"impact is \(8, 100\), must be a name such as 'soft', or \(gain, frequency, decay\)"),
        (("a", 100, 80), TypeError, "impact_gain must be a number, not str"),
        ((-1, 100, 80), fs.InvalidError, "impact_gain is -1, must be within 0..1000000"),
        ((8, 0.5, 80), fs.InvalidError, "impact_frequency is 0.5, must be within 1..100000"),
        ((8, 100, 0), fs.InvalidError, "impact_decay is 0, must be within 1..1000000"),
    ):
        with pytest.raises(error, match=sentence):
            fs.surface(impact=impact)
