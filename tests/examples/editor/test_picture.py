"""What is seen: the picture, the plots, and much of both."""

from __future__ import annotations

import io
import itertools
import math
import pathlib
from typing import Any

import forceserver as fs
import numpy as np

from conftest import (
    PATIENCE,
    Editor,
    Lab,
    Page,
    Second,
    eventually,
    picture,
    pixels,
    project,
    share,
    terrain,
)


def ink_of(image: Any) -> Any:
    """How much darker than the ground each pixel is, without its colour: 0 to 1."""
    return np.clip(0xF5 - image @ [0.299, 0.587, 0.114], 0, None) / 0xF5


def test_states_are_told_apart(lab: Lab, page: Page) -> None:
    rover = lab.join("rover")
    rover["felt"] = fs.Point(position=(-0.06, 0, 0), front=fs.Gaussian(1, 0.05, limit=2))
    rover["off"] = fs.Point(position=(0, 0, 0.03), enabled=False, front=fs.Gaussian(1, 0.05, limit=2))
    rover["old"] = fs.Point(position=(0.06, 0, 0), lifetime=0.1, front=fs.Gaussian(1, 0.05, limit=2))
    for name, state in (("felt", "felt"), ("off", "disabled"), ("old", "expired")):
        page.wait_for_selector(f'#table .item[data-name="rover/{name}"][data-state="{state}"]')
    image = ink_of(pixels(page))
    box = page.locator("#view canvas").bounding_box()
    forms = {}
    for name in ("felt", "off", "old"):
        x, y = page.place(f"rover/{name}")
        forms[name] = image[int(y - box["y"]) - 8 : int(y - box["y"]) + 9, int(x - box["x"]) - 8 : int(x - box["x"]) + 9] > 0.1
    for one, other in itertools.combinations(forms.values(), 2):
        assert np.count_nonzero(one ^ other) > 0.3 * np.count_nonzero(one | other)


LOOKS = {"felt": (1, 1), "fading": (2, 0.5), "disabled": (3, 0), "expired": (2, 0), "refused": (4, 0)}  # state, weight


def test_looks_differ_without_colour(lab: Lab, page: Page) -> None:
    """Of each primitive: felt, fading, disabled, expired and refused are drawn in other forms, not in other colours alone."""
    rover = lab.join("rover")
    profile = fs.Gaussian(0.01, 0.01, limit=1)
    corners = [(-0.05, -0.03, 0), (-0.02, 0.04, 0), (0.02, -0.04, 0), (0.05, 0.03, 0)]
    made = {
        "point": fs.Point(front=profile),
        "polyline": fs.Polyline(corners, front=profile),
        "plane": fs.Plane(normal=(0, -0.5, 1), front=profile),
        "mesh": fs.Mesh([(-0.05, -0.05, -0.03), (0.05, -0.05, -0.03), (0, 0.06, -0.03), (0, 0, 0.06)],
                        [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], front=profile),
        "fine mesh": terrain(120),
    }  # fmt: skip
    for name, one in made.items():
        one.lifetime = 1000
        rover[name] = one
    for name in made:
        page.wait_for_selector(f'#table .item[data-name="rover/{name}"][data-state="felt"]')
    page.wait_for_function("() => editor.view.things.targets.filter(t => t.userData.item !== undefined).length === 3")
    page.evaluate("editor.model.take = () => false")  # the states that are drawn here are made up
    page.evaluate("""() => { const { model, view } = editor;
        model.hand = null;
        model.clients.forEach(client => { client.force = [0, 0, 0] });
        view.workspace.visible = false;
        for (const part of ["#view-bar", "#scale", ".letters"]) document.querySelector(part).style.display = "none" }""")
    for name in made:
        seen = {}
        for look, (state, weight) in LOOKS.items():
            page.evaluate(
                """([name, state, weight]) => { const { model } = editor;
                   for (const item of model.items.values()) {
                     item.told.short === name ? model.hidden.delete(item.told.id) : model.hidden.add(item.told.id);
                     Object.assign(item, { state, weight, force: [0, 0, 0] });
                   } }""", [name, state, weight])  # fmt: skip
            picture(page, f"look of a {name}, {look}")
            seen[look] = ink_of(pixels(page)[8:-8, 8:-8])  # without what is beside the picture
        for one, other in itertools.combinations(LOOKS, 2):
            forms = [seen[look] > 0.04 for look in (one, other)]
            union = np.count_nonzero(forms[0] | forms[1])
            assert union > 60, (name, one, other)
            differs = np.count_nonzero(forms[0] ^ forms[1]) / union
            if {one, other} == {"felt", "fading"}:  # of the same form: it is seen through
                tones = [float(seen[look][forms[0] & forms[1]].mean()) for look in (one, other)]
                assert tones[0] > 1.25 * tones[1], (name, tones)
            else:
                assert differs > 0.1, (name, one, other, differs)


