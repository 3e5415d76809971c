"""Commands of the editor's server that change what an object is, and those about its own scene."""

from __future__ import annotations

import math
from typing import Any

import forceserver as fs
import numpy as np
import pytest

from conftest import Editor, Lab, Second, eventually
from wire import POINT, Socket, with_socket

TETRAHEDRON = b"v 0 0 0\nv 50 0 0\nv 0 50 0\nv 0 0 50\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"


def with_hazard(started: Any) -> tuple[Editor, Second]:
    """A rover with a hazard, an editor beside it, and a second client that looks at both."""
    lab = started(Lab)
    rover = lab.join("rover")
    rover["hazard"] = fs.Point(position=(0.05, 0, 0), front=fs.Gaussian(1, 0.01, limit=2))
    return started(Editor, lab.endpoint), started(Second, lab.endpoint)


def test_frame_tool_and_clutch_are_undone(started: Any) -> None:
    lab = started(Lab)
    editor, second = started(Editor, lab.endpoint), started(Second, lab.endpoint)

    def now() -> Any:
        return second.ask("frame editor")

    async def journey(s: Socket) -> None:
        first = now()
        steps: list[tuple[str, dict[str, Any]]] = [
            ("frame", {"fields": {"scale": 2, "position": [0.02, 0, 0]}}),
            ("frame", {"fields": {"orientation": [1, 0, 0, 1], "force_scale": 0.5}}),
            ("tool", {"points": [[0, 0, 0], [0.01, 0, 0]]}),
            ("clutch", {"held": True}),
        ]
        states = [first]
        for name, fields in steps:
            assert await s.ask(name, **fields) == {}
            states.append(now())
        assert states[1]["scale"] == 2 and states[2]["force_scale"] == 0.5
        assert len(states[3]["points"]) == 6 and states[4]["held"]
        for state in reversed(states[:-1]):
            assert "scene" in (await s.ask("undo"))["text"]
            assert now() == state
        for state in states[1:]:
            await s.ask("redo")
            assert now() == state
        assert (await s.ask("frame", fields={"scale": -1}))["field"] == "frame.scale"  # what is refused is no step
        await s.ask("undo")
        assert now() == states[3]

    with_socket(editor, journey)


def test_a_file_sets_the_frame_and_is_undone_as_one_step(started: Any) -> None:
    lab = started(Lab)
    editor, second = started(Editor, lab.endpoint), started(Second, lab.endpoint)

    async def journey(s: Socket) -> None:
        await s.ask("frame", fields={"scale": 3})
        await s.ask("add", name="a", primitive="point", fields=POINT)
        await s.ask("save", file="room")
        await s.ask("frame", fields={"scale": 5})
        await s.ask("remove", names=["a"])
        assert await s.ask("load", file="room.json") == {}
        assert second.ask("frame editor")["scale"] == 3 and second.get("editor/a")["status"] == "FS_OK"
        await s.ask("undo")
        assert second.ask("frame editor")["scale"] == 5 and second.get("editor/a")["status"] == "FS_ERROR_NOT_FOUND"

    with_socket(editor, journey)


def test_a_change_of_several_is_taken_whole_or_not_at_all(started: Any) -> None:
    editor, second = with_hazard(started)

    async def journey(s: Socket) -> None:
        await s.ask("add", name="wall", primitive="plane", fields={"contact.keep": "front", "contact.limit": 3})
        bad = await s.ask("change", names=["wall", "rover/hazard"], fields={"contact.keep": "back"})  # the hazard is a point
        assert bad["field"] == "contact.keep" and "POINT" in bad["text"]
        assert second.get("editor/wall")["keep"] == 1 and second.get("rover/hazard")["keep"] == 0
        assert (await s.ask("undo"))["text"] == "add wall"  # it was no step

    with_socket(editor, journey)


