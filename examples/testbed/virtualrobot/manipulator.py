"""The arm as force-objects: its tip follows the hand, which feels how far it reaches, the ground and the rocks.

The scene is in the axes of the rover, with the origin at the shoulder. Nothing in it is switched on or off.
"""

from __future__ import annotations

import forceserver as fs
import numpy as np
import shapely
from numpy.typing import NDArray

from .arm import Arm
from .ground import Array
from .robot import Changes, Place, as_pose, is_held, period
from .world import World, product

arm_scale, arm_force_scale = 12.0, 0.05  # m of the arm for a metre of the hand; N at the hand for a newton at the tip
home = (0.6, 0.0, -0.25)  # m, from the shoulder: where the hand is at the origin of the device
stiffness, limit = 500.0, 60.0  # N/m and N at the tip: of the envelope
around = 3.0  # m: so far around the shoulder the ground is felt
small_change = 0.02  # of what the tip touches: less does not matter


def raised_rock(points: Array, triangles: NDArray[np.int32], height: float) -> Array:
    """The points of a convex mesh, moved so that each triangle is further out by `height`, m, as nearly as can be."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    of_points = [normals[(triangles == k).any(axis=1)] for k in range(len(points))]
    moved: Array = points + [np.linalg.lstsq(n, np.full(len(n), height), rcond=0.1)[0] for n in of_points]
    return moved


class Manipulator:
    """The arm in its scene; the rover stands."""

    def __init__(self, scene: fs.Scene, world: World) -> None:
        self.scene, self.world, self.arm = scene, world, Arm(world)
        self.changes = Changes(scene)
        world.steer(0, 0)
        self.outline = self.arm.outline()
        shapely.prepare(self.outline)
        self.ground_at = self.arm.shoulder  # in the world: the origin of the ground
        self.places = self._places()
        self.law = self._law(self.arm.place)  # N/m and N, as set
        frame = fs.Frame(pose=fs.Pose(position=-np.array(home) / arm_scale), scale=arm_scale, force_scale=arm_force_scale)
        scene.set_frame(frame)
        points, triangles = world.ground.mesh(self.ground_at, around)
        radius = self.arm.radius  # the tip is a ball, and the hand is its middle
        raised = points + radius * np.array([world.ground.normal(x, y, radius) for x, y, _ in points]) - self.ground_at
        with scene.change():
            inside = fs.Contact(keep="back", stiffness=stiffness, limit=limit)
            scene["envelope"] = fs.Mesh(*self.arm.envelope(), contact=inside)
            scene["ground"] = fs.Mesh(raised, triangles, contact=self._contact(), pose=as_pose(self.places["ground"]))
            for i in world.rocks:
                points, triangles = world.rock(i)
                points = raised_rock(points, triangles, radius)
                name = world.model.geom(i).name
                at_rock = (points - world.data.geom_xpos[i]) @ world.data.geom_xmat[i].reshape(3, 3)
                scene[name] = fs.Mesh(at_rock, triangles, contact=self._contact(), pose=as_pose(self.places[name]))
            for name in world.parts():
                scene[name] = fs.Point(enabled=False, pose=as_pose(self.places[name]))
        self.touched = ["ground", *(world.model.geom(i).name for i in world.rocks)]

    def _contact(self) -> fs.Contact:
        return fs.Contact(keep="front", stiffness=self.law[0], limit=self.law[1])

    def _law(self, place: Array) -> tuple[float, float]:
        """Of what the tip touches there, N/m and N: the arm's motors and MuJoCo's contact in series; what the motors can bear."""
        x, y, _ = self.arm.to_world(place)
        normal = self.world.ground.normal(x, y, 0.1) @ self.arm.axes
        motors, contact = self.arm.stiffness_along(normal), self.arm.contact_along(normal)
        return 1 / (1 / motors + 1 / contact), self.arm.most_along(normal)

    def _places(self) -> dict[str, Place]:
        """Of all that moves, in the scene; of the rover's parts, on the map."""
        back = self.world.orientation * [1, -1, -1, -1]
        out: dict[str, Place] = {"ground": (self.arm.to_arm(self.ground_at), back)} | self.world.parts()
        for i in self.world.rocks:
            turned = product(back, self.world.orientation_of(i))
            out[self.world.model.geom(i).name] = (self.arm.to_arm(self.world.data.geom_xpos[i]), turned)
        return out

    def _is_within_reach(self, place: Array) -> bool:
        low, high = self.arm.range[0]
        x, y, z = place
        return bool(low <= np.arctan2(y, x) <= high and shapely.contains_xy(self.outline, np.hypot(x, y), z))

    def frame(self, hand: fs.Hand, time: float) -> str | None:
        """A frame that begins at `time` (s, on the scene's clock). The tip goes to the hand, into the ground as well, where the
        motors then push; or where the envelope holds the hand."""
        at = np.asarray(hand.state.pose.position)
        if is_held(hand.state, time):
            self.arm.reach_for(at if self._is_within_reach(at) else np.asarray(hand.response.proxy.position), period)
        self.world.step(round(period / self.world.model.opt.timestep))
        before, self.places = self.places, self._places()
        # Only while nothing is touched: who goes in where it is soft, and out where it is stiff, would gain energy.
        law = self.law if hand.response.flags & fs.ResponseFlags.CONTACT else self._law(at)
        is_new = any(abs(new - old) > small_change * old for new, old in zip(law, self.law, strict=True))

        def show() -> None:
            if is_new:
                self.law = law
                for name in self.touched:
                    self.changes.attempt(f"the contact of {name}", lambda: self._show_contact(name))
            self.changes.move({name: (place, self.places[name]) for name, place in before.items()}, time)

        self.changes.together(show)
        return self.changes.tell()

    def _show_contact(self, name: str) -> None:
        self.scene[name].contact = self._contact()
