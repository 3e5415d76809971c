"""A picture becomes a relief: white is the surface, black lies 1 mm deeper. The hand pushes 3 mm deep and goes across a dent."""

import pathlib
import tempfile

import numpy as np
from PIL import Image
from recipe import finish, rounded

import forceserver as fs


def draw(path):
    """A dark spot on white, 6 pixels right of the middle and 5 above it."""
    column, row = np.meshgrid(np.arange(41), np.arange(31))
    distance = np.hypot(column - 26, row - 10)
    Image.fromarray(np.rint(255 * (1 - np.exp(-((distance / 5) ** 2)))).astype(np.uint8)).save(path)


def heights_of(path, depth):
    """The heights of a picture with 8 or 16 bits of grey or in colour, m. Its lowest row comes first, as y goes upwards in it."""
    with Image.open(path) as picture:
        is_16_bit = picture.mode.startswith("I")
        grey = np.asarray(picture) / 65535 if is_16_bit else np.asarray(picture.convert("L")) / 255
    return depth * (grey[::-1] - 1)


with tempfile.TemporaryDirectory() as folder:
    path = pathlib.Path(folder) / "dent.png"
    draw(path)
    heights = heights_of(path, 1e-3)
rows, columns = heights.shape
width = 1e-3  # m, of a pixel
scene = fs.Scene()
scene["relief"] = fs.Plane(
    contact=fs.Contact(keep="front", stiffness=500, limit=5),
    surface=fs.surface(heights=heights, width=width, first=(-width * (columns - 1) / 2, -width * (rows - 1) / 2)),
)
tool = fs.Tool(scene)
state, felt = fs.State(), fs.Response()
for x, y, z in ((-14, 5, 1), (-14, 5, -3), (1, 5, -3), (6, 5, -3), (11, 5, -3), (6, 0, -3), (6, -5, -3)):  # mm
    state.pose.position = (1e-3 * x, 1e-3 * y, 1e-3 * z)
    tool.evaluate(state, out=felt)
    where = "above" if z > 0 else "on the relief"
    force = ", ".join(f"{rounded(value):5.2f}" for value in felt.wrench.force)
    print(f"{where:26} ({x:5.1f}, {y:5.1f}, {z:5.1f}) mm   ({force}) N")
finish(scene)
