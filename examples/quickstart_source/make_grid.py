#!/usr/bin/env python3
"""Makes jacksboro_fault.asc from matplotlib's sample data:

    ./make_grid.py jacksboro_fault_dem.npz > jacksboro_fault.asc

The input is matplotlib/mpl-data/sample_data/jacksboro_fault_dem.npz of any matplotlib 3 package (a zip of .npy arrays).
It holds heights in metres, the northern row first; in it the names ymin and ymax are swapped.
"""
import array
import io
import re
import struct
import sys
import zipfile


def read_npy(archive, name):
    """The values of one array and its shape; numpy is not needed for that."""
    data = io.BytesIO(archive.read(name + ".npy"))
    assert data.read(8) == b"\x93NUMPY\x01\x00", name
    header = data.read(struct.unpack("<H", data.read(2))[0]).decode()
    kind = {"<i2": "h", "<f8": "d"}[re.search(r"'descr': '([^']*)'", header)[1]]
    assert "'fortran_order': False" in header
    shape = [int(n) for n in re.findall(r"\d+", re.search(r"'shape': \(([^)]*)\)", header)[1])]
    values = array.array(kind, data.read())
    if sys.byteorder == "big":
        values.byteswap()
    return values, shape


def main():
    with zipfile.ZipFile(sys.argv[1]) as archive:
        heights, (rows, columns) = read_npy(archive, "elevation")
        west, south, step = (read_npy(archive, name)[0][0] for name in ("xmin", "ymax", "dx"))
    print(f"ncols {columns}\nnrows {rows}\nxllcorner {west:.6f}\nyllcorner {south:.6f}\ncellsize {step:.10f}")
    for row in range(rows):
        print(*heights[row * columns:(row + 1) * columns])


if __name__ == "__main__":
    main()