def test_the_surface_of_a_solid(started: Any) -> None:
    lab = started(Lab)
    rover = lab.join("rover")
    contact, heights = fs.Contact(keep="front", stiffness=100, limit=4), [[0, -1e-3, -5e-4]]
    rover["cloth"] = fs.Plane(contact=contact, surface=fs.surface(heights=heights, width=2e-3, repeats=True))
    editor, second = started(Editor, lab.endpoint), started(Second, lab.endpoint)

    async def journey(s: Socket) -> None:
        async def change(name: str, **fields: Any) -> Any:
            return await s.ask("change", names=[name], fields={f"surface.{field}": value for field, value in fields.items()})

        await s.ask("add", name="wall", primitive="plane", fields={"contact.keep": "front", "contact.limit": 3})
        for name in ("editor/wall", "rover/cloth"):
            short = name.removeprefix("editor/")
            for fields, wanted, told in (
                ({"impact": "medium"}, [8, 100, 80], "medium"),
                ({"impact_gain": 5}, [5, 100, 80], "own"),
                ({"impact_frequency": 60, "impact_decay": 30}, [5, 60, 30], "own"),
                ({"impact": "hard"}, [10, 250, 60], "hard"),
                ({"static_friction": 0.3}, [10, 250, 60], "hard"),
                ({"static_friction": 0}, [10, 250, 60], "hard"),
            ):
                await change(short, **fields)
                assert second.get(name)["impact"] == wanted, (name, fields)
                await s.until(lambda s, short=short, told=told: s.objects[short]["surface"]["impact"] == told)
            for field, value, sentence in (
                ("impact", "loud", "impact 'loud' is unknown; use 'none', 'soft', 'medium' or 'hard'"),
                ("impact_gain", -1, "impact_gain is -1, must be within 0..1000000"),
                ("impact_frequency", 0.5, "impact_frequency is 0.5, must be within 1..100000"),
                ("colour", 1, "surface has no field colour"),
            ):
                bad = await change(short, **{field: value})
                assert bad["field"] == f"surface.{field}" and sentence in bad["text"], bad
            await change(short, impact_gain=0)
            if short == "wall":
                assert "impact" not in second.get(name)  # it has no surface any more
            else:
                assert second.get(name)["impact"] == [0, 0, 0]
            await change(short, impact_gain=3)
            assert second.get(name)["impact"] == [3, 100, 80]  # as wood
        assert second.get("rover/cloth")["heights"] == heights[0] and second.get("rover/cloth")["column_width"] == 2e-3

    with_socket(editor, journey)


def test_another_primitive(started: Any) -> None:
    editor, second = with_hazard(started)
    names = ["point", "polyline", "plane", "mesh"]

    async def journey(s: Socket) -> None:
        await s.ask("add", name="a", primitive="point", fields=POINT)
        for name in ("a", "rover/hazard"):
            where = name if "/" in name else f"editor/{name}"
            first = second.get(where)
            assert await s.ask("change", names=[name], fields={"primitive": "plane"}) == {}
            solid = {"back.kind": "constant", "back.gain": 1, "back.limit": 2, "contact.keep": "front", "contact.limit": 3}
            assert await s.ask("change", names=[name], fields=solid) == {}
            plane = second.get(where)
            assert plane["primitive"] == 2 and plane["front"] == first["front"] and plane["keep"] == 1
            assert (await s.ask("change", names=[name], fields={"primitive": "mesh"}))["field"] == "primitive"
            assert await s.ask("change", names=[name], fields={"primitive": "polyline"}) == {}
            line = second.get(where)
            assert names[line["primitive"]] == "polyline" and line["points"] == [0, 0, 0, 0.05, 0, 0]
            assert line["keep"] == 0 and line["back"]["kind"] == 0 and line["position"] == first["position"]
            # A file makes it a mesh, and another file another mesh.
            for points in (4, 3):
                data = TETRAHEDRON if points == 4 else b"v 0 0 0\nv 50 0 0\nv 0 50 0\nf 1 2 3\n"
                assert await s.ask("upload", size=len(data), file="part.obj") == {}
                await s.socket.send(data)
                assert await s.ask("change", names=[name], fields={}, upload=True, scale=0.001) == {}
                mesh = second.get(where)
                assert mesh["primitive"] == 3 and mesh["point_count"] == points and mesh["points"][3] == 0.05
                assert mesh["front"] == first["front"] and mesh["position"] == first["position"]
            await s.ask("undo")
            assert second.get(where)["point_count"] == 4
            for _ in range(2):
                assert "who" in (told := await s.ask("undo")), told
            assert second.get(where) == plane
            for _ in range(2):
                await s.ask("undo")
            assert second.get(where) == first

    with_socket(editor, journey)


