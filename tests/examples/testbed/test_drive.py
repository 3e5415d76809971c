"""The rover in the modes drive and map."""

from __future__ import annotations

import math

import forceserver as fs
import numpy as np
import pytest
from rig import Rig, angle_between, hand_at
from virtualrobot.ground import BadTerrain, read_heights, terrain_file, width
from virtualrobot.recording import make_robot
from virtualrobot.robot import Changes, Robot, Trouble, limit, map_scale, period, stiffness, twist_between
from virtualrobot.world import World


def plane_of(scene: fs.Scene, time: float) -> tuple[np.ndarray, np.ndarray]:
    """Where the plane of the wheels is then, and its normal."""
    motions = scene.get_motions(None)
    (at,) = fs.motion_at(motions[motions["name"] == "wheels"], time)
    w, x, y, z = at["orientation"]
    return np.array(at["position"]), np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])


def to_right(world: World) -> np.ndarray:
    return -world.axes[:, 1]


def speed_of(world: World) -> float:
    """m/s, ahead."""
    return float(world.data.qvel[:3] @ world.axes[:, 0])


def test_the_plane_is_across_the_axles(tmp_path):
    path = [(0, 0, 0, 0), (1, 0.03, 0, 0), (5, 0.04, 0.01, 0), (10, 0.03, 0.03, 0), (15, -0.02, 0.03, 0), (20, 0, 0, 0)]
    with Rig(tmp_path, path, "drive") as rig:
        headings = []
        for _ in rig.run(20):
            position, normal = plane_of(rig.scene, rig.scene.time)
            assert angle_between(normal, to_right(rig.world)) < 0.1
            assert np.linalg.norm(position) == 0
            headings.append(rig.world.heading)
        assert np.ptp(np.unwrap(headings)) > 0.5 and rig.robot.driven > 3 and not rig.said


def test_what_the_hand_feels(tmp_path):
    """Nothing ahead or up, a spring to either side, 3 N at most; in the map around the rover."""
    with Rig(tmp_path, [(0, 0, 0, 0)], "map") as rig:
        for _ in rig.run(1):
            pass
        here, axes = rig.robot.parts["pose"][0], rig.world.axes
        for way, expected in ((axes[:, 0], 0), (axes[:, 2], 0), (axes[:, 1], 1)):
            for depth in (-0.04, -0.01, 0.005, 0.019, 0.03):  # m of the hand
                (force,) = rig.scene.evaluate([here + depth * map_scale * way], time=rig.scene.time)
                wanted = -math.copysign(min(stiffness * abs(depth), limit), depth) * expected
                assert force @ way == pytest.approx(wanted, abs=2e-3)
                assert np.linalg.norm(force - wanted * way) < 2e-3 + 1e-3 * abs(wanted)


def test_ten_goals():
    scene, world, random = fs.Scene(), World(), np.random.default_rng(2)
    robot = Robot(scene, world, "map")
    time = 0.0
    for _ in range(10):
        goal = [*(random.uniform(-0.8, 0.8, 2) * world.ground.half), 0]
        begin = time
        while np.linalg.norm(world.position[:2] - goal[:2]) > 0.5:
            time += period
            assert robot.frame(hand_at(goal, time), time) is None
            assert time - begin < 120
    assert robot.driven > 150


@pytest.mark.parametrize("left", [0.8, -1.67, 2.5])
def test_a_goal_at_the_side(left):
    """It lies within the tightest turn."""
    world = World()
    robot = Robot(fs.Scene(), world, "map")
    goal = world.position + left * world.axes[:, 1]
    places = [world.position]
    while np.linalg.norm((places[-1] - goal)[:2]) > 0.5:
        assert robot.frame(hand_at(goal, len(places) * period), len(places) * period) is None
        places.append(world.position)
        assert len(places) * period < 15
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() < 0.04  # the plane goes through it


