"""VIZ: hazards that are drawn, felt and seen; its processes; a picture without a display."""

from __future__ import annotations

import itertools
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import forceserver as fs
import numpy as np
import pytest
import shapely
from rig import Rig, eventually, patience, testbed
from virtualrobot.ground import Ground, width
from virtualrobot.manipulator import Manipulator, raised_rock
from virtualrobot.robot import joystick_scale, map_scale
from virtualrobot.world import World
from viz.__main__ import Controls, loop
from viz.app import Viz
from viz.hazards import BadBorder, Hazards, drape, force
from viz.picture import Picture
from viz.show import Show

border = [(-10, -8), (-2, -12), (6, -9), (9, -1), (5, 6), (-4, 7), (-11, 1)]  # m: seven nodes
numbers = itertools.count(1)


@pytest.fixture(scope="module")
def ground() -> Ground:
    return Ground()


@pytest.fixture
def lab() -> Iterator[str]:
    """A server in this process, with a hand that rests."""
    endpoint = f"shm:viz-test-{os.getpid()}-{next(numbers)}"
    with fs.Scene() as base, fs.Servo(base, "sim:?hold=0,0,0.01") as servo, fs.Server(servo, endpoint):
        yield endpoint


def expect_border(scene: fs.Scene, name: str, ground: Ground) -> None:
    """One closed line on the ground, which keeps the hand away."""
    its = scene.object_get(name)
    assert its.primitive == fs.Primitive.POLYLINE and its.shape.get_info().closed
    points = np.asarray(its.shape.get_points())
    assert np.abs([z - ground.height(x, y) for x, y, z in points]).max() < 1e-3
    apart = np.linalg.norm(np.diff(points[:, :2], axis=0, append=points[:1, :2]), axis=1)
    assert apart.max() <= 0.01 * width + 1e-9
    assert its.front.sense == fs.Sense.REPULSIVE and its.front.limit == 3


# ------------------------------------------------------------------------------------------------------------- hazards


def test_a_border_is_draped(ground):
    line = drape(ground, np.array(border))
    assert len(line) > 80
    for node in border:
        assert np.linalg.norm(line[:, :2] - node, axis=1).min() < 1e-9


@pytest.mark.parametrize(("nodes", "words"), [
    ([(0, 0), (5, 5)], "three nodes"),
    ([(0, 0), (5, 5), (5, 5), (0, 0)], "three nodes"),
    ([(0, 0), (5, 5), (5, 0), (0, 5)], "crosses itself"),
    ([(0, 0), (5, 5), (40, 0)], "off the map"),
    ([(0, 0), (5, 5), (np.nan, 0)], "nowhere"),
])  # fmt: skip
def test_what_is_no_border(ground, nodes, words):
    with fs.Scene() as scene:
        hazards = Hazards(scene, ground)
        hazards.put("hazard 1", np.array(border))
        with pytest.raises(BadBorder, match=words):
            hazards.put("hazard 1", np.array(nodes))
        expect_border(scene, "hazard 1", ground)


def test_a_hazard_pushes_away_without_a_jump(ground):
    with fs.Scene() as scene:
        hazards = Hazards(scene, ground)
        hazards.width = 4.0
        hazards.put("hazard 1", np.array(border))
        # Across the edge from the first to the second node, at its middle.
        a, b = np.array(border[0], float), np.array(border[1], float)
        across = np.array([(b - a)[1], -(b - a)[0]]) / np.linalg.norm(b - a)
        places = (a + b) / 2 + np.outer(np.linspace(-6, 6, 2401), across)
        forces = scene.evaluate([[x, y, ground.height(x, y)] for x, y in places])
        size = np.linalg.norm(forces, axis=1)
        assert 2.5 < size.max() <= 3 and size[0] == 0 and size[-1] == 0
        assert np.linalg.norm(np.diff(forces, axis=0), axis=1).max() < 0.2  # from 5 mm to 5 mm on the map
        hazards.change("hazard 1", 2.0, 1.0)
        assert hazards.settings("hazard 1") == (pytest.approx(2.0), pytest.approx(1.0))
        assert hazards.new_name() == "hazard 2"


# ------------------------------------------------------------------------------------------------------------- drawing


