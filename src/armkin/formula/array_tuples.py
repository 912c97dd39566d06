"""Arrays with a row for each target or candidate: named tuples of these, selected, stacked, replaced."""

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

Columns = TypeVar("Columns")  # a named tuple of arrays


def rows_of(columns: Columns, rows: NDArray[Any] | slice) -> Columns:
    """Some rows: by indices, flags or as a slice."""
    table: Any = columns
    selected: Columns = table._make(_select(column, rows) for column in table)
    return selected


def _select(column: Any, rows: NDArray[Any] | slice) -> Any:
    """Rows of an array or of a named tuple."""
    return rows_of(column, rows) if isinstance(column, tuple) else column[rows]


def stack_rows(parts: Sequence[Columns]) -> Columns:
    """The rows of all parts, padded to the widest; a column that is None in the first part is None in all."""
    if len(parts) == 1:
        return parts[0]
    first: Any = parts[0]
    stack: Columns = first._make(_concatenate(column) for column in zip(*parts, strict=True))
    return stack


def replace_rows(columns: Columns, index: NDArray[Any], rows: Columns) -> Columns:
    """The columns with new rows at `index`, padded to the wider ones; columns that are wide enough change in place."""
    table: Any = columns
    pairs = zip(table, rows, strict=True)  # type: ignore[call-overload]
    changed: Columns = table._make(_replace_values(column, index, values) for column, values in pairs)
    return changed


def _replace_values(column: Any, index: NDArray[Any], rows: Any) -> Any:
    """Replace rows of an array or of a named tuple."""
    if isinstance(column, tuple):
        return replace_rows(column, index, rows)
    column = column if rows.ndim < 2 else widen_columns(column, rows.shape[1])
    column[index] = rows if rows.ndim < 2 else widen_columns(rows, column.shape[1])
    return column


def _concatenate(parts: Sequence[Any]) -> Any:
    """Stack arrays or named tuples."""
    if parts[0] is None:
        return None
    if isinstance(parts[0], tuple):
        return stack_rows(parts)
    width = 0 if parts[0].ndim < 2 else max(part.shape[1] for part in parts)
    return np.concatenate([widen_columns(part, width) for part in parts])


def widen_columns(array: NDArray[Any], width: int) -> NDArray[Any]:
    """An array (N, B, ...) padded to a number of columns with nan, False or -1."""
    if array.ndim < 2 or array.shape[1] >= width:
        return array
    missing_value = {"f": np.nan, "b": False}.get(array.dtype.kind, -1)
    pads = [(0, 0), (0, width - array.shape[1]), *[(0, 0)] * (array.ndim - 2)]
    return np.pad(array, pads, constant_values=missing_value)


def branch_rows(values: Sequence[ArrayLike], count: int) -> NDArray[Any]:
    """Entries on branch axes (b0, b1, b2, N) as rows (N, B, entries)."""
    shape = np.broadcast_shapes((1, 1, 1, count), *(np.shape(v) for v in values))
    rows = np.empty((*shape, len(values)))
    for k, value in enumerate(values):
        rows[..., k] = value
    return rows.reshape(int(np.prod(shape[:-1])), count, len(values)).swapaxes(0, 1).copy()