def test_twist(started: Any) -> None:
    editor, second = with_hazard(started)

    async def journey(s: Socket) -> None:
        await s.ask("add", name="a", primitive="point", fields=POINT | {"pose.position": [0.05, 0, 0]})
        for name in ("a", "rover/hazard"):
            where = name if "/" in name else f"editor/{name}"
            assert await s.ask("change", names=[name], fields={"twist.linear": [0.2, 0, 0]}) == {}
            assert second.get(where)["twist"] == [0.2, 0, 0, 0, 0, 0] and second.get(where)["position"] == [0.05, 0, 0]
            assert await s.ask("twist", name=name) == {"linear": [0.2, 0, 0], "angular": [0, 0, 0]}
            await s.until(lambda s, name=name: abs(s.poses[s.objects[name]["id"]][0] - 0.07) < 1e-12)  # it has moved for 0.1 s
            # A turn begins where the motion has ended, and the velocity stays.
            assert await s.ask("change", names=[name], fields={"twist.angular": [0, 0, math.pi]}) == {}
            found = second.get(where)
            assert found["twist"] == [0.2, 0, 0, 0, 0, math.pi] and abs(found["position"][0] - 0.07) < 1e-12
            turn = [math.cos(math.pi / 20), 0, 0, math.sin(math.pi / 20)]
            await s.until(lambda s, name=name: np.allclose(s.poses[s.objects[name]["id"]][3:], turn, atol=1e-12))
            # Who puts it somewhere ends its motion, and it stays turned as it was.
            assert await s.ask("change", names=[name], fields={"pose.position": [0.01, 0, 0]}) == {}
            found = second.get(where)
            assert found["twist"] == [0] * 6 and found["position"] == [0.01, 0, 0] and np.allclose(found["orientation"], turn, atol=1e-12)
            for velocity in ([0.2, 0, 0, 0, 0, math.pi], [0.2, 0, 0, 0, 0, 0], [0] * 6):
                assert "who" in (told := await s.ask("undo")), told
                assert second.get(where)["twist"] == velocity
            assert second.get(where)["position"] == [0.05, 0, 0]
            await s.ask("redo")
            assert second.get(where)["twist"] == [0.2, 0, 0, 0, 0, 0]
            await s.ask("undo")
        bad = await s.ask("change", names=["a"], fields={"twist.linear": [1e30, 0, 0]})
        assert bad["field"].startswith("twist.linear"), bad
        assert "text" in await s.ask("change", names=["a"], fields={"twist.linear": [1]})

    with_socket(editor, journey)


PROFILES = {
    "constant": fs.Constant(1, limit=2, reach=0.05),
    "increasing": fs.LinearIncreasing(30, 0.2, limit=2),
    "decreasing": fs.LinearDecreasing(-30, 1.5, limit=2),
    "gaussian": fs.Gaussian(1.5, 0.01, limit=2),
    "quadratic": fs.Quadratic(800, 0.1, limit=2),
    "inverse": fs.Inverse(0.01, 0.1, limit=2),
    "expression": fs.Custom("1.5*exp(-d/0.02)", limit=2),
    "table": fs.Profile(kind="custom", gain=0.5, limit=2, curve=fs.curve_create_table([0, 3, 1], 0.02)),
}


