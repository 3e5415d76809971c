"""chart_figures.py CSV FOLDER: draws chart.png and chart.svg from what bench_chart printed; tests/bench/chart runs it."""

import csv
import io
import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402
from PIL import Image  # noqa: E402

rows = list(csv.DictReader(open(sys.argv[1])))
folder = pathlib.Path(sys.argv[2])
meshes = list(dict.fromkeys(row["mesh"] for row in rows))
styles = {
    "ours": ("tab:red", "o"),
    "accuracy": ("tab:pink", "*"),
    "other searches": ("tab:blue", "s"),
    "all triangles": ("black", "X"),
    "decimated": ("tab:orange", "v"),
    "grid of distances": ("tab:green", "^"),
    "grid of forces": ("tab:purple", "D"),
    "at UTM": ("tab:brown", "P"),
}
LEAST = 1e-9  # N: what errs less is drawn here


def short(row):
    """The label of a point: what its kind does not say."""
    name = row["method"]
    for word in ("decimated to ", "distances ", "forces ", ", warm radius"):
        name = name.replace(word, "")
    return name


def error(row):
    """The larger of the two laws' errors that 99 % of the places keep below, N."""
    return max(float(row["gaussian_p99_N"]), float(row["wall_p99_N"]), LEAST)


def place(panel, row, cost, offset, colour):
    panel.annotate(short(row), (float(row[cost]), error(row)), offset, textcoords="offset points", fontsize=6, color=colour)


def draw(panel, shown, cost):
    """Methods as points, and a line through those that no other beats in both cost and error."""
    points = sorted((float(r[cost]), error(r)) for r in shown if float(r[cost]) > 0 and r["kind"] != "at UTM")
    front, least = [], float("inf")
    for x, y in points:
        if y < least:
            front.append((x, y))
            least = y
    panel.step(*zip(*front), where="post", color="black", linewidth=1, zorder=1)
    for kind, (colour, marker) in styles.items():
        of_kind = [row for row in shown if row["kind"] == kind and float(row[cost]) > 0]
        panel.scatter([float(r[cost]) for r in of_kind], [error(r) for r in of_kind], c=colour, marker=marker, s=26, label=kind)
        for row in of_kind:
            if error(row) > 10 * LEAST or kind == "all triangles":
                place(panel, row, cost, (4, 3), colour)
    # The labels of the exact ones stand above each other, in the order of the cost.
    exact = [row for row in shown if error(row) <= 10 * LEAST and row["kind"] != "all triangles" and float(row[cost]) > 0]
    for k, row in enumerate(sorted(exact, key=lambda row: float(row[cost]))):
        place(panel, row, cost, (6, 8 + 9 * k), styles[row["kind"]][0])
    panel.set(xscale="log", yscale="log", ylim=(LEAST / 4, 60))
    panel.grid(True, which="major", linewidth=0.3)


figure, axes = pyplot.subplots(2, len(meshes), figsize=(4.3 * len(meshes), 7.4), sharey=True)
for column, mesh in zip(axes.T, meshes):
    of_mesh = [row for row in rows if row["mesh"] == mesh and row["way"] == "sliding"]
    draw(column[0], of_mesh, "median_ns")
    draw(column[1], of_mesh, "bytes")
    column[0].set(title=f"{mesh}, {int(of_mesh[0]['triangles']):,} triangles", xlabel="ns a query, median")
    column[1].set_xlabel("bytes beside the mesh")
for row in axes:
    row[0].set_ylabel("error of the force (vector), 99 % below, N")
axes[1, 0].legend(fontsize=6, loc="lower left", bbox_to_anchor=(0, 0.2))
figure.tight_layout()
figure.savefig(folder / "chart.svg")
drawn = io.BytesIO()
figure.savefig(drawn, dpi=80)
Image.open(drawn).convert("RGB").quantize(16, Image.Quantize.MAXCOVERAGE).save(folder / "chart.png", optimize=True)
print(f"{len(rows)} rows: {folder}/chart.csv, chart.svg, chart.png")
