"""A force-server in this process, an editor beside it, a second client in C, and one Chromium for all journeys."""

from __future__ import annotations

import contextlib
import io
import itertools
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

import forceserver as fs
import numpy as np
import pytest

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[2]
PATIENCE = 90  # s: nothing here is a measure of time, this only ends what would never come

_numbers = itertools.count(1)


def eventually(f: Callable[[], Any], what: str = "") -> Any:
    """Waits until f() is true, and returns it."""
    end = time.monotonic() + PATIENCE
    while not (value := f()):
        assert time.monotonic() < end, f"it never came: {what or f}"
        time.sleep(0.02)
    return value


class Lab:
    """A server with the simulator: the hand rests at the origin, so that forces are known."""

    def __init__(self, device: str = "sim:?hold=0,0,0&encoder=ideal&friction=0&hand_stiffness=20000&hand_damping=200",
                 endpoint: str = "", **options: Any) -> None:
        self.endpoint = endpoint or f"shm:editor-test-{os.getpid()}-{next(_numbers)}"
        self.base = fs.Scene()
        self.servo = fs.Servo(self.base, device, fade=0.05, ramp=-1)
        self.server = fs.Server(self.servo, self.endpoint, **options)
        self.clients: list[fs.Scene] = []

    def join(self, name: str) -> fs.Scene:
        self.clients.append(fs.connect(self.endpoint, name))
        return self.clients[-1]

    def close(self) -> None:
        for client in self.clients:
            client.close()
        self.server.close()
        self.servo.close()
        self.base.close()


class Second:
    """The second client, in C."""

    def __init__(self, program: pathlib.Path, endpoint: str, name: str = "second") -> None:
        self._process = subprocess.Popen([program, endpoint, name], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def ask(self, line: str) -> Any:
        assert self._process.stdin and self._process.stdout
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()
        return json.loads(self._process.stdout.readline())

    def get(self, name: str) -> Any:
        return self.ask(f"get {name}")

    def close(self) -> None:
        self._process.kill()
        self._process.wait()


class Editor:
    """The program forceserver-editor, in a process of its own."""

    def __init__(self, endpoint: str, folder: pathlib.Path, *options: str, opens: bool = False) -> None:
        """opens: the browser that BROWSER names."""
        folder.mkdir(exist_ok=True)
        self.folder = folder
        environment = os.environ | {"XDG_STATE_HOME": str(folder / ".state"), "PYTHONUNBUFFERED": "1"}
        quiet = [] if opens else ["--no-browser"]
        command = [sys.executable, "-m", "forceserver_editor", endpoint, *quiet, "--folder", str(folder), *options]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment)
        assert self.process.stdout
        self.said = ""
        while not (found := re.search(r"http://\S+/", self.said)):
            line = self.process.stdout.readline()
            assert line, f"the editor ended: {self.said}"
            self.said += line
        self.address = found[0]

    @property
    def port(self) -> int:
        return int(self.address.split(":")[2].split("/")[0])

    @property
    def token(self) -> str:
        return self.address.split("/")[3]

    def close(self) -> None:
        """Whatever was done to it: it never fails in a way that it was not made for."""
        if self.process.poll() is None:
            self.process.terminate()
        said = self.process.communicate(timeout=PATIENCE)[0]
        assert "Traceback" not in said and "Warning" not in said, said


