"""Where an object is put, and what can be read and set by its name."""

import copy
import pickle

import numpy as np
import pytest

import forceserver as fs


def at(pose):
    return pose.position.tolist() + pose.orientation.tolist()


@pytest.fixture
def a(scene, spring):
    scene.set_time(10)
    scene["a"] = spring
    return scene["a"]


def test_what_is_moved_stands_still(scene, a):
    for step in range(3):
        scene.set_time(10 + 0.05 * (step + 1))
        a.move((0.01 * step, 0, 0))
        assert not a.twist.linear.any() and scene.get_motions()["horizon"][0] == 0
    scene.set_time(10.2)
    assert np.allclose(scene.evaluate([[0.02, 0, 0]]), 0)  # it is where it was put
    a.move(twist=fs.Twist(linear=(1, 0, 0)))
    assert a.twist.linear.tolist() == [1, 0, 0]


def test_a_stream_of_moves_goes_on(scene, a):
    for step in range(3):
        scene.set_time(10 + 0.05 * (step + 1))
        a.stream((0.01 * step, 0, 0), (1, 0, 0, 0))
    assert np.allclose(a.twist.linear, [0.2, 0, 0])
    scene.set_time(10.2)
    assert np.allclose(scene.evaluate([[0.03, 0, 0]]), 0)


def test_a_change_of_place_is_where_it_says(scene, a):
    a.move((0, 0, 0), (1, 0, 0, 0), twist=fs.Twist(linear=(1, 0, 0), angular=(0, 0, np.pi)))
    scene.set_time(10.05)
    a.change(position=(0.5, 0, 0), lifetime=0)  # the time of the old motion does not count
    assert np.allclose(scene.evaluate([[0.5, 0, 0]]), 0) and not a.twist.linear.any()
    turn = np.pi * 0.05 / 2
    assert np.allclose(a.pose.orientation, [np.cos(turn), 0, 0, np.sin(turn)])  # as it was felt then
    a.move((0, 0, 0), (1, 0, 0, 0), twist=fs.Twist(linear=(1, 0, 0), angular=(0, 0, np.pi)))
    scene.set_time(10.1)
    a.move(orientation=(0, 1, 0, 0))
    assert np.allclose(at(a.pose), [0.05, 0, 0, 0, 1, 0, 0])
    a.move((0, 0, 0), (1, 0, 0, 0), twist=fs.Twist(linear=(1, 0, 0), angular=(0, 0, np.pi)))
    scene.set_time(13)  # a twist counts for 0.1 s
    a.move(position=(7, 0, 0))
    turn = np.pi * 0.1 / 2
    assert np.allclose(at(a.pose), [7, 0, 0, np.cos(turn), 0, 0, np.sin(turn)])
    a.change(twist=fs.Twist(linear=(0, 1, 0)))
    assert a.twist.linear.tolist() == [0, 1, 0] and a.pose.position.tolist() == [7, 0, 0]


def test_a_change_of_place_and_more_is_one_group(scene, a):
    with pytest.raises(fs.InvalidError):
        a.change(position=(float("nan"), 0, 0), front=fs.Constant(1, limit=1))
    assert a.front.kind is fs.ProfileKind.LINEAR_INCREASING
    with scene.change():
        a.change(position=(1, 0, 0), front=fs.Constant(1, limit=1))
    assert a.front.kind is fs.ProfileKind.CONSTANT and a.pose.position[0] == 1
    scene.object_change(fs.Object(name="a", damping=3, primitive="point", front=fs.Constant(2, limit=2)), "profiles | contact")
    assert a.damping == 3 and a.pose.position[0] == 1
    for wrong in ({"pose": fs.Pose(), "position": (0, 0, 0)}, {"name": "b"}, {"enabeld": False}):
        with pytest.raises(TypeError):
            a.change(**wrong)


