"""python -m virtualrobot ENDPOINT [--mode drive|map|arm]: the rover as a client of a force-server, until Ctrl-C."""

from __future__ import annotations

import argparse
import contextlib
import math
import signal
import sys

import forceserver as fs

from .ground import BadTerrain, terrain_file
from .options import options
from .pace import Pace
from .recording import Recorder, make_robot
from .robot import period
from .world import World


name = "rover"  # of the client


def say(text: str) -> None:
    print(f"{name}: {text}", flush=True)


def where(world: World) -> str:
    compass = (90 - math.degrees(world.heading)) % 360
    x, y, _ = world.position
    return f"at {x:.1f} m east, {y:.1f} m north, heading {compass:.0f} degrees"


def tell_events(scene: fs.Scene) -> None:
    for event in scene.events(0):
        if event.kind == fs.EventKind.DISCONNECTED:
            raise ConnectionError("the server has gone")
        if event.kind == fs.EventKind.REFUSED:
            say(f"the server does not take {event.name}: {event.text}")
        if event.kind == fs.EventKind.EDITED:
            say(f"{event.name} was {'edited' if event.name in scene else 'removed'} by {event.text}")
        if event.kind == fs.EventKind.DEVICE:
            is_ready = event.status == 0
            say(f"the device {event.name} is ready" if is_ready else f"no force from the device {event.name}: {event.text}")


def run(chosen: argparse.Namespace) -> None:
    terrain = chosen.terrain or terrain_file
    world = World(terrain)
    with contextlib.ExitStack() as stack:
        scene = stack.enter_context(fs.connect(chosen.endpoint, chosen.name))
        file = stack.enter_context(chosen.record.open("w")) if chosen.record else None
        robot = make_robot(scene, world, chosen.mode)
        recorder = Recorder(file, chosen.mode, terrain, world.ground) if file else None
        if recorder:
            stack.callback(recorder.end)
        say(f"it stands {where(world)}; mode {chosen.mode}")
        pace = Pace(period)
        time = scene.time - period
        try:
            while True:
                time += pace.wait() * period  # by whole periods, so that a frame that is a little late makes no step
                hand = scene.hand()
                said = robot.frame(hand, time)
                if recorder:
                    recorder.add(hand, time, world)
                if said:
                    say(said)
                robot.changes.attempt("events", lambda: tell_events(scene))
                if pace.frames % 100 == 0:
                    say(where(world))
        finally:
            say(f"{pace}")


def main() -> int:
    global name
    chosen = options(sys.argv[1:])
    name = chosen.name
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    try:
        run(chosen)
    except KeyboardInterrupt:
        return 0
    except fs.DisconnectedError:
        print("virtualrobot: the server has gone", file=sys.stderr)
        return 1
    except (BadTerrain, fs.Error, OSError) as failure:
        print(f"virtualrobot: {failure}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