@pytest.fixture(scope="session")
def second_program(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    program = tmp_path_factory.mktemp("second") / "second"
    library = pathlib.Path(fs.__file__).parent
    found = next(library.glob("libforceserver.so*"))
    subprocess.run(["cc", "-Wall", "-Wextra", "-Werror", f"-I{ROOT}/include", HERE / "second.c", found,
                    f"-Wl,-rpath,{library}", "-o", program, "-lm"], check=True)  # fmt: skip
    return program


@pytest.fixture
def started(tmp_path: pathlib.Path, second_program: pathlib.Path) -> Iterator[Callable[..., Any]]:
    """Starts a Lab, an Editor or a Second, which end with the test."""
    with contextlib.ExitStack() as stack:

        def start(kind: type, *arguments: Any, **options: Any) -> Any:
            if kind is Editor:
                folder = options.pop("folder", tmp_path / "scenes")
                arguments = (arguments[0], folder, *arguments[1:])
            if kind is Second:
                arguments = (second_program, *arguments)
            made = kind(*arguments, **options)
            stack.callback(made.close)
            return made

        yield start


# ---- The browser

FLAGS = (
    "--no-sandbox --disable-background-networking --disable-dev-shm-usage --disable-component-update --no-first-run "
    "--ignore-gpu-blocklist --use-gl=angle --use-angle=gl-egl"
).split()


@pytest.fixture(scope="session")
def chromium() -> Iterator[Any]:
    playwright = pytest.importorskip("playwright.sync_api")
    program = shutil.which("chromium")
    if program is None:
        pytest.skip("there is no chromium")
    with playwright.sync_playwright() as p:
        browser = p.chromium.launch(executable_path=program, args=FLAGS)
        yield browser
        browser.close()


class Page:
    """A page of the editor, by mouse and keys."""

    def __init__(self, browser: Any, address: str, size: tuple[int, int] = (1000, 640), **options: Any) -> None:
        self.context = browser.new_context(viewport={"width": size[0], "height": size[1]}, accept_downloads=True, **options)
        self.page = self.context.new_page()
        self.page.set_default_timeout(PATIENCE * 1000)
        self.errors: list[str] = []
        self.asked: list[str] = []
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.goto(address + "?noantialias")
        self.page.wait_for_selector('body[data-server="there"]')

    def __getattr__(self, name: str) -> Any:
        return getattr(self.page, name)

    def select(self, name: str) -> None:
        """By a click in the table."""
        self.fill("#filter", name.rpartition("/")[2])
        self.locator(f'#table .item[data-name="{name}"] .name').click()
        self.fill("#filter", "")
        self.evaluate("document.activeElement.blur()")
        self.wait_for_selector(f'#panel[data-selected="{name}"]')

    def field(self, path: str) -> Any:
        return self.locator(f'#panel .field[data-path="{path}"] :is(input, select, textarea)').first

    def set(self, path: str, value: str) -> None:
        """Types a value into a field, and Enter."""
        field = self.field(path)
        field.scroll_into_view_if_needed()
        field.fill(value)
        field.press("Control+Enter" if field.evaluate("e => e.tagName") == "TEXTAREA" else "Enter")

    def choose(self, path: str, value: str) -> None:
        self.field(path).select_option(value)

    def error(self, path: str) -> str:
        """The sentence at a field."""
        at = self.locator(f'#panel .field[data-path="{path}"] .error:not(:empty)')
        at.wait_for()
        return str(at.inner_text())

    def place(self, name: str) -> tuple[float, float]:
        """Where an object is in the window."""
        found = self.evaluate("""name => { const {model, view} = editor, item = model.byName(name), p = view.project(item.place),
            box = view.canvas.getBoundingClientRect(); return [p.x + box.left, p.y + box.top] }""", name)
        return found[0], found[1]

    def drag(self, start: tuple[float, float], end: tuple[float, float], steps: int = 4, key: str = "") -> None:
        self.mouse.move(*start)
        self.mouse.down()
        if key:
            self.keyboard.down(key)
        self.mouse.move(*end, steps=steps)
        self.mouse.up()
        if key:
            self.keyboard.up(key)

    def wait_drawn(self) -> None:
        """Until the picture shows what the page knows now."""
        self.evaluate("""() => new Promise(done => { editor.view.change();
            requestAnimationFrame(() => requestAnimationFrame(() => done(null))) })""")

    def close(self) -> None:
        strangers = [url for url in self.asked if not url.startswith(("http://127.0.0.1:", "blob:", "data:"))]
        self.context.close()
        assert not strangers, f"the page asked for {strangers}"
        assert not self.errors, self.errors


@pytest.fixture
def opened(chromium: Any) -> Iterator[Callable[..., Page]]:
    with contextlib.ExitStack() as stack:

        def open_page(address: str, *arguments: Any, **options: Any) -> Page:
            page = Page(chromium, address, *arguments, **options)
            stack.callback(page.close)
            return page

        yield open_page


# ---- What journeys share

PICTURES = ROOT / "build/editor-pictures"


def picture(page: Page, name: str) -> None:
    PICTURES.mkdir(parents=True, exist_ok=True)
    page.wait_drawn()
    page.screenshot(path=PICTURES / f"{name}.png")


def pixels(page: Page, selector: str = "#view canvas") -> Any:
    """What is seen, as an array of (height, width, 3)."""
    image = pytest.importorskip("PIL.Image")
    page.wait_drawn()
    shot = page.locator(selector).screenshot()
    return np.asarray(image.open(io.BytesIO(shot)).convert("RGB")).astype(int)


def share(image: Any, colour: int, near: int = 40) -> float:
    """The share of pixels near a colour."""
    wanted = np.array([colour >> 16, colour >> 8 & 255, colour & 255])
    return float(np.mean(np.abs(image - wanted).max(axis=2) < near))


def project(page: Page, place: Any) -> tuple[float, float]:
    found = page.evaluate(
        """at => { const {view} = editor, p = view.project(at), box = view.canvas.getBoundingClientRect();
           return [p.x + box.left, p.y + box.top] }""", [float(x) for x in place])  # fmt: skip
    return found[0], found[1]


def terrain(count: int = 40, size: float = 0.12, height: float = 0.01) -> fs.Mesh:
    x = np.linspace(-size, size, count)
    across, along = np.meshgrid(x, x)
    points = np.stack([across, along, -0.06 + height * np.sin(40 * across) * np.cos(30 * along)], -1).reshape(-1, 3)
    i = np.arange(count * count).reshape(count, count)
    lower = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:]], -1).reshape(-1, 3)
    upper = np.stack([i[:-1, :-1], i[1:, 1:], i[1:, :-1]], -1).reshape(-1, 3)
    return fs.Mesh(points, np.concatenate([lower, upper]), contact=fs.Contact(keep="front", stiffness=400, limit=6))


@pytest.fixture
def lab(started: Any) -> Lab:
    made: Lab = started(Lab)
    return made


@pytest.fixture
def second(started: Any, lab: Lab) -> Second:
    made: Second = started(Second, lab.endpoint)
    return made


@pytest.fixture
def page(started: Any, lab: Lab, opened: Callable[[str], Page]) -> Page:
    return opened(started(Editor, lab.endpoint).address)
