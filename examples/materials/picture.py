"""Draws a run: for each material its relief, the forces and the spectrum of the stroke, and those of the tap.

picture.py SCENE.json TABLE.csv PICTURE.png"""

import sys

import matplotlib
import numpy as np

import measure

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402

scene_file, table, picture = sys.argv[1:]
scene, rows = measure.read_scene(scene_file), measure.read_table(table)


def relief(surface, width=16, height=9):
    """The heights (mm) of so many mm of it, ten to a mm."""
    texture = surface.get("texture")
    if not texture:
        return np.zeros((10 * height, 10 * width))
    heights = 1000 * np.array(texture["heights"])
    across = (np.arange(10 * width) / 10000 / texture["column_width"]).astype(int) % heights.shape[1]
    along = (np.arange(10 * height) / 10000 / texture.get("row_width", 1)).astype(int) % heights.shape[0]
    return heights[np.ix_(along, across)]


figure, axes = pyplot.subplots(len(measure.MATERIALS), 5, figsize=(16, 13), width_ratios=(1, 1.5, 1.5, 1.5, 1.5), sharex="col")
for material, (patch, stroke, rough, tap, rings) in zip(measure.MATERIALS, axes):
    item, surface = scene[material]
    patch.imshow(relief(surface), cmap="gray", vmin=-0.25, vmax=0.05, extent=(0, 16, 0, 9), interpolation="bicubic")
    patch.set_ylabel(material, fontsize="x-large")
    patch.set(yticks=[], xlim=(0, 16))

    felt = measure.part(rows, material, "stroke")
    stroke.plot(felt["time"], felt["normal"], color="C7", linewidth=0.9, label="pushes away")
    stroke.plot(felt["time"], felt["tangential"], color="C0", linewidth=0.9, label="holds back")
    stroke.set(ylim=(0, 1.8), xlim=(0, 0.5))

    forces, _ = measure.sliding(felt)
    rough.semilogy(measure.spectrum(forces), color="C0", linewidth=0.9)
    rough.set(ylim=(2e-5, 1), xlim=(5, 200))

    felt = measure.part(rows, material, "tap")
    tap.plot(felt["time"], felt["normal"], color="C7", linewidth=0.9)
    tap.set(ylim=(0, 5.2), xlim=(0.08, 0.3))

    rings.set(ylim=(0, 11), xlim=(0, 200))
    impact = surface.get("impact")
    if impact:
        ring = measure.ring(felt, item["contact"]["stiffness"])
        rings.plot(1000 * np.array(measure.ring_spectrum(ring)), color="C3", linewidth=0.9)
    rings.text(5, 10.6, f"set to {impact['frequency']} Hz" if impact else "no impact", va="top")

titles = ("black: 0.2 mm deep", "stroke: forces, N", "what holds back: spectrum, N", "tap: force, N",
          "its impact: spectrum, mN s")
for axis, title in zip(axes[0], titles):
    axis.set_title(title)
for axis, label in zip(axes[-1], ("mm", "s", "Hz", "s", "Hz")):
    axis.set_xlabel(label)
axes[0, 1].legend(loc="upper right", fontsize="small")
figure.tight_layout()
figure.savefig(picture, dpi=75)