@pytest.mark.parametrize("every", [period, 0.333])
def test_steps_of_force(tmp_path, every):
    """From one tick to the next the force hardly changes, also where frames come three times a second: the plane then stands after
    0.1 s, and goes on without a jump."""
    path = [(0, 0, 0, 0), (1, 0.03, 0.01, 0), (4, 0.04, 0.02, 0), (8, 0.03, -0.02, 0), (12, -0.02, 0.01, 0)]
    with Rig(tmp_path, path, "drive") as rig:
        steps = []
        for _ in rig.run(12, every):
            felt = rig.felt()
            steps.append(np.linalg.norm(np.diff(felt, axis=0), axis=1))
        step = np.concatenate(steps)
        print(f"steps of force per tick: p99.9 {np.quantile(step, 0.999):.4f} N, max {step.max():.4f} N")
        assert step.max() < 0.05


def test_two_runs_have_the_same_bits(tmp_path):
    """Hand, servo and physics in one process, in virtual time."""

    def run() -> tuple[bytes, bytes]:
        with Rig(tmp_path, [(0, 0, 0, 0), (1, 0.03, 0.01, 0), (4, 0.04, -0.02, 0)], "drive") as rig:
            felt = [rig.felt().tobytes() for _ in rig.run(4)]
            return b"".join(felt), rig.world.data.qpos.tobytes()

    assert run() == run()


@pytest.mark.parametrize("flags", [0, fs.StateFlags.READY | fs.StateFlags.CLUTCHED])
def test_without_a_hand_it_stops(flags):
    world = World()
    robot = Robot(fs.Scene(), world, "drive")
    for k in range(100):
        robot.frame(hand_at([1, 0, 0], (k + 1) * period), (k + 1) * period)
    assert speed_of(world) > 0.6
    for k in range(5):  # 0.2 s
        robot.frame(hand_at([1, 0, 0], 4.04 + k * period, flags=flags), 4.04 + k * period)
    assert abs(speed_of(world)) < 0.1


def test_a_hand_that_is_not_heard_of():
    """A server that hangs gives the last place of the hand for ever."""
    world = World()
    robot = Robot(fs.Scene(), world, "drive")
    for k in range(100):
        robot.frame(hand_at([1, 0, 0], (k + 1) * period), (k + 1) * period)
    said = [robot.frame(hand_at([1, 0, 0], 4.0), 4.0 + (k + 1) * period) for k in range(8)]
    assert abs(speed_of(world)) < 0.1
    said.append(robot.frame(hand_at([0, 0, 0], 5.0), 5.0))
    assert [text for text in said if text] == ["it stands: nothing is heard of the hand", "the hand is there again"]


def test_a_force_fades_by_time():
    """Also where frames come three times a second."""
    robot = Robot(fs.Scene(), World(), "map")
    robot.frame(hand_at([8, 0, 0], 1), 1)
    robot.world.data.qpos[3:7] = [0, 1, 0, 0]
    times = [1 + k / 3 for k in range(1, 7)]
    said = [(time, text) for time in times if (text := robot.frame(hand_at([8, 0, 0], time), time))]
    assert said[0][1] == "the rover has tipped over" and "put back" in said[1][1]
    assert said[1][0] - said[0][0] < 0.7


def test_it_stands_where_it_is_put():
    world, random = World(), np.random.default_rng(6)
    for x, y in random.uniform(-0.9, 0.9, (30, 2)) * world.ground.half:
        world.put(x, y, random.uniform(-3, 3))
        assert world.axes[2, 2] > 0.8 and np.linalg.norm(world.position[:2] - [x, y]) < 0.7


def test_speed_changes_alike_in_both_directions():
    for sign in (1, -1):
        robot = Robot(fs.Scene(), World(), "drive")
        ahead = robot.world.axes[:, 0]
        speeds = []
        for k in range(60):
            robot.frame(hand_at(np.array([1.0 if k < 40 else -1.0]) * sign * ahead, (k + 1) * period), (k + 1) * period)
            speeds.append(sign * robot.wish.speed)
        step = np.diff([0, *speeds])
        assert step[:20] == pytest.approx([0.04] * 20) and step.min() == pytest.approx(-0.2)
        assert 0.0 in np.round(speeds[40:], 9)  # it stands before it goes the other way