class Mouse:
    def __init__(self, picture: Picture) -> None:
        self.picture, self.interactor = picture, picture.plotter.iren.interactor

    def place(self, x: float, y: float, z: float) -> tuple[int, int]:
        """Where it is in the picture, in pixels."""
        renderer = self.picture.plotter.renderer
        renderer.SetWorldPoint(x, y, z, 1)
        renderer.WorldToDisplay()
        return tuple(round(v) for v in renderer.GetDisplayPoint()[:2])

    def move(self, at: tuple[int, int]) -> None:
        self.interactor.SetEventInformation(*at, 0, 0, "\0", 0, None)
        self.interactor.MouseMoveEvent()

    def drag(self, begin: tuple[int, int], end: tuple[int, int]) -> None:
        self.move(begin)
        self.interactor.LeftButtonPressEvent()
        for part in np.linspace(0, 1, 5):
            self.move(tuple(round(a + part * (b - a)) for a, b in zip(begin, end, strict=True)))
        self.interactor.LeftButtonReleaseEvent()

    def key(self, name: str) -> None:
        x, y = self.interactor.GetEventPosition()
        self.interactor.SetEventInformation(x, y, 0, 0, "\x7f", 0, name)
        self.interactor.KeyPressEvent()
        self.interactor.KeyReleaseEvent()

    def click(self, at: tuple[int, int]) -> None:
        self.move(at)
        self.interactor.LeftButtonPressEvent()
        self.interactor.LeftButtonReleaseEvent()


@pytest.fixture(scope="module")
def picture(ground) -> Iterator[Picture]:
    one = Picture(ground, off_screen=True)
    one.plotter.iren.interactor.Initialize()
    yield one
    one.close()


def draw(mouse: Mouse, ground: Ground, nodes: list[tuple[float, float]]) -> None:
    places = [mouse.place(x, y, ground.height(x, y)) for x, y in nodes]
    for at in [*places, places[0]]:
        mouse.click(at)


def test_drawn_with_the_mouse_seen_and_felt(lab, ground, picture):
    mouse = Mouse(picture)
    with fs.connect(lab, "viz") as scene, fs.connect(lab, "other") as other:
        viz = Viz(scene, ground)
        show = Show(viz, picture)
        drawing = viz.draw_in(picture)
        drawing.begin()
        draw(mouse, ground, border)
        assert viz.hazards.names() == ["hazard 1"] and drawing.pen is None
        scene.sync(10)
        expect_border(other, "viz/hazard 1", ground)
        nodes = drawing.borders[0].drawn
        assert np.linalg.norm(nodes[:, :2] - border, axis=1).max() < 0.2  # a pixel is 0.1 m

        # The hand is felt where the border is: VIZ evaluates what it has, at the place of the hand.
        x, y, z = nodes[0] + [-1.0, 0, 0]
        assert np.linalg.norm(scene.evaluate([[x, y, z]], name="hazard 1")) > 0.5

        # A second one that crosses itself is dropped, the first stays.
        drawing.begin()
        draw(mouse, ground, [(12, 12), (18, 18), (18, 12), (12, 18)])
        assert viz.hazards.names() == ["hazard 1"] and drawing.pen is None and len(drawing.borders) == 1

        # A node is moved, another taken away.
        before = np.asarray(scene["hazard 1"].shape.get_points())
        begin, end = (mouse.place(*place) for place in (nodes[3], nodes[3] + [4, 0, 0]))
        mouse.drag(begin, end)
        after = np.asarray(scene["hazard 1"].shape.get_points())
        assert after[:, 0].max() > before[:, 0].max() + 2
        expect_border(scene, "hazard 1", ground)

        # One that crosses itself comes back.
        begin, end = (mouse.place(*place) for place in (drawing.borders[0].drawn[0], nodes[4]))
        mouse.drag(begin, end)
        mouse.drag(end, mouse.place(12, 12, ground.height(12, 12)))
        assert np.allclose(drawing.borders[0].drawn, drawing.borders[0].nodes)
        expect_border(scene, "hazard 1", ground)

        # Delete takes away the node below the mouse, down to three.
        for _ in range(8):
            mouse.move(mouse.place(*drawing.borders[0].drawn[1]))
            mouse.key("Delete")
            assert len(drawing.borders[0].drawn) == len(viz.hazards.nodes("hazard 1")) >= 3
        assert len(drawing.borders[0].drawn) == 3
        expect_border(scene, "hazard 1", ground)

        show.update()
        assert picture.colours_seen() > 1000
        # What is shown of its reach is its width from the border: 3 m.
        shown = np.asarray(picture.plotter.actors["reach hazard 1"].mapper.dataset.points)
        at = shapely.LinearRing(np.asarray(scene["hazard 1"].shape.get_points())[:, :2])
        assert np.allclose(shapely.distance(at, shapely.points(shown[:, :2])), 3, atol=0.05)
        # Another client removes it: its border goes, too.
        scene.sync(30)
        other.object_remove("viz/hazard 1")
        eventually(lambda: viz.tell_events() or not drawing.borders)
        assert viz.hazards.newest is None
        show.update()
        assert not picture.lines and not [name for name in picture.plotter.actors if "reach" in name]
        # The first of two nodes does not close a border, which is said; nor does what crosses itself make one.
        drawing.begin()
        first, *rest = (mouse.place(x, y, ground.height(x, y)) for x, y in border[:3])
        for at in (first, rest[0], first):
            mouse.click(at)
        assert "a border needs three nodes before it can be closed" in viz.news()
        for at in (rest[1], first):
            mouse.click(at)
        assert len(drawing.borders[0].drawn) == 3 and viz.hazards.newest == "hazard 1"
        viz.draw_hazard(None, np.array([(12, 12), (18, 18), (18, 12), (12, 18)]))
        show.update()
        assert "no hazard: the border crosses itself" in words_of(picture)
        viz.remove_newest()
        assert "hazard 1 is removed" in viz.news() and not drawing.borders
        show.update()
        viz.close()


