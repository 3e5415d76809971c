#!/usr/bin/env python3
"""validate_schema.py SCHEMA SOURCE...: checks every scene against SCHEMA, and that SCHEMA refuses scenes with one fault.
A source is a folder with scenes, or a program that writes some into the folder that is its argument. Ends with 77 where python3-jsonschema is missing."""
import copy
import json
import pathlib
import subprocess
import sys
import tempfile

try:
    from jsonschema import Draft202012Validator
except ImportError:
    print("python3-jsonschema is missing: not checked")
    sys.exit(77)

GOOD = {
    "$schema": "share/forceserver/scene.schema.json",
    "forceserver": "scene",
    "version": 1,
    "frame": {"pose": {"position": [0, 0, 0]}, "scale": 2},
    "tool": [[0, 0, 0]],
    "tool_radius": 0.01,
    "surfaces": {"grid": {"texture": {"heights": [[0, -1]], "column_width": 0.1}, "impact": {"gain": 1, "frequency": 9, "decay": 2}},
                 "waves": {"texture": {"expression": "-x^2", "columns": 4, "rows": 2, "column_width": 0.1, "row_width": 0.2}}},
    "shapes": {"p": {"points": [[0, 0, 0], [1, 0, 0]], "closed": True}, "m": {"file": "a/b..ply", "scale": 0.001}},
    "curves": {"t": {"step": 0.1, "table": [1, "inf"]}, "e": {"expression": "3*d"}},
    "objects": [
        {"name": "a", "primitive": "polyline", "shape": "p", "front": {"kind": "custom", "gain": 1, "curve": "e"}},
        {"name": "b", "primitive": "plane", "contact": {"keep": "front", "limit": 3}, "back": {"kind": "none"}},
        {"name": "c", "primitive": "point", "age": 12.5},
    ],
}

# Each: where, and what stands there instead (None: nothing).
FAULTS = [
    (["$schema"], 1), (["forceserver"], None), (["forceserver"], "rover"), (["version"], None), (["version"], 2), (["colour"], 1),
    (["frame", "scale"], 0), (["frame", "force_scale"], -1), (["frame", "pose", "position"], [0, 0]),
    (["frame", "pose", "colour"], 1), (["tool"], []), (["tool"], [[0, 0, 0]] * 33), (["tool"], [[0, 0, "x"]]),
    (["tool_radius"], -1), (["tool_radius"], "1"), (["surfaces", "grid", "texture", "heights"], None),
    (["surfaces", "grid", "texture", "expression"], "-x"), (["surfaces", "grid", "texture", "rows"], 2),
    (["surfaces", "waves", "texture", "rows"], None), (["surfaces", "waves", "texture", "columns"], 0),
    (["surfaces", "grid", "impact", "decay"], None), (["surfaces", "grid", "impact", "frequency"], 0),
    (["shapes", "p", "points"], [[0, 0, 0]]), (["shapes", "p", "file"], "a.ply"), (["shapes", "p", "closed"], 1),
    (["shapes", "m", "file"], "/a.ply"), (["shapes", "m", "file"], "../a.ply"), (["shapes", "m", "file"], "a/../b.ply"),
    (["shapes", "m", "file"], "./a.ply"), (["shapes", "m", "file"], "a//b.ply"), (["shapes", "m", "file"], ""),
    (["shapes", "m", "file"], "a/.."), (["shapes", "m", "scale"], 0), (["shapes", "m", "colour"], 1),
    (["curves", "t", "step"], 0), (["curves", "t", "table"], [1]), (["curves", "t", "table"], [1, "big"]),
    (["curves", "t", "expression"], "1"), (["curves", "e", "expression"], ""), (["curves", "e", "expression"], None),
    (["objects"], {}), (["objects", 0, "name"], None), (["objects", 0, "name"], ""), (["objects", 0, "name"], "a/b"),
    (["objects", 0, "name"], "x" * 64), (["objects", 0, "name"], "a\tb"), (["objects", 0, "primitive"], "ball"),
    (["objects", 0, "primitive"], None), (["objects", 0, "shape"], None), (["objects", 0, "back"], {}),
    (["objects", 0, "contact"], {}), (["objects", 1, "shape"], "p"), (["objects", 1, "time"], 1),
    (["objects", 2, "start"], 1), (["objects", 2, "age"], "inf"),
    (["objects", 1, "enabled"], 1), (["objects", 1, "tool_points"], -1), (["objects", 1, "tool_points"], 2**32),
    (["objects", 1, "contact", "keep"], "both"), (["objects", 1, "contact", "friction"], 3),
    (["objects", 1, "contact", "reserved"], 0), (["objects", 1, "lifetime"], -1), (["objects", 1, "damping"], -1),
    (["objects", 0, "front", "kind"], "strong"), (["objects", 0, "front", "sense"], "pull"),
    (["objects", 0, "front", "limit"], -1), (["objects", 0, "front", "gain"], "1"),
    (["objects", 0, "front", "gains"], 1),
    (["objects", 1, "twist"], {"x": 1}), (["objects", 1, "pose"], {"orientation": [1, 0, 0]}),
]


def with_fault(path, value):
    scene = copy.deepcopy(GOOD)
    place = scene
    for key in path[:-1]:
        place = place[key]
    if value is None:
        del place[path[-1]]
    else:
        place[path[-1]] = value
    return scene


def check_described(schema, place, failures):
    """Every property says what it is, and every object is closed."""
    if isinstance(schema, dict):
        if schema.get("type") == "object" and "additionalProperties" not in schema:
            failures.append(f"{place}: other keys are not forbidden")
        for key, value in schema.items():
            if key == "properties" and not any(k in place for k in ("/if", "/then", "/else")):
                for name, inner in value.items():
                    if "description" not in inner and "$ref" not in inner:
                        failures.append(f"{place}/{key}/{name}: no description")
            check_described(value, f"{place}/{key}", failures)
    elif isinstance(schema, list):
        for i, value in enumerate(schema):
            check_described(value, f"{place}/{i}", failures)


def main():
    schema = json.loads(pathlib.Path(sys.argv[1]).read_text(encoding="utf-8"))
    Draft202012Validator.check_schema(schema)
    validator = Draft202012Validator(schema)
    failures = []
    check_described(schema, "", failures)

    with tempfile.TemporaryDirectory() as folder:
        files = []
        for source in map(pathlib.Path, sys.argv[2:]):
            if source.is_file():
                subprocess.run([source, folder], check=True)
            else:
                files += source.glob("*.json")
        files = sorted(files + list(pathlib.Path(folder).glob("*.json")))
        for file in files:
            for error in validator.iter_errors(json.loads(file.read_text(encoding="utf-8"))):
                failures.append(f"{file.name}: {error.json_path}: {error.message[:200]}")
    if len(files) < 50:
        failures.append(f"there were only {len(files)} scenes")

    for error in validator.iter_errors(GOOD):
        failures.append(f"the good scene: {error.json_path}: {error.message[:200]}")
    for path, value in FAULTS:
        if validator.is_valid(with_fault(path, value)):
            failures.append(f"taken as good: {path} = {value!r:.60}")

    print("\n".join(failures) or f"{len(files)} scenes are as the schema says, {len(FAULTS)} faults are refused")
    return 1 if failures else 0


sys.exit(main())
