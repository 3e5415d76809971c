"""How the page is laid out: at every width, light and dark, and what is written on it."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import forceserver as fs
import numpy as np
import pytest

from conftest import Editor, Lab, Page, Second, eventually, picture, pixels, project, terrain

SIZES = {1440: 900, 1000: 640, 894: 640, 760: 600, 600: 800, 480: 700, 400: 800, 360: 640, 320: 568}

# What of an element is seen at its middle; null: something else, or nothing.
SEEN = """e => { const b = e.getBoundingClientRect(), at = document.elementFromPoint(b.x + b.width / 2, b.y + b.height / 2);
    return e.contains(at) && b.left >= 0 && b.top >= 0 && b.right <= innerWidth && b.bottom <= innerHeight }"""

# Texts whose contrast with what is behind them is below 4.5 (WCAG AA). What cannot be used now is paler.
FAINT = """() => { const linear = c => c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4,
    paint = document.createElement('canvas').getContext('2d', { willReadFrequently: true }),
    rgb = colour => { paint.clearRect(0, 0, 1, 1); paint.fillStyle = colour; paint.fillRect(0, 0, 1, 1); return [...paint.getImageData(0, 0, 1, 1).data] },
    light = c => 0.2126 * linear(c[0] / 255) + 0.7152 * linear(c[1] / 255) + 0.0722 * linear(c[2] / 255),
    ground = e => { for (; e; e = e.parentElement) { const c = rgb(getComputedStyle(e).backgroundColor); if (c[3] === 255) return c } return [255, 255, 255] };
    return [...document.querySelectorAll('body *')].filter(e => e.checkVisibility({ visibilityProperty: true, opacityProperty: true })
        && !e.matches(':disabled, canvas, option, [aria-hidden] *') && !e.closest('.hidden')
        && [...e.childNodes].some(n => n.nodeType === 3 && n.data.trim())).map(e => {
      const a = light(rgb(getComputedStyle(e).color)), b = light(ground(e));
      return [(Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05), e.textContent.trim().slice(0, 40)] }).filter(([ratio]) => ratio < 4.5) }"""


def full(lab: Lab) -> None:
    rover = lab.join("rover")
    lab.base["pull"] = fs.Point(position=(0.05, 0, 0), front=fs.Constant(3, limit=5))
    rover["land"] = terrain()
    rover["off"] = fs.Point(position=(-0.06, -0.05, 0.03), enabled=False)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_width(lab: Lab, started: Any, opened: Callable[..., Page], scheme: str) -> None:
    full(lab)
    page = opened(started(Editor, lab.endpoint).address, color_scheme=scheme)
    page.wait_for_selector('#table .item[data-name="rover/land"][data-state="felt"]')
    for width, height in SIZES.items():
        page.page.set_viewport_size({"width": width, "height": height})
        page.evaluate("() => editor.model.select([...editor.model.items.keys()])")
        page.evaluate("() => editor.model.select([editor.model.byName('rover/land').told.id])")
        picture(page, f"{scheme}, {width}")
        assert page.locator("#stop").evaluate(SEEN), width
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        box = page.locator("#view").bounding_box()
        assert box["width"] * box["height"] > 0.25 * width * height, (width, box)  # the picture has its share
        shown = [page.locator(part).is_visible() for part in ("#table", "#panel", "#plots")]
        assert sum(shown) == (1 if width < 700 else 3), (width, shown)
        if width < 700:  # one of the rest at a time
            for tab, part in (("fields", "#panel"), ("curves", "#plots"), ("objects", "#table")):
                page.click(f'#tabs [data-tab="{tab}"]')
                assert page.locator(part).is_visible()
                picture(page, f"{scheme}, {width}, {tab}")
                assert page.evaluate(FAINT) == [], (width, tab)
        # The hint of the filter can be read to its end.
        assert page.locator("#filter").evaluate("""e => { const on = document.createElement('canvas').getContext('2d'), s = getComputedStyle(e);
            on.font = s.font; return on.measureText(e.placeholder).width < e.clientWidth - parseFloat(s.paddingLeft) - parseFloat(s.paddingRight) }"""), width
        assert (faint := page.evaluate(FAINT)) == [], (width, faint)
        # What is done seldom is in a menu where there is no room for it.
        if not page.locator("#scene").is_visible():
            page.locator(".opener").last.click()
        page.click("#scene")
        dialog = page.locator("dialog")
        words = dialog.inner_text()
        assert re.search(r"at the device, m\n", words) and "degrees" in words  # units
        assert page.evaluate(FAINT) == []
        assert dialog.evaluate("e => { const b = e.getBoundingClientRect(); return b.left >= 0 && b.right <= innerWidth && b.bottom <= innerHeight }")
        red = page.locator("#stop").bounding_box()
        assert red["y"] + red["height"] <= dialog.bounding_box()["y"], width  # beside the window, where it still works
        page.keyboard.press("Escape")
        page.locator("dialog").wait_for(state="detached")
    assert lab.base.get_servo_stats().enabled


def test_dark_and_light(lab: Lab, started: Any, opened: Callable[..., Page]) -> None:
    """All of the page follows the person's choice, at once, also what is painted by hand."""
    full(lab)
    page = opened(started(Editor, lab.endpoint).address)
    page.wait_for_selector('#table .item[data-name="rover/land"]')
    page.select("rover/land")
    places = ("#view canvas", "#table", "#panel", "#curve canvas", "#time canvas", "#bar")
    for scheme in ("light", "dark", "light"):
        page.page.emulate_media(color_scheme=scheme)
        for place in places:
            eventually(lambda place=place, scheme=scheme: (np.median(pixels(page, place)) < 100) == (scheme == "dark"), f"{place}, {scheme}")
        for place in places[3:5]:  # what is drawn can be told from its ground
            eventually(lambda place=place: np.ptp(pixels(page, place).mean(axis=2)) > 90, f"{place}, {scheme}")