def words_of(picture: Picture) -> str:
    return str(picture.words.GetText(2))


def test_the_nodes_go_where_another_client_has_moved_their_hazard(lab, ground, picture, tmp_path):
    file = tmp_path / "hazards.json"
    mouse = Mouse(picture)
    with fs.connect(lab, "viz") as scene, fs.connect(lab, "other") as other:
        viz = Viz(scene, ground)
        viz.keep_hazards_in(file)
        drawing = viz.draw_in(picture)
        viz.draw_hazard(None, np.array(border))
        scene.sync(30)
        other["viz/hazard 1"].move(position=(5, 4, 0))
        with pytest.MonkeyPatch.context() as patch, pytest.raises(TimeoutError):  # the server hangs: the event is told later
            patch.setattr(viz.hazards, "nodes", Mock(side_effect=fs.TimeoutError("it hangs")))
            eventually(lambda: viz.tell_events())
        eventually(lambda: viz.tell_events() or drawing.borders)
        assert np.allclose(drawing.borders[0].drawn[:, :2], np.array(border) + (5, 4))
        # A node is dragged: the other's edit stays.
        x, y = drawing.borders[0].drawn[3, :2]
        mouse.drag(mouse.place(x, y, ground.height(x, y)), mouse.place(x + 4, y, ground.height(x + 4, y)))
        nodes = viz.hazards.nodes("hazard 1")
        assert np.allclose(np.delete(nodes, 3, axis=0), np.delete(np.array(border) + (5, 4), 3, axis=0), atol=1e-6)
        assert nodes[3] == pytest.approx([x + 4, y], abs=0.3)
        # So it is for its corners; what is no border any more has no nodes.
        scene.sync(30)
        square = np.array([(0, 0, 0), (5, 0, 0), (5, 5, 0), (0, 5, 0)], float)
        other["viz/hazard 1"].shape = fs.shape_create_polyline(square, True)
        eventually(lambda: viz.tell_events() or len(drawing.borders[0].drawn) == 4)
        other["viz/hazard 1"].move(position=(1, 2, 0))
        eventually(lambda: viz.tell_events() or drawing.borders[0].drawn[0, 0] == 1)
        for is_following in (False, True):
            with fs.Scene() as again:
                loaded = Hazards(again, ground, is_following=is_following)
                loaded.keep_in(file)
                assert np.allclose(loaded.nodes("hazard 1"), square[:, :2] + (1, 2))
        other["viz/hazard 1"].shape = fs.shape_create_polyline(square[:2], False)
        eventually(lambda: viz.tell_events() or not drawing.borders)
        viz.close()


def test_the_sliders_show_and_set_the_newest_hazard(ground, picture, tmp_path, capsys):
    file = tmp_path / "hazards.json"
    with fs.Scene() as kept:
        hazards = Hazards(kept, ground)
        for name, hazards.width, hazards.newtons in (("hazard west", 5, 1), ("hazard 10", 2, 4), ("hazard 9", 6, 2)):
            hazards.put(name, np.array(border))
        kept.save(str(file))
    with fs.Scene() as scene:
        viz = Viz(scene, ground)
        controls = Controls(viz, picture)
        viz.keep_hazards_in(file)
        assert "3 hazards loaded from" in capsys.readouterr().out
        width, newtons = controls.sliders

        def shown() -> tuple[float, ...]:
            controls.update()
            return tuple(slider.GetRepresentation().GetValue() for slider in controls.sliders)

        assert viz.hazards.order == ["hazard west", "hazard 9", "hazard 10"] and shown() == pytest.approx((2, 4))
        width.GetRepresentation().SetValue(3.5)
        width.InvokeEvent("EndInteractionEvent")
        assert viz.hazards.settings("hazard 10") == pytest.approx((3.5, 4))
        scene["hazard 10"].front = force(3.0, 1.5)
        newtons.GetRepresentation().SetValue(2.5)
        newtons.InvokeEvent("EndInteractionEvent")
        assert viz.hazards.settings("hazard 10") == pytest.approx((3, 2.5))
        scene["hazard 10"].front = force(4.0, 1.5)
        assert shown() == pytest.approx((4, 1.5))
        viz.remove_newest()
        assert shown() == pytest.approx((6, 2))
        viz.draw_hazard(None, np.array(border))
        assert viz.hazards.settings(viz.hazards.newest) == pytest.approx((6, 2))
        viz.drawing.take_away(viz.hazards.newest)
        for name in viz.hazards.names():
            viz.drawing.take_away(name)
        picture.plotter.clear_slider_widgets()
        viz.close()


