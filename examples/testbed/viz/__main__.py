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
import time
from pathlib import Path

import forceserver as fs
from virtualrobot.ground import BadTerrain, Ground, terrain_file

from .app import Viz, wait_for_frame
from .drawing import Drawing
from .picture import NoPicture, Picture


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
    parser.add_argument("--hazards", type=Path, metavar="FILE", help="a scene file: loaded where it exists, and saved at the end")
    parser.add_argument("--off-screen", metavar="FILE.png", help="draws into a file, once a second, instead of a window")
    parser.add_argument("--terrain", type=Path, default=terrain_file, metavar="FILE", help="heights, an Esri ASCII grid")
    chosen = parser.parse_args(arguments)
    if chosen.embed == (chosen.endpoint is not None):
        parser.error("either ENDPOINT or --embed")
    if chosen.embed and not chosen.device:
        parser.error("--embed needs --device URI, such as sim:?path=figure8")
    if not chosen.embed and (chosen.device or chosen.listen):
        parser.error("--device and --listen are for --embed")
    return chosen


def load(viz: Viz, path: Path) -> None:
    with fs.Scene() as file:
        file.load(str(path))
        with viz.scene.change():
            for name in file:
                viz.scene[name] = file[name]


def save(viz: Viz, path: Path) -> None:
    with fs.Scene() as file:
        for name in viz.hazards.names():
            one = viz.scene[name].object
            one.pose, one.twist = fs.Pose(), fs.Twist()
            file[name] = one
        file.save(str(path))


def add_controls(viz: Viz, picture: Picture) -> None:
    drawing = Drawing(picture, viz.draw_hazard)

    def remove_newest() -> None:
        names = viz.hazards.names()
        if names:
            viz.hazards.remove(names[-1])
            drawing.take_away(names[-1])

    def change() -> None:
        names = viz.hazards.names()
        if names:
            viz.hazards.change(names[-1], viz.hazards.width, viz.hazards.newtons)

    def set_width(value: float) -> None:
        viz.hazards.width = value
        change()

    def set_newtons(value: float) -> None:
        viz.hazards.newtons = value
        change()

    plotter = picture.plotter
    plotter.add_key_event("d", drawing.begin)
    plotter.add_key_event("Escape", drawing.give_up)
    plotter.add_key_event("x", remove_newest)
    look = {"pointa": (0.72, 0.12), "pointb": (0.97, 0.12), "style": "modern", "title_height": 0.02, "interaction_event": "end"}
    plotter.add_slider_widget(set_width, (1, 8), value=viz.hazards.width, title="newest hazard: width, m", **look)
    look |= {"pointa": (0.72, 0.27), "pointb": (0.97, 0.27)}
    plotter.add_slider_widget(set_newtons, (0.5, 5), value=viz.hazards.newtons, title="newest hazard: N", **look)


def run(chosen: argparse.Namespace) -> None:
    ground = Ground(chosen.terrain)
    with contextlib.ExitStack() as stack:
        is_near = bool(chosen.follow or chosen.arm)
        picture = Picture(ground, off_screen=chosen.off_screen is not None, is_near=is_near)
        stack.callback(picture.close)
        if chosen.embed:
            scene = watched = stack.enter_context(fs.Scene())
            servo = stack.enter_context(fs.Servo(scene, chosen.device))
            if chosen.listen:
                stack.enter_context(fs.Server(servo, chosen.listen))
                watched = stack.enter_context(fs.connect(chosen.listen, f"{chosen.name} watching"))
        else:
            scene = watched = stack.enter_context(fs.connect(chosen.endpoint, chosen.name))
        viz = Viz(scene, watched, ground, chosen.name, chosen.follow, chosen.arm)
        stack.callback(viz.close)
        if chosen.hazards and chosen.hazards.exists():
            load(viz, chosen.hazards)
        if chosen.off_screen is None:
            add_controls(viz, picture)
        viz.say(f"the ground has {picture.ground.n_cells} triangles")
        try:
            loop(viz, picture, chosen.off_screen)
        finally:
            if chosen.hazards:
                save(viz, chosen.hazards)


def loop(viz: Viz, picture: Picture, off_screen: str | None) -> None:
    while off_screen is not None or not picture.is_closed:
        begin = time.monotonic()
        viz.tell_events()
        viz.show(picture)
        if off_screen is not None:
            picture.save(off_screen)
            time.sleep(1)
        else:
            picture.go_on()
            wait_for_frame(begin)


def main() -> int:
    chosen = options(sys.argv[1:])
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    try:
        run(chosen)
    except KeyboardInterrupt:
        return 0
    except (BadTerrain, NoPicture, fs.Error, ConnectionError) as failure:
        print(f"viz: {failure}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
