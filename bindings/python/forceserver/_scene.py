"""Scenes as mappings, tools, devices, servos and servers."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, MutableMapping
from typing import TYPE_CHECKING, Any, NamedTuple, Unpack

from . import _core
from ._core import Error, EventKind, NotFoundError, Object
from ._objects import _put, fields_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ._core import (
        Array,
        Event,
        Report,
        Response,
        Rotation,
        ServerOptionsFields,
        ServoOptionsFields,
        ServoStats,
        State,
        Structs,
        Twist,
        Wrench,
    )


class Hand(NamedTuple):
    """The hand at the last tick: its state, what it feels of this scene, and what the device got of all."""

    state: State
    response: Response
    sent: Wrench


class SceneObject:
    """What has a name in a scene: scene["rock"]. It reads the scene anew at each use."""

    def __init__(self, scene: Scene, name: str) -> None:
        self.scene = scene
        self.name = name

    @property
    def object(self) -> Object:
        """A copy: its fields can be read, or changed and set again."""
        return self.scene.object_get(self.name)

    @property
    def report(self) -> Report:
        """What became of it."""
        return self.scene.get_report(self.name)

    def move(
        self,
        position: ArrayLike | None = None,
        orientation: ArrayLike | Rotation | None = None,
        *,
        twist: Twist | None = None,
        time: float = 0,
    ) -> None:
        """Moves it; what is not given stays.

        position: m. orientation: (w, x, y, z), or scipy's Rotation (scipy's own order is x, y, z, w). twist: how it
        moves from then on; None, for streams of moves: worked out from this and the last move, if that is at most 0.2 s
        old.
        """
        pose = _core.Pose() if position is not None and orientation is not None else self.object.pose
        if position is not None:
            pose.position = position
        if orientation is not None:
            pose.orientation = orientation
        self.scene.object_move(self.name, pose, twist, time)

    def change(self, **fields: Any) -> None:
        """Changes these fields of Object (position and orientation are also names here) and leaves the rest."""
        bits = fields_of(fields)
        changed = self.object
        _put(changed, fields)  # type: ignore[arg-type]
        self.scene.object_change(changed, bits)

    def remove(self) -> None:
        """Removes it; under a servo it fades out."""
        self.scene.object_remove(self.name)

    def evaluate(self, positions: ArrayLike, out: Array | None = None, *, time: float = 0) -> Array:
        """As Scene.evaluate, of this object alone."""
        return self.scene.evaluate(positions, out, name=self.name, time=time)

    def __repr__(self) -> str:
        return f"<{self.name!r} in {self.scene!r}>"


class Scene(_core.Scene):
    """The force-objects of one application, by name: scene["rock"] = fs.Point(..), scene["rock"].move(..), del
    scene["rock"]. In a connected scene "client/rock" is another client's."""

    def __init__(self, handle: _core.Scene | None = None) -> None:
        super().__init__(_core.scene_create() if handle is None else handle)

    # ---- A mapping of names to objects

    def __setitem__(self, name: str, value: Object | SceneObject) -> None:
        named = value.object if isinstance(value, SceneObject) else value.copy()
        named.name = name
        self.object_set(named)

    def __getitem__(self, name: str) -> SceneObject:
        self.object_get(name)  # raises NotFoundError, a KeyError
        return SceneObject(self, name)

    def __delitem__(self, name: str) -> None:
        self.object_remove(name)

    def __contains__(self, name: object) -> bool:
        if not isinstance(name, str):
            return False
        try:
            self.object_get(name)
        except NotFoundError:
            return False
        return True

    def __iter__(self) -> Iterator[str]:
        """The names of the scene's own objects."""
        names = [bytes(name).decode(errors="surrogateescape") for name in self.get_motions()["name"]]
        return iter([name for name in names if "/" not in name])

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __bool__(self) -> bool:
        return True

    def keys(self) -> list[str]:
        return list(self)

    def values(self) -> list[SceneObject]:
        return [SceneObject(self, name) for name in self]

    def items(self) -> list[tuple[str, SceneObject]]:
        return [(name, SceneObject(self, name)) for name in self]

    def get(self, name: str, default: SceneObject | None = None) -> SceneObject | None:
        return SceneObject(self, name) if name in self else default

    def update(self, objects: Mapping[str, Object]) -> None:
        """Sets several objects, one after the other; in `with scene.change()` all of them or none."""
        for name, value in objects.items():
            self[name] = value

    # ---- Groups

    @contextlib.contextmanager
    def change(self) -> Iterator[Scene]:
        """with scene.change(): several changes, felt from one tick on.

        Meanwhile the scene's changes belong to this thread: those of other threads wait for the end. An exception takes
        all back. It cannot be nested: StateError.
        """
        self.begin()
        try:
            yield self
            self.commit()
        except BaseException:
            with contextlib.suppress(Error):
                self.cancel()
            raise

    # ---- What is felt

    def evaluate(
        self, positions: ArrayLike, out: Array | None = None, *, name: str | None = None, time: float = 0
    ) -> Array:
        """The forces (N, shape (n, 3)) that a resting point feels at positions (m, shape (n, 3)), of all objects or of
        one. out: where they are written; it is returned, else a new array. time: s, on the scene's clock; 0: now."""
        return self.evaluate_field(name, time, positions, out)

    def hand(self) -> Hand:
        """The hand of the servo that runs this scene, here or at the server."""
        return Hand(*self.get_hand())

    @property
    def time(self) -> float:
        """The scene's clock, s."""
        return self.get_time()

    def events(self, timeout: float | None = None) -> Iterator[Event]:
        """Events as they come. timeout: s that it waits for each before it ends; None: for ever, 0: what is there."""
        while (event := self.next_event(float("inf") if timeout is None else timeout)).kind != EventKind.NONE:
            yield event

    def __repr__(self) -> str:
        return "<closed forceserver.Scene>" if self.closed else f"<forceserver.Scene of {len(self)} objects>"