def test_loaded_hazards_can_be_moved(ground, picture, tmp_path):
    file = tmp_path / "hazards.json"
    with fs.Scene() as kept:
        kept["table"] = fs.Wall((0, 0, 0), (0, 0, 1), stiffness=100, limit=1)
        kept["ground"] = fs.Point(enabled=False)
        Hazards(kept, ground).put("hazard 7", np.array(border))
        kept.save(str(file))
    mouse = Mouse(picture)
    with fs.Scene() as scene:
        viz = Viz(scene, ground)
        drawing = viz.draw_in(picture)
        viz.keep_hazards_in(file)
        assert viz.hazards.newest == "hazard 7" and scene["ground"].primitive == fs.Primitive.MESH and "table" not in scene
        nodes = viz.hazards.nodes("hazard 7")
        assert np.abs(nodes - border).max() < 1e-9
        begin, end = (mouse.place(x, y, ground.height(x, y)) for x, y in (border[3], (13, -1)))
        mouse.drag(begin, end)
        assert np.abs(viz.hazards.nodes("hazard 7")[:, 0]).max() == pytest.approx(13, abs=0.3)
        viz.draw_hazard(None, np.array(border) + [15, 15])
        assert viz.hazards.newest == "hazard 8"
        drawing.take_away("hazard 7")
        viz.close()
    with fs.Scene() as kept:  # what else is in the file stays, with its frame
        kept.load(str(file))
        assert kept.frame.scale == 1
        assert sorted(kept) == ["ground", "hazard 7", "hazard 8", "table"]
        assert np.asarray(kept["hazard 7"].shape.get_points())[:, 0].max() == pytest.approx(13, abs=0.3)


def test_a_file_that_cannot_be_written(ground, tmp_path, capsys):
    """All goes on, it is said once, and the next change that can be saved saves all."""
    file = tmp_path / "hazards.json"
    with fs.Scene() as scene:
        viz = Viz(scene, ground)
        viz.keep_hazards_in(file)
        assert viz.draw_hazard(None, np.array(border)) == "hazard 1"
        with fs.Scene() as kept:
            kept.load(str(file))
            assert kept.frame.scale == map_scale  # so other programs have the hazards as large as VIZ has them
        for spoil, mend in (
            (lambda: file.write_text("{ broken"), file.unlink),
            (lambda: (file.unlink(), file.mkdir()), file.rmdir),
        ):
            spoil()
            for _ in range(3):
                assert viz.draw_hazard(None, np.array(border)) is not None
            assert capsys.readouterr().out.count("could not be saved") == 1
            mend()
            viz.change_newest(newtons=2.0)
            assert "saved again" in capsys.readouterr().out
            with fs.Scene() as kept:
                kept.load(str(file))
                assert sorted(kept) == sorted(viz.hazards.names())
        viz.close()


def test_hazards_of_others_in_the_file_stay(ground, tmp_path):
    """Also where the file is a link."""
    real, file = tmp_path / "real.json", tmp_path / "hazards.json"
    file.symlink_to(real)
    with fs.Scene() as scene, fs.Scene() as other:
        viz = Viz(scene, ground)
        viz.keep_hazards_in(file)
        viz.draw_hazard(None, np.array(border))
        other.load(str(file))
        Hazards(other, ground).put("hazard north", np.array(border) + [5, 5])
        other.save(str(real))
        viz.draw_hazard(None, np.array(border))
        viz.remove_newest()
        with fs.Scene() as kept:
            kept.load(str(real))
            assert sorted(kept) == ["hazard 1", "hazard north"] and file.is_symlink()
        viz.close()


def test_a_hazard_that_another_client_has_spoilt(lab, ground, capsys):
    with fs.connect(lab, "viz") as scene, fs.connect(lab, "other") as other:
        viz = Viz(scene, ground)
        viz.draw_hazard(None, np.array(border))
        scene.sync(30)
        point = fs.Point(name="viz/hazard 1")
        other.object_change(point, fs.Part.SHAPE)
        eventually(lambda: viz.tell_events() or scene["hazard 1"].primitive == fs.Primitive.POINT)
        assert viz.draw_hazard("hazard 1", np.array(border)) is None
        viz.change_newest()
        viz.remove_newest()
        assert "Traceback" not in capsys.readouterr().out and not viz.hazards.names()
        viz.close()


