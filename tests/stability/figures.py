"""figures.py FOLDER: draws the pictures from the CSV files there; tests/stability/charts runs it."""

import csv
import io
import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
from matplotlib import colors, pyplot  # noqa: E402
from PIL import Image  # noqa: E402

folder = pathlib.Path(sys.argv[1])
RAW, CURED = "tab:red", "tab:blue"


def read(name):
    """The columns of a CSV file, by their names; numbers where they are numbers."""
    rows = list(csv.DictReader(open(folder / f"{name}.csv")))

    def number(text):
        try:
            return float(text)
        except ValueError:
            return text

    return {key: [number(row[key]) for row in rows] for key in rows[0]}


def save(figure, name):
    figure.savefig(folder / f"{name}.svg", metadata={"Date": None})
    image = io.BytesIO()
    figure.savefig(image, dpi=100)
    Image.open(image).convert("RGB").quantize(64).save(folder / f"{name}.png", optimize=True)
    pyplot.close(figure)
    print(folder / f"{name}.png")


def draw_wall():
    """The wall of the ways' task, felt in two ways."""
    figure, (place, force) = pyplot.subplots(2, 1, sharex=True, figsize=(8, 4.5), constrained_layout=True)
    for name, colour, label in (
        ("way_application_held", RAW, "the application computes the force, 25 times a second"),
        ("way_servo_500", CURED, "the servo evaluates the same object, 500 times a second"),
    ):
        way = read(name)
        shown = [i for i, t in enumerate(way["time s"]) if t <= 5]
        times = [way["time s"][i] for i in shown]
        place.plot(times, [way["position mm"][i] for i in shown], colour, linewidth=1, label=label)
        force.plot(times, [way["force N"][i] for i in shown], colour, linewidth=1)
    place.axhspan(-70, 0, color="0.9")
    place.set_ylim(-70, 100)
    place.set_ylabel("hand, mm; grey: the wall")
    place.legend(loc="upper right", fontsize=8)
    force.set_ylabel("force, N")
    force.set_xlabel("time, s")
    figure.suptitle("A wall of 1000 N/m on which the nominal hand presses with 4 N", fontsize=10)
    save(figure, "wall")


def draw_ways():
    """The task's height over time, a panel for each way."""
    table = read("ways")
    ids = [
        ("application_held", "application_interpolated", "application_extrapolated"),
        ("servo_1000", "servo_500", "force_2ms"),
        ("force_5ms", "force_10ms", "force_20ms"),
        ("model_10ms", "model_10ms_25Hz", "model_20ms"),
        ("passivity_5ms", "passivity_10ms", "capped_10ms"),
    ]
    names = {
        "application_held": "application at 25 Hz, held", "application_interpolated": "application at 25 Hz, interpolated",
        "application_extrapolated": "application at 25 Hz, extrapolated", "servo_1000": "servo of the library, 1 kHz",
        "servo_500": "servo of the library, 500 Hz", "force_2ms": "force over a link, 2 ms",
        "force_5ms": "force over a link, 5 ms", "force_10ms": "force over a link, 10 ms",
        "force_20ms": "force over a link, 20 ms", "model_10ms": "local model over a link, 10 ms, 100 Hz",
        "model_10ms_25Hz": "local model over a link, 10 ms, 25 Hz", "model_20ms": "local model over a link, 20 ms, 100 Hz",
        "passivity_5ms": "force over a link with passivity controller, 5 ms",
        "passivity_10ms": "force over a link with passivity controller, 10 ms",
        "capped_10ms": "force over a link, slopes capped, 10 ms",
    }
    figure, panels = pyplot.subplots(len(ids), 3, sharex=True, sharey=True, figsize=(11, 11), constrained_layout=True)
    for row, of_row in zip(panels, ids):
        for panel, identity in zip(row, of_row):
            way = read(f"way_{identity}")
            i = table["way"].index(names[identity])
            steady = table["oscillation mm"][i] < 0.3
            panel.plot(way["time s"], way["position mm"], CURED if steady else RAW, linewidth=0.8)
            panel.axhline(0, color="0.6", linewidth=0.6)
            panel.axhline(150, color="0.6", linewidth=0.6)
            panel.set_ylim(-80, 200)
            panel.set_title(
                f"{names[identity]}\nerror {table['rms error N'][i]:.2f} N rms, energy {table['energy J'][i]:+.2f} J,"
                f" oscillation {table['oscillation mm'][i]:.2f} mm",
                fontsize=7.5,
            )
    for panel in panels[-1]:
        panel.set_xlabel("time, s")
    for row in panels:
        row[0].set_ylabel("hand, mm")
    figure.suptitle("The same task in several ways; blue: it keeps to its way, red: it oscillates by more than 0.3 mm", fontsize=10)
    save(figure, "ways")