def test_words_and_numbers_that_are_not_cut_off(lab: Lab, started: Any, opened: Callable[..., Page], second: Second) -> None:
    editor = started(Editor, lab.endpoint)
    page = opened(editor.address)
    # Distances can be had in another scale where there is one.
    assert page.get_by_text("client m", exact=True).count() == 0 and page.locator("#metres").is_hidden()
    rover = lab.join("rover")
    rover.set_frame(fs.Frame(scale=2))
    rover["far"] = fs.Point(position=(0.1, 0, 0), front=fs.Gaussian(1, 0.1, limit=2))
    page.locator('#table .item[data-name="rover/far"] .number').first.filter(has_text=re.compile("50.0|49.9 mm")).wait_for()
    page.get_by_label("distances in the scale of each client").check()
    page.locator('#table .item[data-name="rover/far"] .number').first.filter(has_text=re.compile("100.0|99.[89] mm")).wait_for()
    # The formulas of all kinds stay within the panel.
    page.click("#add-plane")
    page.wait_for_selector('#panel[data-selected="plane"]')
    for kind in ("constant", "linear_increasing", "linear_decreasing", "gaussian", "quadratic", "inverse", "custom"):
        page.choose("front.kind", kind)
        page.wait_for_function("kind => editor.model.byName('plane').told.front.kind === kind", arg=kind)
        page.wait_drawn()
        cut = page.evaluate("""() => { const panel = document.querySelector('#panel').getBoundingClientRect();
            return [...document.querySelectorAll('#panel .formula')].filter(e => { const r = document.createRange(); r.selectNodeContents(e);
              return r.getBoundingClientRect().left < panel.left || r.getBoundingClientRect().right > panel.right }).map(e => e.textContent) }""")
        assert cut == [], kind
    # A limit of the slope is told in words, all of them.
    page.set("back.gain", "90000")
    page.locator("#capped", has_text=re.compile(r"^slope limited to \d+ N/m$")).wait_for()
    assert page.locator("#capped").evaluate("e => e.scrollWidth <= e.clientWidth")
    bottoms = "() => [...document.querySelectorAll('#plots, #plots canvas')].map(e => e.getBoundingClientRect().bottom)"
    page.wait_for_function(f"() => Math.max(...({bottoms})()) < innerHeight + 1")  # nor its axis
    # Draw is a tool as Move and Turn are: one of them is chosen.
    for tool in ("#tool-turn", "#tool-draw"):
        page.click(tool)
        assert page.locator('#view-bar [aria-pressed="true"]').evaluate_all("all => all.map(e => '#' + e.id)") == [tool]
    page.click("#draw-cancel")
    assert page.locator("#tool-turn").get_attribute("aria-pressed") == "true"


