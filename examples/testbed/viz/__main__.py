"""python -m viz ENDPOINT | --embed --device URI [--listen ENDPOINT]: the map, and the hazards that are drawn on it, until the
window is closed or Ctrl-C.

d: draw a hazard; click its nodes, and the first again to close it. Nodes can be moved afterwards; Delete takes away the one below the
mouse. Escape: drop what is being drawn. x: remove the newest hazard. q: end.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import signal
import sys
import time
from pathlib import Path

import forceserver as fs
from virtualrobot.ground import BadTerrain, Ground, terrain_file

from .app import Viz, period
from .picture import NoPicture, Picture
from .show import Show


signals = (signal.SIGTERM, signal.SIGINT)
patience = 10  # s, in which VIZ ends by itself


class Ending:
    """The first SIGTERM or Ctrl-C ends VIZ, and further ones do nothing. A VIZ that has not ended by itself after some seconds
    hangs, and the alarm ends it."""

    def __init__(self) -> None:
        self.has_begun = False
        self.is_looked_for = False  # by the loop; an exception could be raised inside of VTK there, which drops it
        for number in signals:
            signal.signal(number, self._take_signal)

    def begin(self) -> None:
        if not self.has_begun:
            self.has_begun = True
            signal.alarm(patience)

    def _take_signal(self, *_: object) -> None:
        is_first = not self.has_begun
        self.begin()
        if is_first and not self.is_looked_for:
            sys.exit(0)

    def finish(self) -> None:
        """Python is about to take back what this has set, and then a signal would kill it."""
        for number in signals:
            signal.signal(number, signal.SIG_IGN)

    def wait(self, seconds: float) -> None:
        """Until then, or until VIZ is to end."""
        end = time.monotonic() + seconds
        while not self.has_begun and (left := end - time.monotonic()) > 0:
            time.sleep(min(left, 0.05))


def endpoint(word: str) -> str:
    """A bare name is one in shared memory, as for the programs of forceserver."""
    return word if ":" in word else f"shm:{word}"


def options(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="viz", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("endpoint", metavar="ENDPOINT", nargs="?", type=endpoint, help="of a server, such as lab or shm:lab")
    parser.add_argument("--name", default="viz", help="of the client (%(default)s)")
    parser.add_argument("--embed", action="store_true", help="scene, servo and device in this process, instead of a server")
    parser.add_argument("--device", metavar="URI", help="of the embedded servo")
    parser.add_argument("--listen", metavar="ENDPOINT", type=endpoint, help="lets other clients into the embedded servo")
    parser.add_argument("--follow", metavar="CLIENT",
                        help='keeps the point "pose" of this client in the middle, as a rover in mode drive does')  # fmt: skip
    parser.add_argument("--arm", metavar="CLIENT",
                        help="shows the arm of this client near by; the ground is not felt, as that client gives it")  # fmt: skip
    parser.add_argument("--hazards", type=Path, metavar="FILE", help="a scene file: its hazards are loaded, and saved after each change")
    parser.add_argument("--off-screen", type=Path, metavar="FILE.png",
                        help="draws into a file, once a second, instead of a window")  # fmt: skip
    parser.add_argument("--terrain", type=Path, default=terrain_file, metavar="FILE", help="heights, an Esri ASCII grid")
    chosen = parser.parse_args(arguments)
    if chosen.embed == (chosen.endpoint is not None):
        parser.error("either ENDPOINT or --embed")
    if chosen.embed and not chosen.device:
        parser.error("--embed needs --device URI, such as sim:?path=figure8")
    if not chosen.embed and (chosen.device or chosen.listen):
        parser.error("--device and --listen are for --embed")
    if chosen.embed and not chosen.listen and (chosen.follow or chosen.arm):
        parser.error("without --listen no rover comes in, so neither --follow nor --arm goes with it")
    if chosen.off_screen and chosen.off_screen.suffix.lower() != ".png":
        parser.error(f"--off-screen writes PNG files: {chosen.off_screen} must end with .png")
    if chosen.off_screen and not os.access(chosen.off_screen.parent, os.W_OK | os.X_OK):
        parser.error(f"--off-screen {chosen.off_screen}: there is no folder {chosen.off_screen.parent} that can be written")
    if chosen.arm and (chosen.follow or chosen.hazards):
        parser.error("--arm is for looking on: neither --follow nor --hazards goes with it")
    return chosen


class Controls:
    """The keys, and two sliders that show and set the newest hazard."""

    def __init__(self, viz: Viz, picture: Picture) -> None:
        self.viz = viz
        drawing, plotter = viz.draw_in(picture), picture.plotter
        plotter.add_key_event("d", drawing.begin)
        plotter.add_key_event("Escape", drawing.give_up)
        plotter.add_key_event("x", viz.remove_newest)
        look = {"style": "modern", "title_height": 0.02, "interaction_event": "end"}
        low, high = {"pointa": (0.72, 0.12), "pointb": (0.97, 0.12)}, {"pointa": (0.72, 0.27), "pointb": (0.97, 0.27)}
        self.sliders = [
            plotter.add_slider_widget(lambda value: viz.change_newest(width=value), (1, 8), value=viz.hazards.width,
                                      title="newest hazard: width, m", **look, **low),
            plotter.add_slider_widget(lambda value: viz.change_newest(newtons=value), (0.5, 5), value=viz.hazards.newtons,
                                      title="newest hazard: N", **look, **high),
        ]  # fmt: skip
        self.shown: tuple[str, float, float] | None = None  # the newest hazard that the sliders show

    def update(self) -> None:
        """The sliders go to the newest hazard where it is another one, or has changed."""
        try:
            newest = self.viz.hazards.take_newest()
        except KeyError:
            return  # it has just been removed
        if newest is None or newest == self.shown:
            return
        self.shown = newest
        for slider, value in zip(self.sliders, newest[1:], strict=True):
            slider.GetRepresentation().SetValue(value)


def run(chosen: argparse.Namespace, ending: Ending) -> None:
    ground = Ground(chosen.terrain)
    with contextlib.ExitStack() as last, contextlib.ExitStack() as stack:
        watched = None
        if chosen.embed:
            scene = stack.enter_context(fs.Scene())
            servo = stack.enter_context(fs.Servo(scene, chosen.device))
            if chosen.listen:
                stack.enter_context(fs.Server(servo, chosen.listen))
                watched = stack.enter_context(fs.connect(chosen.listen, f"{chosen.name} watching"))
        else:
            scene = watched = stack.enter_context(fs.connect(chosen.endpoint, chosen.name))
        picture = Picture(ground, off_screen=chosen.off_screen is not None, is_near=bool(chosen.follow or chosen.arm))
        last.callback(picture.close)  # when the force has ended
        viz = Viz(scene, ground, chosen.name, chosen.follow, is_felt=chosen.arm is None, watched=watched)
        stack.callback(viz.close)
        # The sliders call back when they are made, so the hazards of the file come after them.
        controls = Controls(viz, picture) if chosen.off_screen is None and chosen.arm is None else None
        if chosen.hazards:
            viz.keep_hazards_in(chosen.hazards)
        viz.begin_to_follow()
        viz.say(f"the ground has {picture.ground.n_cells} triangles")
        try:
            loop(viz, Show(viz, picture, chosen.arm), controls, picture, chosen.off_screen, ending)
        finally:
            ending.begin()


def loop(viz: Viz, show: Show, controls: Controls | None, picture: Picture, off_screen: Path | None, ending: Ending) -> None:
    """Until VIZ is to end."""
    ending.is_looked_for = True
    is_silent = False
    while not ending.has_begun and (off_screen is not None or not picture.is_closed):
        begin = time.monotonic()
        try:
            viz.tell_events()
            if controls:
                controls.update()
            show.update()
        except TimeoutError as failure:
            if not is_silent:
                viz.say(str(failure))
            picture.show_words(str(failure))
            is_silent = True
        else:
            if is_silent:
                viz.say("the server answers again")
            is_silent = False
        if off_screen is not None:
            picture.save(off_screen)
            ending.wait(1)
        else:
            picture.go_on()
            ending.wait(begin + period - time.monotonic())


def main() -> int:
    chosen, ending = options(sys.argv[1:]), Ending()
    try:
        run(chosen, ending)
    except (BadTerrain, NoPicture, fs.Error, OSError) as failure:
        print(f"viz: {failure}", file=sys.stderr)
        return 1
    finally:
        ending.finish()
    return 0


if __name__ == "__main__":
    sys.exit(main())
