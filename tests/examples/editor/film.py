"""film.py FILM.gif: films the force editor while objects are changed by mouse and keys. tests/examples/editor/film runs it.

The servo runs in virtual time, a frame's worth of ticks for each picture: however slow the machine is, the film has the speed of
the hand.
"""

from __future__ import annotations

import io
import math
import os
import pathlib
import shutil
import sys
import tempfile

import forceserver as fs
from conftest import FLAGS, Editor, Page, project, terrain
from PIL import Image
from playwright.sync_api import sync_playwright

FRAME = 0.08  # s
SIZE = (900, 560)
COLOURS = 128
PERIOD = 3.2  # s, of the hand on its ellipse

# A pointer of its own: pictures of a page do not show the mouse.
POINTER = """() => {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg"), form = document.createElementNS(svg.namespaceURI, "path");
  form.setAttribute("d", "M1 1 L1 18 L5.5 14 L8.5 21 L11.5 19.7 L8.5 13 L14.5 13 Z");
  form.setAttribute("fill", "#111");
  form.setAttribute("stroke", "#fff");
  svg.append(form);
  Object.assign(svg.style, { position: "fixed", left: 0, top: 0, width: "18px", height: "24px", zIndex: 99, pointerEvents: "none" });
  document.body.append(svg);
  addEventListener("pointermove", (event) => { svg.style.transform = `translate(${event.clientX}px, ${event.clientY}px)`; }, true);
}"""


class Film:
    def __init__(self, servo: fs.Servo, scene: fs.Scene, page: Page) -> None:
        self.servo, self.scene, self.page = servo, scene, page
        self.frames: list[Image.Image] = []
        self.at = (SIZE[0] * 0.45, SIZE[1] * 0.85)
        page.mouse.move(*self.at)

    def pass_time(self) -> None:
        """For as long as a frame is shown, until the page knows of it."""
        self.servo.step(round(FRAME * 1000))
        self.page.wait_for_function("time => editor.model.told.time >= time - 1e-6", arg=self.scene.get_time())
        self.page.wait_for_timeout(100)  # until the plots have it, too
        self.page.wait_drawn()

    def shoot(self, seconds: float = FRAME) -> None:
        for _ in range(round(seconds / FRAME)):
            self.pass_time()
            self.frames.append(Image.open(io.BytesIO(self.page.screenshot())).convert("RGB"))

    def go(self, to: tuple[float, float], seconds: float) -> None:
        """Moves the mouse there, as a hand does."""
        start, count = self.at, round(seconds / FRAME)
        for i in range(1, count + 1):
            part = (1 - math.cos(math.pi * i / count)) / 2
            self.at = (start[0] + part * (to[0] - start[0]), start[1] + part * (to[1] - start[1]))
            self.page.mouse.move(*self.at)
            self.shoot()

    def click(self, to: tuple[float, float], seconds: float) -> None:
        self.go(to, seconds)
        self.page.mouse.click(*to)

    def drag(self, to: tuple[float, float], seconds: float) -> None:
        self.page.mouse.down()
        self.go(to, seconds)
        self.page.mouse.up()

    def save(self, path: pathlib.Path) -> None:
        """All frames have the colours of five of them, so that what stands still is the same in each."""
        chosen = self.frames[:: max(1, len(self.frames) // 5)]
        sheet = Image.new("RGB", (SIZE[0], SIZE[1] * len(chosen)))
        for i, frame in enumerate(chosen):
            sheet.paste(frame, (0, i * SIZE[1]))
        palette = sheet.quantize(COLOURS, dither=Image.Dither.NONE)
        frames = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in self.frames]
        times = [round(1000 * FRAME)] * (len(frames) - 1) + [1500]  # ms; it rests on the last one
        frames[0].save(path, save_all=True, append_images=frames[1:], duration=times, loop=0, optimize=True)


def middle(page: Page, selector: str) -> tuple[float, float]:
    box = page.locator(selector).bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def act(film: Film) -> None:
    page = film.page
    film.shoot(0.8)
    # A hazard is moved into the way of the hand.
    film.click(page.place("rover/hazard"), 0.7)
    page.wait_for_selector('#panel[data-selected="rover/hazard"]')
    film.shoot(0.3)
    grip = page.evaluate("editor.tools.gizmo.grip('x')")
    film.go(project(page, grip), 0.4)
    film.drag(project(page, [grip[0] - 0.035, grip[1], grip[2]]), 1.2)
    film.shoot(0.6)
    # It becomes stronger.
    film.go(middle(page, '#curve [data-handle="front.gain"]'), 0.7)
    film.drag((film.at[0], film.at[1] - 40), 0.8)
    film.shoot(0.5)
    # A path is drawn on the ground, and draws the hand to itself.
    film.click(middle(page, "#tool-draw"), 0.7)
    for x, y in ((-0.07, -0.03), (-0.03, -0.055), (0.03, -0.055)):
        film.click(project(page, (x, y, -0.06 + 0.01 * math.sin(40 * x) * math.cos(30 * y))), 0.4)
    page.keyboard.press("Enter")
    page.wait_for_selector('#panel[data-selected="line"]')
    film.shoot(2.2)


def main(path: pathlib.Path) -> None:
    with tempfile.TemporaryDirectory() as temporary, sync_playwright() as playwright:
        folder = pathlib.Path(temporary)
        way = [(t, 0.06 * math.cos(2 * math.pi * t / PERIOD), 0.045 * math.sin(2 * math.pi * t / PERIOD), -0.06) for t in (0.05 * i for i in range(1000))]
        (folder / "hand.txt").write_text("".join("%g %g %g %g\n" % at for at in way))
        scene, endpoint = fs.Scene(), f"shm:film-{os.getpid()}"
        servo = fs.Servo(scene, f"sim:?path={folder}/hand.txt", mode="virtual")
        server = fs.Server(servo, endpoint)
        rover = fs.connect(endpoint, "rover")
        rover["land"] = terrain(60)
        rover["hazard"] = fs.Point(position=(0.1, 0.03, -0.045), front=fs.Gaussian(2, 0.02, limit=4, sense="repulsive"))
        editor = Editor(endpoint, folder / "scenes")
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        page = Page(browser, editor.address, SIZE)
        page.evaluate(POINTER)
        page.wait_for_selector('#table[data-count="2"]')
        page.mouse.move(SIZE[0] * 0.32, SIZE[1] * 0.3)
        page.mouse.wheel(0, -240)  # nearer
        film = Film(servo, scene, page)
        for _ in range(round(PERIOD / FRAME)):
            film.pass_time()
        act(film)
        film.save(path)
        page.close()
        browser.close()
        editor.close()
        for one in (rover, server, servo, scene):
            one.close()
    print(f"{path}: {len(film.frames)} frames, {path.stat().st_size} bytes")


main(pathlib.Path(sys.argv[1]))