MutableMapping.register(Scene)


def connect(endpoint: str, client_name: str) -> Scene:
    """A scene at a server: connect("shm:lab", "rover"). "shm:lab?timeout=5" waits for one that is not there yet."""
    return Scene(_core.scene_connect(endpoint, client_name))


class Tool(_core.Tool):
    """What touches a scene in a loop of one's own; the application owns time, device and safety.

    points: of the tool, in the frame of the handle (m, shape (n, 3)); None: those of the scene's tool.

        state, response = fs.State(), fs.Response()        # kept: this is the quick way
        tool.evaluate(state, out=response)
        states = np.zeros(1000, fs.State.dtype)            # or many at once
        forces = tool.evaluate(states)["wrench"]["force"]
    """

    def __init__(self, scene: _core.Scene, points: ArrayLike | None = None) -> None:
        super().__init__(scene.tool_create(points))


class Device(_core.Device):
    """A haptic device or the simulator: Device("sim:?path=figure8"). device_open has all options."""

    def __init__(self, uri: str = "sim:") -> None:
        super().__init__(_core.device_open(uri))


def devices() -> Structs:
    """The devices that can be opened: an array of DeviceEntry.dtype."""
    return _core.device_list()


class Servo(_core.Servo):
    """The loop between a scene and a device; it runs until close() or the end of its `with`.

    options are the fields of ServoOptions: mode ("thread", "caller", "virtual"), rate, force_limit, fade ..
    A servo that is collected, or alive when the interpreter ends, is stopped; the force is 0 first.
    """

    def __init__(
        self, scene: _core.Scene, device: _core.Device | str = "sim:", **options: Unpack[ServoOptionsFields]
    ) -> None:
        self.scene = scene
        self.device = Device(device) if isinstance(device, str) else device
        super().__init__(scene.servo_start(self.device, _core.ServoOptions(**options)))

    @property
    def stats(self) -> ServoStats:
        """How it does."""
        return self.scene.get_servo_stats()

    @property
    def record(self) -> Structs:
        """The flight record: the newest ticks, an array of Tick.dtype."""
        return self.get_record()


class Server(_core.Server):
    """Lets other processes into a servo: Server(servo, "shm:lab"). options are the fields of ServerOptions."""

    def __init__(self, servo: _core.Servo, endpoint: str, **options: Unpack[ServerOptionsFields]) -> None:
        super().__init__(servo.server_start(endpoint, _core.ServerOptions(**options)))
