"""The rover's arm: what it reaches, and what the hand feels of it."""

from __future__ import annotations

import forceserver as fs
import mujoco  # type: ignore[import-untyped]
import numpy as np
import pytest
import shapely
from rig import Rig
from virtualrobot.arm import Arm, envelope_error, nearest
from virtualrobot.manipulator import Manipulator, arm_scale, home
from virtualrobot.robot import period
from virtualrobot.world import World


def at_device(place) -> np.ndarray:
    """Of a place in the arm's axes."""
    return (np.asarray(place) - home) / arm_scale


def rest_at(place, *, since: float = 1.0) -> list[tuple[float, float, float, float]]:
    x, y, z = at_device(place)
    return [(0, 0, 0, 0), (since, x, y, z)]


@pytest.fixture(scope="module")
def arm() -> Arm:
    return Arm(World())


def test_jacobian_and_joints(arm):
    random = np.random.default_rng(1)
    outline = arm.outline()
    for _ in range(20):
        q = random.uniform(*arm.range.T)
        by_difference = np.stack([(arm.tip_of(q + d) - arm.tip_of(q - d)) / 2e-6 for d in 1e-6 * np.eye(4)], axis=1)
        assert np.allclose(arm.jacobian_of(q), by_difference, atol=1e-8)
    inner = outline.buffer(-0.005)
    for _ in range(200):
        while not inner.contains(shapely.Point(p := random.uniform([nearest, -1.1], [1.1, 1.1]))):
            pass
        azimuth = random.uniform(-1.5, 1.5)
        place = np.array([p[0] * np.cos(azimuth), p[0] * np.sin(azimuth), p[1]])
        q = arm.solve(place)
        assert (q >= arm.range[:, 0]).all() and (q <= arm.range[:, 1]).all()
        assert np.linalg.norm(arm.tip_of(q) - place) < 1e-3


def test_outline(arm):
    """Each place of the tip is in it, and near each part of its border there is one."""
    random = np.random.default_rng(2)
    outline = arm.outline()
    low, high = arm.range[1:].T
    joints = random.uniform(low, high, (400_000, 3))
    ends = random.integers(0, 2, joints.shape) * (high - low) + low
    at_end = random.random(joints.shape) < 0.5
    joints = np.where(at_end, ends, joints)  # the border is where joints are at their ends, or the chain is straight
    joints[::3, 1:] *= random.random((len(joints[::3]), 1)) < 0.5
    joints = np.clip(joints, low, high)
    angle = np.cumsum(joints, axis=1)
    tips = np.stack([np.cos(angle) @ arm.lengths, -np.sin(angle) @ arm.lengths], axis=1)
    tips = tips[tips[:, 0] > nearest]
    points = shapely.points(tips)
    assert shapely.distance(outline, points).max() < envelope_error
    border = [outline.exterior.interpolate(part, normalized=True) for part in np.linspace(0, 1, 500)]
    tree = shapely.STRtree(points)
    away = np.array([points[tree.nearest(place)].distance(place) for place in border if place.x > nearest + 0.01])
    assert np.quantile(away, 0.9) < 0.01, np.quantile(away, [0.5, 0.9, 1])


def test_envelope_is_closed(arm):
    points, triangles = arm.envelope()
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    assert len(np.unique(edges, axis=0)) == len(edges)  # each once in each direction
    assert {*map(tuple, edges)} == {*map(tuple, edges[:, ::-1])}
    volume = np.einsum("ij,ij->", points[triangles[:, 0]], np.cross(points[triangles[:, 1]], points[triangles[:, 2]])) / 6
    assert volume > 1


@pytest.mark.parametrize("place", [(0.6, 0.0, 0.1), (0.5, 0.5, 0.2), (0.3, -0.4, 0.5), (0.9, 0.2, -0.05)])
def test_the_tip_comes_to_the_hand(tmp_path, place):
    with Rig(tmp_path, rest_at(place), "arm") as rig:
        for hand in rig.run(4):
            pass
        reached = np.asarray(hand.state.pose.position)
        assert np.linalg.norm(reached - place) < 0.05
        assert np.linalg.norm(rig.robot.arm.place - reached) < 2e-3


