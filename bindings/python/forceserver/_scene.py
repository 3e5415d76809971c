"""Scenes as mappings, tools, devices, servos and servers."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterable, Iterator, KeysView, Mapping, MutableMapping
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar, Unpack, overload

import numpy as np

from . import _core
from ._core import Error, EventKind, Object, StateError, Twist
from ._objects import _put, fields_of

__all__ = ["Device", "Hand", "Scene", "SceneObject", "Server", "Servo", "Tool", "connect", "devices", "drivers"]

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ._core import (
        Array,
        Event,
        Report,
        Contact,
        Frame,
        Pose,
        Primitive,
        Profile,
        Response,
        Rotation,
        Rows,
        ServerOptionsFields,
        ServoOptionsFields,
        ServoStats,
        Shape,
        Surface,
        State,
        Structs,
        Wrench,
    )
    from ._objects import Common

Got = TypeVar("Got")
Given = TypeVar("Given")
_NOTHING = object()


class Hand(NamedTuple):
    """The hand at the last tick: its state, what it feels of this scene, and what the device got of all."""

    state: State
    response: Response
    sent: Wrench


class _Field(Generic[Got, Given]):
    """A field of an object in a scene: read anew each time, as a copy that cannot be changed; set by SceneObject.change."""

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name
        self.__doc__ = getattr(Object, name).__doc__

    @overload
    def __get__(self, one: None, owner: type) -> _Field[Got, Given]: ...
    @overload
    def __get__(self, one: SceneObject, owner: type) -> Got: ...
    def __get__(self, one: SceneObject | None, owner: type) -> _Field[Got, Given] | Got:
        if one is None:
            return self
        value = getattr(one.object, self.name)
        return value._constant() if hasattr(value, "_constant") else value  # type: ignore[no-any-return]

    def __set__(self, one: SceneObject, value: Given) -> None:
        one.change(**{self.name: value})  # type: ignore[arg-type]


class SceneObject:
    """What has a name in a scene: scene["rock"]. It reads the scene anew at each use. Its fields can be set:
    scene["rock"].enabled = False."""

    __slots__ = ("name", "scene")

    def __init__(self, scene: Scene, name: str) -> None:
        self.scene = scene
        self.name = name

    primitive: _Field[Primitive, int | str] = _Field()
    pose: _Field[Pose, Pose] = _Field()
    twist: _Field[Twist, Twist] = _Field()
    time: _Field[float, float] = _Field()
    start: _Field[float, float] = _Field()
    lifetime: _Field[float, float] = _Field()
    front: _Field[Profile, Profile] = _Field()
    back: _Field[Profile, Profile] = _Field()
    damping: _Field[float, float] = _Field()
    contact: _Field[Contact, Contact] = _Field()
    shape: _Field[Shape | None, Shape | None] = _Field()
    surface: _Field[Surface | None, Surface | None] = _Field()
    tool_points: _Field[int, int] = _Field()
    enabled: _Field[bool, bool] = _Field()

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
        """Puts it somewhere, where it stands still. For a stream of moves use stream().

        position: m. orientation: (w, x, y, z), or scipy's Rotation (scipy's own order is x, y, z, w). What is not given
        is what is felt now; another thread or client that moves it meanwhile is overruled. twist: how it moves from then
        on, for 0.1 s at most. time: s, on the scene's clock; 0: now.
        """
        self.scene.object_move(self.name, self._pose(position, orientation, time), twist or Twist(), time)

    def stream(
        self,
        position: ArrayLike | None = None,
        orientation: ArrayLike | Rotation | None = None,
        *,
        time: float = 0,
    ) -> None:
        """One of a stream of moves, as of what a tracker or a simulation follows: how it moves is worked out from this
        and the last move, if that is at most 0.2 s old. After the last one it comes to rest up to two steps too far.
        """
        self.scene.object_move(self.name, self._pose(position, orientation, time), None, time)

    def _pose(self, position: ArrayLike | None, orientation: ArrayLike | Rotation | None, time: float = 0) -> Pose:
        """With what is felt now for what is not given."""
        if position is not None and orientation is not None:
            return _core.Pose(position=position, orientation=orientation)  # type: ignore[typeddict-item, unused-ignore]
        client, slash, _ = self.name.rpartition("/")
        for motion in self.scene.get_motions(client if slash else self.scene._client):
            if motion["name"] == self.name:
                break
        else:
            self.scene.object_get(self.name)  # says what is wrong
            raise StateError(f"object '{self.name}' came or went meanwhile")
        one = np.zeros(1, _core.Motion.dtype)
        for part in ("pose", "twist", "time", "horizon"):
            one[part] = motion[part]
        (at,) = _core.motion_at(one, time or self.scene.time)
        pose = _core.Pose(position=at["position"], orientation=at["orientation"])  # type: ignore[typeddict-item, unused-ignore]
        if position is not None:
            pose.position = position
        if orientation is not None:
            pose.orientation = orientation
        return pose

    def change(self, **fields: Unpack[Common]) -> None:
        """Changes these fields of Object (position and orientation are also names here) and leaves the rest. What is
        put somewhere else stands still there, unless twist is given."""
        places = ("pose", "position", "orientation", "twist")
        moved: dict[str, Any] = {name: value for name, value in fields.items() if name in places}
        other = {name: value for name, value in fields.items() if name not in places}
        if not moved or "time" in fields:
            return self._change(fields)
        fields_of(moved)
        made = Object()
        _put(made, fields)  # refuses what cannot be
        pose = made.pose
        if "pose" not in moved:
            pose = self._pose(moved.get("position"), moved.get("orientation"))
        if not other:
            return self.scene.object_move(self.name, pose, made.twist, 0)
        with self.scene._group():
            self._change(other)  # type: ignore[arg-type]
            self.scene.object_move(self.name, pose, made.twist, 0)

    def _change(self, fields: Common) -> None:
        bits = fields_of(dict(fields))
        changed = self.object
        _put(changed, fields)
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

    __slots__ = ("_client", "_endpoint")
    _client: str | None  # of a connected scene
    _endpoint: str | None  # "" of one whose maker did not tell

    def __init__(self, handle: _core.Scene | None = None) -> None:
        super().__init__(_core.scene_create() if handle is None else handle)
        self._client, self._endpoint = None, None if handle is None else ""

    # ---- A mapping of names to objects

    def __setitem__(self, name: str, value: Object | SceneObject) -> None:
        if not isinstance(value, (Object, SceneObject)):
            raise TypeError(f"a scene holds Objects (fs.Point, fs.Mesh ..), not {type(value).__name__}")
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
        except (KeyError, ValueError):  # ValueError: no object can have such a name
            return False
        return True

    def __iter__(self) -> Iterator[str]:
        """The names of the scene's own objects."""
        names = self.get_motions(self._client)["name"].tolist()
        return iter([name for name in names if "/" not in name])

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __bool__(self) -> bool:
        return True

    def keys(self) -> KeysView[str]:
        return KeysView(self)

    def values(self) -> list[SceneObject]:
        return [SceneObject(self, name) for name in self]

    def items(self) -> list[tuple[str, SceneObject]]:
        return [(name, SceneObject(self, name)) for name in self]

    @overload
    def get(self, name: str) -> SceneObject | None: ...
    @overload
    def get(self, name: str, default: Given) -> SceneObject | Given: ...
    def get(self, name: str, default: Any = None) -> Any:
        return SceneObject(self, name) if name in self else default

    @overload
    def pop(self, name: str) -> Object: ...
    @overload
    def pop(self, name: str, default: Given) -> Object | Given: ...
    def pop(self, name: str, default: Any = _NOTHING) -> Any:
        """Removes an object, and gives a copy of it."""
        if default is not _NOTHING and name not in self:
            return default
        taken = self.object_get(name)
        self.object_remove(name)
        return taken

    def popitem(self) -> tuple[str, Object]:
        """Removes the object that is listed first, and gives its name and a copy."""
        for name in self:
            return name, self.pop(name)
        raise KeyError("popitem(): the scene is empty")

    def setdefault(self, name: str, default: Object | SceneObject) -> SceneObject:
        """The object of this name; where there is none, `default` is set first."""
        if name not in self:
            self[name] = default
        return SceneObject(self, name)

    def update(
        self,
        objects: Mapping[str, Object] | Iterable[tuple[str, Object]] = (),
        /,
        **more: Object,
    ) -> None:
        """Sets several objects, one after the other; in `with scene.change()` all of them or none."""
        for name, value in [*(objects.items() if isinstance(objects, Mapping) else objects), *more.items()]:
            self[name] = value

    def _ipython_key_completions_(self) -> list[str]:
        """What scene['<Tab> offers: the names of all objects that the scene can see."""
        return self.get_motions(None)["name"].tolist()  # type: ignore[no-any-return]

    # ---- Groups

    @contextlib.contextmanager
    def change(self) -> Iterator[Scene]:
        """with scene.change(): a group: several changes, felt from one tick on.

        It belongs to this thread: changes of other threads go past it. An exception takes all back. It cannot be
        nested: StateError.
        """
        with self._group(may_join=False):
            yield self

    @contextlib.contextmanager
    def _group(self, may_join: bool = True) -> Iterator[None]:
        """A group; or where this thread has one open, and may_join, that one."""
        thread = threading.get_ident()
        is_open = False  # before
        try:
            try:
                self.begin()
            except StateError as error:
                is_open = True  # or the scene is closed
                if self.closed:
                    raise
                if not may_join:
                    raise StateError("scene.change() cannot be nested") from error
            yield
            if not is_open:
                if threading.get_ident() != thread:
                    raise StateError("a group can only be committed in the thread that has opened it")
                self.commit()
        except BaseException:
            if not is_open and threading.get_ident() == thread:
                with contextlib.suppress(Error):
                    self.cancel()
            raise

    # ---- Frame, clutch, tool: as copies that cannot be changed

    @property
    def frame(self) -> Frame:
        """Between the scene and the device."""
        return self.get_frame()._constant()

    @frame.setter
    def frame(self, frame: Frame) -> None:
        self.set_frame(frame)

    @property
    def clutch(self) -> bool:
        """Whether it is held: the hand moves, the tool stays and the force of this scene fades out."""
        return self.get_view().held

    @clutch.setter
    def clutch(self, held: bool) -> None:
        self.set_clutch(held)

    @property
    def tool(self) -> Array:
        """The points of the tool, in the frame of the handle (m, shape (n, 3))."""
        points = self.get_tool()
        points.flags.writeable = False
        return points

    @tool.setter
    def tool(self, points: ArrayLike) -> None:
        self.set_tool(points)

    @property
    def tool_radius(self) -> float:
        """The radius of the tool's points (m); 0: they are points."""
        return self.get_tool_radius()

    @tool_radius.setter
    def tool_radius(self, radius: float) -> None:
        self.set_tool_radius(radius)

    # ---- What is felt

    def evaluate(
        self, positions: ArrayLike, out: Array | None = None, *, name: str | None = None, time: float = 0
    ) -> Array:
        """The forces (N) that a resting point feels at positions (m), of all objects or of one: an array of vectors, or a
        grid of them, of shape (.., 3). out: where they are written; it is returned, else a new array of that shape. time:
        s, on the scene's clock; 0: now."""
        return self.evaluate_field(name, time, positions, out)

    def hand(self) -> Hand:
        """The hand of the servo that runs this scene, here or at the server."""
        return Hand(*self.get_hand())

    @property
    def time(self) -> float:
        """The scene's clock, s."""
        return self.get_time()

    @time.setter
    def time(self, time: float) -> None:
        self.set_time(time)

    def events(self, timeout: float | None = None) -> Iterator[Event]:
        """Events as they come. timeout: s that it waits for each before it ends; None: for ever, 0: what is there. After
        DISCONNECTED there are no more."""
        while (event := self.next_event(float("inf") if timeout is None else timeout)).kind != EventKind.NONE:
            yield event
            if event.kind == EventKind.DISCONNECTED:
                return

    def __repr__(self) -> str:
        endpoint = getattr(self, "_endpoint", "")
        if self.closed or endpoint == "":
            return super().__repr__()
        if endpoint is not None:
            return f"<forceserver.Scene of {self._client!r} at {endpoint!r}>"
        try:
            return f"<forceserver.Scene of {len(self)} object{'' if len(self) == 1 else 's'}>"
        except Error:
            return super().__repr__()


