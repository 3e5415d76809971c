"""Looks at the server for all browsers: a thread of its own looks when a browser waits for it, 30 times a second at most. The
force of the ticks in between is in the flight record.

What it saw last is a Seen, which never changes. A browser gets of it what is new to it.
"""

from __future__ import annotations

import collections
import functools
import math
import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import forceserver as fs
import numpy as np

from .plain import Plain, Shapes, number, numbers, plain, pose

RATE = 30  # states a second, at most
UNSEEN_RATE = 3  # looks a second while no browser waits for one, so that events are fetched before they are dropped
SAMPLE_RATE = 1000  # forces a second, at most about; of a faster servo the largest ones
KEPT_SAMPLES = 10 * SAMPLE_RATE  # 10 s: a browser that is slower than this misses some
GETS_PER_STATE = 400  # objects that are fetched for one state, so that a scene of thousands does not hold it up

FELT_COLUMNS = 12  # id, state, weight, distance, point 3, force 3, slope wanted, slope applied

Doubles = np.ndarray[Any, np.dtype[np.float64]]
Floats = np.ndarray[Any, np.dtype[np.float32]]


@dataclass(frozen=True)
class Rows:
    """Where all objects are and how they are felt, a row for each."""

    # Position (3) and orientation (4), in the frame of the object's client, at the time of the state. In full, because
    # an edit begins with them.
    poses: Doubles = field(default_factory=lambda: np.zeros((0, 7)))
    # What is only looked at. The id is a uint32; the others are those of fs_report, in the frame of the editor's scene,
    # the point as its offset from the hand.
    felt: Floats = field(default_factory=lambda: np.zeros((0, FELT_COLUMNS), np.float32))

    def new_since(self, last: Rows | None) -> Rows:
        """The rows that differ from the last ones, bit for bit; all of them if there are others than before."""
        bits, poses = self.felt.view(np.uint32), self.poses.view(np.uint64)
        if last is None or len(last.felt) != len(bits):
            return self
        last_bits = last.felt.view(np.uint32)
        if not np.array_equal(bits[:, 0], last_bits[:, 0]):
            return self
        differs = (bits != last_bits).any(axis=1) | (poses != last.poses.view(np.uint64)).any(axis=1)
        return self if differs.all() else Rows(self.poses[differs], self.felt[differs])


@dataclass(frozen=True)
class Known:
    """An object as the page is told of it."""

    id: int
    name: str
    revision: int
    version: int  # the Seen.version in which it last changed
    told: Plain


@dataclass(frozen=True)
class Seen:
    serial: int = 0
    error: str = "not connected yet"  # "": connected
    connection: int = 0
    version: int = 0
    objects: dict[int, Known] = field(default_factory=dict)
    rows: Rows = field(default_factory=Rows)
    samples: Doubles = field(default_factory=lambda: np.zeros((0, 4)))  # time, and the force sent to the device
    sample_count: int = 0  # of all samples ever read: samples holds the last of them
    plain: Plain = field(default_factory=dict)  # time, hand, clients, stats ..
    events: tuple[Plain, ...] = ()