def test_borders_of_others_are_drawn_where_they_are(lab, ground, picture):
    square = np.array([(1, 0, 0), (2, 0, 0), (2, 1, 0), (1, 1, 0)], float)
    half = np.sqrt(0.5)
    with fs.connect(lab, "viz") as scene, fs.connect(lab, "other") as other:
        other.set_frame(fs.Frame(pose=fs.Pose(position=(0.01, 0, 0)), scale=100))
        other["square"] = fs.Polyline(square, closed=True, position=(0, 1, 0), orientation=(half, 0, 0, half))
        other.sync(30)
        viz = Viz(scene, ground)
        show = Show(viz, picture)
        for moved in (0.0, 5.0):
            if moved:
                other["square"].move(position=(moved, 1, 0), orientation=(half, 0, 0, half))
                other.sync(30)
            show.update()
            at_device = (np.stack([-square[:, 1], square[:, 0], square[:, 2]], axis=1) + [moved, 1, 0]) / 100 + [0.01, 0, 0]
            bounds = np.reshape(picture.plotter.actors["line other/square"].bounds, (3, 2))[:2]
            expected = map_scale * np.stack([at_device.min(axis=0), at_device.max(axis=0)], axis=1)[:2]
            assert np.allclose(bounds, expected, atol=1e-3)
        # One that is open is drawn open; of two points, and VIZ's own, it has a reach, too.
        other["open"] = fs.Polyline(square)
        other.sync(30)
        scene["hazard two"] = fs.Polyline([[0, 0, 0], [5, 0, 0]], front=force(3, 3))
        show.update()
        assert [picture.plotter.actors[f"line other/{name}"].mapper.dataset.n_points for name in ("square", "open")] == [5, 4]
        assert picture.plotter.actors["reach hazard two"].bounds[:4] == pytest.approx((-3, 8, -3, 3), abs=0.05)
        viz.close()
        del other["square"], other["open"], scene["hazard two"]
        other.sync(30)
        eventually(lambda: show.update() or not picture.lines)


def test_borders_of_others_while_it_follows(lab, ground, picture):
    with fs.connect(lab, "viz") as scene, fs.connect(lab, "other") as other:
        other["line"] = fs.Polyline([[0, 0, 0], [0.01, 0, 0]])
        other.sync(30)
        viz = Viz(scene, ground, follow="rover")
        show = Show(viz, picture)
        for offset, scale in (((0, 0, 0), 1), ((5, -3, 1), 1), ((5, -3, 1), 0.1)):
            viz.offset = np.array(offset, float)
            other.set_frame(fs.Frame(scale=scale))
            other.sync(30)
            show.update()
            ends = np.array([offset, np.array(offset) + [joystick_scale * 0.01 / scale, 0, 0]])
            assert picture.plotter.actors["line other/line"].bounds[:2] == pytest.approx(ends[:, 0])
        waits = "waits for the client 'rover' and its rover"
        assert viz.news() == [waits]  # once
        viz.said.clear()
        show.update()
        assert waits in words_of(picture)
        del other["line"]
        other.sync(30)
        eventually(lambda: show.update() or not picture.lines)
        viz.close()


def test_what_the_window_says_of_the_hand(lab, ground, picture, capsys):
    with fs.connect(lab, "viz") as scene, fs.connect(lab, "other") as other:
        viz = Viz(scene, ground)
        show = Show(viz, picture)
        show.update()
        assert "below the ground" not in words_of(picture)
        hand = scene.hand()
        show._show_words(hand._replace(sent=fs.Wrench(force=(0.4, 0, 0))), None, {})
        assert words_of(picture).startswith("the hand gets 0.4 N: the servo's damping")
        other.stop_force()
        eventually(lambda: viz.tell_events() or "other stopped all force" in viz.news())
        show.update()
        assert words_of(picture).startswith("the hand gets 0.0 N: other has stopped the force")
        other.resume_force()
        eventually(lambda: viz.tell_events() or "other let the force return" in viz.news())
        show.update()
        assert "has stopped" not in words_of(picture) and "other stopped all force" in capsys.readouterr().out
        viz.close()


def test_a_hand_below_the_ground_is_seen(ground, picture):
    with fs.Scene() as scene, fs.Servo(scene, "sim:?hold=0,0,-0.01"):
        viz = Viz(scene, ground)
        show = Show(viz, picture)
        eventually(lambda: show.update() or "the hand is below the ground" in words_of(picture))
        picture.plotter.render()
        x, y = Mouse(picture).place(*picture.hand.position)
        image = picture.plotter.screenshot(return_img=True)
        assert np.ptp(image[image.shape[0] - 1 - y, x].astype(int)) < 10  # grey or white, as no place of the ground is
        viz.close()