MutableMapping.register(Scene)


def connect(endpoint: str, client_name: str) -> Scene:
    """A scene at a server: connect("shm:lab", "rover"). "shm:lab?timeout=5" waits for one that is not there yet."""
    scene = Scene(_core.scene_connect(endpoint, client_name))
    scene._client, scene._endpoint = client_name, endpoint
    return scene


class Tool(_core.Tool):
    """What touches a scene in a loop of one's own; the application owns time, device and safety. Close it when it is no
    longer needed.

    points: of the tool, in the frame of the handle (m, shape (n, 3)); None: those of the scene's tool.

        state, response = fs.State(), fs.Response()        # kept: this is the quick way
        tool.evaluate(state, out=response)
        states = np.zeros(1000, fs.State.dtype)            # or many at once
        forces = tool.evaluate(states)["wrench"]["force"]

    Where one of many states cannot be evaluated, the error names it, and `out` has the responses of those before it.
    """

    __slots__ = ()

    def __init__(self, scene: _core.Scene, points: ArrayLike | None = None) -> None:
        super().__init__(scene.tool_create(points))


class Device(_core.Device):
    """A haptic device or the simulator: Device("sim:?path=figure8"). device_open has all options."""

    __slots__ = ("uri",)

    def __init__(self, uri: str = "sim:") -> None:
        super().__init__(_core.device_open(uri))
        self.uri = uri

    def __repr__(self) -> str:
        return _named(self, repr(getattr(self, "uri", "")))


