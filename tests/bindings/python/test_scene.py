"""The facade: scenes as mappings, groups, servos, servers and events."""

import contextlib
import os
import threading
import time
from collections.abc import MutableMapping

import numpy as np
import pytest

import forceserver as fs

ENDPOINT = f"shm:python-{os.getpid()}"


@pytest.fixture
def server(scene):
    with fs.Servo(scene, fs.Device("sim:")) as servo, fs.Server(servo, ENDPOINT, max_objects=100):
        yield servo


def test_a_scene_is_a_mapping(scene, spring):
    assert isinstance(scene, MutableMapping) and len(scene) == 0 and "a" not in scene and bool(scene)
    scene["a"] = spring
    assert spring.name == ""  # what is given stays as it is
    scene["b"] = scene["a"]
    assert sorted(scene) == sorted(scene.keys()) == ["a", "b"] and len(scene) == 2 and "a" in scene and 3 not in scene
    assert sorted(name for name, _ in scene.items()) == ["a", "b"] and scene["b"].object.front.gain == 200
    assert scene.get("c") is None and scene.get("a").name == "a" and len(scene.values()) == 2
    for missing in (
        lambda: scene["c"],
        lambda: scene.__delitem__("c"),
        lambda: scene["a"].scene["d"].move(position=(0, 0, 0)),
    ):
        with pytest.raises(KeyError):
            missing()
    del scene["a"]
    assert list(scene) == ["b"] and "1 object>" in repr(scene)
    scene.update({"c": spring, "d": spring})
    with pytest.raises(fs.InvalidError), scene.change():
        scene.update({"e": spring, "/": spring})
    assert sorted(scene) == ["b", "c", "d"]
    with pytest.raises(fs.InvalidError):
        scene["x" * 64] = spring
    for wrong in (3, None, fs.Constant(1, limit=1)):
        with pytest.raises(TypeError, match="a scene holds Objects"):
            scene["a"] = wrong


def test_move_and_change(scene, spring):
    scene["a"] = spring
    one = scene["a"]
    one.move(position=(1, 2, 3))
    one.move(orientation=(0, 1, 0, 0))
    assert one.object.pose.position.tolist() == [1, 2, 3] and one.object.pose.orientation.tolist() == [0, 1, 0, 0]
    one.move((4, 5, 6), (1, 0, 0, 0), twist=fs.Twist(linear=(1, 0, 0)))
    assert one.object.twist.linear.tolist() == [1, 0, 0]
    one.change(front=fs.Gaussian(3, 0.1, limit=4), enabled=False)
    assert one.object.front.kind is fs.ProfileKind.GAUSSIAN and not one.object.enabled
    assert one.object.pose.position.tolist() == [4, 5, 6]
    one.change(position=(0, 0, 0))
    assert one.object.pose.position.tolist() == [0, 0, 0]
    with pytest.raises(TypeError):
        one.change(name="b")
    with pytest.raises(fs.InvalidError):
        one.change(front=fs.Gaussian(-3, 0.1, limit=4))
    assert one.object.front.gain == 3 and "a" in repr(one)
    one.remove()
    assert not list(scene)


def test_progress_of_a_build():
    side = np.linspace(0, 1, 200)
    x, y = np.meshgrid(side, side)
    points = np.stack([x, y, 0.1 * np.sin(9 * x)], -1).reshape(-1, 3)
    corner = np.arange(200 * 199).reshape(199, 200)[:, :-1].reshape(-1, 1)
    shape = fs.Mesh(points, np.concatenate([corner + [0, 1, 200], corner + [1, 201, 200]])).shape
    assert shape.get_progress() == 0
    builder = threading.Thread(target=shape.build)
    builder.start()
    seen = [0]
    while seen[-1] < 1:
        seen.append(shape.get_progress())
    builder.join()
    assert seen == sorted(seen) and shape.get_info().built


def test_every_kind_of_object(scene, tmp_path):
    front = fs.LinearIncreasing(100, limit=3)
    scene["point"] = fs.Point(position=(1, 0, 0), front=front, lifetime=3, tool_points=1, enabled=True)
    scene["line"] = fs.Polyline([[0, 0, 0], [1, 0, 0], [1, 1, 0]], closed=True, front=front)
    scene["plane"] = fs.Plane(position=(0, 0, 1), normal=(0, 2, 0), front=front, back=front)
    scene["mesh"] = fs.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], front=front)
    scene["again"] = fs.Mesh(scene["mesh"].object.shape, front=front)
    scene["wall"] = fs.Wall((0, 0, 0), (0, 0, 1), 500, 10)
    assert scene["line"].object.shape.get_info().closed
    assert np.allclose(fs.intensity(scene["wall"].object.back, [0.01]), [5])
    scene.save(tmp_path / "room.json")
    with fs.Scene() as other:
        other.load(tmp_path / "room.json")
        assert sorted(other) == sorted(scene)
        p = np.random.default_rng(3).uniform(-1, 1, (100, 3))
        assert (other.evaluate(p) == scene.evaluate(p)).all()
    assert fs.Mesh(next(tmp_path.glob("*.ply"))).shape.get_info().primitive is fs.Primitive.MESH
    with pytest.raises(fs.NotFoundError):
        scene.load(tmp_path / "nix.json")
    for wrong in (
        lambda: fs.Mesh([[0, 0, 0]]),
        lambda: fs.Plane(normal=(0, 0, 1), orientation=(1, 0, 0, 0)),
        lambda: fs.Point(nix=3),
        lambda: fs.Polyline(None),
    ):
        with pytest.raises((TypeError, AttributeError)):
            wrong()