def test_a_copy_from_another_scale_feels_the_same(started: Any) -> None:
    lab = started(Lab)
    rover = lab.join("rover")
    theirs = fs.Frame(pose=fs.Pose(position=(0.01, 0.02, 0)), scale=4.0, force_scale=0.5)
    rover.set_frame(theirs)
    for name, profile in PROFILES.items():
        rover[name] = fs.Plane(position=(0.2, 0, 0), front=profile, back=profile, damping=3)
    rover["line"] = fs.Polyline([(0, 0, 0), (0.4, 0, 0)], front=PROFILES["gaussian"])
    rover["part"] = fs.Mesh([(0, 0, 0), (0.4, 0, 0), (0, 0.4, 0)], [[0, 1, 2]], contact=fs.Contact(keep="front", stiffness=100, limit=4, damping=2, friction=0.3))
    rough = fs.surface(heights=[[0, -8e-3]], width=4e-3, impact="medium")
    rover["cloth"] = fs.Plane(contact=fs.Contact(keep="front", stiffness=100, limit=4), surface=rough)
    ice = fs.surface(static_friction=0.4, dynamic_friction=0.2, slip_distance=8e-3)
    rover["ice"] = fs.Plane(contact=fs.Contact(keep="front", stiffness=100, limit=4), surface=ice)
    editor, second = started(Editor, lab.endpoint), started(Second, lab.endpoint)

    async def journey(s: Socket) -> None:
        await s.ask("frame", fields={"scale": 0.5, "force_scale": 2, "orientation": [1, 0, 0, 1]})
        for name in PROFILES:
            assert await s.ask("adopt", name=f"rover/{name}") == {"name": name}
            for at in (-0.04, -0.013, 0.002, 0.01, 0.04):  # m at the device
                was = 0.5 * second.ask(f"law 0 {4 * at} rover/{name}")
                now = 2 * second.ask(f"law 0 {0.5 * at} editor/{name}")
                assert now == pytest.approx(was, abs=1e-12), (name, at)
            # A slope k of the scene is scale*force_scale*k at the device: here 2 there and 1 here.
            found = second.get(f"editor/{name}")
            assert found["front"]["limit"] == 0.5
            # Its place: (0.2, 0, 0)/4 + (0.01, 0.02, 0) at the device, in a scene that is turned by 90 degrees.
            assert np.allclose(found["position"], [0.5 * 0.02, -0.5 * 0.06, 0], atol=1e-12)
        await s.ask("adopt", name="rover/line")
        assert second.get("editor/line")["points"] == [0, 0, 0, 0.05, 0, 0]
        await s.ask("adopt", name="rover/part")
        part = second.get("editor/part")
        assert part["points"][3] == 0.05 and part["triangles"] == 1 and part["friction"] == 0.3
        assert (part["stiffness"], part["contact_limit"], part["contact_damping"]) == (200, 1, 4)
        await s.ask("adopt", name="rover/cloth")
        cloth = second.get("editor/cloth")
        assert cloth["impact"] == [16, 100, 80] and cloth["heights"] == [0, -1e-3] and cloth["column_width"] == 5e-4
        await s.ask("adopt", name="rover/ice")
        assert (second.get("editor/ice")["static_friction"], second.get("editor/ice")["slip_distance"]) == (0.4, 1e-3)
        await s.ask("undo")
        await s.ask("undo")
        await s.ask("undo")
        assert second.get("editor/part")["status"] == "FS_ERROR_NOT_FOUND"
        await s.ask("frame", fields={"force_scale": 0})
        assert "nothing is felt" in (await s.ask("adopt", name="rover/line"))["text"]

    with_socket(editor, journey)


def test_the_curve_as_it_is_felt(started: Any) -> None:
    lab = started(Lab)
    rover = lab.join("rover")
    rover.set_frame(fs.Frame(scale=2.0, force_scale=1.0))
    rover["wall"] = fs.Plane(front=fs.Gaussian(2, 0.02, limit=4, sense="repulsive"), back=fs.LinearIncreasing(80_000, limit=4))
    editor, second = started(Editor, lab.endpoint), started(Second, lab.endpoint)

    async def journey(s: Socket) -> None:
        await s.until(lambda s: "rover/wall" in s.objects)
        felt: Any = {}
        for _ in range(600):
            told = await s.ask("curve", name="rover/wall", until=0.05)
            await s.state()
            felt = s.felt[s.objects["rover/wall"]["id"]]
            if told["steepest"] == pytest.approx(felt[11] / 2):  # it changes while the clients share it
                break
        assert told["steepest"] == pytest.approx(felt[11] / 2)
        for side, sign in (("front", 1), ("back", -1)):
            raw, capped = np.array(told[side]), np.array(told[side + "_capped"])
            assert np.all(capped <= raw + 1e-12) and np.any(capped < raw - 0.1)
            for i in (1, 20, 399):
                d = sign * told["distances"][i]
                assert capped[i] == pytest.approx(abs(second.ask(f"law {told['steepest']:.17g} {d:.17g} rover/wall")), abs=1e-12)
        soft = await s.ask("add", name="soft", primitive="plane", fields={"back.kind": "linear_increasing", "back.gain": 1, "back.limit": 1})
        assert soft == {"name": "soft"}
        assert (await s.ask("curve", name="soft", until=0.05))["front_capped"] is None

    with_socket(editor, journey)