def test_fields_of_what_is_in_a_scene(scene, a):
    assert set(fs._core.PARTS) <= set(dir(fs.SceneObject))
    a.enabled = False
    assert a.enabled is False and a.report.state in (fs.ObjectState.DISABLED, fs.ObjectState.FADING)
    a.pose = fs.Pose(position=(1, 2, 3), orientation=(1, 0, 0, 0))
    assert a.pose.position.tolist() == [1, 2, 3]
    a.front = fs.Constant(2, limit=3)
    assert a.front == fs.Constant(2, limit=3) and a.shape is None and a.damping == 0
    for wrong in (
        lambda: setattr(a.front, "gain", 4),  # of a copy
        lambda: setattr(a.pose, "position", (0, 0, 0)),
        lambda: setattr(a.twist, "linear", (0, 0, 0)),
        lambda: setattr(a, "name_", "b"),
        lambda: setattr(a, "nix", 1),
    ):
        with pytest.raises(AttributeError):
            wrong()
    for wrong in (lambda: a.pose.position.__setitem__(0, 7), lambda: np.asarray(a.pose)["position"].__setitem__(0, 7)):
        with pytest.raises(ValueError):
            wrong()
    own = a.object
    own.front.gain = 7  # what `object` gives is one's own
    assert own.front.gain == 7 and a.front.gain == 2


def test_fields_of_a_scene(scene):
    scene.frame = fs.Frame(pose=fs.Pose(orientation=(1, 0, 0, 0)), scale=2, force_scale=0.5)
    scene.clutch = True
    scene.tool = [[0, 0, 0], [1, 0, 0]]
    scene.tool_radius = 0.25
    scene.time = 7
    assert scene.tool_radius == 0.25
    with pytest.raises(fs.Error, match="radius is -1 m"):
        scene.tool_radius = -1
    assert scene.frame.scale == 2 and scene.clutch and scene.tool.shape == (2, 3) and scene.time == 7
    with pytest.raises(AttributeError, match="is a copy"):
        scene.frame.scale = 3
    with pytest.raises(ValueError):
        scene.tool[0] = 1


def test_what_does_nothing_cannot_be_set(scene):
    device = fs.Device("sim:")
    with fs.Servo(scene, device, mode="virtual") as servo:
        assert servo.enabled
        servo.enabled = False
        servo.step(1)
        assert not servo.stats.enabled and not servo.enabled
        server = fs.Server(servo, "shm:places")
        for one, name in ((servo, "force_limit"), (scene, "nix"), (device, "force"), (server, "locked"), (fs.Tool(scene), "x")):
            with pytest.raises(AttributeError):
                setattr(one, name, 1)
        server.close()


def test_structs_are_equal_where_their_values_are(scene, spring):
    assert fs.Pose(position=(1, 2, 3)) == fs.Pose(position=(1, 2, 3)) != fs.Pose()
    assert spring == fs.Point(front=fs.LinearIncreasing(200, limit=5)) and spring != fs.Point() and spring != 3
    assert fs.Object(name="a") != fs.Object(name="b") and fs.Response() == fs.Response() and fs.View() == fs.View()
    curve = fs.curve_create_table([1, 2], 1)
    assert fs.Custom(curve, limit=1) == fs.Custom(curve, limit=1) != fs.Custom([1, 2], step=1, limit=1)
    with pytest.raises(TypeError):
        hash(fs.Pose())


class Named(fs.Mesh):
    def __init__(self, label):
        super().__init__(np.eye(3), [[0, 1, 2]], position=(1, 2, 3), front=fs.Custom("d", limit=1))
        self.label = [label]


