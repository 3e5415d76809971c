"""The types of forceserver.idl for cyclonedds (PyPI), those that this example needs. What the fields mean is told there."""
from dataclasses import dataclass, field

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.annotations import final
from cyclonedds.idl.types import array, bounded_str, float32, float64, int32, sequence, uint32, uint64

name63, name20, content_key = bounded_str[63], bounded_str[20], bounded_str[32]


def keyed(*names):
    """The keys, described as the idlc of Cyclone DDS does it."""
    def mark(struct):
        for name in names:
            struct.__idl_field_annotations__.setdefault(name, {}).update(key=True, must_understand=True)
        return struct
    return mark


def made(struct, **values):
    return field(default_factory=lambda: struct(**values))


@dataclass
@final
class Vec3(IdlStruct, typename="forceserver.Vec3"):
    x: float64 = 0
    y: float64 = 0
    z: float64 = 0


@dataclass
@final
class Quat(IdlStruct, typename="forceserver.Quat"):
    w: float64 = 1
    x: float64 = 0
    y: float64 = 0
    z: float64 = 0


@dataclass
@final
class Pose(IdlStruct, typename="forceserver.Pose"):
    position: Vec3 = made(Vec3)
    orientation: Quat = made(Quat)


@dataclass
@final
class Twist(IdlStruct, typename="forceserver.Twist"):
    linear: Vec3 = made(Vec3)
    angular: Vec3 = made(Vec3)


@dataclass
@final
class Profile(IdlStruct, typename="forceserver.Profile"):
    kind: int32 = 0
    sense: int32 = 0
    gain: float64 = 0
    width: float64 = 0
    limit: float64 = 0
    reach: float64 = 0
    shift: float64 = 0
    curve: content_key = ""


@dataclass
@final
class Contact(IdlStruct, typename="forceserver.Contact"):
    keep: int32 = 0
    stiffness: float64 = 0
    limit: float64 = 0
    damping: float64 = 0
    friction: float64 = 0


@dataclass
@final
@keyed("site", "client", "name")
class ForceObject(IdlStruct, typename="forceserver.ForceObject"):
    site: name20 = ""
    client: name63 = ""
    name: name63 = ""
    session: uint64 = 0
    revision: uint64 = 0
    change: uint64 = 0
    change_size: uint32 = 1
    primitive: int32 = 0
    place: Pose = made(Pose)
    motion: Twist = made(Twist)
    time: float64 = 0
    start: float64 = 0
    horizon: float64 = 0
    front: Profile = made(Profile)
    back: Profile = made(Profile)
    damping: float64 = 0
    solid: Contact = made(Contact)
    form: content_key = ""
    finish: content_key = ""
    tool_points: uint32 = 0
    enabled: bool = True


@dataclass
@final
@keyed("content", "piece")
class Shape(IdlStruct, typename="forceserver.Shape"):
    content: content_key = ""
    piece: uint32 = 0
    pieces: uint32 = 1
    primitive: int32 = 0
    is_closed: bool = False
    points: sequence[Vec3, 2700] = made(list)
    triangles: sequence[uint32, 16200] = made(list)


@dataclass
@final
@keyed("content", "piece")
class Curve(IdlStruct, typename="forceserver.Curve"):
    content: content_key = ""
    piece: uint32 = 0
    pieces: uint32 = 1
    expression: bounded_str[255] = ""
    step: float64 = 0
    forces: sequence[float64, 8192] = made(list)


@dataclass
@final
class Moved(IdlStruct, typename="forceserver.Moved"):
    client: name63 = ""
    name: name63 = ""
    revision: uint64 = 0
    place: Pose = made(Pose)
    twist: array[float32, 6] = made(lambda: [0.0] * 6)
    horizon: float32 = 0
    time: float64 = 0


@dataclass
@final
@keyed("site")
class Motions(IdlStruct, typename="forceserver.Motions"):
    site: name20 = ""
    session: uint64 = 0
    number: uint64 = 0
    sent: float64 = 0
    moves: sequence[Moved, 100] = made(list)


@dataclass
@final
@keyed("site")
class Hand(IdlStruct, typename="forceserver.Hand"):
    site: name20 = ""
    number: uint64 = 0
    sent: float64 = 0
    time: float64 = 0
    place: Pose = made(Pose)
    motion: Twist = made(Twist)
    force: Vec3 = made(Vec3)
    torque: Vec3 = made(Vec3)
    flags: uint32 = 0
    buttons: uint32 = 0


@dataclass
@final
class Report(IdlStruct, typename="forceserver.Report"):
    client: name63 = ""
    name: name63 = ""
    state: int32 = 0
    weight: float64 = 0
    distance: float64 = 0
    at: Vec3 = made(Vec3)
    force: Vec3 = made(Vec3)
    torque: Vec3 = made(Vec3)


@dataclass
@final
@keyed("site")
class Reports(IdlStruct, typename="forceserver.Reports"):
    site: name20 = ""
    number: uint64 = 0
    sent: float64 = 0
    felt: sequence[Report, 64] = made(list)


@dataclass
@final
class HeldObjects(IdlStruct, typename="forceserver.HeldObjects"):
    site: name20 = ""
    objects: uint32 = 0
    digest: uint64 = 0


@dataclass
@final
@keyed("site")
class Status(IdlStruct, typename="forceserver.Status"):
    site: name20 = ""
    session: uint64 = 0
    version: bounded_str[31] = ""
    has_server: bool = False
    is_mirror: bool = False
    mirrors: name20 = ""
    device: name63 = ""
    force_axes: uint32 = 0
    torque_axes: uint32 = 0
    workspace_radius: float64 = 0
    workspace_height: float64 = 0
    workspace_angle: float64 = 0
    force_max: float64 = 0
    torque_max: float64 = 0
    device_damping: float64 = 0
    mass: float64 = 0
    rate: float64 = 0
    max_stiffness: float64 = 0
    damping: float64 = 0
    delay: float64 = 0
    faults: uint32 = 0
    enabled: bool = False
    motion_rate: float64 = 0
    objects: uint32 = 0
    digest: uint64 = 0
    held: sequence[HeldObjects, 64] = made(list)
    wanted: sequence[bounded_str[32], 16] = made(list)


@dataclass
@final
class EditedObject(IdlStruct, typename="forceserver.EditedObject"):
    primitive: int32 = 0
    place: Pose = made(Pose)
    motion: Twist = made(Twist)
    time: float64 = 0
    start: float64 = 0
    horizon: float64 = 0
    front: Profile = made(Profile)
    back: Profile = made(Profile)
    damping: float64 = 0
    solid: Contact = made(Contact)
    form: content_key = ""
    finish: content_key = ""
    tool_points: uint32 = 0
    enabled: bool = True


@dataclass
@final
@keyed("site", "client", "name")
class Edit(IdlStruct, typename="forceserver.Edit"):
    site: name20 = ""
    client: name63 = ""
    name: name63 = ""
    asker: name20 = ""
    editor: name63 = ""
    number: uint64 = 0
    removes: bool = False
    parts: uint32 = 0
    wanted: EditedObject = made(EditedObject)


@dataclass
@final
@keyed("site")
class Answer(IdlStruct, typename="forceserver.Answer"):
    site: name20 = ""
    answerer: name20 = ""
    number: uint64 = 0
    is_stop: bool = False
    result: int32 = 0
    text: bounded_str[255] = ""
