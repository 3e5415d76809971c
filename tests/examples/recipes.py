"""The recipes: their output is physically correct and is the output that their page shows. The page also has their code
and the figure of object.h.

recipes.py PROGRAM_FOLDER RECIPES_FOLDER [LEFT_OUT...]
"""
import json
import math
import pathlib
import re
import subprocess
import sys
import tempfile

programs, folder, left_out = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]), sys.argv[3:]
NUMBERS = r"\(\s*(-?[\d.]+),\s*(-?[\d.]+),\s*(-?[\d.]+)\)"
failures = 0


def expect(good, sentence):
    global failures
    if not good:
        failures += 1
        print(f"FAILED: {sentence}")


def norm(v):
    return math.sqrt(sum(x * x for x in v))


def near(a, b, tolerance=0.006):
    return all(abs(x - y) <= tolerance for x, y in zip(a, b))


def read(text):
    """For each line: its label, the place in mm or the speed in m/s, and the force in N."""
    for line in text.splitlines():
        found = re.fullmatch(rf"(.{{26}}) {NUMBERS} mm   {NUMBERS} N", line)
        if found:
            numbers = [float(x) for x in found.groups()[1:]]
            yield found[1].strip(), numbers[:3], numbers[3:]
            continue
        found = re.fullmatch(rf"(.{{26}}) +(-?[\d.]+) m/s   {NUMBERS} N", line)
        expect(found, f"a line cannot be read: {line}")
        if found:
            yield found[1].strip(), float(found[2]), [float(x) for x in found.groups()[2:]]


def wall(x):  # free above 0, 500 N/m below, 10 N at most
    return [0, 0, min(10, max(0, -x[2] * 0.5))]


def box(x):
    depth = [half - abs(value) for value, half in zip(x, (30, 30, 20))]
    if min(depth) <= 0:
        return [0, 0, 0]
    axis = depth.index(min(depth))
    return [math.copysign(min(10, 0.5 * depth[i]), x[i]) if i == axis else 0 for i in range(3)]


def solid(x):  # the hand has come from above
    return [0, 0, min(5, max(0, -0.2 * x[2]))]


def check_stick_slip(lines):
    """It sticks up to a lag of 1.6 mm; slips by s, with a lag of 1.6 mm - 0.4 s, down to 0.8 mm; and sticks when it comes back."""
    wanted = [0, -0.5, -0.8, -2 / 3, -0.4, -0.4, 0.1, 0.4, -0.15, -0.8 + 0.2 * 0.2 / 0.6]
    lines = list(lines)
    expect(len(lines) == len(wanted), f"stick_slip has {len(lines)} lines")
    for (where, x, force), aside in zip(lines, wanted):
        expect(near(force, [aside, 0, 1]), f"stick_slip, {where} at {x[0]} mm: {force} N, not {aside}")


def corduroy(x):
    """stiffness * (depth + h) * (normal - grad h), h the cosine that the heights are of."""
    if x[2] > 0:
        return [0, 0, 0]
    height, slope = 0.2 * (math.cos(math.pi / 2 * x[0]) - 1), -0.1 * math.pi * math.sin(math.pi / 2 * x[0])
    push = 0.5 * (-x[2] + height)
    return [-push * slope, 0, push]


def check_impact(lines):
    """The spring, and 8 N s/m * v * exp(-80 t) * sin(2 pi 100 t) where the hand comes at v, 20 mm/s at least."""
    lines = list(lines)
    expect(len(lines) == 15, f"impact has {len(lines)} lines")
    for where, x, force in lines:
        speed = float(where.split()[0])
        wanted = 0
        if "above" not in where:
            t = float(where.split()[-2]) / 1000
            wanted = -0.5 * x[2] + (8 * speed * math.exp(-80 * t) * math.sin(200 * math.pi * t) if speed > 0.02 else 0)
        expect(near(force, [0, 0, wanted]), f"impact, {where}: {force} N, not {wanted}")


def fingertip(x):  # a ball of 8 mm
    post = [v - p for v, p in zip(x, (40, 0, 8))]
    push = max(0, 1 - 0.1 * max(0, norm(post) - 8)) / norm(post)
    return [0.5 * max(0, 8 - x[0]) + push * post[0], 0, 0.5 * max(0, 8 - x[2]) + push * post[2]]


def sphere(x):
    size = norm(x)
    return [0, 0, 0] if size == 0 else [min(10, max(0, 0.5 * (30 - size))) * value / size for value in x]


def gravity(_):
    return [0, 0, -0.2 * 9.81]


