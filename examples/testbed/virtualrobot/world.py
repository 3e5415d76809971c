"""The world of the rover: its ground, rocks and wheels, in MuJoCo. x: east, y: north, z: up; m, kg, s, rad."""

from __future__ import annotations

import math
from pathlib import Path

import mujoco  # type: ignore[import-untyped]
import numpy as np
from numpy.typing import NDArray

from .ground import Array, Ground, relief, terrain_file

wheels = [f"{place} {side}" for side in ("left", "right") for place in ("front", "middle", "rear")]


def product(a: Array, b: Array) -> Array:
    """Of two quaternions (w, x, y, z)."""
    out = np.zeros(4)
    mujoco.mju_mulQuat(out, a, b)
    return out


class World:
    """The physics, and what others want to know of it. One step is model.opt.timestep."""

    def __init__(self, path: Path = terrain_file) -> None:
        self.ground = Ground(path)
        spec = mujoco.MjSpec.from_file(str(Path(__file__).with_name("rover.xml")))
        field = spec.hfield("ground")
        field.nrow, field.ncol = self.ground.grid.shape
        field.size = [*self.ground.half, relief, 1]
        field.userdata = self.ground.grid.ravel()
        for rock in (geom for geom in spec.geoms if geom.classname.name == "rock"):
            rock.pos = [*rock.pos[:2], self.ground.height(rock.pos[0], rock.pos[1])]
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.rover = self.model.body("rover").id
        self.rocks = [i for i in range(self.model.ngeom) if self.model.geom(i).name.startswith("rock")]
        # Where the wheels are from the middle of the rover, m; those in the middle are not steered.
        mujoco.mj_forward(self.model, self.data)
        middle = self.data.site("middle").xpos
        self.wheels = {name: (self.data.body(name).xpos - middle)[:2] for name in wheels}
        self.radius = float(self.model.geom_size[self.model.body("front left").geomadr[0], 0])
        self.put(0, 0, 0)

    # ----------------------------------------------------------------------------------------------------------- rocks

    def rock(self, geom: int) -> tuple[Array, NDArray[np.int32]]:
        """The points and triangles of a rock, in the world."""
        mesh = self.model.geom_dataid[geom]
        first, count = self.model.mesh_vertadr[mesh], self.model.mesh_vertnum[mesh]
        points = self.model.mesh_vert[first : first + count].astype(float)
        first, count = self.model.mesh_faceadr[mesh], self.model.mesh_facenum[mesh]
        turn = self.data.geom_xmat[geom].reshape(3, 3)
        return points @ turn.T + self.data.geom_xpos[geom], self.model.mesh_face[first : first + count].copy()

    def orientation_of(self, geom: int) -> Array:
        out = np.zeros(4)
        mujoco.mju_mat2Quat(out, self.data.geom_xmat[geom])
        return out

    # ----------------------------------------------------------------------------------------------------------- rover

    def put(self, x: float, y: float, heading: float) -> None:
        """The rover stands there at rest, its arm folded; it is let down from a little above. heading: 0 east, pi/2 north."""
        time, up = self.data.time, self.ground.normal(x, y, 0.6)
        mujoco.mj_resetDataKeyframe(self.model, self.data, self.model.key("folded").id)
        ahead = np.array([math.cos(heading), math.sin(heading), 0])
        left = np.cross(up, ahead)
        left /= np.linalg.norm(left)
        axes = np.stack([np.cross(left, up), left, up], axis=1)
        self.data.qpos[:3] = [x, y, self.ground.height(x, y) + 1]
        mujoco.mju_mat2Quat(self.data.qpos[3:7], axes.ravel())
        for joint in ("azimuth", "shoulder", "elbow", "wrist"):
            self.data.joint(joint).qpos = self.data.actuator(joint).ctrl
        self.steer(0, 0)
        self.step(700)
        self.data.time = time

    def steer(self, speed: float, curvature: float) -> None:
        """speed: m/s ahead. curvature: 1/m, above 0 to the left. Each wheel rolls about the same centre of the turn."""
        for name, (x, y) in self.wheels.items():
            ahead, aside = 1 - curvature * y, curvature * x
            self.data.actuator(f"drive {name}").ctrl = speed * math.hypot(ahead, aside) / self.radius
            if not name.startswith("middle"):
                self.data.actuator(f"steer {name}").ctrl = math.atan2(aside, ahead)

    def step(self, count: int) -> None:
        mujoco.mj_step(self.model, self.data, count)

    @property
    def axes(self) -> Array:
        """Columns: ahead, to the left, up of the hull."""
        return np.array(self.data.xmat[self.rover]).reshape(3, 3)

    @property
    def position(self) -> Array:
        """Of the middle of the rover, between its wheels."""
        return np.array(self.data.site("middle").xpos)

    @property
    def orientation(self) -> Array:
        return np.array(self.data.xquat[self.rover])

    def parts(self) -> dict[str, tuple[Array, Array]]:
        """Where they are on the map, and how they stand: "pose" is the rover's, the others are joints and tip of the arm."""
        out = {"pose": (self.position, self.orientation)}
        for name, body in (("shoulder", "turret"), ("elbow", "forearm"), ("wrist", "scoop")):
            out[name] = (np.array(self.data.body(body).xpos), np.array(self.data.body(body).xquat))
        out["tip"] = (np.array(self.data.site("tip").xpos), out["wrist"][1])
        return out

    @property
    def heading(self) -> float:
        return math.atan2(self.axes[1, 0], self.axes[0, 0])
