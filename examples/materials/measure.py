"""Reads the table of a run, and works out spectra. It needs nothing but Python."""

import cmath
import csv
import json
import math

RATE = 1000  # Hz, of the servo
MATERIALS = ("rubber", "wood", "ice", "sandpaper", "corduroy", "metal")
NUMBERS = ("x", "y", "z", "tangential", "normal", "sent x", "sent y", "sent z")


def read_table(path):
    """The rows in order, as dictionaries."""
    with open(path, newline="") as file:
        return [{key: value if key in ("material", "action") else float(value) for key, value in row.items()}
                for row in csv.DictReader(file)]


def read_scene(path):
    """For each material its object and its surface, as they are in the file."""
    with open(path) as file:
        scene = json.load(file)
    return {item["name"]: (item, scene["surfaces"][item["surface"]]) for item in scene["objects"]}


def part(rows, material, action):
    """The columns of what was done to a wall; time: s, since it began."""
    chosen = [row for row in rows if row["material"] == material and row["action"] == action]
    columns = {name: [row[name] for row in chosen] for name in NUMBERS}
    columns["time"] = [i / RATE for i in range(len(chosen))]
    return columns


def sliding(stroke):
    """The forces (N) of a stroke in its last 0.38 s, when the hand slides steadily: tangential, normal."""
    return stroke["tangential"][-380:], stroke["normal"][-380:]


def ring(tap, stiffness):
    """N, from the contact on: the impact. It is what the force has beside that of the spring of the contact (N/m)."""
    begin = next((i for i, z in enumerate(tap["z"]) if z < 0), len(tap["z"]))
    return [n - stiffness * max(0, -z / 1000) for n, z in zip(tap["normal"][begin:], tap["z"][begin:])]


def transform(values, frequency):
    """Of the values times their window, divided by their number."""
    turn = -2j * math.pi * frequency / RATE
    return sum(value * cmath.exp(turn * i) for i, value in enumerate(values)) / len(values)


def spectrum(forces, highest=200):
    """N, the amplitudes at 0, 1, 2.. Hz of what varies in the forces (with a Hann window, of which a sine keeps its height)."""
    mean, count = sum(forces) / len(forces), len(forces)
    windowed = [2 * (f - mean) * (1 - math.cos(2 * math.pi * (i + 0.5) / count)) / 2 for i, f in enumerate(forces)]
    return [2 * abs(transform(windowed, frequency)) for frequency in range(highest + 1)]


def ring_spectrum(forces, highest=200):
    """N s, at 0, 1, 2.. Hz: a force that ends by itself needs no window."""
    return [abs(transform(forces, frequency)) * len(forces) / RATE for frequency in range(highest + 1)]


def peak(amplitudes):
    """Hz, where the amplitude is the largest."""
    return max(range(len(amplitudes)), key=amplitudes.__getitem__)
