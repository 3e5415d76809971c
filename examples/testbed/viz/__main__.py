"""python -m viz ENDPOINT | --embed --device URI [--listen ENDPOINT]: the map, and the hazards that are drawn on it, until the
window is closed or Ctrl-C.

d: draw a hazard; click its nodes, and the first again to close it. Nodes can be moved afterwards; Delete takes away the one below the
mouse. Escape: drop what is being drawn. x: remove the newest hazard. q: end.
"""

from __future__ import annotations

import argparse
import contextlib
import signal
import sys
import threading
import time
from pathlib import Path

import forceserver as fs
import numpy as np
from virtualrobot.ground import BadTerrain, Ground, terrain_file

from .app import Viz, period
from .drawing import Drawing
from .picture import NoPicture, Picture
from .show import Show


def options(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="viz", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("endpoint", metavar="ENDPOINT", nargs="?", help="of a server, such as shm:lab")
    parser.add_argument("--name", default="viz", help="of the client (%(default)s)")
    parser.add_argument("--embed", action="store_true", help="scene, servo and device in this process, instead of a server")
    parser.add_argument("--device", metavar="URI", help="of the embedded servo")
    parser.add_argument("--listen", metavar="ENDPOINT", help="lets other clients into the embedded servo")
    parser.add_argument("--follow", metavar="CLIENT",
                        help='keeps the point "pose" of this client in the middle, as a rover in mode drive does')  # fmt: skip
    parser.add_argument("--arm", metavar="CLIENT",
                        help="shows the arm of this client near by; the ground is not felt, as that client gives it")  # fmt: skip
    parser.add_argument("--hazards", type=Path, metavar="FILE", help="a scene file: its hazards are loaded, and saved after each change")
    parser.add_argument("--off-screen", metavar="FILE.png", help="draws into a file, once a second, instead of a window")
    parser.add_argument("--terrain", type=Path, default=terrain_file, metavar="FILE", help="heights, an Esri ASCII grid")
    chosen = parser.parse_args(arguments)
    if chosen.embed == (chosen.endpoint is not None):
        parser.error("either ENDPOINT or --embed")
    if chosen.embed and not chosen.device:
        parser.error("--embed needs --device URI, such as sim:?path=figure8")
    if not chosen.embed and (chosen.device or chosen.listen):
        parser.error("--device and --listen are for --embed")
    if chosen.arm and (chosen.follow or chosen.hazards):
        parser.error("--arm is for looking on: neither --follow nor --hazards goes with it")
    return chosen


def add_controls(viz: Viz, picture: Picture) -> Drawing:
    drawing = Drawing(picture, viz.draw_hazard)
    hazards = viz.hazards
    viz.removed = drawing.take_away

    def set_width(value: float) -> None:
        hazards.width = value
        viz.change_newest()

    def set_newtons(value: float) -> None:
        hazards.newtons = value
        viz.change_newest()

    plotter = picture.plotter
    plotter.add_key_event("d", drawing.begin)
    plotter.add_key_event("Escape", drawing.give_up)
    plotter.add_key_event("x", viz.remove_newest)
    look = {"style": "modern", "title_height": 0.02, "interaction_event": "end"}
    low, high = {"pointa": (0.72, 0.12), "pointb": (0.97, 0.12)}, {"pointa": (0.72, 0.27), "pointb": (0.97, 0.27)}
    plotter.add_slider_widget(set_width, (1, 8), value=hazards.width, title="newest hazard: width, m", **look, **low)
    plotter.add_slider_widget(set_newtons, (0.5, 5), value=hazards.newtons, title="newest hazard: N", **look, **high)
    return drawing


def run(chosen: argparse.Namespace) -> None:
    ground = Ground(chosen.terrain)
    with contextlib.ExitStack() as stack:
        is_near = bool(chosen.follow or chosen.arm)
        picture = Picture(ground, off_screen=chosen.off_screen is not None, is_near=is_near)
        stack.callback(picture.close)
        watched = None
        if chosen.embed:
            scene = stack.enter_context(fs.Scene())
            servo = stack.enter_context(fs.Servo(scene, chosen.device))
            if chosen.listen:
                stack.enter_context(fs.Server(servo, chosen.listen))
                watched = stack.enter_context(fs.connect(chosen.listen, f"{chosen.name} watching"))
        else:
            scene = watched = stack.enter_context(fs.connect(chosen.endpoint, chosen.name))
        viz = Viz(scene, ground, chosen.name, chosen.follow, chosen.arm is None)
        viz.watched = watched or scene
        stack.callback(viz.close)
        # The sliders call back when they are made, so the hazards of the file come after them.
        drawing = add_controls(viz, picture) if chosen.off_screen is None and chosen.arm is None else None
        if chosen.hazards:
            viz.keep_hazards_in(chosen.hazards)
            if drawing:
                for name in viz.hazards.order:
                    nodes = viz.hazards.nodes(name)
                    if len(nodes) >= 3:  # else it is no border
                        drawing.add(name, np.array([[x, y, ground.height(x, y)] for x, y in nodes]))
        viz.begin_to_follow()
        viz.say(f"the ground has {picture.ground.n_cells} triangles")
        loop(viz, Show(viz, picture, watched, chosen.arm), picture, chosen.off_screen)


def loop(viz: Viz, show: Show, picture: Picture, off_screen: str | None) -> None:
    """Until it is to end. What a signal raised inside of VTK would be lost there, so the first one only says that it is to end."""
    ends = threading.Event()

    def end(*_: object) -> None:
        if ends.is_set():
            raise KeyboardInterrupt
        ends.set()

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, end)
    is_silent = False
    while not ends.is_set() and (off_screen is not None or not picture.is_closed):
        begin = time.monotonic()
        try:
            viz.tell_events()
            show.update()
        except TimeoutError as failure:
            if not is_silent:
                viz.say(str(failure))
            is_silent = True
        else:
            is_silent = False
        if off_screen is not None:
            picture.save(off_screen)
            ends.wait(1)
        else:
            picture.go_on()
            ends.wait(max(0.0, begin + period - time.monotonic()))


def main() -> int:
    chosen = options(sys.argv[1:])
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    try:
        run(chosen)
    except KeyboardInterrupt:
        return 0
    except (BadTerrain, NoPicture, fs.Error, OSError) as failure:
        print(f"viz: {failure}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