@pytest.mark.parametrize("place", [(1.6, 0.3, 0.4), (0.4, 0.2, 1.5), (-0.3, 0.9, 0.3)])
def test_the_hand_out_of_reach(tmp_path, place):
    """It is drawn back; the tip waits at the envelope, and both come together again."""
    out = at_device(place)
    back = at_device((0.6, 0.1, 0.2))
    path = [(0, *at_device((0.6, 0.1, 0.2))), (1, *at_device((0.6, 0.1, 0.2))), (2, *out), (5, *out), (6, *back)]
    with Rig(tmp_path, path, "arm") as rig:
        steps = []
        for hand in rig.run(8):
            steps.append(np.abs(np.diff(np.linalg.norm(rig.felt(), axis=1))).max())
            if abs(rig.scene.time - 4.9) < 0.03:
                state, proxy = np.asarray(hand.state.pose.position), np.asarray(hand.response.proxy.position)
                assert np.linalg.norm(hand.response.wrench.force) > 5
                assert np.linalg.norm(state - proxy) > 0.02
                assert np.linalg.norm(rig.robot.arm.place - proxy) < 5e-3
        assert np.linalg.norm(rig.robot.arm.place - np.asarray(hand.state.pose.position)) < 2e-3
        assert max(steps) < 0.05, max(steps)


def pressed(rig: Rig) -> float:
    """N, of MuJoCo's contacts of the tip with the ground."""
    world, force = rig.world, np.zeros(6)
    pair = {world.model.geom("tip").id, world.model.geom("ground").id}
    total = 0.0
    for i in range(world.data.ncon):
        if pair == set(world.data.contact[i].geom):
            mujoco.mj_contactForce(world.model, world.data, i, force)
            total += force[0]
    return total


places = [(-8, 5, 0.5), (12, -9, 2.0), (5, 14, -1.0), (-15, -12, 1.5), (20, 3, 0.0)]  # m, m, rad: of a rover, away from the rocks


@pytest.mark.parametrize("place", places)
def test_the_ground_pushes_as_in_the_physics(tmp_path, place):
    world = World()
    world.put(*place)
    for x, y in ((0.7, -0.3), (0.65, 0.2)):
        path = rest_at(Arm(world).ground_below(x, y) + [0, 0, 0.003], since=2)
        with Rig(tmp_path, path, "arm", place=place) as rig:
            felt, contact = [], []
            for k, hand in enumerate(rig.run(6)):
                if k * period > 4:
                    felt.append(np.linalg.norm(hand.response.wrench.force))  # N in the scene
                    contact.append(pressed(rig))
            assert 5 < np.mean(contact) < rig.robot.law[1]
            assert np.mean(felt) == pytest.approx(np.mean(contact), rel=0.2), (felt[-1], contact[-1])


def test_nothing_is_felt_above_the_ground(tmp_path):
    """The hand comes quickly to a place just above it, and leads the tip by much."""
    place = places[0]
    world = World()
    world.put(*place)
    above = Arm(world).ground_below(0.75, -0.1) + [0, 0, 0.1]
    path = [(0, *at_device((0.6, 0.3, 0.1))), (2, *at_device((0.6, 0.3, 0.1))), (2.4, *at_device(above)), (4, *at_device(above))]
    with Rig(tmp_path, path, "arm", place=place) as rig:
        for hand in rig.run(4):
            x, y, z = rig.robot.arm.to_world(np.asarray(hand.state.pose.position))
            is_above = z > world.ground.height(x, y) + 0.03
            assert np.linalg.norm(hand.response.wrench.force) < 0.01 or not is_above
        assert is_above