def devices() -> Rows:
    """The devices that can be opened: an array with the fields of DeviceEntry."""
    return _core.device_list()


def drivers() -> Rows:
    """The drivers that are known, and why one cannot be used: an array with the fields of DriverInfo. Loads all modules."""
    return _core.driver_list()


class Servo(_core.Servo):
    """The loop between a scene and a device; it runs until close() or the end of its `with`.

    options are the fields of ServoOptions: mode ("thread", "caller", "virtual"), rate, force_limit, fade ..
    A servo that is collected, or alive when the interpreter ends, is stopped; the force is 0 first.
    """

    __slots__ = ("device", "scene")

    def __init__(
        self, scene: _core.Scene, device: _core.Device | str = "sim:", **options: Unpack[ServoOptionsFields]
    ) -> None:
        for value, name, wanted in ((scene, "scene", _core.Scene), (device, "device", (_core.Device, str))):
            if not isinstance(value, wanted):
                raise TypeError(f"{name} must be a {name.capitalize()}, not {type(value).__name__}")
        self.scene = scene
        self.device = Device(device) if isinstance(device, str) else device
        super().__init__(scene.servo_start(self.device, _core.ServoOptions(**options)))

    @property
    def stats(self) -> ServoStats:
        """How it does."""
        if self.closed:
            raise StateError("this Servo is closed")
        if self.scene.closed:
            raise StateError("the scene of this servo is closed, and its stats with it; the servo runs on until close()")
        return self.scene.get_servo_stats()

    @property
    def enabled(self) -> bool:
        """False: no force, from the next tick on. True: it ramps up again, also after a fault that was kept."""
        return bool(self.stats.enabled)

    @enabled.setter
    def enabled(self, enabled: bool) -> None:
        self.set_enabled(enabled)

    def __repr__(self) -> str:
        return _named(self, f"on {getattr(self, 'device', None)!r}")

    @property
    def record(self) -> Structs:
        """The flight record: the newest ticks, an array of Tick.dtype."""
        return self.get_record()


class Server(_core.Server):
    """Lets other processes into a servo: Server(servo, "shm:lab"). options are the fields of ServerOptions. The servo runs
    while the server is kept."""

    __slots__ = ("endpoint", "servo")

    def __init__(self, servo: _core.Servo, endpoint: str, **options: Unpack[ServerOptionsFields]) -> None:
        if not isinstance(servo, _core.Servo):
            raise TypeError(f"servo must be a Servo, not {type(servo).__name__}")
        super().__init__(servo.server_start(endpoint, _core.ServerOptions(**options)))
        self.servo = servo  # which is not collected before this
        self.endpoint = endpoint

    def __repr__(self) -> str:
        return _named(self, f"at {getattr(self, 'endpoint', '')!r}")


def _named(handle: Device | Servo | Server, what: str) -> str:
    return f"<{'closed ' if handle.closed else ''}forceserver.{type(handle).__name__} {what}>"