def magnet(where, x):
    charge = float(where.split("at ")[-1].split()[0]) / 100 if "%" in where else 1
    d = norm(x)
    force = charge * 3 * d / 10 * math.exp(0.5 - (d / 10) ** 2 / 2)
    return [0, 0, 0] if d == 0 else [-force * value / d for value in x]


def check_path(lines):
    for where, x, force in lines:
        a, b = ((-60, 0, 0), (0, 0, 0)) if x[0] <= 0 else ((0, 0, 0), (60, 0, 30))
        along = [q - p for p, q in zip(a, b)]
        part = sum((v - p) * w for v, p, w in zip(x, a, along)) / norm(along) ** 2
        to = [p + min(1, max(0, part)) * w - v for v, p, w in zip(x, a, along)]
        d = norm(to)
        wanted = {0: 0, 5: 2, 10: 3, 15: 2}.get(d, 0 if d >= 20 else None)
        expect(wanted is not None and near(force, [wanted * v / d if d else 0 for v in to]), f"path, {where}: {force}")


def check_hazard(lines):
    for where, x, force in lines:
        size = math.hypot(x[0], x[1])
        edge = [40 * x[0] / size, 40 * x[1] / size, 0] if size else [40, 0, 0]
        away = [v - e for v, e in zip(x, edge)]
        d = norm(away)
        wanted = {0: 0, 5: 2.2, 10: 3, 15: 2.4, 20: 1.2, 25: 0.3}.get(d, 0 if d >= 30 else None)
        expect(wanted is not None and near(force, [wanted * v / d if d else 0 for v in away]),
               f"hazard, {where}: {force}")


def check_viscous_zone(lines):
    for where, speed, force in lines:
        wanted = -math.copysign(min(5, 20 * abs(speed)), speed) if "inside" in where else 0
        expect(near(force, [0, wanted, 0]), f"viscous_zone, {where}: {force}")


def by_formula(name, formula):
    def check(lines):
        for where, x, force in lines:
            wanted = formula(where, x) if formula is magnet else formula(x)
            expect(near(force, wanted), f"{name}, {where}: {force} N, not {wanted}")
    return check


CHECKS = {"wall": by_formula("wall", wall), "box": by_formula("box", box),
          "solid": by_formula("solid", solid), "stick_slip": check_stick_slip,
          "corduroy": by_formula("corduroy", corduroy), "impact": check_impact,
          "fingertip": by_formula("fingertip", fingertip), "sphere": by_formula("sphere", sphere),
          "path": check_path, "gravity": by_formula("gravity", gravity), "viscous_zone": check_viscous_zone,
          "hazard": check_hazard, "magnet": by_formula("magnet", magnet)}

page = (folder / "README.md").read_text()
sections = {}
for name, code, output in re.findall(r"\n\[`(\w+)\.c`\]\(\1\.c\).*?\n```c\n(.*?)```\n.*?```text\n(.*?)```", page, re.S):
    sections[name] = code, output
figure = re.search(r"\n(    [^\n]*front\.sense[^\n]*\n(?:\n|    [^\n]*\n)*)", page)[1].splitlines()
header = {line.lstrip(" *").rstrip() for line in (folder / "../../include/forceserver/object.h").read_text().splitlines()}
for line in figure:
    expect(line.strip() in header, f"object.h draws front and back in another way: {line}")
sources = {path.stem for path in folder.glob("*.c")}
expect(sources == set(CHECKS), f"there are {sorted(sources)}, checks for {sorted(CHECKS)}")
expect(sources == set(sections), f"there are {sorted(sources)}, in the page {sorted(sections)}")
for name in sorted(sources & set(CHECKS) & set(sections)):
    code, shown = sections[name]
    expect(code == (folder / f"{name}.c").read_text(), f"the page has another {name}.c than the file")
    if name in left_out:
        continue
    with tempfile.TemporaryDirectory() as temporary:
        scene = pathlib.Path(temporary) / "scene.json"
        run = subprocess.run([programs / name, scene], capture_output=True, text=True, timeout=60)
        expect(run.returncode == 0, f"{name} ended with {run.returncode}: {run.stderr}")
        count = 3 if name == "fingertip" else 1
        expect(scene.exists() and len(json.loads(scene.read_text())["objects"]) == count, f"{name} has not saved its scene")
    expect(run.stdout == shown, f"{name} prints\n{run.stdout}and the page shows\n{shown}")
    lines = list(read(run.stdout))
    expect(len(lines) >= 4 and any(norm(force) > 1 for _, _, force in lines), f"{name} shows too little")
    expect(name in ("gravity", "stick_slip") or any(norm(force) == 0 for _, _, force in lines), f"{name} is felt everywhere")
    CHECKS[name](lines)
print(f"{failures} failures")
sys.exit(failures > 0)