def test_plot_of_a_known_force(lab: Lab, page: Page) -> None:
    lab.base["pulse"] = fs.Point(position=(0.1, 0, 0), front=fs.Custom("2 + 1.5*sin(2*_pi*t)", limit=10))
    page.wait_for_function("() => Number(document.querySelector('#time').dataset.points) > 300 && editor.model.told.serial > 0")
    page.wait_for_function("() => editor.plots.csv().split('\\n').filter(line => Number(line.split(',')[1]) > 0.4).length > 1100")
    page.click("#plot-pause")
    with page.expect_download() as download:
        page.click("#plot-csv")
    rows = np.loadtxt(io.StringIO(pathlib.Path(download.value.path()).read_text()), delimiter=",", skiprows=1)
    rows = rows[rows[:, 0] > rows[rows[:, 1] > 0.4][0, 0] + 0.2]  # from when it has faded in
    t = rows[:, 0]
    fit = np.stack([np.ones_like(t), np.sin(2 * np.pi * t), np.cos(2 * np.pi * t)], 1)
    mean, sine, cosine = np.linalg.lstsq(fit, rows[:, 1], rcond=None)[0]
    assert abs(mean - 2) < 0.04 and abs(math.hypot(sine, cosine) - 1.5) < 0.03
    assert np.abs(rows[:, 1]).max() > 3.45  # no peak is lost
    for what in ("clients", "servo"):
        page.select_option("#plot-what", what)
        page.select_option("#plot-span", "60")
        page.wait_for_selector('#time[data-span="60"]')