def rub(ground: Ground, viz: Viz, tmp_path: Path, seconds: float) -> np.ndarray:
    """A hand that is drawn over the map, some millimetres below the ground: the forces of each tick, N, shape (n, 3)."""
    random = np.random.default_rng(4)
    rows = [(0.0, 0.0, 0.0, 0.02)]
    for t in np.arange(1, seconds + 5, 4):
        x, y = random.uniform(-0.09, 0.09, 2)
        rows.append((t, x, y, ground.height(x * map_scale, y * map_scale) / map_scale - random.uniform(0, 0.003)))
    file = tmp_path / "path.txt"
    file.write_text("".join(f"{t} {x} {y} {z}\n" for t, x, y, z in rows))
    with (
        fs.Device(f"sim:?hand=firm&friction=0&encoder=ideal&path={file}") as device,
        fs.Servo(viz.scene, device, mode="virtual") as servo,
    ):
        felt, last = [], 0
        for _ in range(round(5 * seconds)):
            servo.step(200)
            ticks = viz.scene.get_record(last)
            last = int(ticks["number"][-1])
            felt.append(np.asarray(ticks["tick"]["response"]["wrench"]["force"]).reshape(-1, 3))
        return np.concatenate(felt)


def test_the_ground_is_felt_without_a_jump(ground, tmp_path):
    with fs.Scene() as scene:
        viz = Viz(scene, ground)
        force = rub(ground, viz, tmp_path, 40)
        assert (force[:800] == 0).all() and np.linalg.norm(force, axis=1).max() > 1
        step = np.linalg.norm(np.diff(force, axis=0), axis=1)
        # The hand goes on by some 25 um a tick, up and down over the bumps by more: 400 N/m.
        assert step.max() < 0.1, (step.max(), np.quantile(step, 0.999))
        viz.close()


def test_a_border_is_drawn_around_the_rover(ground, tmp_path):
    """The hand feels it softly: when it is drawn, when it is changed, when it is taken away. The rover goes on."""
    with Rig(tmp_path, [(0, 0.02, 0, 0.004)], "map") as rig:
        hazards = Hazards(rig.scene, ground)
        square = np.array([(-5, -4), (7, -4), (7, 4), (-5, 4)])  # m; the hand is at (6, 0)
        forces, edits = [], {
            100: lambda: hazards.put("hazard 1", square),
            200: lambda: hazards.put("hazard 1", square + [0.3, 0]),
            300: lambda: hazards.change("hazard 1", 5, 2),
            400: lambda: hazards.remove("hazard 1"),
        }  # fmt: skip
        for frame, _ in enumerate(rig.run(20)):
            forces.append(rig.felt())
            edits.get(frame, lambda: None)()
        sizes = [np.linalg.norm(forces[frame][-1]) for frame in (99, 199, 399, 499)]
        assert sizes[0] < 0.2 and sizes[1] > 1 and 0.5 < sizes[2] < 2.2 and sizes[3] < 0.2, sizes
        step = np.linalg.norm(np.diff(np.concatenate(forces), axis=0), axis=1)
        assert step[1000:].max() < 0.05, step.max()
        assert rig.robot.driven > 4 and not rig.said


def test_it_follows_a_rover(lab, ground):
    with fs.connect(lab, "rover") as rover, fs.connect(lab, "viz") as scene:
        viz = Viz(scene, ground, follow="rover")
        assert not viz.follow_once()
        rover["pose"] = fs.Point(position=(5, -3, 1), enabled=False)
        eventually(viz.follow_once)
        viz.draw_hazard(None, np.array(border))
        rover.object_move("pose", fs.Pose(position=(6, -3, 1)), fs.Twist(linear=(0.5, 0, 0)), 0)
        rover.sync(10)
        eventually(lambda: viz.follow_once() and viz.offset[0] == 6)
        for name in ("ground", "hazard 1"):
            assert np.allclose(scene[name].pose.position, (-6, 3, -1)) and np.allclose(scene[name].twist.linear, (-0.5, 0, 0))
        # Hazards that come and go do not end it.
        viz.begin_to_follow()
        for _ in range(60):
            viz.hazards.remove(viz.draw_hazard(None, np.array(border)) or "")
        assert viz._follower.is_alive()
        viz.close()