def draw_failures():
    """Each failure beside its cure, on the same axes."""
    rows = [
        ("1_inverse_10_ms", "1: inverse, gain 0.02 N m, delay 10 ms", None),
        ("2_constant_10_ms", "2: constant attraction of 3 N, delay 10 ms", None),
        ("3_gaussian", "3: gaussian attraction of 5 N", None),
        ("4_corner_5_ms", "4: corner that repels with 5 N, delay 5 ms (across it)", None),
        ("5_sheet", "5: sheet of 4 mm, pushed with 2.7 N", None),
        ("6_moving_wall", "6: wall that moves, poses at 25 Hz", (3, 4.5)),
        ("7_dead_client", "7: the client dies at 3 s", (2.5, 6)),
        ("8_velocity", "8: damping of 20 N s/m from a 20 um encoder", (2, 2.3)),
        ("9", "9: 40 N wanted at the edge of a DELTA, each motor clipped", None),
        ("10_overlapping_4", "10: four attractors of 2000 N/m, delay 2 ms", None),
        ("11_texture_2_ms", "11: ridges of +-0.1 mm, 1 mm apart, delay 2 ms (across them)", None),
        ("12_impact_2_ms", "12: impact of 200 N s/m, a handle that falls, delay 2 ms", None),
        ("13_stick_slip_2_ms", "13: stick and slip at 5000 N/m, delay 2 ms (along the surface)", None),
    ]
    figure, panels = pyplot.subplots(len(rows), 2, figsize=(9, 27), constrained_layout=True)
    for (raw, cured), (name, title, window) in zip(panels, rows):
        raw.set_title(title + (": raw" if name != "9" else ""), fontsize=8)
        cured.set_title("with the default options", fontsize=8)
        if name == "9":
            clipping = read("failure_9_clipping")
            for panel, key, colour in ((raw, "raw deg", RAW), (cured, "cured deg", CURED)):
                panel.hist(clipping[key], bins=range(0, 51, 2), color=colour)
                panel.set_xlabel("error of the direction, degrees", fontsize=8)
                panel.set_ylabel("cases", fontsize=8)
            continue
        data = read(f"failure_{name}")
        keys = list(data)
        shown = [i for i, t in enumerate(data[keys[0]]) if window is None or window[0] <= t <= window[1]]
        values = [data[key][i] for key in keys[1:] for i in shown]
        spread = max(values) - min(values) or 1
        for panel, key, colour in ((raw, keys[1], RAW), (cured, keys[2], CURED)):
            panel.plot([data[keys[0]][i] for i in shown], [data[key][i] for i in shown], colour, linewidth=0.8)
            panel.set_ylim(min(values) - 0.05 * spread, max(values) + 0.05 * spread)
            panel.set_ylabel(key.split(" ", 1)[1].replace(" ", ", "), fontsize=8)
            panel.set_xlabel("time, s", fontsize=8)
    save(figure, "failures")


