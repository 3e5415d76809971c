"""Draws a flight of the quickstart: the terrain, the path of the hand over it, and the force of each object over time.

picture.py TERRAIN.asc FORCES.csv PICTURE.png"""

import sys

import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402

terrain, forces, picture = sys.argv[1:]
with open(terrain) as file:
    head = {key: float(value) for key, value in (next(file).split() for _ in range(5))}
    heights = np.loadtxt(file)  # m, the northern row first
step_y = head["cellsize"] * 111.2  # km
step_x = step_y * np.cos(np.radians(head["yllcorner"] + head["nrows"] * head["cellsize"] / 2))
width, depth = step_x * (heights.shape[1] - 1), step_y * (heights.shape[0] - 1)

with open(forces) as file:
    names = file.readline().strip().split(",")[4:]
    rows = np.loadtxt(file, delimiter=",", ndmin=2)
if len(rows) < 2:
    sys.exit("the flight was too short for a picture")
time, x, y, newtons = rows[:, 0], rows[:, 1] / 1000, rows[:, 2] / 1000, rows[:, 4:]

figure, (over, chart) = pyplot.subplots(1, 2, figsize=(14, 6), width_ratios=(1, 1.3))
extent = (-width / 2, width / 2, -depth / 2, depth / 2)
shown = over.imshow(heights, cmap="gist_earth", extent=extent, alpha=0.7)
figure.colorbar(shown, ax=over, label="height, m")
over.plot(x, y, color="black", linewidth=0.8)
for i, name in enumerate(names):  # where on its path the hand feels this object most of all
    here = (newtons[:, i] > 0.05) & (newtons.argmax(axis=1) == i)
    over.plot(x[here], y[here], ".", color=f"C{i}", markersize=5)
    chart.plot(time, newtons[:, i], color=f"C{i}", label=name)
over.set(title="path of the hand, in the colour of what it feels", xlabel="east, km", ylabel="north, km")
over.set(xlim=extent[:2], ylim=extent[2:])
chart.set(title="force of each object", xlabel="time, s", ylabel="force, N", xlim=(time[0], time[-1]))
chart.legend()
figure.tight_layout()
figure.savefig(picture, dpi=90)