def test_the_hand_and_the_rocks_where_the_arm_has_them(lab, ground, picture):
    world = World()
    with fs.connect(lab, "rover") as rover, fs.connect(lab, "viz") as scene:
        robot = Manipulator(rover, world)
        viz = Viz(scene, ground, is_felt=False)
        nobody = Show(viz, picture, arm_client="nobody")
        nobody.update()
        assert not picture.hand.GetVisibility() and "waits for the client 'nobody' and its arm" in words_of(picture)
        robot.frame(rover.hand(), 0)
        line = np.array([(0.1, 0.2, 0), (0.3, 0.2, 0)])
        rover["line"] = fs.Polyline(line)
        rover.sync(10)
        show = Show(viz, picture, arm_client="rover")
        scene.sync(30)

        def is_shown_where_it_is() -> bool:
            show.update()
            hand = np.asarray(rover.hand().state.pose.position)
            return np.linalg.norm(picture.hand.position - robot.arm.to_world(hand)) < 1e-3

        eventually(is_shown_where_it_is)  # the hand may still move
        drawn = np.reshape(picture.plotter.actors["line rover/line"].bounds, (3, 2))
        ends = np.array([robot.arm.to_world(end) for end in line])
        assert np.allclose(drawn, np.stack([ends.min(axis=0), ends.max(axis=0)], axis=1) + [[0], [0], [0.05]], atol=1e-3)
        assert len(show.rocks) == 10
        for i in world.rocks:
            drawn = picture.plotter.actors[f"rover/{world.model.geom(i).name}"].bounds
            points = raised_rock(*world.rock(i), robot.arm.radius)  # as it is felt
            assert np.allclose(np.reshape(drawn, (3, 2)), np.stack([points.min(axis=0), points.max(axis=0)], axis=1), atol=2e-3)
        viz.close()


# ----------------------------------------------------------------------------------------------------------- processes


def start(*arguments: str, display: str = "") -> subprocess.Popen[str]:
    environment = {**os.environ, "DISPLAY": display, "WAYLAND_DISPLAY": ""}
    return subprocess.Popen([sys.executable, "-B", "-m", "viz", *arguments], cwd=testbed, text=True, env=environment,
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT)  # fmt: skip


def names(scene: fs.Scene) -> list[str]:
    return [str(name) for name in scene.get_motions(None)["name"]]


def test_embedded_with_others(tmp_path, ground):
    """The device is in VIZ's process; another client sees its ground, and it sees the client's border."""
    endpoint = f"shm:viz-embedded-{os.getpid()}"
    hazards, image = tmp_path / "hazards.json", tmp_path / "viz.png"
    with fs.Scene() as file:
        Hazards(file, ground).put("hazard 1", np.array(border))
        file.save(str(hazards))
    viz = start("--embed", "--device", "sim:", "--listen", endpoint, "--off-screen", str(image), "--hazards", str(hazards))
    with fs.connect(f"{endpoint}?timeout={patience}", "other") as scene:
        eventually(lambda: {"server/ground", "server/hazard 1"} <= set(names(scene)))
        expect_border(scene, "server/hazard 1", ground)
        scene.set_frame(fs.Frame(scale=map_scale))
        eventually(image.exists)
        viz.send_signal(signal.SIGTERM)
        output, _ = viz.communicate(timeout=patience)
        assert viz.returncode == 0, output
    with fs.Scene() as file:
        file.load(str(hazards))
        assert list(file) == ["hazard 1"]
        expect_border(file, "hazard 1", ground)


def test_further_signals_do_not_kill_it(lab, tmp_path):
    viz = start(lab, "--off-screen", str(tmp_path / "viz.png"))
    with fs.connect(lab, "other") as scene:
        eventually(lambda: "viz/ground" in names(scene))
        for number in itertools.cycle((signal.SIGINT, signal.SIGTERM)):
            if viz.poll() is not None:
                break
            viz.send_signal(number)
            time.sleep(0.01)
        output, _ = viz.communicate(timeout=patience)
        assert viz.returncode == 0 and "Traceback" not in output, output


def test_the_alarm_ends_one_that_hangs():
    hangs = "import os, time; m.patience = 1; m.Ending().is_looked_for = True; os.kill(os.getpid(), 15); time.sleep(60)"
    viz = subprocess.run([sys.executable, "-B", "-c", f"from viz import __main__ as m; {hangs}"], cwd=testbed, timeout=patience)
    assert viz.returncode == -signal.SIGALRM


def test_a_server_that_answers_again(ground, picture, tmp_path, capsys):
    ending, answers = SimpleNamespace(has_begun=False, wait=lambda seconds: None), iter((False, False, True))

    def update() -> None:
        if not next(answers):
            raise TimeoutError("the server hangs")
        ending.has_begun = True

    with fs.Scene() as scene:
        viz = Viz(scene, ground)
        loop(viz, SimpleNamespace(update=update), None, picture, tmp_path / "viz.png", ending)
        said = capsys.readouterr().out
        assert said.count("the server hangs") == 1 and said.count("the server answers again") == 1
        assert words_of(picture) == "the server hangs"
        viz.close()


