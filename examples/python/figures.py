"""Draws two figures of the paper from the library itself, into the folder that is given (here by default):
figure_3.png: force fields of each primitive with each profile, attractive and repulsive;
figure_4.png: the profiles, f(d), with their limits. It needs matplotlib, with which Pillow comes."""

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



def save(figure, name, dpi):
    """With few colours, so that the file is small."""
    figure.tight_layout()
    drawn = io.BytesIO()
    figure.savefig(drawn, dpi=dpi)
    Image.open(drawn).convert("RGB").quantize(16, Image.Quantize.MAXCOVERAGE).save(folder / name, optimize=True)


# Distances up to 60 mm, forces up to a limit of 4 N.
profiles = {
    "constant": lambda sense: fs.Constant(3, limit=4, sense=sense),
    "linear increasing": lambda sense: fs.LinearIncreasing(100, 0.5, limit=4, sense=sense),
    "linear decreasing": lambda sense: fs.LinearDecreasing(-100, 5, limit=4, sense=sense),
    "gaussian": lambda sense: fs.Gaussian(5, 0.02, limit=4, sense=sense),
    "quadratic": lambda sense: fs.Quadratic(2000, 0.2, limit=4, sense=sense),
    "inverse": lambda sense: fs.Inverse(0.05, limit=4, sense=sense),
    "custom": lambda sense: fs.Custom("3*exp(-d/0.03)*(1+cos(200*d))/2", limit=2.5, sense=sense),
}


def tube(corners):
    """The sides of a prism along z over a polygon in the plane z = 0: what the plane shows is the polygon."""
    n = len(corners)
    points = np.vstack([np.column_stack([corners, np.full(n, z)]) for z in (-1, 1)])
    i, j = np.arange(n), np.roll(np.arange(n), -1)
    return points, np.vstack([np.column_stack([i, j, n + j]), np.column_stack([i, n + j, n + i])])


path = np.array([[-0.04, -0.02], [-0.01, 0.02], [0.015, -0.015], [0.04, 0.02]])
triangle = 0.035 * np.array([[np.cos(a), np.sin(a)] for a in np.pi * (0.5 + 2 / 3 * np.arange(3))])
primitives = {
    "point": (lambda profile: fs.Point(front=profile), np.zeros((1, 2))),
    "polyline": (lambda profile: fs.Polyline(np.column_stack([path, np.zeros(4)]), front=profile), path),
    "plane": (
        lambda profile: fs.Plane(normal=(0, 1, 0), front=profile, back=profile),
        np.array([[-0.06, 0], [0.06, 0]]),
    ),
    "mesh": (
        lambda profile: fs.Mesh(*tube(triangle), front=profile, back=profile),
        np.vstack([triangle, triangle[:1]]),
    ),
}

rows = [(name, sense) for name in primitives for sense in ("attractive", "repulsive")]
side = np.linspace(-0.055, 0.055, 14)
x, y = (grid.ravel() for grid in np.meshgrid(side, side))
places = np.column_stack([x, y, np.zeros_like(x)])
figure, axes = pyplot.subplots(len(rows), len(profiles), figsize=(2 * len(profiles), 2 * len(rows)), squeeze=False)
scene = fs.Scene()
for row, (primitive, sense) in zip(axes, rows):
    make, outline = primitives[primitive]
    for panel, (kind, profile) in zip(row, profiles.items()):
        scene["shown"] = make(profile(sense))
        forces = scene.evaluate(places)
        panel.plot(*(1e3 * outline.T), "o-" if len(outline) == 1 else "-", color="tab:red", markersize=4)
        panel.quiver(1e3 * x, 1e3 * y, forces[:, 0], forces[:, 1], scale=45, width=0.008)
        panel.set(xticks=[], yticks=[], aspect="equal", xlim=(-60, 60), ylim=(-60, 60))
        if row[0] is axes[0, 0]:
            panel.set_title(kind)
    row[0].set_ylabel(f"{primitive},\n{sense}")
save(figure, "figure_3.png", dpi=65)

d = np.linspace(0, 0.06, 601)
figure, axes = pyplot.subplots(1, len(profiles), figsize=(2.4 * len(profiles), 2.4), sharey=True)
for panel, (kind, profile) in zip(axes, profiles.items()):
    limited, free = profile("attractive"), profile("attractive")
    free.limit = 1e6
    panel.plot(1e3 * d, fs.intensity(free, d), ":", color="tab:gray")
    panel.plot(1e3 * d, fs.intensity(limited, d), color="tab:blue")
    panel.axhline(limited.limit, linestyle="--", color="tab:red", linewidth=0.8)
    panel.set(title=kind, xlabel="d, mm", ylim=(0, 6))
axes[0].set_ylabel("f(d), N")
save(figure, "figure_4.png", dpi=60)
print(
    f"{len(rows) * len(profiles)} force fields: {folder / 'figure_3.png'}; "
    f"{len(profiles)} profiles: {folder / 'figure_4.png'}"
)