class Look:
    def __init__(self, endpoint: str, name: str, alone: bool, told: Callable[[], None]) -> None:
        """name: of the editor as a client. alone: fail if the name is taken. told: is called after each look."""
        self.endpoint, self.name, self.alone = endpoint, name, alone
        self.scene: fs.Scene | None = None
        self.me = name
        self.connection = 0  # grows with every new connection
        self.shapes = Shapes()
        self.seen = Seen()
        self.is_awaited = threading.Event()  # a browser waits for a state
        self._told = told
        self._ends = threading.Event()
        self._fetching: set[str] = set()
        self._again: set[str] = set()  # objects to fetch even if their revision is the same
        self._ids = 0
        self._numbers: dict[str, int] = {}  # of the other clients, in the order in which they were first seen
        self._event_count = 0
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="look", daemon=True)
        self._forget()

    # ---- For the thread of the event loop and that of the edits.

    def start(self) -> None:
        self._thread.start()

    def close(self) -> None:
        self._ends.set()
        if self._thread.is_alive():
            self._thread.join()
        if self.scene is not None:
            self.scene.close()

    def fetch_again(self, name: str) -> None:
        with self._lock:
            self._again.add(name)

    def look_at_stats(self) -> None:
        """With the next look, as they have changed."""
        self._stats_time = 0.0

    def connect(self) -> None:
        """Raises fs.Error. Two editors cannot have one name: the second is "NAME 2", unless it was told its name."""
        for number_ in range(1, 10):
            self.me = self.name if number_ == 1 else f"{self.name} {number_}"
            try:
                scene = fs.connect(self.endpoint, self.me)
                break
            except fs.ExistsError:
                if self.alone or number_ == 9:
                    raise
        self._forget()
        self.connection += 1  # before the scene is there, so that nobody takes it for the one before
        self.scene = scene

    # ---- The thread.

    def _forget(self) -> None:
        self._by_name: dict[bytes, Known] = {}
        # The names of the last motions, with their revisions, and reports. None: not known.
        self._listed: bytes | None = None
        self._report_names: bytes | None = None
        self._order: Any = None
        self._ids_in_order: Any = None
        self._samples = np.zeros((2 * KEPT_SAMPLES, 4))  # only ever added to: what a Seen has of it stays as it is
        self._filled = self._sample_count = self._tick = 0
        self._events: collections.deque[Plain] = collections.deque(maxlen=200)
        self._view_content, self._views = b"", dict[str, Plain]()
        self._client_content, self._clients = b"", list[Plain]()
        self._stats: Plain = {}
        self._stats_time = 0.0
        self._device: Plain = {}

    def _run(self) -> None:
        version = 0
        last_look = 0.0
        while not self._ends.is_set():
            try:
                if self.scene is None:
                    self.connect()
                scene = self.scene
                assert scene is not None
                time.sleep(max(0.0, last_look + 1 / RATE - time.monotonic()))
                self.is_awaited.wait(max(0.0, last_look + 1 / UNSEEN_RATE - time.monotonic()))
                self.is_awaited.clear()
                # After one that came late the next may come a little early.
                last_look = max(last_look + 1 / RATE, time.monotonic() - 0.25 / RATE)
                self.seen = self._look(scene, version)
                version = self.seen.version
            except fs.TimeoutError:
                self._look_again()
                continue  # the server is busy: the page keeps what it has
            except Exception as error:
                self._look_again()
                if not isinstance(error, fs.Error):
                    traceback.print_exc()  # a bug of the editor: the page says so; the scene stays, as it may be felt
                elif self.scene is not None and isinstance(error, fs.DisconnectedError):
                    self.scene.close()  # of another error, such as no memory or no descriptor, the scene may recover
                    self.scene = None
                self.seen = Seen(self.seen.serial + 1, str(error), self.connection, version)
                self._told()
                self._ends.wait(0.3)
                continue
            self._told()

    def _look_again(self) -> None:
        """The last look came to nothing: the next one is to find all that it had found."""
        self._listed = None
        for name in self._fetching:
            self.fetch_again(name)

    def _read_forces(self, scene: fs.Scene, now: float) -> None:
        """Takes the forces of the ticks since the last look, so that no peak is missed."""
        record = np.asarray(scene.get_record(self._tick))
        if len(record):
            self._tick = int(record["number"][-1])
            struct, ticks = record.dtype, _matrix(record).view(float)
            time_at, force_at = _word(struct, "tick", "state", "time"), _word(struct, "tick", "sent", "force")
            each = math.ceil((self._stats["rate"] or 0) / (1.05 * SAMPLE_RATE))
            if each > 1:
                ticks = ticks[_peaks(ticks[:, force_at : force_at + 3], each)]
            times, forces = ticks[:, time_at], ticks[:, force_at : force_at + 3]
            if times.min() <= 0:  # ticks of a device that was not there
                times, forces = times[times > 0], forces[times > 0]
        else:
            times, forces = np.zeros(0), np.zeros((0, 3))
        last = self._samples[self._filled - 1, 0] if self._filled else 0
        if not len(times) and self._stats["faults"] and now > last:  # no record: there is no force
            times, forces = np.array([now]), np.zeros((1, 3))
        new = len(times)
        if self._filled + new > len(self._samples):
            kept = self._samples[self._filled - min(KEPT_SAMPLES, self._filled) : self._filled]
            self._samples = np.concatenate([kept, np.zeros((KEPT_SAMPLES + new, 4))])
            self._filled = len(kept)
        added = self._samples[self._filled : self._filled + new]
        added[:, 0], added[:, 1:] = times, forces
        self._filled += new
        self._sample_count += new

    def _look(self, scene: fs.Scene, version: int) -> Seen:
        last = self.seen
        motions, reports = np.asarray(scene.get_motions()), np.asarray(scene.get_reports())
        version, objects = self._find_objects(scene, motions, version, last.objects)
        if version != last.version:
            self.shapes.keep({known.told["shape"]["hash"] for known in objects.values() if known.told["shape"]})
        self._take_events(scene)
        if time.monotonic() > self._stats_time + 0.5:
            self._stats, self._stats_time = _stats(scene.get_servo_stats()), time.monotonic()
        if not self._device:
            self._device = _device(scene.get_device_info())
        hand, now = scene.hand(), scene.get_time()
        self._read_forces(scene, now)
        return Seen(
            last.serial + 1,
            "",
            self.connection,
            version,
            objects,
            self._rows(now, hand.state.pose.position, motions, reports),
            self._samples[max(0, self._filled - KEPT_SAMPLES) : self._filled],
            self._sample_count,
            {"time": now, "me": self.me, "device": self._device, "stats": self._stats}
            | {"hand": _hand(hand), "clients": self._find_clients(scene)},
            tuple(self._events),
        )

    def _find_objects(
        self, scene: fs.Scene, motions: Any, version: int, before: dict[int, Known]
    ) -> tuple[int, dict[int, Known]]:
        """Fetches the objects that are new or have changed."""
        with self._lock:
            again, self._again = self._again, set()
        self._fetching = again
        names, revisions = motions["name"], motions["revision"]
        listed = names.tobytes() + revisions.tobytes()
        if not again and listed == self._listed:
            return version, before
        version += 1
        fetched, missed, by_name = 0, False, {}
        for name, revision in zip(names.tolist(), revisions.tolist(), strict=True):
            known = self._by_name.get(name)
            text = str(name)
            if known is None or known.revision != revision or text in again:
                if fetched == GETS_PER_STATE:
                    missed = True
                    if text in again:
                        self.fetch_again(text)
                    if known is None:
                        continue
                else:
                    fetched += 1
                    known = self._fetch(scene, text, revision, version, known)
                    if known is None:
                        continue
            by_name[name] = known
        self._by_name = by_name
        self._listed = None if missed else listed
        self._report_names = None
        self._ids_in_order = np.array([by_name[n].id if n in by_name else 0 for n in names.tolist()], np.uint32)
        return version, {known.id: known for known in by_name.values()}

    def _fetch(self, scene: fs.Scene, name: str, revision: int, version: int, before: Known | None) -> Known | None:
        try:
            found = scene.object_get(name)
        except fs.NotFoundError:
            return None  # it has gone since the list was made
        if before is None:
            self._ids += 1
        id_ = self._ids if before is None else before.id
        client, _, rest = name.rpartition("/")
        told = {"id": id_, "name": name, "client": client or self.me, "own": not client, "short": rest}
        return Known(id_, name, revision, version, told | plain(found, self.shapes))

    def _rows(self, now: float, hand: Doubles, motions: Any, reports: Any) -> Rows:
        if (names := reports["name"].tobytes()) != self._report_names:
            self._report_names = names
            places = {name: i for i, name in enumerate(reports["name"].tolist())}
            order = [places.get(name, -1) for name in motions["name"].tolist()]
            self._order = slice(None) if order == list(range(len(places))) else np.array(order, int)
            self._is_reported = np.array(order, int) >= 0
        poses = _words(motions, "pose", "twist").view(float).copy()
        if motions["horizon"].any():
            moving = np.flatnonzero(motions["horizon"])
            moves = np.zeros(len(moving), fs.Motion.dtype)
            for part in ("pose", "twist", "time", "horizon"):
                moves[part] = motions[part][moving]
            poses[moving] = fs.motion_at(moves, now).view(float).reshape(-1, 7)
        felt = np.zeros((len(motions), FELT_COLUMNS), np.float32)
        felt.view(np.uint32)[:, 0] = self._ids_in_order
        if len(reports):
            felt[:, 1] = reports["state"][self._order]
            columns = _words(reports, "weight", "reserved").view(float)[self._order]
            felt[:, 2:10] = columns[:, [0, 3, 4, 5, 6, 7, 8, 9]]  # weight, distance, point, force
            felt[:, 4:7] = columns[:, 4:7] - hand
            with np.errstate(over="ignore"):  # what is more than a float32 can hold is infinite there
                felt[:, 10:] = columns[:, 1:3]  # the slopes
            felt[~np.isfinite(columns[:, 3]), 4:7] = 0  # what is too far to be felt has no point
            if not self._is_reported.all():
                felt[~self._is_reported, 1:] = 0
        is_known = self._ids_in_order > 0
        return Rows(poses, felt) if is_known.all() else Rows(poses[is_known], felt[is_known])

    def _find_clients(self, scene: fs.Scene) -> list[Plain]:
        views, clients = np.asarray(scene.get_views()), np.asarray(scene.get_clients())
        if (content := views.tobytes()) != self._view_content:
            self._view_content, self._client_content = content, b""
            self._views = {name: _view(view) for name, view in views.tolist()}
        if (content := clients.tobytes()) != self._client_content:
            self._client_content = content
            self._clients = []
            for name, force in zip(clients["name"].tolist(), clients["wrench"]["force"].tolist(), strict=True):
                if name not in self._views:
                    continue  # it has just come
                told: Plain = {"name": name, "force": numbers(force)} | self._views[name]
                if name not in (self.me, "server"):
                    told["number"] = self._numbers.setdefault(name, len(self._numbers))
                self._clients.append(told)
        return self._clients

    def _take_events(self, scene: fs.Scene) -> None:
        for event in scene.events(0):
            if event.kind == fs.EventKind.DISCONNECTED:
                raise fs.DisconnectedError(event.text or "the server is gone")
            if event.name and event.kind in (fs.EventKind.EDITED, fs.EventKind.REFUSED):
                self.fetch_again(event.name)
            self._event_count += 1
            told = {"serial": self._event_count, "kind": event.kind.name.lower(), "name": event.name}
            self._events.append(told | {"text": event.text, "value": number(event.value), "time": event.time})