def test_a_group_is_felt_as_a_whole_or_not(scene, spring):
    scene["a"] = spring
    with scene.change():
        scene["b"] = spring
        del scene["a"]
        assert list(scene) == ["b"]
    assert list(scene) == ["b"]
    for error in (ZeroDivisionError, KeyboardInterrupt):
        with pytest.raises(error), scene.change():
            scene["c"] = spring
            del scene["b"]
            raise error
        assert list(scene) == ["b"] and scene["b"].object.front.gain == 200
    with scene.change():
        with pytest.raises(fs.StateError), scene.change():
            pass
        scene["d"] = spring  # the outer group is still open
    assert sorted(scene) == ["b", "d"]
    with pytest.raises(fs.StateError):
        scene.commit()
    with scene.change(), pytest.raises(fs.InvalidError):
        scene["/"] = spring
    scene["e"] = spring


def test_changes_of_other_threads_go_past_the_group(scene, spring):
    seen = []

    def other():
        seen.extend(scene)
        scene["other"] = spring

    with pytest.raises(ZeroDivisionError), scene.change():
        scene["mine"] = spring
        thread = threading.Thread(target=other)
        thread.start()
        thread.join()
        assert sorted(scene) == ["mine", "other"]
        raise ZeroDivisionError
    assert seen == [] and list(scene) == ["other"]