def test_copies_and_pickles_are_of_the_same_class():
    made = Named("rock")
    for again in (copy.copy(made), made.copy(), copy.deepcopy(made)):
        assert type(again) is Named and again == made and again.label == ["rock"]
        again.pose.position = (0, 0, 0)
        assert made.pose.position.tolist() == [1, 2, 3]
    assert copy.copy(made).label is made.label and copy.deepcopy(made).label is not made.label
    again = pickle.loads(pickle.dumps(made))
    assert type(again) is Named and again.label == ["rock"] and again.pose == made.pose
    assert again.shape.get_points().tolist() == np.eye(3).tolist() and again.front.curve.get_expression() == "d"
    custom = fs.Custom(lambda d: d, until=1, limit=1)
    for again in (copy.copy(custom), pickle.loads(pickle.dumps(custom))):
        assert type(again) is fs.Custom and again.sampled == custom.sampled
    for one in (fs.State(time=3), fs.Gaussian(3, 0.1, limit=5), fs.Contact(keep="front"), fs.Event(), fs.Frame()):
        again = pickle.loads(pickle.dumps(one))
        assert type(again) is type(one) and again == one
    line = pickle.loads(pickle.dumps(fs.Polyline([[0, 0, 0], [1, 0, 0]], closed=True).shape))
    assert line.get_info().closed and line.get_triangles() is None
    content = line.get_info().content
    assert content == fs.shape_create_polyline(line.get_points(), True).get_info().content and len(content) == 2
    assert content != fs.shape_create_polyline(line.get_points(), False).get_info().content
    info = fs.ShapeInfo(content=content)
    assert info.content == content and info != fs.ShapeInfo() and f"content=({content[0]}, {content[1]})" in repr(info)
    with pytest.raises(fs.InvalidError, match="content has 1 numbers"):
        info.content = [1]
    with pytest.raises((fs.InvalidError, OverflowError, ValueError)):
        info.content = [1, -1]
    assert info.content == content
    with pytest.raises(TypeError):
        pickle.dumps(fs.Scene())


@pytest.mark.parametrize("made", ["fs.Scene()", "fs.Device()", "fs.Tool(fs.Scene())", "fs.Servo(fs.Scene())", "fs._core.Scene(fs.Scene())"])
def test_a_handle_is_not_copied_and_does_not_end_the_process(run, made):
    said = run(f"""
        import copy, pickle, forceserver as fs
        made = {made}
        calls = [lambda p=p: pickle.dumps(made, p) for p in range(pickle.HIGHEST_PROTOCOL + 1)]
        for call in [*calls, lambda: copy.copy(made), lambda: copy.deepcopy(made), lambda: copy.deepcopy([made]), made.__reduce__]:
            try: call()
            except TypeError as error: print(error)
        print(made.closed)
    """).splitlines()
    assert len(said) == 11 and said[-1] == "False" and all(": it is a handle of this process" in line for line in said[:-1])


def test_all_else_is_pickled_by_every_protocol():
    for made in (fs.Pose(position=(1, 2, 3)), fs.Point(front=fs.Gaussian(3, 0.1, limit=5)), fs.Custom("d", limit=1), fs.Fault.SPEED):
        for protocol in range(pickle.HIGHEST_PROTOCOL + 1):
            again = pickle.loads(pickle.dumps(made, protocol))
            assert type(again) is type(made) and repr(again) == repr(made)
    assert fs.Pose(position=(1, 2, 3)).__reduce__()[1][2]["position"].tolist() == [1, 2, 3]
    curve = copy.deepcopy(fs.curve_create_expression("1+d"))
    assert curve.get_expression() == "1+d"


def test_many_poses_at_once():
    moves = np.zeros(3, fs.Motion.dtype)
    moves["pose"]["orientation"][:, 0] = 1
    moves["twist"]["linear"] = [(1, 0, 0), (0, 2, 0), (0, 0, 3)]
    moves["horizon"] = 0.1
    poses = fs.motion_at(moves, 0.05)
    assert np.allclose(poses["position"], np.diag([0.05, 0.1, 0.15]))
    frame = fs.Frame(pose=fs.Pose(position=(0.1, 0, 0)), scale=2)
    there = fs.frame_to_device(frame, poses)
    assert np.allclose(there["position"], poses["position"] / 2 + [0.1, 0, 0])
    assert np.allclose(fs.frame_to_scene(frame, there)["position"], poses["position"])
    assert fs.frame_to_device(frame, fs.Pose(position=poses[1]["position"])).position[1] == 0.05
    moves["horizon"][1] = 7
    with pytest.raises(fs.InvalidError, match=r"motion\[1\]: motion.horizon is 7, must be within 0..0.1 s"):
        fs.motion_at(moves, 0.05)