def draw_map():
    """Delay and stiffness: where a pushed wall oscillates, and the exact boundaries."""
    simulated, boundary = read("map_simulated"), read("map_boundary")
    delays = sorted(set(simulated["delay ms"]))
    stiffnesses = sorted(set(simulated["stiffness N/m"]))
    swing = [[float("nan")] * len(delays) for _ in stiffnesses]
    for delay, stiffness, value in zip(*simulated.values()):
        if value > 0:
            swing[stiffnesses.index(stiffness)][delays.index(delay)] = value
    figure, panel = pyplot.subplots(figsize=(9, 6), constrained_layout=True)
    mesh = panel.pcolormesh(delays, stiffnesses, swing, norm=colors.LogNorm(0.1, 100), cmap="OrRd", shading="nearest")
    figure.colorbar(mesh, label="simulated: oscillation of a pushed wall, mm peak to peak; white: none")
    for key, style in (
        ("nominal hand", "k-"), ("firm hand", "k--"), ("light hand", "k-."), ("released", "k:"),
        ("released with local damping", "b:"), ("bound", "b-"),
    ):
        label = {"bound": "bound of the slopes (the servo's default)"}.get(key, f"exact boundary, {key}")
        panel.plot(boundary["delay ms"], boundary[key], style, linewidth=2 if key == "bound" else 1.1, label=label)
    for delay, text, up in (
        (0, "servo", 7), (5, "link, 5 ms", 7), (10, "10 ms", 7), (20, "20 ms", 7), (21.5, "application at 25 Hz", -12),
    ):
        panel.plot(delay, 1000, "o", color="black", markersize=5, clip_on=False)
        panel.annotate(text, (delay, 1000), (5, up), textcoords="offset points", fontsize=8)
    panel.set_yscale("log")
    panel.set_xlim(0, 50)
    panel.set_ylim(50, 20000)
    panel.set_xlabel("delay, ms, beside the period of 1 ms")
    panel.set_ylabel("stiffness, N/m")
    panel.legend(fontsize=8, loc="upper right")
    save(figure, "map")


def draw_sensitivity():
    """How far the handle is from its boundary when it is not as assumed."""
    data, friction = read("sensitivity"), read("sensitivity_friction")
    whats = list(dict.fromkeys(data["what"]))
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(11, 4.8), constrained_layout=True)
    for n, (key, colour) in enumerate((("0 ms", "tab:blue"), ("2 ms", "tab:green"), ("10 ms", "tab:orange"))):
        for i, what in enumerate(whats):
            values = {f: v for w, f, v in zip(data["what"], data["factor"], data[key]) if w == what}
            y = len(whats) - i - 0.22 * (n - 1)
            left.plot([values[0.5], values[1.0], values[2.0]], [y] * 3, "-", color=colour, linewidth=1)
            for factor, marker in ((0.5, "v"), (1.0, "o"), (2.0, "^")):
                left.plot(values[factor], y, marker, color=colour, markersize=5,
                          label=f"delay {key}" if i == 0 and factor == 1.0 else None)
    left.axvline(1, color="red", linewidth=1)
    left.set_yticks(range(len(whats), 0, -1), whats)
    left.set_xlabel("exact boundary / bound; left of 1: unstable")
    left.set_xscale("log")
    ticks = (0.5, 1, 2, 4, 8)
    left.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    left.minorticks_off()
    left.set_title("down: half of the assumed value, up: twice", fontsize=9)
    left.legend(fontsize=8)
    for stiffness in sorted(set(friction["stiffness N/m"])):
        points = [(f, d) for f, s, d in zip(*friction.values()) if s == stiffness]
        right.plot(*zip(*points), "o-", label=f"{stiffness:.0f} N/m")
    right.set_xlabel("Coulomb friction of the device, N")
    right.set_ylabel("delay at which a pushed wall begins to oscillate, ms")
    right.set_yscale("log")
    right.set_yticks((1, 2, 5, 10, 20, 50), ("1", "2", "5", "10", "20", "50"))
    right.legend(fontsize=8)
    save(figure, "sensitivity")


draw_wall()
draw_ways()
draw_failures()
draw_map()
draw_sensitivity()
