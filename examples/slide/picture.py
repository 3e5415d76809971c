"""Draws a run of the slide: the arm's world from the side, and over time the slide and the forces.

picture.py TABLE.csv PICTURE.png"""

import sys

import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402

table, picture = sys.argv[1:]
rows = np.genfromtxt(table, delimiter=",", skip_header=1)
time, held, slide, tip = rows[:, 0], rows[:, 1] > 0, 1000 * rows[:, 2:5], rows[:, 5:8]
ground, too_high, forces = rows[:, 8], rows[:, 9], rows[:, 10:12]
size = np.linalg.norm(slide, axis=1)  # mm

figure, axes = pyplot.subplot_mosaic([["side", "slide"], ["side", "forces"]], figsize=(14, 6), width_ratios=(1, 1.6))
side = axes["side"]
angle = np.radians(np.linspace(-60, 60, 61))  # of the envelope in arm.cpp
radius, angle = np.repeat([1.2, 0.4, 1.2], [61, 61, 1]), np.concatenate([angle, angle[::-1], angle[:1]])
side.plot(radius * np.cos(angle), radius * np.sin(angle), color="C1", label="what the arm can reach")
by_x = np.argsort(tip[:, 0])
side.plot(tip[by_x, 0], ground[by_x], color="C2", label="the ground, as it should be")
side.plot(tip[:, 0], tip[:, 2], color="black", linewidth=0.8, label="path of the tip")
felt = np.isfinite(too_high)
for when, colour, label in ((size < 20, "C0", "without slide"), (size >= 20, "C3", "with slide")):
    here = felt & when
    side.plot(tip[here, 0], (ground + too_high)[here], "o", color=colour, markersize=7, label=f"the ground is felt, {label}")
side.set(title="the arm's world from the side", xlabel="forward, m", ylabel="up, m", aspect="equal")
side.set(xlim=(0, 1.6), ylim=(-1.15, 1.85))
side.legend(fontsize="small", loc="upper left")

for i, axis in enumerate("xyz"):
    axes["slide"].plot(time, slide[:, i], color=f"C{i}", label=axis)
axes["slide"].set(title="how far the terrain's world has slid in the arm's world", ylabel="slide, mm")
axes["forces"].plot(time, forces[:, 0], color="C2", label="ground")
axes["forces"].plot(time, forces[:, 1], color="C1", label="envelope")
axes["forces"].set(title="force on the hand", xlabel="time, s", ylabel="force, N")
for name in ("slide", "forces"):
    low, high = axes[name].get_ylim()
    axes[name].fill_between(time, low, high, where=held, color="0.85", label="the terrain's clutch is held")
    axes[name].set(xlim=(time[0], time[-1]), ylim=(low, high))
    axes[name].legend(fontsize="small", loc="upper left", bbox_to_anchor=(0.27 if name == "forces" else 0, 1))
figure.tight_layout()
figure.savefig(picture, dpi=90)