def test_each_thread_has_a_group_of_its_own(scene, spring):
    def work(number):
        for i in range(50):
            with contextlib.suppress(ZeroDivisionError):
                with scene.change():
                    scene[f"{number}"] = spring
                    scene[f"{number} too"] = spring
                    if i % 2:
                        raise ZeroDivisionError
                with scene.change():
                    del scene[f"{number}"], scene[f"{number} too"]

    with scene.change():  # it is open all the while
        scene["mine"] = spring
        threads = [threading.Thread(target=work, args=(n,)) for n in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert list(scene) == ["mine"]


def test_threads_that_evaluate_and_edit_at_once(scene, spring):
    scene["spring"] = spring
    errors, stop = [], threading.Event()
    states = np.zeros(500, fs.State.dtype)
    states["pose"]["position"][:, 0] = 0.01
    shared = fs.Tool(scene)
    kept = fs.State(pose=fs.Pose(position=(0.01, 0, 0)))

    def guarded(work):
        def loop():
            try:
                while not stop.is_set():
                    work()
            except BaseException as error:
                errors.append(error)

        return threading.Thread(target=loop)

    def evaluate():
        force = shared.evaluate(states)["wrench"]["force"][:, 0]
        assert np.isin(np.round(force, 9), (-2, -1)).all()

    def evaluate_one():
        assert round(shared.evaluate(kept).wrench.force[0], 9) in (-2, -1)

    def edit():
        scene["spring"].change(front=fs.LinearIncreasing(100, limit=5))
        with scene.change():
            scene["spring"].change(front=fs.LinearIncreasing(200, limit=5))
        scene["more"] = fs.Mesh([[9, 0, 0], [9, 1, 0], [9, 0, 1]], [[0, 1, 2]])
        scene.get_reports(), scene.keys()

    threads = [
        guarded(work)
        for work in (evaluate, evaluate, evaluate_one, edit, edit, lambda: scene.evaluate(np.zeros((100, 3))))
    ]
    for thread in threads:
        thread.start()
    time.sleep(1.5)
    stop.set()
    for thread in threads:
        thread.join()
    assert errors == []


def test_lists_with_names_of_all_kinds(scene, spring):
    names = ["a", "ü" * 15, "x" * 63, "力", "b c", "🙂"]
    for name in names:
        scene[name] = spring
    assert scene.get_motions().name.tolist() == names
    reports = scene.get_reports()
    assert reports.name.tolist() == names and (reports.primitive == fs.Primitive.POINT).all()
    assert reports[3].name == "力" and reports.wrench.force.shape == (6, 3)


def test_servo_in_virtual_time(scene, spring):
    scene["spring"] = spring
    with fs.Servo(scene, fs.Device("sim:?path=figure8"), mode="virtual", force_limit=3) as servo:
        servo.step(1000)
        assert servo.stats.ticks == 1000 and servo.stats.rate == 1000
        record = servo.record
        assert record.dtype == fs.Tick.dtype and len(record) == 1000
        assert (np.linalg.norm(record["sent"]["force"], axis=1) <= 3 + 1e-9).all() and record["sent"]["force"].any()
        same = scene.get_record(0)
        assert same.dtype == fs.RecordedTick.dtype and (same["tick"] == record).all()
        assert scene.get_record(997)["number"].tolist() == [998, 999, 1000] and len(scene.get_record(1000)) == 0
        hand = scene.hand()
        assert (hand.sent.force == record["sent"]["force"][-1]).all() and hand.state.time > 0
        with pytest.raises(fs.StateError):
            fs.Servo(scene, fs.Device("sim:"))
        servo.set_enabled(False)
        servo.step(2)
        assert not scene.hand().sent.force.any()
        with pytest.raises(fs.TimeoutError, match="0.3 s"):
            scene["more"] = spring
            scene.sync(0.3)
    with pytest.raises(fs.StateError):
        servo.step(1)
    with pytest.raises(TypeError):
        fs.Servo(scene, mode="virtual", nix=3)
    with pytest.raises(fs.InvalidError):
        fs.Servo(scene, rate=-1)
    with pytest.raises(ValueError):
        fs.Servo(scene, mode="nix")


def test_events(scene, spring):
    assert list(scene.events(timeout=0)) == []
    start = time.monotonic()
    assert list(scene.events(timeout=0.25)) == [] and time.monotonic() - start >= 0.25
    spring.lifetime = 0.05
    scene["brief"] = spring
    with fs.Servo(scene):
        event = next(event for event in scene.events(timeout=30) if event.kind == fs.EventKind.EXPIRED)
    assert event.name == "brief"
    for wrong in (-1, float("nan")):
        with pytest.raises(fs.InvalidError):
            scene.next_event(wrong)


def test_clients(server, spring):
    with fs.connect(ENDPOINT, "rover") as rover, fs.connect(ENDPOINT, "editor") as editor:
        with rover.change():
            rover["rock"] = spring
            rover["path"] = fs.Polyline([[0, 0, 0], [1, 0, 0]], front=fs.Constant(1, limit=1))
        rover.sync(5)
        assert sorted(rover) == ["path", "rock"] and list(editor) == [] and "rover/rock" in editor
        assert editor.get_clients()["name"].tolist() == ["server", "rover", "editor"]
        rover.frame = fs.Frame(scale=3, force_scale=0.5)
        rover.sync(5)
        views = editor.get_views()
        assert views.name.tolist() == ["server", "rover", "editor"]
        assert views["view"].frame.scale.tolist() == [1, 3, 1]  # views.view is NumPy's method
        assert views[1]["view"].frame.force_scale == editor.get_view("rover").frame.force_scale == 0.5
        assert views["view"].points.shape == (3, 32, 3) and views["view"].point_count.tolist() == [1, 1, 1]
        editor["rover/rock"].change(front=fs.LinearIncreasing(77, limit=5))
        assert next(event for event in rover.events(timeout=30) if event.kind == fs.EventKind.EDITED).text
        rover.sync(5)
        assert rover["rock"].object.front.gain == 77
        assert (fs.Tool(rover).evaluate(fs.State(pose=fs.Pose(position=(0.01, 0, 0)))).wrench.force[0]) < 0
        with pytest.raises(ZeroDivisionError), rover.change():
            rover["c"] = spring
            raise ZeroDivisionError
        assert sorted(rover) == ["path", "rock"]
        with pytest.raises(fs.ExistsError):
            fs.connect(ENDPOINT, "rover")
        with pytest.raises(fs.FullError):
            for i in range(200):
                rover[f"{i}"] = spring
        server.close()
        with pytest.raises(fs.DisconnectedError):
            rover.sync(5), rover.get_reports()
    with pytest.raises(fs.NotFoundError):
        fs.connect(ENDPOINT, "rover")


def test_connect_waits_for_a_server(scene):
    start = time.monotonic()
    with pytest.raises(fs.Error):
        fs.connect(ENDPOINT + "b?timeout=0.3", "rover")
    assert time.monotonic() - start >= 0.3
    servo, servers = fs.Servo(scene), []
    thread = threading.Timer(0.3, lambda: servers.append(fs.Server(servo, ENDPOINT + "b")))
    thread.start()
    with fs.connect(ENDPOINT + "b?timeout=30", "rover") as rover:
        assert len(rover.get_clients()) == 2
    thread.join()
    servers[0].close()
    servo.close()


def test_plot():
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    axes = fs.plot(fs.Gaussian(3, 0.02, limit=2))
    assert axes.lines[0].get_ydata().max() == 2
    with fs.Scene() as scene:
        scene["a"] = fs.Point(front=fs.Constant(1, limit=1))
        assert fs.plot(scene).collections