def test_4096_objects(lab: Lab, page: Page, second: Second) -> None:
    rover = lab.join("rover")
    with rover.change():
        for i in range(4096):
            place = (0.002 * (i % 64) - 0.064, 0.002 * (i // 64) - 0.064, -0.03)
            rover[f"p{i}"] = fs.Point(position=place, front=fs.Gaussian(0.01, 0.004, limit=1, sense="repulsive"))
    page.wait_for_selector('#table[data-count="4096"]')
    assert page.locator("#table .space .line").count() < 80  # only those in sight
    page.select("rover/p4095")
    page.set("front.gain", "0.02")
    eventually(lambda: second.get("rover/p4095")["front"]["gain"] == 0.02)
    picture(page, "4096 objects")
    page.mouse.click(*page.place("rover/p0"))
    page.wait_for_selector('#panel:not([data-selected="rover/p4095"]):not([data-selected=""])')


def test_276k_triangles(lab: Lab, page: Page, second: Second) -> None:
    rover = lab.join("rover")
    rover["land"] = terrain(372)
    page.wait_for_selector('#table .item[data-name="rover/land"][data-state="felt"]')
    page.wait_for_function("() => editor.view.things.targets.some(t => t.userData.item !== undefined)")
    picture(page, "terrain of 275 thousand triangles")
    before = pixels(page)
    assert share(before, 0xC9AE8E, 60) > 0.07
    page.mouse.click(*project(page, (0.03, -0.03, -0.055)))
    page.wait_for_selector('#panel[data-selected="rover/land"]')
    page.field("enabled").uncheck()
    eventually(lambda: second.get("rover/land")["enabled"] is False)


def test_a_million_triangles_are_seen_and_picked(lab: Lab, page: Page, second: Second) -> None:
    rover = lab.join("rover")
    rover["land"] = terrain(709)
    page.wait_for_selector('#table .item[data-name="rover/land"][data-state="felt"]')
    page.wait_for_function("() => editor.view.things.targets.some(t => t.userData.item !== undefined)")
    assert share(pixels(page), 0xC9AE8E, 60) > 0.07
    page.mouse.click(*project(page, (0.03, -0.03, -0.055)))
    page.wait_for_selector('#panel[data-selected="rover/land"]')
    page.field("enabled").uncheck()
    eventually(lambda: second.get("rover/land")["enabled"] is False)


def test_utm_does_not_jitter(lab: Lab, page: Page, second: Second) -> None:
    rover = lab.join("rover")
    rover["site"] = fs.Point(position=(500_000.125, 4_100_000.5, 310.25), front=fs.Gaussian(1, 0.01, limit=2))
    page.wait_for_selector('#table .item[data-name="rover/site"]')
    page.select("rover/site")
    page.keyboard.press("f")
    page.wait_drawn()
    centre = page.place("rover/site")
    box = page.locator("#view canvas").bounding_box()
    assert abs(centre[0] - box["x"] - box["width"] / 2) < 1 and abs(centre[1] - box["y"] - box["height"] / 2) < 1
    rover["site"].move(position=(500_000.126, 4_100_000.5, 310.25), twist=fs.Twist())  # by a millimetre
    page.wait_for_function("() => editor.model.byName('rover/site').pose.position[0] === 500000.126")
    page.wait_drawn()
    moved = page.place("rover/site")
    assert 1 < math.hypot(moved[0] - centre[0], moved[1] - centre[1]) < 60


def test_webgl_lost_and_missing(lab: Lab, page: Page, chromium: Any, started: Any) -> None:
    page.evaluate("""() => { window.lose = editor.view.canvas.getContext('webgl2').getExtension('WEBGL_lose_context'); lose.loseContext() }""")
    page.wait_for_selector('#view[data-webgl="lost"]')
    page.evaluate("lose.restoreContext()")
    page.wait_for_selector("#view:not([data-webgl])")
    page.click("#add-plane")
    page.wait_for_selector('#panel[data-selected="plane"]')
    page.wait_for_selector('#table .item[data-name="plane"][data-state="felt"]')
    assert share(pixels(page), 0xBFD0E2) > 0.05  # it draws again
    # A browser without WebGL: all but the picture works.
    editor = started(Editor, lab.endpoint)
    context = chromium.new_context(viewport={"width": 1000, "height": 640})
    context.add_init_script("HTMLCanvasElement.prototype.getContext = (old => function (kind, ...rest) "
                            "{ return kind.startsWith('webgl') ? null : old.call(this, kind, ...rest) })(HTMLCanvasElement.prototype.getContext)")  # fmt: skip
    blind = context.new_page()
    blind.goto(editor.address)
    blind.get_by_text("has no WebGL").wait_for()
    blind.click("#add-point")
    blind.wait_for_selector('#panel[data-selected="point"]')
    context.close()


def test_picture_for_people(lab: Lab, page: Page, second: Second) -> None:
    """Not much is asserted here: it is for the eye."""
    rover, arm = lab.join("rover"), lab.join("arm")
    lab.base["pull"] = fs.Point(position=(0.06, 0.02, 0.05), front=fs.Constant(1.5, limit=5))
    rover["land"] = terrain(80)
    rover["hazard"] = fs.Point(position=(-0.03, 0.02, 0), front=fs.Gaussian(3, 0.02, limit=3, sense="repulsive"))
    rover["off"] = fs.Point(position=(-0.06, -0.05, 0.03), enabled=False)
    arm["path"] = fs.Polyline([(-0.08, -0.02, 0), (-0.02, 0.04, 0.02), (0.04, 0.05, 0.02), (0.09, 0, 0)], front=fs.Gaussian(1.5, 0.03, limit=2))
    arm["sheet"] = fs.Plane(position=(0, 0.1, 0), normal=(0, -1, 0.2), front=fs.Gaussian(0.4, 0.02, limit=1, sense="repulsive"))
    page.wait_for_selector('#table[data-count="6"]')
    page.wait_for_function("() => editor.view.things.targets.filter(t => t.userData.item !== undefined).length === 2")
    page.select("rover/hazard")
    page.wait_for_function("() => Math.hypot(...editor.model.sent) > 1")
    page.wait_for_function("() => Number(document.querySelector('#time').dataset.points) > 300")
    picture(page, "overview")
    page.select("arm/path")
    picture(page, "polyline")
    page.select("rover/land")
    page.set("contact.friction", "3")
    page.error("contact.friction")
    picture(page, "refused field")
    assert second.get("rover/land")["friction"] == 0
