"""Lists of structs as flat columns, for tables."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["table"]

AXES = {(3,): "x y z", (4,): "w x y z", (3, 3): "xx xy xz yx yy yz zx zy zz"}


def table(rows: Any) -> dict[str, NDArray[Any]]:
    """The columns of a list of structs, by name and without nesting: what pandas.DataFrame and its like take.

        frame = pandas.DataFrame(fs.table(scene.get_record(0)))
        frame["tick.state.pose.position.x"]

    rows: a list that a scene gives, such as scene.get_reports(), an array of structs, or one struct. Each column is an
    array with an entry for each row; text is str. What is reserved is left out.
    """
    array = np.asarray([np.asarray(row) for row in rows] if isinstance(rows, (list, tuple)) else rows)
    if array.dtype.names is None:
        raise TypeError(f"rows must be an array of structs, such as scene.get_reports(), not {type(rows).__name__}")
    return dict(_flat("", np.atleast_1d(array).view(np.ndarray)))


def _flat(path: str, column: NDArray[Any]) -> Iterator[tuple[str, NDArray[Any]]]:
    sides = column.shape[1:]
    if column.dtype.names is not None:
        for name in column.dtype.names:
            if not name.startswith(("reserved", "struct_size")):
                yield from _flat(f"{path}.{name}" if path else name, column[name])
    elif sides in AXES:
        parts = AXES[sides].split()
        yield from zip((f"{path}.{part}" for part in parts), column.reshape(len(column), len(parts)).T, strict=True)
    elif sides:
        for i in range(sides[0]):
            yield from _flat(f"{path}.{i}", column[:, i])
    else:
        yield path, np.char.decode(column, "utf-8", "surrogateescape") if column.dtype.kind == "S" else column
