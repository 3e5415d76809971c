"""The arm of the rover: where it reaches, its joints for a place of the tip, and how stiff it is there.

Places are in the arm's axes: those of the rover, with the origin at the shoulder; m, rad.
"""

from __future__ import annotations

import math

import mujoco  # type: ignore[import-untyped]
import numpy as np
import shapely
from numpy.typing import NDArray

from .ground import Array
from .world import World

joints = ("azimuth", "shoulder", "elbow", "wrist")
nearest = 0.1  # m, from the azimuth's axis: nearer, the arm would have to turn too fast
fold = 0.9  # rad, down from the forearm: the angle of the wrist where there is a choice
envelope_error = 1e-3  # m, by which the envelope may differ from where the tip can be


class Arm:
    def __init__(self, world: World) -> None:
        self.world, self.model, self.data = world, world.model, world.data
        joint = [self.model.joint(name) for name in joints]
        self.addresses = np.array([one.qposadr[0] for one in joint])  # in qpos
        self.motors = [self.model.actuator(name).id for name in joints]
        self.range = np.array([self.model.actuator_ctrlrange[i] for i in self.motors])
        self.gains = np.array([self.model.actuator_gainprm[i, 0] for i in self.motors])  # N m/rad
        self.torques = np.array([self.model.actuator_forcerange[i, 1] for i in self.motors])  # N m
        self.tip = self.model.site("tip").id
        self.radius = float(self.model.geom("tip").size[0])  # m
        parts = [self.model.body("forearm"), self.model.body("scoop"), self.model.site("tip")]
        self.lengths = np.array([float(part.pos[0]) for part in parts])  # m
        self.targets = np.array([self.data.ctrl[i] for i in self.motors])
        self.wanted = self.targets  # the joints where the tip is at the hand
        grids = np.meshgrid(*[np.linspace(low, high, 12) for low, high in self.range[1:]])
        self.postures = np.stack([grid.ravel() for grid in grids], axis=1)  # of shoulder, elbow and wrist
        self.posture_tips = np.array([self._in_plane(np.array([0, *posture])) for posture in self.postures])

    # ------------------------------------------------------------------------------------------------------------ axes

    @property
    def axes(self) -> Array:
        """Columns: the arm's axes in the world."""
        return self.world.axes

    @property
    def shoulder(self) -> Array:
        """Its place in the world."""
        return np.array(self.data.body("turret").xpos)

    def to_world(self, place: Array) -> Array:
        return self.shoulder + self.axes @ place

    def to_arm(self, place: Array) -> Array:
        return (place - self.shoulder) @ self.axes

    def ground_below(self, x: float, y: float) -> Array:
        """The ground at x, y of the arm's axes."""
        east, north, _ = self.to_world(np.array([x, y, 0]))
        return self.to_arm(np.array([east, north, self.world.ground.height(east, north)]))

    @property
    def place(self) -> Array:
        """Of the tip."""
        return self.to_arm(self.data.site_xpos[self.tip])

    # ---------------------------------------------------------------------------------------------------------- joints

    def tip_of(self, q: Array) -> Array:
        r, z = self._in_plane(q)
        return np.array([r * math.cos(q[0]), r * math.sin(q[0]), z])

    def _in_plane(self, q: Array) -> tuple[float, float]:
        angles = np.cumsum(q[1:])  # about y: above 0 is down
        return float(self.lengths @ np.cos(angles)), float(-(self.lengths @ np.sin(angles)))

    def jacobian_of(self, q: Array) -> Array:
        """Of tip_of: m/rad, shape (3, 4)."""
        angles = np.cumsum(q[1:])
        out, inward = np.zeros((3, 4)), np.array([math.cos(q[0]), math.sin(q[0]), 0])
        r, _ = self._in_plane(q)
        out[:, 0] = [-r * inward[1], r * inward[0], 0]
        for i in range(3):
            along = self.lengths[i:]
            out[:, 1 + i] = -(along @ np.sin(angles[i:])) * inward - (along @ np.cos(angles[i:])) * np.array([0, 0, 1])
        return out

    def solve(self, place: Array) -> Array:
        """The joints for a place of the tip, near the present targets where these lead to it. Where the tip cannot be, the joints
        that bring it near."""
        near = self._solve_from(self.targets, place)
        if np.linalg.norm(place - self.tip_of(near)) < 1e-4:
            return near
        there = np.hypot(*(self.posture_tips - [math.hypot(*place[:2]), place[2]]).T)
        other = self._solve_from(np.array([math.atan2(place[1], place[0]), *self.postures[np.argmin(there)]]), place)
        return min(near, other, key=lambda q: float(np.linalg.norm(place - self.tip_of(q))))

    def _solve_from(self, q: Array, place: Array) -> Array:
        """Damped least squares (Wampler 1986), with the wrist folded where there is a choice."""
        for _ in range(60):
            error = place - self.tip_of(q)
            if np.linalg.norm(error) < 1e-5:
                break
            jacobian = self.jacobian_of(q)
            # A joint at its end is left out, where it would go on.
            damping = 1e-4 + 0.1 * float(error @ error)
            free = np.ones(4, bool)
            for _ in range(3):
                j = jacobian * free
                inverse = j.T @ np.linalg.inv(j @ j.T + damping * np.eye(3))
                rest = np.array([0, 0, 0, 0.2 * (fold - q[3]) * free[3]])
                step = np.clip(inverse @ error + rest - inverse @ (j @ rest), -0.3, 0.3)
                ends = free & ((q + step < self.range[:, 0]) | (q + step > self.range[:, 1]))
                if not ends.any():
                    break
                q = np.where(ends, np.clip(q + step, self.range[:, 0], self.range[:, 1]), q)
                free &= ~ends
            q = np.clip(q + step * free, self.range[:, 0], self.range[:, 1])
        return q

    def reach_for(self, place: Array, seconds: float) -> None:
        """Lets the motors bring the tip there: the targets of the joints go on by at most 1.5 rad/s."""
        most = 1.5 * seconds
        self.wanted = self.solve(place)
        self.targets += np.clip(self.wanted - self.targets, -most, most)
        for i, target in zip(self.motors, self.targets, strict=True):
            self.data.ctrl[i] = target

    # ------------------------------------------------------------------------------------------------------- stiffness

    def stiffness_along(self, n: Array) -> float:
        """N/m, of the motors against a push on the tip along n (in the arm's axes, of length 1), where the tip is at the hand."""
        by_joint = self.jacobian_of(self.wanted).T @ n  # N m for a push of 1 N
        return float(1 / (by_joint**2 / self.gains).sum())

    def most_along(self, n: Array) -> float:
        """N, that the motors can bear there."""
        by_joint = np.abs(self.jacobian_of(self.wanted).T @ n)
        return float(np.min(self.torques / np.maximum(by_joint, 1e-3)))

    def contact_along(self, n: Array) -> float:
        """N/m, of MuJoCo's contact at the tip at rest: k d / ((1 - d) A) with k = 1 / (d timeconst dampratio)^2, and A the push's
        acceleration of the tip, 1/kg (MuJoCo's documentation, Computation and Solver parameters)."""
        geom = self.model.geom("tip").id
        (timeconst, ratio), most = self.model.geom_solref[geom], self.model.geom_solimp[geom, 1]
        jacobian = np.zeros((3, self.model.nv))
        mujoco.mj_jacSite(self.model, self.data, jacobian, None, self.tip)
        along = (self.axes @ n) @ jacobian
        felt = np.zeros((1, self.model.nv))
        mujoco.mj_solveM(self.model, self.data, felt, along[None])
        return float(most / (1 - most) / (along @ felt[0]) / (most * timeconst * ratio) ** 2)

    # -------------------------------------------------------------------------------------------------------- envelope

    def outline(self) -> shapely.Geometry:
        """Where the tip can be in the plane of the arm: r (m, from the azimuth's axis), z.

        At each distance from the shoulder there is an elbow and a wrist for some angles, and the shoulder turns these on; it
        turns by more than any gap between them. So the outline is the least and the greatest angle at each distance.
        """
        first, second, last = self.lengths
        low, high = self.range[1:].T
        elbow = np.linspace(low[1], high[1], 4001)
        before = first + second * np.exp(-1j * elbow)  # r + i z of the wrist, as if the shoulder were at 0
        middle = (low[1] + high[1]) / 2
        ends = []
        for distance in np.arange(nearest, float(self.lengths.sum()), envelope_error / 2):
            cosine = (distance**2 - np.abs(before) ** 2 - last**2) / (2 * np.abs(before) * last)
            bend = np.arccos(cosine, where=np.abs(cosine) <= 1, out=np.full_like(cosine, np.nan))
            wrist = np.concatenate([-np.angle(before) + sign * bend - elbow for sign in (1, -1)])
            wrist = (wrist + math.pi) % math.tau - math.pi
            both = np.concatenate([elbow, elbow])
            good = (wrist >= low[2]) & (wrist <= high[2])
            if good.any():
                tip = np.concatenate([before, before])[good] + last * np.exp(-1j * (both + wrist)[good])
                angle = np.angle(tip * np.exp(1j * middle)) - middle  # the elbow bends down only, so none is near its ends
                ends.append((distance, angle.min() - high[0], angle.max() - low[0]))
        distance, least, greatest = np.array(ends).T
        around = [np.concatenate([out, back[::-1], out[:1]]) for out, back in ((distance, distance), (least, greatest))]
        far = float(self.lengths.sum()) + 1
        whole = shapely.Polygon(self._curve(*around))
        return whole.intersection(shapely.box(nearest, -far, far, far)).simplify(envelope_error / 4)

    @staticmethod
    def _curve(distance: Array, angle: Array) -> Array:
        """Through these places in polar coordinates; where the angle jumps, along a circle."""
        middle = (distance[1:] + distance[:-1]) / 2
        points = [np.array([distance[0] * np.exp(1j * angle[0])])]
        for r, begin, end, there in zip(middle, angle[:-1], angle[1:], distance[1:], strict=True):
            if abs(end - begin) > 0.02:
                points.append(r * np.exp(1j * np.linspace(begin, end, 2 + int(abs(end - begin) / 0.02))))
            points.append(np.array([there * np.exp(1j * end)]))
        places = np.concatenate(points)
        return np.stack([places.real, places.imag], axis=1)

    def envelope(self) -> tuple[Array, NDArray[np.int32]]:
        """Where the tip can be, as a closed surface whose fronts are outside: the outline, swept about the azimuth's axis."""
        outline = shapely.orient_polygons(self.outline())
        corners = shapely.get_coordinates(outline)[:-1]  # counter-clockwise
        count = len(corners)
        low, high = self.range[0]
        step = 2 * math.acos(1 - envelope_error / corners[:, 0].max())
        azimuth = np.linspace(low, high, 1 + math.ceil((high - low) / step))
        points = np.stack([np.outer(np.cos(azimuth), corners[:, 0]), np.outer(np.sin(azimuth), corners[:, 0]),
                           np.outer(np.ones_like(azimuth), corners[:, 1])], axis=-1).reshape(-1, 3)  # fmt: skip
        here = (np.arange(len(azimuth) - 1)[:, None] * count + np.arange(count)).ravel()
        after = (np.arange(len(azimuth) - 1)[:, None] * count + (np.arange(count) + 1) % count).ravel()
        sides = np.stack([here, after + count, after, here, here + count, after + count], axis=1).reshape(-1, 3)
        number = {tuple(corner): i for i, corner in enumerate(corners)}
        parts = shapely.get_parts(shapely.constrained_delaunay_triangles(outline))
        of_parts = [shapely.get_coordinates(part)[:3] for part in shapely.orient_polygons(parts)]
        cap = np.array([[number[tuple(corner)] for corner in part] for part in of_parts])
        last = (len(azimuth) - 1) * count
        return points, np.concatenate([sides, cap, cap[:, ::-1] + last]).astype(np.int32)
