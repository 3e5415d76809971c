"""Compares what the players of the scenario gave, and prints a table.

compare.py SCENARIO.json REFERENCE NAME=FILE...: each file is what a player printed; the name is "LANGUAGE here" or
"LANGUAGE connected". The reference is that of C++ in process. It is compared with what the scenario states; all others
are compared with it:
- what an evaluation gives (verbs profile, law, evaluate, tool) is the same bit for bit, also across shm: a tool evaluates the
  scene's own objects in this process;
- in process everything else is within 1e-12, and so is all of a connected scene until a servo runs;
- what a servo gives across shm is within 1e-9: until it has taken a change, a server runs a few ticks more or less.
What only a connected scene has (clients, their objects) is compared with C++ connected."""

import json
import math
import struct
import sys

EXACT = ("profile", "law", "evaluate", "tool")


def read(path):
    """place in the scenario -> (status, what it gave)."""
    with open(path) as file:
        rows = [line.rstrip("\n").split("\t") for line in file]
    return {row[0]: (row[1][1:], [v[1:] if v[0] == "'" else float.fromhex(v) for v in row[2:]]) for row in rows}


def steps_of(steps, prefix="", only=None):
    for i, step in enumerate(steps):
        step = {**({"only": only} if only else {}), **step}
        yield prefix + str(i), step
        yield from steps_of(step.get("steps", []), f"{prefix}{i}.", step.get("only"))


def difference(a, b):
    """0: the same bits; nan: not comparable."""
    if isinstance(a, str) or isinstance(b, str):
        return 0.0 if a == b else math.nan
    if struct.pack("d", a) == struct.pack("d", b):
        return 0.0
    return max(abs(a - b), 5e-324)  # 0 and -0 are not the same bits


class Row:
    """What became of one player."""

    def __init__(self, name):
        self.name, self.values, self.same, self.largest, self.servo, self.failures = name, 0, 0, 0.0, 0.0, 0

    def fail(self, sentence):
        self.failures += 1
        if self.failures <= 10:
            print(f"FAILED: {self.name}: {sentence}")

    def add(self, place, verb, given, wanted, tolerance):
        if len(given) != len(wanted):
            return self.fail(f"step {place} ({verb}) gives {len(given)} values, not {len(wanted)}")
        for i, (a, b) in enumerate(zip(given, wanted)):
            off = difference(a, b)
            self.values += 1
            self.same += off == 0
            if not off <= tolerance:
                self.fail(f"step {place} ({verb}), value {i}: {a}, not {b}")
            elif tolerance == 1e-9:
                self.servo = max(self.servo, off)
            else:
                self.largest = max(self.largest, off)


def main():
    with open(sys.argv[1]) as file:
        steps = list(steps_of(json.load(file)["steps"]))
    reference = read(sys.argv[2])
    stated = Row("C++, against what the scenario states")
    for place, step in steps:
        if step.get("only") == "connected":
            continue
        status, given = reference.get(place, ("nothing", []))
        if status != step.get("status", "OK"):
            stated.fail(f"step {place} ({step['do']}) ends with {status}, not {step.get('status', 'OK')}")
        elif "gives" in step:
            stated.add(place, step["do"], given, step["gives"], 1e-12)
    rows = []
    players = [argument.split("=", 1) for argument in sys.argv[3:]]
    reference_connected = read(dict(players)["C++ connected"]) if "C++ connected" in dict(players) else {}
    for name, path in players:
        row, result, connected, servo = Row(name), read(path), name.endswith(" connected"), False
        rows.append(row)
        for place, step in steps:
            verb = step["do"]
            servo |= verb == "servo"
            if step.get("only", "connected" if connected else "here") != ("connected" if connected else "here"):
                continue
            if place not in result:
                row.fail(f"step {place} ({verb}) is missing")
                continue
            status, given = result[place]
            wanted = reference.get(place) or reference_connected.get(place)
            if not wanted:
                row.fail(f"step {place} ({verb}) is missing in C++")
                continue
            wanted_status, wanted = wanted
            if status != wanted_status:
                row.fail(f"step {place} ({verb}) ends with {status}, not {wanted_status}")
                continue
            row.add(place, verb, given, wanted, 0 if verb in EXACT else 1e-9 if connected and servo else 1e-12)
    print(f"{len(steps)} steps, {sum('status' in s for _, s in steps)} of them errors; {stated.values} values are as stated")
    print(f"{'':18} {'values':>7} {'same bits':>10} {'largest difference':>19} {'with a servo over shm':>22}")
    for row in rows:
        over = f"{row.servo:22.2g}" if row.name.endswith(" connected") else f"{'-':>22}"
        print(f"{row.name:18} {row.values:7} {row.same:10} {row.largest:19.2g} {over}")
    failures = sum(row.failures for row in [stated, *rows])
    print(f"{failures} failures")
    sys.exit(failures > 0)


main()