def test_curve_of_a_solid(lab: Lab, page: Page) -> None:
    rover = lab.join("rover")
    rover["wall"] = fs.Plane(position=(0, 0, -0.05), contact=fs.Contact(keep="front", stiffness=200, limit=3))
    rover["tiny"] = fs.Point(position=(0.05, 0, 0), front=fs.Gaussian(1, 1e-4, limit=2))
    rover["nothing"] = fs.Point(position=(0.05, 0, 0))
    page.wait_for_selector('#table .item[data-name="rover/nothing"]')

    def ticks() -> list[str]:
        return page.evaluate("editor.curve.plot.axes[0]._values")

    page.select("rover/wall")
    page.wait_for_selector('#curve[data-curve="rover/wall"]')
    page.wait_for_function("() => editor.curve.answer?.distances.length > 100")
    page.wait_drawn()
    assert len(set(ticks())) == len(ticks()) > 2
    distances = page.evaluate("editor.curve.plot.data[0]")
    assert np.allclose(page.evaluate("editor.curve.plot.data[5]"), np.minimum(200 * np.array(distances), 3)) and distances[-1] > 0.015
    assert page.locator(".key.solid").is_visible() and not page.locator(".key.front").is_visible()
    page.select("rover/tiny")  # another reason for ticks that are all 0
    page.wait_for_selector('#curve[data-curve="rover/tiny"]')
    page.wait_for_function("() => editor.curve.answer?.distances.at(-1) < 0.001")
    page.wait_drawn()
    assert len(set(ticks())) == len(ticks()) > 2
    page.select("rover/nothing")
    page.locator("#curve").get_by_text("no force profile").wait_for()


def test_sizes_in_the_picture(lab: Lab, page: Page) -> None:
    """Hand and arrows keep their size on the screen, so that they do not hide what is small; and how large that is can be read."""
    rover = lab.join("rover")
    points = 0.002 * np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    rover["small"] = fs.Mesh(points, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], position=(0.002, 0, 0), front=fs.Constant(1, limit=2), back=fs.Constant(1, limit=2))
    page.wait_for_selector('#table .item[data-name="rover/small"][data-state="felt"]')
    page.wait_for_function("() => Math.hypot(...editor.model.sent) > 0.9")

    def seen() -> tuple[float, float, float]:
        """The radius of the hand, the length of 10 mm at the hand, and the width of the thickest arrow, in pixels."""
        page.wait_drawn()
        pixel = np.hypot(*np.subtract(project(page, (0, 0, 0.0005)), project(page, (0, 0, -0.0005)))) / 0.001
        hand, arrow = page.evaluate("""() => [editor.view.hand.children[0].scale.x, Math.max(...Array.from({ length: editor.view.things.shafts.count },
            (_, i) => Math.hypot(...editor.view.things.shafts.mesh.instanceMatrix.array.slice(16 * i, 16 * i + 3))))]""")
        return hand * pixel, 0.01 * pixel, 2 * arrow * pixel

    far = seen()
    assert page.locator("#grid-length").inner_text() == "grid 50 mm" and page.locator("#scale-length").inner_text() in ("50 mm", "100 mm")
    for letter in "xyz":
        at = page.locator(f".letters .{letter}")
        assert at.inner_text() == letter and at.is_visible()
    page.select("rover/small")
    page.keyboard.press("f")
    near = seen()
    assert near[1] > 20 * far[1]  # so much nearer
    assert max(far[0], near[0]) < 12 and max(far[2], near[2]) < 10, (far, near)
    picture(page, "a small mesh")
    length = page.locator("#scale-length").inner_text()
    bar = page.locator("#scale-bar").bounding_box()["width"]
    assert length.endswith((" mm", " µm")) and 25 < bar < 80
    metres = float(length.split()[0]) * (1e-3 if "mm" in length else 1e-6)
    middle = page.evaluate("editor.model.byName('rover/small').place")
    across = page.evaluate("""([at, long]) => { const { view } = editor, e = view.camera.matrixWorld.elements, project = p => view.project(p),
        a = project(at), b = project(at.map((x, i) => x + long * e[i])); return Math.hypot(a.x - b.x, a.y - b.y) }""", [middle, metres])  # fmt: skip
    assert abs(across - bar) < 0.05 * bar, (across, bar)
    eventually(lambda: page.evaluate("editor.view.things.arrowCount") > 0)