def test_two_and_one_is_killed(lab, tmp_path):
    one = start(lab, "--off-screen", str(tmp_path / "one.png"))
    with fs.connect(lab, "other") as scene:
        eventually(lambda: "viz/ground" in names(scene))
        two = start(lab, "--off-screen", str(tmp_path / "two.png"))
        output, _ = two.communicate(timeout=patience)
        assert two.returncode == 1 and "Traceback" not in output and "viz" in output.splitlines()[-1], output
        one.kill()
        one.communicate(timeout=patience)
        eventually(lambda: "viz/ground" not in names(scene))


@pytest.mark.parametrize(("arguments", "words"), [
    ((), "either ENDPOINT or --embed"),
    (("shm:a", "--embed"), "either ENDPOINT or --embed"),
    (("--embed",), "--device"),
    (("shm:a", "--device", "sim:"), "for --embed"),
    (("shm:a", "--arm", "rover", "--follow", "rover"), "--arm"),
    (("--embed", "--device", "sim:", "--follow", "rover"), "--listen"),
    (("--embed", "--device", "sim:", "--arm", "rover"), "--listen"),
    (("--embed", "--device", "sim:", "--off-screen", "/none/none.png"), "there is no folder /none "),
    (("shm:a", "--off-screen", "none.jpg"), "none.jpg must end with .png"),
    (("shm:a", "--terrain", "none.asc"), "none.asc"),
    (("--embed", "--device", "sim:"), "no display"),
    (("--embed", "--device", "nonsense:"), "nonsense"),
    (("--embed", "--device", "sim:", "--listen", "a/b"), "shm:a/b"),
    (("nobody-is-there",), "shm:nobody-is-there"),
])  # fmt: skip
def test_wrong_words(arguments, words):
    viz = start(*arguments)
    output, _ = viz.communicate(timeout=patience)
    assert viz.returncode in (1, 2) and words in output and "Traceback" not in output, output


@pytest.mark.parametrize(("variables", "options", "words"), [
    ({"__EGL_VENDOR_LIBRARY_FILENAMES": "/dev/null"}, ("--off-screen", "none.png"), "OpenGL"),
    ({"DISPLAY": ":9999"}, (), "cannot be opened"),
])  # fmt: skip
def test_nothing_to_draw_with(lab, tmp_path, variables, options, words):
    environment = {**os.environ, "DISPLAY": "", "WAYLAND_DISPLAY": "", **variables}
    viz = subprocess.run([sys.executable, "-B", "-m", "viz", lab, *options], cwd=testbed, env=environment, text=True, capture_output=True)
    assert viz.returncode == 1 and words in viz.stderr.splitlines()[-1], viz.stderr


@pytest.mark.skipif(not (shutil.which("Xvfb") and shutil.which("xdotool")), reason="there is no Xvfb or no xdotool")
def test_with_a_real_mouse(lab, ground):
    """On a display: d, seven clicks and the first place again; another client sees the border. x removes it, q ends."""
    number = 90 + os.getpid() % 900
    screen = subprocess.Popen(["Xvfb", f":{number}", "-screen", "0", "1100x700x24"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        eventually(lambda: Path(f"/tmp/.X11-unix/X{number}").exists())
        viz = start(lab, display=f":{number}")

        def mouse(*words: str) -> str:
            return subprocess.run(["xdotool", *words], env={**os.environ, "DISPLAY": f":{number}"}, text=True, check=True,
                                  capture_output=True).stdout.strip()  # fmt: skip

        with fs.connect(lab, "other") as scene:
            eventually(lambda: "viz/ground" in names(scene))
            window = eventually(lambda: subprocess.run(["xdotool", "search", "--name", "VIZ"], env={**os.environ, "DISPLAY": f":{number}"},
                                                       text=True, capture_output=True).stdout.split())[-1]  # fmt: skip
            time.sleep(2)
            middle = [(560, 260), (640, 280), (660, 350), (600, 420), (500, 430), (430, 380), (460, 300)]
            mouse("windowfocus", window)
            for pause in (0.5, 2, 5, 10):  # s, in which VIZ takes a move or a click, however busy the machine is
                mouse("mousemove", "--window", window, "500", "500")
                mouse("key", "--window", window, "Escape")
                time.sleep(pause)
                mouse("key", "--window", window, "d")
                for x, y in [*middle, middle[0]]:
                    mouse("mousemove", "--window", window, str(x), str(y))
                    time.sleep(pause)
                    mouse("click", "1")
                    time.sleep(pause)
                if "viz/hazard 1" in names(scene):
                    break
            expect_border(scene, "viz/hazard 1", ground)
            mouse("key", "--window", window, "x")
            eventually(lambda: "viz/hazard 1" not in names(scene))
            mouse("key", "--window", window, "q")
            output, _ = viz.communicate(timeout=patience)
        assert viz.returncode == 0 and "hazard 1 has 7 nodes" in output, output
    finally:
        screen.terminate()
        screen.wait(patience)