@pytest.mark.parametrize("place", [(-18, 24), (0, -4), (21, 23)])
def test_it_stands_on_a_slope(place):
    world = World()
    world.put(*place, 1.0)
    world.step(500)
    begin = world.position
    assert world.axes[2, 2] < 0.995
    world.step(5000)  # 10 s
    assert np.linalg.norm(world.position - begin) < 5e-3


def test_a_hand_that_jumps_turns_nothing_over():
    world, random = World(), np.random.default_rng(5)
    robot = Robot(fs.Scene(), world, "drive")
    for k in range(500):
        robot.frame(hand_at(random.uniform(-2, 2, 3), (k + 1) * period), (k + 1) * period)
        assert world.axes[2, 2] > 0.6


def in_trouble(robot: Robot, hand: list[float], patience: float) -> list[str]:
    """What is said until the rover has been put back, and then has its full force again."""
    said = []
    for k in range(round(patience / period)):
        strength = robot.strength
        text = robot.frame(hand_at(hand, (k + 1) * period), (k + 1) * period)
        assert abs(robot.strength - strength) < 0.1
        if text:
            said.append(text)
        if len(said) == 2 and robot.strength == 1:
            return said
    raise AssertionError(f"it is not put back: {said}")


def test_on_its_back():
    world = World()
    robot = Robot(fs.Scene(), world, "map")
    for k in range(300):
        robot.frame(hand_at([8, 0, 0], (k + 1) * period), (k + 1) * period)
    world.data.qpos[3:7] = [0, 1, 0, 0]
    world.data.qpos[2] += 0.3
    said = in_trouble(robot, [8, 0, 0], 5)
    assert said[0] == "the rover has tipped over" and "put back" in said[1]
    assert world.axes[2, 2] > 0.9 and robot.scene["wheels"].front.limit == limit


def test_at_the_edge():
    """It is put back again and again, and says so once until it has moved freely. A goal off the map is sought on the map."""
    world = World()
    world.put(width / 2 - 8, 0, 0)
    robot = Robot(fs.Scene(), world, "drive")
    said = in_trouble(robot, [1, 0, 0], 30)
    assert said[0] == "the rover is at the edge of the map" and abs(world.position[0]) < width / 2 - 1
    times = 30 + period * np.arange(1000)
    assert not [text for time in times if (text := robot.frame(hand_at([1, 0, 0], time), time))]
    world.put(0, 0, 0)
    assert in_trouble(robot, [1, 0, 0], 60)[0] == said[0]
    world.put(width / 2 - 3, 0, 0)
    robot = Robot(fs.Scene(), world, "map")
    assert not [text for k in range(500) if (text := robot.frame(hand_at([width, 0, 0], k * period), k * period))]
    assert world.position[0] == pytest.approx(width / 2 - 1.5, abs=0.5)


def test_with_weak_motors():
    world = World()
    robot = Robot(fs.Scene(), world, "map")
    for name in ("front left", "middle left", "rear left", "front right", "middle right", "rear right"):
        world.model.actuator(f"drive {name}").forcerange[:] = [-1, 1]
    said = in_trouble(robot, [20, 0, 0], 30)
    assert said[0] == "the rover is stuck"


@pytest.mark.parametrize("mode", ["map", "arm"])
def test_it_goes_on_where_others_spoil_its_objects(mode):
    """One is gone, and one is now such that it cannot be changed as before: that is told once. The others move on."""
    scene, world = fs.Scene(), World()
    robot = make_robot(scene, world, mode)
    removed, spoilt = ("elbow", "wheels") if mode == "map" else ("envelope", "ground")
    del scene[removed]
    none = {"back": fs.Profile(), "shape": None, "contact": fs.Contact()}
    scene[spoilt].change(primitive=fs.Primitive.POINT, front=fs.Constant(1, limit=1), **none)
    said = []
    for k in range(60):
        if mode == "map" and k == 20:
            robot.trouble = Trouble("a trial", 2.0)  # its force fades
        hand = hand_at([3, 0, 0] if mode == "map" else [0.6, 0.01 * k, 0.1], time := (k + 1) * period)
        said += [text for text in [robot.frame(hand, time)] if text]
    assert len([text for text in said if f"'{spoilt}'" in text]) == 1, said
    motions = scene.get_motions(None)
    assert motions[motions["name"] == "tip"]["time"] == time


