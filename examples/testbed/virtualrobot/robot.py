"""The rover as force-objects: the hand drives it, and feels what it does, 25 times a second.

Each frame computes the next 0.04 s of the physics, then tells the server where the rover is now and how it moves to where it will
be. So from one frame to the next nothing jumps, and the hand's wish is followed one frame later.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import forceserver as fs
import mujoco  # type: ignore[import-untyped]
import numpy as np

from .ground import Array
from .world import World, product

period = 0.04  # s, of a frame
fastest = 0.8  # m/s, of the rover
tightest = 0.6  # 1/m, of a turn
quickest = 1.0  # m/s^2, of its speed
quickest_turn = 1.0  # 1/(m s), of its curvature

stiffness, limit = 150.0, 3.0  # N/m and N, of the plane, at the hand
joystick_scale = 20.0  # m of the scene in drive mode for a metre of the hand
map_scale = 300.0  # the same in map mode: 60 m are 0.2 m of the hand
free, full = 0.005, 0.035  # m of the hand ahead: up to where the rover stands, and from where it is at its fastest
arrived = 0.4  # m, from the goal
edge, goal_edge = 1.0, 1.5  # m, from the end of the map: of where the rover may be, and of where it is sent
freely = 5.0  # m: after so long a way the same trouble is told again
lost_after = 0.1  # s: a hand whose newest place is older is lost

Place = tuple[Array, Array]  # position (m) and orientation (w, x, y, z)


class Wish(NamedTuple):
    """What the rover shall do."""

    speed: float = 0.0  # m/s
    curvature: float = 0.0  # 1/m, above 0 to the left


class Trouble(NamedTuple):
    """Why the rover cannot go on, and how far back it is put on its way."""

    why: str
    metres: float


def wish_of_joystick(hand: Array, axes: Array) -> Wish:
    """hand: of the joystick, m from its middle. Ahead is faster, and against the plane is a turn."""
    ahead, left = float(hand @ axes[:, 0]), float(hand @ axes[:, 1])
    speed = math.copysign(np.clip((abs(ahead) - free) / (full - free), 0, 1), ahead) * fastest
    return Wish(speed, tightest * float(np.clip(left / (limit / stiffness), -1, 1)))


def wish_of_goal(goal: Array, position: Array, axes: Array, backs: bool = False) -> Wish:
    """Pure pursuit (Coulter 1992): along the circle through the goal. What is behind is reached by a turn first. A goal at the
    side, within the tightest turn, would be circled for ever: the rover backs until it lies outside. backs: it does so now."""
    ahead, left = (goal[:2] - position[:2]) @ axes[:2, :2]
    distance = math.hypot(ahead, left)
    if distance < arrived:
        return Wish()
    speed = min(fastest, 0.2 + 0.5 * (distance - arrived))
    within = 1 / tightest - math.hypot(ahead, abs(left) - 1 / tightest)  # m: so far the goal lies within the tightest turn
    if within > (-arrived / 2 if backs else arrived / 2):
        return Wish(-speed)
    curvature = 2 * left / distance**2 if ahead > 0 else math.copysign(tightest, left)
    return Wish(speed, float(np.clip(curvature, -tightest, tightest)))


def orientation_of_plane(rover: Array) -> Array:
    """Of the rover (w, x, y, z) to that of a plane whose normal is its axles: x ahead, y up, z to the right."""
    return product(rover, np.array([math.sqrt(0.5), math.sqrt(0.5), 0, 0]))


def is_held(hand: fs.State, time: float) -> bool:
    """Whether somebody holds the device, and it is known where."""
    return bool(hand.flags & fs.StateFlags.READY) and not hand.flags & fs.StateFlags.CLUTCHED and time - hand.time < lost_after


def as_pose(place: Place) -> fs.Pose:
    return fs.Pose(position=place[0], orientation=place[1])


def twist_between(a: Place, b: Place) -> fs.Twist:
    """From one place to another, a frame later."""
    angular = np.zeros(3)
    mujoco.mju_quat2Vel(angular, product(b[1], a[1] * [1, -1, -1, -1]), period)
    return fs.Twist(linear=(b[0] - a[0]) / period, angular=angular)


class Changes:
    """Changes the objects of a scene. What fails is told once, until it works again; that the server has gone is raised."""

    def __init__(self, scene: fs.Scene) -> None:
        self.scene = scene
        self.failing: set[str] = set()
        self.untold: list[str] = []

    def attempt(self, what: str, does: Callable[[], None]) -> bool:
        """what: of all that is changed, so that the same failure is told once. Gives whether it was done."""
        try:
            does()
        except ConnectionError:
            raise
        except KeyError:
            return False  # another client has removed it, which an event tells
        except fs.Error as failure:
            if what not in self.failing:
                self.untold.append(str(failure))
            self.failing.add(what)
            return False
        self.failing.discard(what)
        return True

    def together(self, does: Callable[[], None]) -> None:
        """All are felt from the same tick on."""

        def change() -> None:
            with self.scene.change():
                does()

        self.attempt("all", change)

    def move(self, moves: dict[str, tuple[Place, Place]], time: float) -> None:
        """Where each object is at `time` (s), and where it will be a frame later."""
        for name, (begin, end) in moves.items():
            pose, twist = as_pose(begin), twist_between(begin, end)
            self.attempt(f"the place of {name}", lambda: self.scene.object_move(name, pose, twist, time))

    def tell(self) -> str | None:
        return self.untold.pop(0) if self.untold else None


class Robot:
    """The rover in mode "drive" or "map", in its scene.

    drive: the hand is a joystick. The middle of the scene is the rover, and its axes are the map's. What the hand feels is the
    plane of its wheels: free ahead, back, up and down, drawn back from either side, until the rover has turned.
    map: the hand is where the rover shall go, on the map. The plane goes through the rover.
    """

    def __init__(self, scene: fs.Scene, world: World, mode: str) -> None:
        self.scene, self.world, self.mode = scene, world, mode
        self.changes = Changes(scene)
        self.scale = joystick_scale if mode == "drive" else map_scale
        self.wish = Wish()
        self.strength = self.shown_strength = 1.0  # of the plane, 0 to 1: now, and as it is set
        self.trouble: Trouble | None = None  # until the rover is put back
        self.good_places: deque[tuple[float, float, float]] = deque(maxlen=200)  # x, y, heading where all was well, each 0.5 m
        self.waited = 0.0  # s, that it has tried to drive since it last moved 0.5 m
        self.driven = 0.0  # m, in all
        self.told, self.quiet_until = "", 0.0  # the last trouble, and up to where it is not told again, m driven
        self.is_quiet = False  # the present trouble is not told
        self.last: float | None = None  # s, when the last frame began
        self.is_silent = False  # nothing has been heard of the hand for too long
        self.moved_from = world.position
        self.was_put = False  # in the last frame
        self.parts = world.parts()
        scene.set_frame(fs.Frame(scale=self.scale))
        with scene.change():
            profile = self._profile()
            scene["wheels"] = fs.Plane(pose=as_pose(self._plane(self.parts)), front=profile, back=profile)
            for name, place in self.parts.items():
                scene[name] = fs.Point(pose=as_pose(place), enabled=False)

    def _profile(self) -> fs.Profile:
        part = max(self.strength, 1e-6)  # a limit is above 0
        return fs.LinearIncreasing(part * stiffness / self.scale, limit=part * limit)

    def _plane(self, parts: dict[str, Place]) -> Place:
        """Of the wheels, in the scene."""
        position, orientation = parts["pose"]
        return (np.zeros(3) if self.mode == "drive" else position), orientation_of_plane(orientation)

    def frame(self, hand: fs.Hand, time: float) -> str | None:
        """A frame that begins at `time` (s, on the scene's clock). Gives what is to be said."""
        before = self.parts
        passed = period if self.last is None else max(period, time - self.last)
        self.last = time
        self._go(self._wanted(hand.state, time) if self.trouble is None else Wish(), passed)
        said = self._look(passed) or self._listen(hand.state, time)
        self.parts = self.world.parts()
        self._show(self.parts if self.was_put else before, time)
        return said or self.changes.tell()

    def _listen(self, hand: fs.State, time: float) -> str | None:
        was_silent, self.is_silent = self.is_silent, bool(hand.flags & fs.StateFlags.READY) and time - hand.time >= lost_after
        if self.is_silent == was_silent:
            return None
        return "it stands: nothing is heard of the hand" if self.is_silent else "the hand is there again"

    def _wanted(self, hand: fs.State, time: float) -> Wish:
        if not is_held(hand, time):
            return Wish()
        position = np.asarray(hand.pose.position)
        if self.mode == "drive":
            return wish_of_joystick(position / self.scale, self.world.axes)
        most = self.world.ground.half - goal_edge
        return wish_of_goal(np.clip(position[:2], -most, most), self.world.position, self.world.axes, self.wish.speed < 0)

    def _go(self, wanted: Wish, passed: float) -> None:
        """Steers, and lets a frame of the physics go by. It brakes five times as quickly as it speeds up: from any speed in
        0.2 s. passed: s since the last frame."""
        most, most_turn, brake = quickest * period, quickest_turn * period, 5 * quickest * passed
        before = self.wish.speed
        brakes = abs(wanted.speed) < abs(before) or wanted.speed * before < 0
        target = wanted.speed if wanted.speed * before >= 0 else 0.0  # the other way only from a stand
        speed = before + float(np.clip(target - before, *((-brake, brake) if brakes else (-most, most))))
        curvature = self.wish.curvature + float(np.clip(wanted.curvature - self.wish.curvature, -most_turn, most_turn))
        self.wish = Wish(speed, curvature)
        self.world.steer(*self.wish)
        self.world.step(round(period / self.world.model.opt.timestep))

    def _look(self, passed: float) -> str | None:
        """Ends the force while the rover is in trouble, and puts it back. Gives what is to be said."""
        self._fade(passed)
        self.was_put = False
        if self.trouble is None:
            self.trouble = self._new_trouble()
            if self.trouble is None:
                return None
            self.is_quiet = self.trouble.why == self.told and self.driven < self.quiet_until
            self.told = self.trouble.why
            return None if self.is_quiet else self.told
        if self.strength > 0:
            return None
        self._put_back(self.trouble.metres)
        self.was_put, self.quiet_until = True, self.driven + freely
        x, y, _ = self.world.position
        return None if self.is_quiet else f"it is put back to {x:.1f} m east, {y:.1f} m north"

    def _fade(self, passed: float) -> None:
        """The force, within 0.5 s."""
        step = passed / 0.5
        self.strength = min(1.0, self.strength + step) if self.trouble is None else max(0.0, self.strength - step)

    def _new_trouble(self) -> Trouble | None:
        x, y, _ = position = self.world.position
        if self.world.axes[2, 2] < 0.3:
            return Trouble("the rover has tipped over", 2.0)
        if (np.abs(position[:2]) > self.world.ground.half - edge).any():
            return Trouble("the rover is at the edge of the map", 3.0)
        way = float(np.linalg.norm(position - self.moved_from))
        self.waited = self.waited + period if abs(self.wish.speed) > 0.1 else 0.0
        if way > 0.5:
            self.driven += way
            self.moved_from, self.waited = position, 0.0
            if self.world.axes[2, 2] > 0.8:
                self.good_places.append((float(x), float(y), self.world.heading))
        return Trouble("the rover is stuck", 3.0) if self.waited > 8.0 else None

    def _put_back(self, metres: float) -> None:
        """It stands at another place, and all begins anew."""
        self._put(metres)
        self.trouble, self.wish, self.waited, self.moved_from = None, Wish(), 0.0, self.world.position

    def _put(self, metres: float) -> None:
        """To the newest place of its way that is at least so far away, and where it stands; else to the middle of the map."""
        here = self.world.position[:2]
        while self.good_places:
            place = self.good_places.pop()
            if np.linalg.norm(here - place[:2]) >= metres:
                self.world.put(*place)
                if self.world.axes[2, 2] > 0.8:
                    return
        self.world.put(0, 0, 0)

    def _show(self, now: dict[str, Place], time: float) -> None:
        """Where all is at the beginning of the frame, and how it moves until its end."""

        def show() -> None:
            if self.strength != self.shown_strength and self.changes.attempt("the force of the wheels", self._show_strength):
                self.shown_strength = self.strength
            of_parts = {name: (now[name], self.parts[name]) for name in now}
            self.changes.move({"wheels": (self._plane(now), self._plane(self.parts))} | of_parts, time)

        self.changes.together(show)

    def _show_strength(self) -> None:
        self.scene["wheels"].change(front=self._profile(), back=self._profile())
