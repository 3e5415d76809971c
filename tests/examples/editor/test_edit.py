"""Editing in a real browser, with a real mouse and keys. What became of it is asked of a second client, in C."""

from __future__ import annotations

import math
import pathlib
import re
from collections.abc import Callable
from typing import Any

import forceserver as fs
import numpy as np

from conftest import (
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


def drag_along_x(page: Page, by: float, key: str = "") -> None:
    """By the arrow of the gizmo, m at the device."""
    page.wait_drawn()
    grip = page.evaluate("editor.tools.gizmo.grip('x')")
    start = project(page, grip)
    page.mouse.move(start[0] - 3, start[1])
    page.drag(start, project(page, [grip[0] + by, grip[1], grip[2]]), key=key)
    page.wait_for_selector('#view[data-dragging="false"]')


def test_add_each_primitive(lab: Lab, page: Page, second: Second, tmp_path: pathlib.Path) -> None:
    empty = pixels(page)
    page.click("#add-point")
    page.wait_for_selector('#panel[data-selected="point"]')
    assert second.get("editor/point")["primitive"] == 0 and second.get("editor/point")["front"]["limit"] == 2
    page.click("#add-plane")
    page.wait_for_selector('#panel[data-selected="plane"]')
    plane = second.get("editor/plane")
    assert plane["primitive"] == 2 and plane["position"][2] == -0.02 and plane["back"]["gain"] == 300
    page.wait_for_selector('#table .item[data-name="plane"][data-state="felt"]')
    assert share(pixels(page), 0xBFD0E2) > share(empty, 0xBFD0E2) + 0.05  # the plane is seen
    # A mesh from a file in millimetres.
    (tmp_path / "part.obj").write_text("v 0 0 0\nv 50 0 0\nv 0 50 0\nv 0 0 50\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
    with page.expect_file_chooser() as chooser:
        page.click("#add-mesh")
    chooser.value.set_files(tmp_path / "part.obj")
    page.fill("#mesh-scale", "0")
    page.click("#mesh-add")
    page.get_by_text("a number above 0 is wanted").wait_for()
    page.fill("#mesh-scale", "0.001")
    page.click("#mesh-add")
    page.wait_for_selector('#panel[data-selected="part"]')
    mesh = second.get("editor/part")
    assert mesh["primitive"] == 3 and mesh["triangles"] == 4 and mesh["points"][3:6] == [0.05, 0, 0]
    # A polyline by clicks on the plane, closed by a click on its first point.
    page.click('#table .item[data-name="part"] .eye')
    page.click("#look-top")
    page.click("#add-polyline")
    corners = [(-0.05, -0.05), (0.05, -0.05), (0.05, 0.05), (-0.05, 0.05)]
    for i, (x, y) in enumerate(corners):
        page.mouse.click(*project(page, (x, y, -0.02)))
        page.wait_for_selector(f'#view[data-drawing="{i + 1}"]')
    page.mouse.click(*project(page, (-0.05, -0.05, -0.02)))
    page.wait_for_selector('#panel[data-selected="line"]')
    line = second.get("editor/line")
    assert line["primitive"] == 1 and line["closed"] and line["point_count"] == 4
    at = np.reshape(line["points"], (4, 3)) + line["position"]
    assert np.abs(at[:, 2] + 0.02).max() < 1e-6 and np.abs(at[:, :2] - corners).max() < 0.001
    # Its corners can be dragged, and removed.
    dot = page.locator('[data-corner="1"]').bounding_box()
    start = (dot["x"] + dot["width"] / 2, dot["y"] + dot["height"] / 2)
    page.drag(start, project(page, (0.08, -0.05, -0.02)))
    page.wait_for_selector('body[data-busy="0"]')
    moved = eventually(lambda: (found := second.get("editor/line"))["points"][3] != line["points"][3] and found)
    moved_at = np.reshape(moved["points"], (4, 3)) + moved["position"]
    assert abs(moved_at[1][0] - 0.08) < 0.002 and moved["points"][6:] == line["points"][6:]  # the others bit for bit
    page.locator('[data-corner="2"]').focus()
    page.keyboard.press("Delete")
    eventually(lambda: second.get("editor/line")["point_count"] == 3)
    for left in (4, 4):
        page.keyboard.press("Control+z")
        eventually(lambda left=left: second.get("editor/line")["point_count"] == left)
    eventually(lambda: second.get("editor/line")["points"] == line["points"])
    assert len(lab.base) == 0


def test_what_is_new_begins_softly(lab: Lab, page: Page, second: Second, tmp_path: pathlib.Path) -> None:
    """It has no force where it is, so that nothing jumps when it appears at the hand; or it is disabled."""
    lab.base["floor"] = fs.Plane(position=(0, 0, -0.05), contact=fs.Contact(keep="front", stiffness=200, limit=3))

    def is_soft(name: str) -> bool:
        forces = [abs(second.ask(f"law 0 {d} editor/{name}")) for d in np.linspace(1e-7, 0.1, 2000)]
        return forces[0] < 0.01 and forces[-1] < 0.01 and 1 < max(forces) < 3 and float(np.abs(np.diff(forces)).max()) < 0.05

    page.click("#add-point")
    page.wait_for_selector('#panel[data-selected="point"]')
    assert is_soft("point")
    page.wait_for_function("() => Number.isFinite(editor.model.byName('point').wanted) && editor.model.byName('point').wanted > 0")  # no jump
    page.click("#look-top")
    page.click("#add-polyline")
    for i, x in enumerate((-0.04, 0.04)):
        page.mouse.click(*project(page, (x, 0.02, -0.05)))
        page.wait_for_selector(f'#view[data-drawing="{i + 1}"]')
    page.keyboard.press("Enter")
    page.wait_for_selector('#panel[data-selected="line"]')
    assert is_soft("line")
    page.choose("front.kind", "none")
    eventually(lambda: second.get("editor/line")["front"]["kind"] == 0)
    page.wait_for_function("() => editor.model.byName('line').told.front.kind === 'none'")
    page.choose("front.kind", "custom")  # a curve of one's own begins like that too
    eventually(lambda: second.get("editor/line")["front"]["kind"] == 7)
    assert abs(second.ask("law 0 1e-7 editor/line")) < 0.01
    (tmp_path / "part.obj").write_text("v 0 0 0\nv 50 0 0\nv 0 50 0\nv 0 0 50\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
    with page.expect_file_chooser() as chooser:
        page.click("#add-mesh")
    chooser.value.set_files(tmp_path / "part.obj")
    page.fill("#mesh-scale", "0.001")
    page.click("#mesh-add")
    page.wait_for_selector('#panel[data-selected="part"]')
    assert second.get("editor/part")["enabled"] is False
    page.locator(".notice", has_text="part is disabled").wait_for()


def test_numbers_after_a_drag_are_short(lab: Lab, page: Page, second: Second) -> None:
    page.click("#add-point")
    page.wait_for_selector('#panel[data-selected="point"]')
    page.set("pose.position.y", "0.0123456789")
    page.wait_for_function("() => editor.model.byName('point').pose.position[1] === 0.0123456789")
    page.click("#look-front")
    drag_along_x(page, 0.0666)
    page.wait_for_selector('body[data-busy="0"]')
    x, y, z = eventually(lambda: (at := second.get("editor/point")["position"])[0] > 0.05 and at)
    assert x == round(x, 4) and (y, z) == (0.0123456789, 0)  # what was not dragged keeps its digits
    page.wait_for_function("x => editor.model.byName('point').pose.position[0] === x", arg=x)
    eventually(lambda: len(page.field("pose.position.x").input_value()) <= 6)
    page.click("#look-top")
    page.keyboard.press("e")
    page.wait_drawn()
    start = project(page, page.evaluate("editor.tools.gizmo.grip('z')"))
    page.mouse.move(*start)
    page.wait_for_function("() => editor.tools.gizmo.isUnderPointer")
    page.drag(start, (start[0] - 37, start[1] + 21), steps=5)
    page.wait_for_selector('body[data-busy="0"]')
    eventually(lambda: re.fullmatch(r"-?\d+(\.\d)?", turn := page.field("pose.turn.rz").input_value()) and turn != "0")


def test_draw_on_the_terrain(lab: Lab, page: Page, second: Second) -> None:
    rover = lab.join("rover")
    rover["land"] = terrain()
    page.wait_for_selector('#table .item[data-name="rover/land"]')
    page.click("#look-top")
    page.wait_for_function("() => editor.view.things.targets.some(t => t.userData.item !== undefined)")
    page.click("#tool-draw")
    for i, (x, y) in enumerate([(-0.06, 0), (0, 0.03), (0.06, 0)]):
        page.mouse.click(*project(page, (x, y, -0.06)))
        page.wait_for_selector(f'#view[data-drawing="{i + 1}"]')
    picture(page, "drawing")
    page.keyboard.press("Enter")
    page.wait_for_selector('#panel[data-selected="line"]')
    line = second.get("editor/line")
    at = np.reshape(line["points"], (3, 3)) + line["position"]
    assert not line["closed"]
    for x, y, z in at:
        assert abs(z - (-0.06 + 0.01 * math.sin(40 * x) * math.cos(30 * y))) < 0.0005
    # The arrows of what is selected are not in the way, and a double click is the end of a line.
    page.wait_drawn()
    grip = project(page, page.evaluate("editor.tools.gizmo.grip('x')"))
    page.click("#tool-draw")
    page.mouse.click(*grip)
    page.wait_for_selector('#view[data-drawing="1"]')
    page.mouse.dblclick(*project(page, (0.06, -0.03, -0.06)))
    page.wait_for_selector('#panel[data-selected="line 2"]')
    assert second.get("editor/line 2")["point_count"] == 2


def test_drag_the_gizmo(lab: Lab, page: Page, second: Second) -> None:
    page.click("#add-point")
    page.wait_for_selector('#panel[data-selected="point"]')
    page.click("#look-front")
    assert second.get("editor/point")["position"] == [0, 0, 0]
    drag_along_x(page, 0.1, "Control")
    eventually(lambda: second.get("editor/point")["position"] == [0.1, 0, 0])  # exactly
    page.wait_for_function("() => editor.model.byName('point').pose.position[0] === 0.1")
    drag_along_x(page, -0.1)
    pixel = 0.1 / abs(project(page, (0.1, 0, 0))[0] - project(page, (0, 0, 0))[0])
    eventually(lambda: abs(second.get("editor/point")["position"][0]) <= 1.5 * pixel)
    assert second.get("editor/point")["position"][1:] == [0, 0]
    page.keyboard.press("Control+z")  # one step per gesture
    eventually(lambda: second.get("editor/point")["position"] == [0.1, 0, 0])
    page.keyboard.press("Control+z")
    eventually(lambda: second.get("editor/point")["position"] == [0, 0, 0])
    page.keyboard.press("Control+Shift+Z")
    eventually(lambda: second.get("editor/point")["position"] == [0.1, 0, 0])


def test_by_keys_alone(lab: Lab, page: Page, second: Second) -> None:
    rover = lab.join("rover")
    for i in range(1, 6):
        rover[f"p{i}"] = fs.Point(position=(0.02 * i, 0, 0.03), front=fs.Gaussian(1, 0.01, limit=2))
    rover["way"] = fs.Polyline([(0, 0, 0), (0.02, 0, 0), (0.02, 0.03, 0)], front=fs.Gaussian(1, 0.01, limit=2))
    for i in range(1, 6):
        page.wait_for_selector(f'#table .item[data-name="rover/p{i}"][data-state="felt"]')
    page.wait_for_selector('#table[data-count="6"]')
    press: Callable[[str], None] = page.keyboard.press

    def go_to(selector: str, key: str = "Tab") -> None:
        for _ in range(200):
            if page.evaluate("selector => document.activeElement.matches(selector)", selector):
                return
            press(key)
        raise AssertionError(f"{key} does not lead to {selector}")

    def enabled() -> list[int]:
        return [i for i in range(1, 6) if second.get(f"rover/p{i}")["enabled"]]

    def chosen() -> list[str]:
        return page.evaluate("""() => [...document.querySelectorAll('#table [role=row][aria-selected=true]')]
            .map(row => row.dataset.name.slice(6))""")

    def active() -> str:
        return page.evaluate("""() => document.getElementById(document.activeElement.getAttribute('aria-activedescendant'))
            ?.dataset.name.slice(6)""")

    go_to("#table [role=grid]")
    press("ArrowDown")
    press("Shift+ArrowDown")
    press("Shift+ArrowDown")
    press("Shift+ArrowUp")
    assert chosen() == ["p1", "p2"] and active() == "p2"
    press("Control+ArrowDown")
    press("Control+ArrowDown")
    assert chosen() == ["p1", "p2"] and active() == "p4"
    press("Control+Space")
    assert chosen() == ["p1", "p2", "p4"]
    press("Space")
    eventually(lambda: enabled() == [3, 5])
    for i in (1, 2, 4):
        page.wait_for_selector(f'#table .item[data-name="rover/p{i}"][data-state="disabled"]')
    press("Control+Space")
    assert chosen() == ["p1", "p2"] and active() == "p4"
    picture(page, "chosen by keys")
    press("End")
    assert chosen() == ["way"] == [active()]
    for is_hidden in (True, False):
        press("h")
        assert page.locator('#table .item.hidden[data-name="rover/way"]').count() == is_hidden
    press("Home")
    press("Shift+End")
    assert len(chosen()) == 6 and active() == "way"
    # All that the filter shows.
    go_to("#filter", "Shift+Tab")
    page.keyboard.type("point p felt")
    go_to("#table [role=grid]")
    press("Control+a")
    assert chosen() == ["p3", "p5"]
    press("Space")
    eventually(lambda: enabled() == [])
    press("Control+z")
    eventually(lambda: enabled() == [3, 5])
    # The corners of a line: from one to the next, moved by a millimetre and by a tenth of that, and removed.
    go_to("#filter", "Shift+Tab")
    press("Control+a")
    page.keyboard.type("way")
    go_to("#table [role=grid]")
    press("ArrowDown")
    page.wait_for_selector('#panel[data-selected="rover/way"]')
    page.wait_for_selector('[data-corner="2"]')
    press("c")
    press("c")
    assert page.evaluate("document.activeElement.dataset.corner") == "1"
    for key, wanted in (("ArrowRight", [0.021, 0, 0]), ("Shift+ArrowDown", [0.021, -0.0001, 0]), ("PageUp", [0.021, -0.0001, 0.001])):
        shape = page.evaluate('editor.model.byName("rover/way").told.shape.hash')
        press(key)
        eventually(lambda wanted=wanted: np.allclose(second.get("rover/way")["points"], [0, 0, 0, *wanted, 0.02, 0.03, 0], atol=1e-12))
        page.wait_for_function('shape => editor.model.byName("rover/way").told.shape.hash !== shape', arg=shape)  # the page knows
        page.wait_for_load_state("networkidle")
        page.wait_drawn()
        page.wait_for_function("at => Math.abs(editor.tools.corners.points[1].reduce((sum, x) => sum + x) - at) < 1e-12", arg=sum(wanted))
    picture(page, "a corner by keys")
    assert page.evaluate("document.activeElement.dataset.corner") == "1"  # it keeps the focus
    press("Delete")
    eventually(lambda: second.get("rover/way")["points"] == [0, 0, 0, 0.02, 0.03, 0])
    press("?")
    page.wait_for_selector("dialog[open]")
    picture(page, "help")


def test_own_and_others_objects_in_one_gesture(lab: Lab, page: Page, second: Second) -> None:
    rover = lab.join("rover")
    rover.set_frame(fs.Frame(scale=2, pose=fs.Pose(orientation=(math.sqrt(0.5), 0, 0, math.sqrt(0.5)))))
    rover["hazard"] = fs.Point(position=(0.04, 0.02, 0), front=fs.Gaussian(1, 0.01, limit=2))
    lab.base["floor"] = fs.Plane(position=(0, 0, -0.05), front=fs.Gaussian(1, 0.01, limit=2))
    page.click("#add-point")
    page.wait_for_selector('#panel[data-selected="point"]')
    names = ["editor/point", "rover/hazard", "server/floor"]
    for name in ("point", *names[1:]):
        line = page.locator(f'#table .item[data-name="{name}"] .name')
        line.click(modifiers=["Control"] if "/" in name else [])
    page.wait_for_selector('#panel[data-selected="point|rover/hazard|server/floor"]')
    first = [second.get(name) for name in names]

    def each(of: str, values: list[Any]) -> None:
        pairs = list(zip(names, values, strict=True))
        eventually(lambda: all(np.allclose(second.get(name)[of], value, atol=1e-12) for name, value in pairs), of)

    # By 0.1 m at the device: in the scene of the rover that is twice as far, and along another axis.
    drag_along_x(page, 0.1, "Control")
    moved = [np.add(one["position"], by) for one, by in zip(first, ([0.1, 0, 0], [0, -0.2, 0], [0.1, 0, 0]), strict=True)]
    each("position", moved)
    page.focus("#table .scroll")
    page.keyboard.press("Space")
    each("enabled", [False] * 3)
    page.set("damping", "1.5")
    each("damping", [1.5] * 3)
    for of, values in (("damping", [0] * 3), ("enabled", [True] * 3), ("position", [one["position"] for one in first])):
        page.keyboard.press("Control+z")  # each was one step
        each(of, values)
    assert [second.get(name) for name in names] == first
    for _ in range(3):
        page.keyboard.press("Control+Shift+z")
    each("damping", [1.5] * 3)
    each("position", moved)
    page.wait_for_function("() => editor.model.byName('point').pose.position[0] === 0.1")  # the page knows, too
    # A turn about the first of them carries the others around it.
    page.click("#look-top")
    page.keyboard.press("e")
    page.wait_drawn()
    start = project(page, page.evaluate("editor.tools.gizmo.grip('z')"))
    apart = page.evaluate(APART)
    turned = 0
    for _ in range(5):  # on a busy machine a drag may come while the picture is still behind the pointer
        page.mouse.move(*start)
        page.wait_for_function("() => editor.tools.gizmo.isUnderPointer")
        page.drag(start, (start[0] - 40, start[1] + 40), steps=8)
        page.wait_for_selector('#view[data-dragging="false"]')
        page.wait_for_selector('body[data-busy="0"]')
        turned = page.evaluate("editor.tools.gizmo.turned")
        if turned:
            break
        page.mouse.move(5, 5)
    assert turned > 5
    cosine = math.cos(math.radians(turned) / 2)
    eventually(lambda: abs(abs(second.get("editor/point")["orientation"][0]) - cosine) < 1e-9)
    page.wait_for_function("() => Math.abs(editor.model.byName('server/floor').turn[3]) > 0.01")
    assert np.allclose(page.evaluate(APART), apart, atol=1e-9)
    assert np.allclose(second.get("editor/point")["position"], moved[0], atol=1e-12)


def test_objects_that_get_different_values_get_them_together(lab: Lab, page: Page, second: Second) -> None:
    rover = lab.join("rover")
    rover["line"] = fs.Polyline([(0, 0, 0), (0.02, 0, 0)], front=fs.Gaussian(1, 0.01, limit=2))
    rover["wall"] = fs.Plane(contact=fs.Contact(keep="back", stiffness=100, limit=3))
    page.click("#add-plane")
    page.wait_for_selector('#panel[data-selected="plane"]')
    page.locator('#table .item[data-name="rover/wall"] .name').click(modifiers=["Control"])
    page.wait_for_selector('#panel[data-selected="plane|rover/wall"]')
    page.choose("contact.keep", "front")  # the own one needs a limit as well
    eventually(lambda: [second.get(name)["contact_limit"] for name in ("editor/plane", "rover/wall")] == [10, 3])
    eventually(lambda: [second.get(name)["keep"] for name in ("editor/plane", "rover/wall")] == [1, 1])
    # What differs is shown as nothing, and what not all of them use is not there.
    page.locator('#table .item[data-name="rover/line"] .name').click()
    page.locator('#table .item[data-name="rover/wall"] .name').click(modifiers=["Control"])
    page.wait_for_selector('#panel[data-selected="rover/line|rover/wall"]')
    assert page.field("front.kind").input_value() == page.field("primitive").input_value() == ""
    assert page.field("enabled").is_checked() and page.field("lifetime").input_value() == "0"
    assert not page.field("contact.keep").is_visible() and not page.field("front.gain").is_visible()
    rover.object_move("line", fs.Pose(position=[0.01, 0.02, 0]), fs.Twist(), 0)
    page.wait_for_selector('#panel .field[data-path="pose.position.x"] input[placeholder="several"]')
    assert page.field("pose.position.x").input_value() == "" and page.field("pose.position.z").input_value() == "0"
    page.choose("primitive", "point")
    eventually(lambda: [second.get(name)["primitive"] for name in ("rover/line", "rover/wall")] == [0, 0])
    assert second.get("rover/wall")["keep"] == 0  # as a point cannot be solid
    page.click("#undo")
    eventually(lambda: [second.get(name)["primitive"] for name in ("rover/line", "rover/wall")] == [1, 2])
    assert second.get("rover/wall")["keep"] == 1
    page.locator(".notice", has_text="Undone: change primitive of rover/line and 1 more").wait_for()
    page.click("#undo")
    eventually(lambda: [second.get(name)["keep"] for name in ("editor/plane", "rover/wall")] == [0, 2])
    page.locator(".notice", has_text="Undone: change contact of plane and 1 more").wait_for()


def test_what_is_typed(lab: Lab, page: Page, second: Second) -> None:
    """It is sent when the person says so, to what was selected then; and why it was not taken is always said."""
    rover = lab.join("rover")
    for name in ("a", "b", "c"):
        rover[name] = fs.Point(position=(0.05, 0, 0), front=fs.Gaussian(1, 0.01, limit=9))
    page.select("rover/a")
    gain = page.field("front.gain")
    page.set("front.gain", "2")
    eventually(lambda: second.get("rover/a")["front"]["gain"] == 2)
    # Undo belongs to what is typed, as long as it is not sent.
    gain.focus()
    page.keyboard.type("7")  # one key: how many of them a browser undoes at once is its own affair
    page.keyboard.press("Control+z")
    page.wait_for_function("() => document.activeElement.value === '2'")
    assert second.get("rover/a")["front"]["gain"] == 2
    # Escape gives a field its value back, and leaves it; the filter is empty then, and shows all.
    page.keyboard.type("88")
    page.keyboard.press("Escape")
    page.wait_for_function("() => document.activeElement === document.body")
    assert gain.input_value() == "2"
    page.locator("#filter").press_sequentially("nobody")
    page.get_by_text("Nothing matches the filter.").wait_for()
    page.keyboard.press("Escape")
    page.locator('#table .item[data-name="rover/b"]').wait_for()
    assert page.locator("#filter").input_value() == ""
    gain.focus()
    # A key that is held is one step.
    for _ in range(6):
        page.keyboard.down("ArrowUp")
    page.keyboard.up("ArrowUp")
    eventually(lambda: second.get("rover/a")["front"]["gain"] == 2.6)
    page.keyboard.press("Control+z")
    eventually(lambda: second.get("rover/a")["front"]["gain"] == 2)
    page.wait_for_function("() => document.activeElement.value === '2'")  # also in a scene where nothing else changes
    # To click at another object is to be done with typing. What was refused is said elsewhere then.
    gain.fill("-1")
    page.locator('#table .item[data-name="rover/b"] .name').click()
    page.wait_for_selector('#panel[data-selected="rover/b"]')
    page.locator(".notice.bad", has_text="gain: ").wait_for()
    assert page.locator("#panel .error:not(:empty)").count() == 0
    # One of the selected objects vanishes: what is half typed was meant for all of them.
    page.locator('#table .item[data-name="rover/c"] .name').click(modifiers=["Control"])
    page.wait_for_selector('#panel[data-selected="rover/b|rover/c"]')
    gain.fill("5")
    del rover["c"]
    page.locator(".notice.bad", has_text="“5” was not sent").wait_for()
    page.keyboard.type("6\n")
    assert gain.input_value() == "1"
    assert [second.get(f"rover/{name}")["front"]["gain"] for name in "ab"] == [2, 1]


# How far the others are from the first that is selected, m at the device.
APART = """() => { const { selection } = editor.model;
    return selection.map(item => Math.hypot(...item.place.map((x, i) => x - selection[0].place[i]))) }"""


def test_turn_by_30_degrees(lab: Lab, page: Page, second: Second) -> None:
    page.click("#add-plane")
    page.wait_for_selector('#panel[data-selected="plane"]')
    page.click("#look-top")
    page.keyboard.press("e")
    page.wait_drawn()
    start = project(page, page.evaluate("editor.tools.gizmo.grip('z')"))
    page.mouse.move(*start)
    page.wait_for_function("() => editor.tools.gizmo.isUnderPointer")
    page.mouse.down()
    page.keyboard.down("Control")
    wanted = [math.cos(math.pi / 12), 0, 0, math.sin(math.pi / 12)]
    for i in range(1, 200):
        page.mouse.move(start[0] - i, start[1] + i)
        turned = page.evaluate("editor.tools.gizmo.turned")
        if abs(turned - 30) < 1e-6:
            break
    page.mouse.up()
    page.keyboard.up("Control")
    found = eventually(lambda: (o := second.get("editor/plane")["orientation"])[3] != 0 and abs(abs(o[3]) - wanted[3]) < 1e-12 and o)
    assert abs(found[0] - wanted[0]) < 1e-12 and found[1:3] == [0, 0]


def test_every_field(lab: Lab, page: Page, second: Second) -> None:
    page.click("#add-plane")
    page.wait_for_selector('#panel[data-selected="plane"]')
    get: Callable[[], Any] = lambda: second.get("editor/plane")  # noqa: E731
    for i, axis in enumerate("xyz"):
        page.set(f"pose.position.{axis}", f"0.0{i + 1}")
    eventually(lambda: get()["position"] == [0.01, 0.02, 0.03])
    page.set("pose.turn.rx", "90")
    eventually(lambda: np.allclose(get()["orientation"], [math.sqrt(0.5), math.sqrt(0.5), 0, 0], atol=1e-15))
    page.set("pose.orientation.x", "0")
    eventually(lambda: get()["orientation"] == [1, 0, 0, 0])
    page.set("pose.position.x", "far")
    assert "not a number" in page.error("pose.position.x") and page.field("pose.position.x").input_value() == "0.01"
    page.set("pose.position.x", "1e20")
    assert "within 1e+15" in page.error("pose.position.x") and get()["position"][0] == 0.01
    # What is typed while the last value is on its way is sent too.
    page.field("damping").evaluate("""field => { for (const text of ["1", "2.5"]) {
        field.value = text; field.dispatchEvent(new KeyboardEvent("keydown", {key: "Enter"})) } }""")
    eventually(lambda: get()["damping"] == 2.5)
    # What a kind does not use is absent, and 0.
    kinds = {"constant": ("gain",), "linear_increasing": ("gain", "offset"), "linear_decreasing": ("gain", "offset"),
             "gaussian": ("gain", "width"), "quadratic": ("gain", "offset"), "inverse": ("gain", "offset"), "custom": ("gain", "curve")}  # fmt: skip
    for number, (kind, used) in enumerate(kinds.items(), 1):
        page.choose("front.kind", kind)
        front = eventually(lambda number=number: (f := get()["front"])["kind"] == number and f)
        for name in ("gain", "offset", "width"):
            page.wait_for_function("""([path, shown]) => document.querySelector(`#panel .field[data-path="${path}"]`).hidden !== shown""",
                                   arg=[f"front.{name}", name in used])  # fmt: skip
            assert name in used or front[name] == 0
        assert front["limit"] > 0
    page.choose("front.kind", "gaussian")
    eventually(lambda: get()["front"]["kind"] == 4)
    for path, value in (("front.gain", 3.5), ("front.width", 0.025), ("front.limit", 4.5), ("front.reach", 0.09)):
        page.set(path, str(value))
        eventually(lambda path=path, value=value: get()["front"][path.split(".")[1]] == value)
    page.choose("front.sense", "repulsive")
    eventually(lambda: get()["front"]["sense"] == 1)
    for path, bad, word in (("front.gain", "-1", ">= 0"), ("front.width", "0", "> 0"), ("front.limit", "0", "> 0"), ("front.reach", "-1", ">= 0")):
        before = page.field(path).input_value()
        page.set(path, bad)
        assert word in page.error(path) and page.field(path).input_value() == before
    # Contact.
    assert page.field("contact.friction").is_hidden()
    page.choose("contact.keep", "either")
    eventually(lambda: get()["keep"] == 3 and get()["contact_limit"] == 10)
    for path, value, told in (("stiffness", 450, "stiffness"), ("limit", 7, "contact_limit"), ("damping", 2, "contact_damping"), ("friction", 0.4, "friction")):
        page.set(f"contact.{path}", str(value))
        eventually(lambda told=told, value=value: get()[told] == value)
    page.set("contact.friction", "3")
    assert "0..2" in page.error("contact.friction")
    # Its surface.
    assert page.field("surface.impact_frequency").is_hidden()
    page.choose("surface.impact", "medium")
    eventually(lambda: get().get("impact") == [8, 100, 80])
    for i, (path, value) in enumerate((("impact_gain", 5), ("impact_frequency", 60), ("impact_decay", 30))):
        page.set(f"surface.{path}", str(value))
        eventually(lambda i=i, value=value: get()["impact"][i] == value)
    page.wait_for_function("document.querySelector('#panel select[data-path=\"surface.impact\"]').value === 'own'")
    page.set("surface.impact_frequency", "0")
    assert "1..100000" in page.error("surface.impact_frequency")
    page.choose("surface.impact", "none")
    eventually(lambda: "impact" not in get())
    page.choose("surface.impact", "own")
    assert "fields below" in page.error("surface.impact") and page.field("surface.impact").input_value() == "none"
    # The rest.
    for path, value in (("damping", 1.5), ("lifetime", 1000), ("start", 12.5)):
        page.set(path, str(value))
        eventually(lambda path=path, value=value: get()[path] == value)
    page.set("tool_points", "1, 3")
    eventually(lambda: get()["tool_points"] == 5)
    page.set("tool_points", "33")
    assert "1 to 32" in page.error("tool_points")
    page.field("enabled").uncheck()
    eventually(lambda: get()["enabled"] is False)
    page.set("name", "wall <b>&")
    page.wait_for_selector('#panel[data-selected="wall <b>&"]')
    assert second.get("editor/wall <b>&")["tool_points"] == 5
    assert second.get("editor/plane")["status"] == "FS_ERROR_NOT_FOUND"


OBJ = {"four": "v 0 0 0\nv 50 0 0\nv 0 50 0\nv 0 0 50\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n", "one": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"}


def test_another_primitive(lab: Lab, page: Page, second: Second, tmp_path: pathlib.Path) -> None:
    for name, text in OBJ.items():
        (tmp_path / f"{name}.obj").write_text(text)
    page.click("#add-point")
    page.wait_for_selector('#panel[data-selected="point"]')
    first = second.get("editor/point")
    page.choose("primitive", "plane")
    eventually(lambda: second.get("editor/point")["primitive"] == 2)
    page.wait_for_function("() => editor.model.byName('point').told.primitive === 'plane'")
    page.choose("contact.keep", "front")
    eventually(lambda: second.get("editor/point")["keep"] == 1)
    page.choose("primitive", "polyline")
    line = eventually(lambda: (o := second.get("editor/point"))["primitive"] == 1 and o)
    assert line["keep"] == 0 and line["points"] == [0, 0, 0, 0.05, 0, 0] and line["front"] == first["front"]
    page.wait_for_selector('[data-corner="1"]')
    # A mesh comes from a file, and so does another mesh in its place.
    with page.expect_file_chooser() as chooser:
        page.choose("primitive", "mesh")
    chooser.value.set_files(tmp_path / "four.obj")
    assert page.field("primitive").input_value() == "polyline"  # until there is a file
    page.fill("#mesh-scale", "0.001")
    page.click("#mesh-add")
    mesh = eventually(lambda: (o := second.get("editor/point"))["primitive"] == 3 and o)
    assert mesh["triangles"] == 4 and mesh["points"][3:6] == [0.05, 0, 0] and mesh["front"] == first["front"]
    page.wait_for_selector("#replace-mesh:visible")
    with page.expect_file_chooser() as chooser:
        page.click("#replace-mesh")
    chooser.value.set_files(tmp_path / "one.obj")
    page.fill("#mesh-scale", "0.1")
    page.click("#mesh-add")
    eventually(lambda: second.get("editor/point").get("triangles") == 1)
    page.wait_for_selector("dialog", state="detached")
    for primitive, triangles in ((3, 4), (1, 0), (2, None), (2, None), (0, None)):
        page.keyboard.press("Control+z")
        eventually(lambda primitive=primitive, triangles=triangles: (o := second.get("editor/point"))["primitive"] == primitive
                   and o.get("triangles") == triangles)  # fmt: skip
    eventually(lambda: second.get("editor/point") == first)


def test_velocity(lab: Lab, page: Page, second: Second) -> None:
    page.click("#add-point")
    page.wait_for_selector('#panel[data-selected="point"]')
    page.set("twist.linear.x", "0.2")
    eventually(lambda: second.get("editor/point")["twist"] == [0.2, 0, 0, 0, 0, 0])
    page.wait_for_function("() => Math.abs(editor.model.byName('point').pose.position[0] - 0.02) < 1e-12")  # it moves for 0.1 s
    page.wait_for_function("""() => document.querySelector('[data-path="twist.linear.x"] input').value === '0.2'""")
    page.set("twist.angular.z", "-3")
    eventually(lambda: second.get("editor/point")["twist"] == [0.2, 0, 0, 0, 0, -3])
    page.set("twist.linear.y", "fast")
    assert "not a number" in page.error("twist.linear.y")
    page.set("twist.linear.y", "1e30")
    assert "twist.linear.y" in page.error("twist.linear.y")
    page.keyboard.press("Control+z")
    eventually(lambda: second.get("editor/point")["twist"] == [0.2, 0, 0, 0, 0, 0])
    page.keyboard.press("Control+z")
    eventually(lambda: second.get("editor/point")["twist"] == [0] * 6 and second.get("editor/point")["position"] == [0, 0, 0])
    page.wait_for_function("""() => document.querySelector('[data-path="twist.linear.x"] input').value === '0'""")


def test_copy_from_another_scale(lab: Lab, page: Page, second: Second) -> None:
    rover = lab.join("rover")
    rover.set_frame(fs.Frame(scale=4, force_scale=0.5))
    rover["hill"] = fs.Plane(position=(0.2, 0, -0.1), front=fs.Gaussian(1.5, 0.08, limit=2, sense="repulsive"))
    page.wait_for_selector('#table .item[data-name="rover/hill"]')
    page.select("rover/hill")
    page.click("#adopt")
    page.wait_for_selector('#panel[data-selected="hill"]')
    copied = second.get("editor/hill")
    assert np.allclose(copied["position"], [0.05, 0, -0.025], atol=1e-15)
    for at in (0.004, 0.02, 0.05):  # m at the device
        assert second.ask(f"law 0 {at} editor/hill") > 0
        assert abs(second.ask(f"law 0 {at} editor/hill") - 0.5 * second.ask(f"law 0 {4 * at} rover/hill")) < 1e-12


def test_capped_curve(lab: Lab, page: Page, second: Second) -> None:
    page.click("#add-plane")
    page.wait_for_selector('#panel[data-selected="plane"]')
    page.wait_for_selector('#curve[data-curve="plane"][data-capped=""]')
    assert page.locator("#capped").is_hidden()
    page.choose("front.kind", "gaussian")
    eventually(lambda: second.get("editor/plane")["front"]["kind"] == 4)
    page.set("back.gain", "90000")
    page.wait_for_selector('#curve[data-curve="plane"]:not([data-capped=""])')
    page.locator("#capped", has_text="N/m").wait_for()
    picture(page, "capped curve")

    def agrees() -> bool:
        drawn = page.evaluate("editor.curve.drawn")
        at = [i for i in range(1, 400, 40) if drawn["steepest"]]
        return bool(at) and all(
            abs(drawn[side + "_capped"][i] - abs(second.ask(f"law {drawn['steepest']!r} {sign * drawn['distances'][i]!r} editor/plane"))) < 1e-9
            and drawn[side + "_capped"][i] <= drawn[side][i] + 1e-9
            for side, sign in (("front", 1), ("back", -1)) for i in at)  # fmt: skip

    eventually(agrees)


def test_curves(lab: Lab, page: Page, second: Second) -> None:
    page.click("#add-point")
    page.wait_for_selector('#panel[data-selected="point"]')
    page.choose("front.curve.way", "expression")
    page.set("front.curve", "2*exp(-d/0.02)*(1+sin(5*t))")
    eventually(lambda: second.get("editor/point")["front"].get("expression") == "2*exp(-d/0.02)*(1+sin(5*t))")
    page.set("front.curve", "1+" * 600_000 + "1")
    assert "too much for one command" in page.error("front.curve")
    page.set("front.curve", "3*(")
    page.locator(".error", has_text="too much").wait_for(state="hidden")
    assert "column 3" in page.error("front.curve")
    assert page.field("front.curve").input_value() == "2*exp(-d/0.02)*(1+sin(5*t))"
    # What was typed is not lost.
    page.get_by_role("button", name="Edit again").click()
    assert page.field("front.curve").input_value() == "3*("
    page.keyboard.press("End")
    page.keyboard.type("1-d)")
    page.keyboard.press("Enter")
    eventually(lambda: second.get("editor/point")["front"].get("expression") == "3*(1-d)")
    page.get_by_role("button", name="Edit again").wait_for(state="hidden")
    page.choose("front.curve.way", "table")
    eventually(lambda: "table" in second.get("editor/point")["front"])
    page.set("front.curve.table", "d\tf\n0\t0\n0.002\t1,5\n0.004\t2\n0.006\t0.5")
    eventually(lambda: second.get("editor/point")["front"]["table"] == [0, 1.5, 2, 0.5])
    assert second.get("editor/point")["front"]["step"] == 0.002
    page.set("front.curve.table", "0, 0\n0.002, 1\n0.005, 2")
    assert "line 3" in page.error("front.curve.table")
    page.get_by_role("button", name="Edit again").click()
    assert page.field("front.curve.table").input_value() == "0, 0\n0.002, 1\n0.005, 2"
    page.set("front.curve.table", "0, 0\n0.002, 1\n0.004, 2")
    eventually(lambda: second.get("editor/point")["front"]["table"] == [0, 1, 2])
    # The handles of the plot.
    page.choose("front.kind", "gaussian")
    page.wait_for_selector('[data-handle="front.limit"]')
    handle = page.locator('[data-handle="front.limit"]')
    page.wait_for_selector('#curve[data-curve="point"]')
    page.wait_for_selector('body[data-busy="0"]')

    def settled() -> Any:  # the handles are made anew with each curve
        before = handle.bounding_box()
        page.wait_drawn()
        return before is not None and handle.bounding_box() == before and before

    box = eventually(settled)
    start = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.drag(start, (start[0], start[1] + 30))
    lower = eventually(lambda: (limit := second.get("editor/point")["front"]["limit"]) < 2 and limit)
    page.wait_for_selector('body[data-busy="0"]')
    assert lower > 0.2
    page.keyboard.press("Control+z")
    eventually(lambda: second.get("editor/point")["front"]["limit"] == 2)


def test_change_a_hazard_while_it_moves(lab: Lab, page: Page, second: Second) -> None:
    assert second.ask("point hazard 0.05 0 0") == "FS_OK"
    page.wait_for_selector('#table .item[data-name="second/hazard"]')
    page.select("second/hazard")
    for i in range(20):
        assert second.ask(f"move hazard {0.05 - 0.001 * i} 0 0") == "FS_OK"
        if i == 5:
            page.set("front.gain", "1.75")
    eventually(lambda: second.get("hazard")["front"]["gain"] == 1.75)
    assert second.get("hazard")["position"] == [0.05 - 0.001 * 19, 0, 0]  # its moves stay
    page.wait_for_function("() => Math.abs(editor.model.byName('second/hazard').pose.position[0] - 0.031) < 1e-12")
    page.keyboard.press("Control+z")
    eventually(lambda: second.get("hazard")["front"]["gain"] == 1)
    assert second.get("hazard")["position"] == [0.05 - 0.001 * 19, 0, 0]
    page.keyboard.press("Control+Shift+z")
    eventually(lambda: second.get("hazard")["front"]["gain"] == 1.75)
    assert second.ask("gain hazard 0.5") == "FS_OK"  # its owner changes it: the step cannot be undone
    page.keyboard.press("Control+z")
    page.locator(".notice.bad", has_text="second").wait_for()
    assert second.get("hazard")["front"]["gain"] == 0.5
    page.click("#adopt")
    page.wait_for_selector('#panel[data-selected="hazard"]')
    assert second.get("editor/hazard")["front"]["gain"] == 0.5