def test_a_failure_is_told_once_until_it_works_again():
    """A server that hangs for a while. One that is gone ends the program."""
    changes = Changes(fs.Scene())

    def fail() -> None:
        raise fs.TimeoutError("it hangs")

    assert not changes.attempt("a", fail) and not changes.attempt("a", fail)
    assert (changes.tell(), changes.tell()) == ("it hangs", None)
    assert changes.attempt("a", lambda: None) and not changes.attempt("a", fail) and changes.tell() == "it hangs"

    def end() -> None:
        raise fs.DisconnectedError("it is gone")

    with pytest.raises(ConnectionError):
        changes.attempt("a", end)


def test_twist_between_leads_there():
    random = np.random.default_rng(1)
    for _ in range(100):
        a, b = ((random.normal(size=3), (q := random.normal(size=4)) / np.linalg.norm(q)) for _ in range(2))
        b = (b[0], (c := a[1] + 0.1 * (b[1] - a[1])) / np.linalg.norm(c))
        one = np.zeros(1, fs.Motion.dtype)
        one["pose"] = (tuple(a[0]), tuple(a[1]))
        twist = twist_between(a, (b[0], -b[1]))
        one["twist"] = (tuple(twist.linear), tuple(twist.angular))
        one["time"], one["horizon"] = 1, 0.1
        (at,) = fs.motion_at(one, 1 + period)
        assert np.allclose(at["position"], b[0])
        q = np.array(at["orientation"])
        assert min(np.abs(q - b[1]).max(), np.abs(q + b[1]).max()) < 1e-9


def test_terrain_files(tmp_path):
    heights, slenderness = read_heights(terrain_file)
    assert heights.shape == (344, 403) and heights.min() == 0 and heights.max() == 1 and 1.0 < slenderness < 1.1
    head = "ncols 3\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 0.001\nNODATA_value -9999\n"
    for text, word in ((head + "1 2 3\n4 5", "5 heights"), (head + "1 2 3 4 -9999 6", "column 1, row 1"), ("ncols 3\n1 2 3", "nrows"),
                       (head + "1 2 3 4 x 6", "could not convert"), (head + "1 2 3 4 nan 6", "not known"), ("", "no ")):  # fmt: skip
        file = tmp_path / "short.asc"
        file.write_text(text)
        with pytest.raises(BadTerrain, match=word):
            read_heights(file)
    for old, new, word in (("ncols 3", "ncols nan", "ncols is nan"), ("ncols 3", "ncols inf", "ncols is inf"), ("ncols 3", "ncols 2.5", "whole"),
                           ("yllcorner 0", "yllcorner 4000000", "latitudes"), ("cellsize 0.001", "cellsize -1", "latitudes"),
                           ("yllcorner 0", "yllcorner 89.99", "latitudes")):  # fmt: skip
        file.write_text(head.replace(old, new) + "1 2 3 4 5 6")
        with pytest.raises(BadTerrain, match=word):
            read_heights(file)
    file.write_text(head + "1 2 3 4 1e308 -1e308")
    with pytest.raises(BadTerrain, match="too far apart"):
        read_heights(file)
    with pytest.raises(BadTerrain, match="No such file"):
        read_heights(tmp_path / "none.asc")


def test_heights_are_those_of_the_physics():
    import mujoco

    world, random = World(), np.random.default_rng(1)
    geom = np.zeros(1, np.int32)
    points, triangles = world.ground.mesh()
    normals = np.cross(points[triangles[:, 1]] - points[triangles[:, 0]], points[triangles[:, 2]] - points[triangles[:, 0]])
    assert (normals[:, 2] > 0).all()
    seen = 0
    for x, y in random.uniform(-1, 1, (300, 2)) * world.ground.half:
        depth = mujoco.mj_ray(world.model, world.data, [x, y, 50], [0, 0, -1], None, 1, world.rover, geom)
        if world.model.geom(geom[0]).name == "ground":
            assert world.ground.height(x, y) == pytest.approx(50 - depth, abs=1e-6)
            seen += 1
    assert seen > 250
