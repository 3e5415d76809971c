"""Draws every kind of profile: the force over the distance, each with three settings, as the library computes it.

profiles.py FOLDER      writes profiles.png and profiles.csv (m, N) there. It needs matplotlib, with which Pillow comes.
"""

import io
import pathlib
import sys

import matplotlib
import numpy as np

import forceserver as fs

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402
from PIL import Image  # noqa: E402

folder = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else ".")
LIMIT = 4  # N
# Of each kind its formula, and three settings: what is told of them, and the profile.
kinds = {
    "constant": (
        "gain",
        {f"gain {gain} N": fs.Constant(gain, limit=LIMIT) for gain in (1, 2, 3)},
    ),
    "linear increasing": (
        "gain d + offset",
        {f"gain {gain} N/m": fs.LinearIncreasing(gain, limit=LIMIT) for gain in (50, 100, 200)},
    ),
    "linear decreasing": (
        "gain d + offset",
        {f"offset 3 N, gain {gain} N/m": fs.LinearDecreasing(gain, 3, limit=LIMIT) for gain in (-50, -100, -200)},
    ),
    "gaussian": (
        "gain exp(-(d/width)²/2)",
        {f"gain 3 N, width {width} mm": fs.Gaussian(3, 1e-3 * width, limit=LIMIT) for width in (5, 10, 20)},
    ),
    "quadratic": (
        "gain d² + offset",
        {f"gain {gain} N/m²": fs.Quadratic(gain, limit=LIMIT) for gain in (1000, 2000, 5000)},
    ),
    "inverse": (
        "gain/d + offset",
        {f"gain {gain} N m": fs.Inverse(gain, limit=LIMIT) for gain in (0.01, 0.02, 0.05)},
    ),
    "custom": (
        "gain curve(d, t), such as\n2 exp(-d/0.03) (1 + cos 300 d)/2",
        {
            f"gain {gain}": fs.Custom("2*exp(-d/0.03)*(1 + cos(300*d))/2", limit=LIMIT, gain=gain)
            for gain in (0.5, 1, 2)
        },
    ),
}

distances = np.linspace(0, 0.06, 241)
columns = {"distance": distances}
figure, axes = pyplot.subplots(3, 3, figsize=(10.5, 9.6), sharey=True)
for panel, (kind, (formula, settings)) in zip(axes.flat, kinds.items()):
    for colour, (told, profile) in zip(("#9ecae1", "#4292c6", "#08306b"), settings.items()):
        columns[f"{kind}: {told}"] = force = fs.intensity(profile, distances)
        panel.plot(1e3 * distances, force, color=colour, linewidth=2, label=told)
    panel.axhline(LIMIT, linestyle="--", color="tab:red", linewidth=1)
    panel.set_title(f"{kind}: {formula}" if "\n" in formula else f"{kind}\n{formula}", fontsize=12)
    panel.legend(loc="upper right", fontsize=9)
    panel.set(xlim=(0, 60), ylim=(0, 6.6), xlabel="distance d, mm")
    panel.grid(alpha=0.3)
for row in axes:
    row[0].set_ylabel("force, N")
for panel in axes.flat[len(kinds):]:
    panel.axis("off")
axes.flat[7].text(0, 0.5, "Red: the limit, 4 N here.\nEvery profile has one.", fontsize=12, va="center")

figure.tight_layout()
drawn = io.BytesIO()
figure.savefig(drawn, dpi=80)
Image.open(drawn).convert("RGB").quantize(48, Image.Quantize.MAXCOVERAGE).save(folder / "profiles.png", optimize=True)
with (folder / "profiles.csv").open("w") as table:
    table.write(",".join(columns).replace(", ", " and ") + "\n")
    for row in zip(*columns.values()):
        table.write(",".join(f"{value:.6g}" for value in row) + "\n")
print(f"{len(columns) - 1} profiles of {len(kinds)} kinds in {folder}")