@pytest.mark.parametrize("seconds", [0.8, 3.2, 6.4])
def test_laps_over_the_ground_give_no_energy(tmp_path, seconds):
    """The hand goes round and round through the ground; the arm has another stiffness at each place."""
    place = places[1]
    world = World()
    world.put(*place)
    middle = (Arm(world).ground_below(0.7, 0.0) + [0, 0, 0.02] - home) / arm_scale
    random = np.random.default_rng(8)
    for _ in range(3):
        t = np.linspace(0, 1, round(seconds / 0.02), endpoint=False)
        lap = np.stack([a * np.sin(2 * np.pi * t + p) for a, p in zip((0.012, 0.012, 0.006), random.uniform(0, 6, 3), strict=True)], axis=1)
        times = 3 + np.arange(0, 6 * seconds, 0.02)
        path = [(0, *middle), *[(round(float(when), 4), *(middle + lap[i % len(lap)])) for i, when in enumerate(times)]]
        with Rig(tmp_path, path, "arm", place=place) as rig:
            hands, forces = [], []
            for _ in rig.run(3 + 5 * seconds):
                hands.append(np.asarray(rig.scene.get_record(rig.last)["tick"]["state"]["pose"]["position"]).reshape(-1, 3))
                forces.append(rig.felt())
        x, f = np.concatenate(hands), np.concatenate(forces)
        begin = 3000 + round(2000 * seconds)  # two laps to settle
        work = np.einsum("ij,ij->i", (f[begin:-1] + f[begin + 1 :]) / 2, np.diff(x[begin:], axis=0))
        assert np.abs(work).sum() > 0.01  # J: it was in the ground
        assert work.sum() < 0.003 * np.abs(work).sum(), (work.sum(), np.abs(work).sum())


def test_a_rock_is_felt_where_the_tip_touches_it():
    """The tip is a ball: its middle comes no nearer than its radius."""
    scene, world = fs.Scene(), World()
    manipulator = Manipulator(scene, world)
    for i in world.rocks[:3]:
        points, triangles = world.rock(i)
        a, b, c = (points[triangles[:, k]] for k in range(3))
        n = np.cross(b - a, c - a)
        n /= np.linalg.norm(n, axis=1)[:, None]
        on_top = n[:, 2] > 0.5
        for above, is_felt in ((0.017, True), (0.023, False)):
            places = [manipulator.arm.to_arm(place) for place in ((a + b + c) / 3 + above * n)[on_top]]
            forces = scene.evaluate(places, name=world.model.geom(i).name)
            assert ((np.linalg.norm(forces, axis=1) > 0) == is_felt).all()


def test_a_rock_is_solid(tmp_path):
    with Rig(tmp_path, rest_at((0.6, 0, 0)), "arm") as rig:
        rock = rig.robot.places["rock 1"][0]
    above, inside = rock + [0, 0, 0.35], rock + [0, 0, 0.05]
    path = [(0, *at_device((0.6, 0, 0))), (1, *at_device(above)), (3, *at_device(inside)), (6, *at_device(above)), (7, *at_device(above))]
    with Rig(tmp_path, path, "arm") as rig:
        felt, steps = 0.0, []
        for hand in rig.run(7):
            steps.append(np.abs(np.diff(np.linalg.norm(rig.felt(), axis=1))).max())
            felt = max(felt, hand.response.wrench.force[2])
        assert felt > 5 and max(steps) < 0.05
        assert np.linalg.norm(hand.response.wrench.force) < 0.01


def test_no_energy_of_a_closed_path():
    """Over the ground, while the rover stands."""
    world = World()
    scene = fs.Scene()
    Manipulator(scene, world)
    random = np.random.default_rng(4)
    for _ in range(5):
        t = np.linspace(0, 2 * np.pi, 20001)
        a = random.normal(size=(2, 3)) * [0.2, 0.2, 0.15]
        path = np.array([0.8, 0, -0.55]) + np.outer(np.cos(t), a[0]) + np.outer(np.sin(2 * t), a[1])
        force = scene.evaluate(path, name="ground")
        work = np.einsum("ij,ij->", (force[1:] + force[:-1]) / 2, np.diff(path, axis=0))
        assert abs(work) < 1e-6 * (1 + np.abs(force).max())
