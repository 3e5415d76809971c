"""The ground: a grid of heights, as the physics, the server and the picture have it. x: east, y: north, z: up; m."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

terrain_file = Path(__file__).parents[2] / "quickstart_source" / "jacksboro_fault.asc"

width = 60.0  # m, from west to east
relief = 2.0  # m, from its lowest to its highest place


class BadTerrain(Exception):
    """The file of heights cannot be used."""


def read_heights(path: Path) -> tuple[Array, float]:
    """The heights of an Esri ASCII grid in degrees, between 0 and 1, southern row first; and how many times as far it is from
    south to north as from west to east."""
    header: dict[str, float] = {}
    line = ""
    try:
        with path.open() as file:
            for line in file:
                words = line.split()
                if len(words) != 2 or not words[0].isidentifier():
                    break
                header[words[0].lower()] = float(words[1])
            values = [float(word) for text in (line, *file) for word in text.split()]
    except (OSError, ValueError) as failure:
        raise BadTerrain(f"{path}: {failure}") from None
    unusable = [name for name, value in header.items() if not math.isfinite(value) and name != "nodata_value"]
    if unusable:
        raise BadTerrain(f"{path}: {unusable[0]} is {header[unusable[0]]:g}")
    missing = {"ncols", "nrows", "yllcorner", "cellsize"} - header.keys()
    if missing:
        raise BadTerrain(f"{path} has no {', '.join(sorted(missing))} in its header")
    south, north = header["yllcorner"], header["yllcorner"] + header["nrows"] * header["cellsize"]
    if not (header["cellsize"] > 0 and south >= -85 and north <= 85):
        raise BadTerrain(f"{path} lies between the latitudes {south:g} and {north:g}; it must be in degrees, within 85")
    columns, rows = int(header["ncols"]), int(header["nrows"])
    if header["ncols"] != columns or header["nrows"] != rows:
        raise BadTerrain(f"{path}: ncols and nrows must be whole numbers")
    if min(rows, columns) < 2 or len(values) != rows * columns:
        raise BadTerrain(f"{path} has {len(values)} heights; {columns} columns and {rows} rows are told, at least 2 of each")
    heights = np.array(values).reshape(rows, columns)[::-1]
    unknown = ~np.isfinite(heights) | (heights == header.get("nodata_value", math.nan))
    if unknown.any():
        row, column = np.argwhere(unknown)[0]
        raise BadTerrain(f"{path}: the height in column {column}, row {rows - 1 - row} is not known")
    latitude = math.radians((south + north) / 2)
    spread = float(heights.max()) - float(heights.min())
    if not math.isfinite(spread):
        raise BadTerrain(f"{path}: the heights are too far apart")
    return (heights - heights.min()) / (spread if spread > 0 else 1), (rows - 1) / ((columns - 1) * math.cos(latitude))


class Ground:
    """The middle of the map is at the origin."""

    def __init__(self, path: Path = terrain_file) -> None:
        self.grid, slenderness = read_heights(path)  # [row from the south, column from the west]: 0 to 1
        self.half = np.array([width / 2, slenderness * width / 2])  # m, from the middle to the east and to the north

    def place_in_grid(self, x: float, y: float) -> tuple[int, int, float, float]:
        """The row and column of the cell, and how far the place is in it to the north and to the east, 0 to 1."""
        last = np.array(self.grid.shape[::-1]) - 1
        column, row = np.clip((np.array([x, y]) / self.half + 1) / 2, 0, 1) * last
        i, j = min(int(row), int(last[1]) - 1), min(int(column), int(last[0]) - 1)
        return i, j, float(row - i), float(column - j)

    def height(self, x: float, y: float) -> float:
        """Of the ground, m. Each cell is two triangles, parted by the line from its south-western to its north-eastern corner."""
        i, j, v, u = self.place_in_grid(x, y)
        a, b, c, d = self.grid[i, j], self.grid[i, j + 1], self.grid[i + 1, j], self.grid[i + 1, j + 1]
        return relief * float(a + u * (b - a) + v * (d - b) if u >= v else a + v * (c - a) + u * (d - c))

    def normal(self, x: float, y: float, spread: float) -> Array:
        """Of the plane through the ground around a place, pointing up. spread: m, to the heights that it goes through."""
        east = self.height(x + spread, y) - self.height(x - spread, y)
        north = self.height(x, y + spread) - self.height(x, y - spread)
        n = np.array([-east, -north, 2 * spread])
        return np.array(n / np.linalg.norm(n))

    def mesh(self, middle: Array | None = None, reach: float = math.inf) -> tuple[Array, NDArray[np.int32]]:
        """The ground as points and triangles, whose fronts are above. middle: x, y, only around it as far as `reach`, m."""
        at = np.zeros(2) if middle is None else middle[:2]
        axes = [np.linspace(-half, half, count) for half, count in zip(self.half, self.grid.shape[::-1], strict=True)]
        columns_of, rows_of = (np.flatnonzero(np.abs(axis - place) <= reach) for axis, place in zip(axes, at, strict=True))
        x, y = np.meshgrid(axes[0][columns_of], axes[1][rows_of])
        points = np.stack([x, y, relief * self.grid[np.ix_(rows_of, columns_of)]], axis=-1).reshape(-1, 3)
        rows, columns = x.shape
        a = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
        b, c, d = a + 1, a + columns, a + columns + 1
        return points, np.stack([a, b, d, a, d, c], axis=1).reshape(-1, 3).astype(np.int32)
