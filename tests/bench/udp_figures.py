"""udp_figures.py FOLDER: draws udp.png and udp.svg from the CSV files that bench_udp wrote there; tests/bench/udp runs it."""

import csv
import io
import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402
from PIL import Image  # noqa: E402

folder = pathlib.Path(sys.argv[1])
rows = list(csv.DictReader(open(folder / "udp.csv")))
places = list(csv.DictReader(open(folder / "udp_paths.csv")))
LEAST = 0.01  # mm: what swings less is drawn here
WAY = "10"  # ms, of the paths that are drawn
styles = {
    ("force", "off"): ("tab:red", "X", "plain force"),
    ("force", "on"): ("tab:orange", "v", "plain force, protected"),
    ("model", "off"): ("tab:blue", "o", "local model"),
    ("model", "on"): ("tab:green", "s", "local model, protected"),
}

figure, (swings, paths) = pyplot.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
for key, (colour, marker, label) in styles.items():
    own = [row for row in rows if (row["render"], row["protected"]) == key]
    swings.plot([float(row["way_ms"]) for row in own], [max(LEAST, float(row["swing_mm"])) for row in own], color=colour,
                marker=marker, label=label)
    own = [row for row in places if (row["render"], row["protected"], row["way_ms"]) == (*key, WAY)]
    paths.plot([float(row["time_s"]) for row in own], [float(row["z_mm"]) for row in own], color=colour, linewidth=0.9, label=label)
swings.set_yscale("log")
swings.set_xlabel("delay of the link, ms each way")
swings.set_ylabel("swing of the hand, mm from end to end")
swings.set_title(f"A wall of 1 kN/m; below {LEAST} mm: it stands", fontsize=10)
swings.grid(alpha=0.3)
swings.legend(fontsize=8)
paths.axhline(0, color="black", linewidth=0.6)
paths.set_xlabel("s")
paths.set_ylabel("hand above the wall, mm")
paths.set_title(f"The hand touches the wall, {WAY} ms each way", fontsize=10)
paths.grid(alpha=0.3)
figure.savefig(folder / "udp.svg")
drawn = io.BytesIO()
figure.savefig(drawn, dpi=80)
Image.open(drawn).convert("RGB").quantize(32, Image.Quantize.MAXCOVERAGE).save(folder / "udp.png", optimize=True)
print(f"{len(rows)} rows: {folder}/udp.csv, udp_paths.csv, udp.svg, udp.png")