def _peaks(forces: Doubles, each: int) -> Any:
    """Of each so many forces, the number of the largest."""
    starts = np.arange(0, len(forces), each)
    sizes = np.full(len(starts) * each, -1.0)
    sizes[: len(forces)] = (forces * forces).sum(axis=1)
    return starts + sizes.reshape(-1, each).argmax(axis=1)


def _words(listed: Any, first: str, last: str) -> Any:
    """The fields of a list of structs from `first` until `last`, as a matrix of numbers of 64 bits: quick to compare."""
    return _matrix(listed)[:, _word(listed.dtype, first) : _word(listed.dtype, last)]


def _matrix(listed: Any) -> Any:
    """A list of structs as numbers of 64 bits, a row for each struct."""
    return listed.view(np.uint64).reshape(len(listed), listed.dtype.itemsize // 8)


@functools.cache
def _word(struct: Any, *path: str) -> int:
    """The column of that matrix at which a field begins, by its name and, before it, those of the structs it is in."""
    at = 0
    for name in path:
        struct, offset = struct.fields[name][:2]
        at += offset
    return at // 8


def _view(view: Any) -> Plain:
    """view: the fields of fs_view, in their order."""
    (pose, scale, force_scale, _), tool, points, count, held, locked = view[:6]
    return {
        "frame": {"pose": _pose(pose), "scale": scale, "force_scale": force_scale},
        "tool": _pose(tool),
        "points": points[:count].tolist(),
        "held": held,
        "locked": locked,
    }


def _pose(value: Any) -> Plain:
    position, orientation = value
    return {"position": position.tolist(), "orientation": orientation.tolist()}


def _hand(hand: fs.Hand) -> Plain:
    speed = float(np.linalg.norm(hand.state.twist.linear))
    return {"pose": pose(hand.state.pose), "sent": numbers(hand.sent.force), "speed": round(speed, 4)}  # a hand at rest is calm


def _stats(stats: fs.ServoStats) -> Plain:
    names = ("rate", "late_p50", "late_p99", "late_max", "compute_p99", "damping")
    faults = [fs.fault_name(int(fault)) for fault in fs.Fault if stats.faults & fault]
    told: Plain = {name: number(getattr(stats, name)) for name in names}
    return told | {"misses": int(stats.misses), "enabled": int(stats.enabled), "faults": faults}


def _device(info: fs.DeviceInfo) -> Plain:
    names = ("name", "workspace_radius", "workspace_height", "force_max", "rate")
    return {name: getattr(info, name) for name in names}
