"""The arm as force-objects: its tip follows the hand, which feels how far it reaches, the ground and the rocks.

The scene is in the axes of the rover, with the origin at the shoulder. Nothing in it is switched on or off: the ground below the
hand is always there, and only a hand that goes below it feels it.
"""

from __future__ import annotations

import forceserver as fs
import mujoco  # type: ignore[import-untyped]
import numpy as np

from .arm import Arm
from .ground import Array
from .robot import Place, as_pose, is_held, move, period
from .world import World, product

arm_scale, arm_force_scale = 12.0, 0.05  # m of the arm for a metre of the hand; N at the hand for a newton at the tip
home = (0.6, 0.0, -0.25)  # m, from the shoulder: where the hand is at the origin of the device
stiffness, limit = 500.0, 60.0  # N/m and N at the tip: of the envelope and the rocks
small_change = 0.02  # of the ground's stiffness: less does not matter


def across(normal: Array) -> Array:
    """The orientation of a plane with this normal: the least turn from z."""
    out = np.zeros(4)
    mujoco.mju_quatZ2Vec(out, normal)
    return out


class Manipulator:
    """The arm in its scene; the rover stands."""

    def __init__(self, scene: fs.Scene, world: World) -> None:
        self.scene, self.world, self.arm = scene, world, Arm(world)
        self.over = self.arm.place  # m: where the hand will be at the end of the frame
        world.steer(0, 0)
        self.places = self._places()
        frame = fs.Frame(pose=fs.Pose(position=-np.array(home) / arm_scale), scale=arm_scale, force_scale=arm_force_scale)
        scene.set_frame(frame)
        with scene.change():
            inside = fs.Contact(keep="back", stiffness=stiffness, limit=limit)
            scene["envelope"] = fs.Mesh(*self.arm.envelope(), contact=inside)
            outside = fs.Contact(keep="front", stiffness=stiffness, limit=limit)
            for i in world.rocks:
                points, triangles = world.rock(i)
                name = world.model.geom(i).name
                at_rock = (points - world.data.geom_xpos[i]) @ world.data.geom_xmat[i].reshape(3, 3)
                scene[name] = fs.Mesh(at_rock, triangles, contact=outside, pose=as_pose(self.places[name]))
            self.ground_law = self._ground_law()  # N/m and N, as set
            scene["ground"] = fs.Plane(back=self._profile(), pose=as_pose(self.places["ground"]))
            for name in world.parts():
                scene[name] = fs.Point(enabled=False, pose=as_pose(self.places[name]))

    def _profile(self) -> fs.Profile:
        return fs.LinearIncreasing(self.ground_law[0], limit=self.ground_law[1])

    def _below(self) -> tuple[Array, Array]:
        """The place on the ground below the hand and the normal there, in the arm's axes; the tip is a ball."""
        x, y, _ = self.arm.to_world(self.over)
        normal = self.world.ground.normal(x, y, self.arm.radius)
        ground = np.array([x, y, self.world.ground.height(x, y)]) + self.arm.radius * normal
        return self.arm.to_arm(ground), normal @ self.arm.axes

    def _ground_law(self) -> tuple[float, float]:
        """N/m and N: of the arm's motors and of MuJoCo's contact in series; what the motors can bear."""
        _, normal = self._below()
        motors, contact = self.arm.stiffness_along(normal), self.arm.contact_along(normal)
        return 1 / (1 / motors + 1 / contact), self.arm.most_along(normal)

    def _places(self) -> dict[str, Place]:
        """Of all that moves, in the scene; of the rover's parts, on the map."""
        place, normal = self._below()
        out: dict[str, Place] = {"ground": (place, across(normal))} | self.world.parts()
        back = self.world.orientation * [1, -1, -1, -1]
        for i in self.world.rocks:
            turned = product(back, self.world.orientation_of(i))
            out[self.world.model.geom(i).name] = (self.arm.to_arm(self.world.data.geom_xpos[i]), turned)
        return out

    def frame(self, hand: fs.Hand, time: float) -> str | None:
        """A frame that begins at `time` (s, on the scene's clock). The tip goes where the hand is, or where the solids hold it."""
        if is_held(hand.state, time):
            self.arm.reach_for(np.asarray(hand.response.proxy.position), period)
            self.over = np.asarray(hand.state.pose.position) + period * np.asarray(hand.state.twist.linear)
        self.world.step(round(period / self.world.model.opt.timestep))
        before, self.places = self.places, self._places()
        law = self._ground_law()
        is_new = any(abs(new - old) > small_change * old for new, old in zip(law, self.ground_law, strict=True))
        with self.scene.change():
            # Only while it is not felt: who goes in where it is soft, and out where it is stiff, would gain energy.
            if is_new and self._is_above(hand, before["ground"]) and "ground" in self.scene:
                self.ground_law = law
                self.scene["ground"].back = self._profile()
            move(self.scene, {name: (place, self.places[name]) for name, place in before.items()}, time)
        return None

    def _is_above(self, hand: fs.Hand, ground: Place) -> bool:
        """Whether the hand is above the plane of the ground, where it feels nothing of it."""
        normal = np.zeros(3)
        mujoco.mju_rotVecQuat(normal, np.array([0.0, 0, 1]), ground[1])
        return float(normal @ (np.asarray(hand.state.pose.position) - ground[0])) > 0
