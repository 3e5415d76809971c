"""The rover's arm: what it reaches, and what the hand feels of it."""

from __future__ import annotations

import forceserver as fs
import mujoco  # type: ignore[import-untyped]
import numpy as np
import pytest
import shapely
from rig import Rig
from virtualrobot.arm import Arm, envelope_error, nearest
from virtualrobot.manipulator import arm_scale, home
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
    """N, of MuJoCo's contacts at the tip."""
    world, force = rig.world, np.zeros(6)
    total = 0.0
    for i in range(world.data.ncon):
        if world.model.geom("tip").id in world.data.contact[i].geom:
            mujoco.mj_contactForce(world.model, world.data, i, force)
            total += force[0]
    return total


def test_the_ground_pushes_as_in_the_physics(tmp_path):
    world = World()
    arm = Arm(world)
    begin = arm.to_world(np.array([0.7, -0.3, 0]))
    ground = arm.to_arm(np.array([*begin[:2], world.ground.height(*begin[:2])]))
    with Rig(tmp_path, rest_at(ground + [0, 0, 0.005], since=2), "arm") as rig:
        felt, contact = [], []
        for k, hand in enumerate(rig.run(7)):
            if k * period > 5:
                felt.append(np.linalg.norm(hand.response.wrench.force))  # N in the scene
                contact.append(pressed(rig))
        print(np.round(contact[::3], 1), np.round(felt[::3], 1))
        print(f"felt {np.mean(felt):.1f} N, in the physics {np.mean(contact):.1f} N; {rig.robot.ground_law}")
        assert 5 < np.mean(contact) < rig.robot.ground_law[1]
        assert np.mean(felt) == pytest.approx(np.mean(contact), rel=0.2)


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
    """Over the ground that stands, around the rocks and in the envelope."""
    from virtualrobot.manipulator import Manipulator

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
