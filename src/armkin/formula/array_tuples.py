"""Named tuples of arrays with a row a target or candidate: some of all rows, several parts one below the other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Columns = TypeVar("Columns")  # a named tuple of arrays


def rows_of(columns: Columns, rows: NDArray[Any] | slice) -> Columns:
    """Some rows: by indices, flags or as a slice."""
    each: Any = columns
    out: Columns = each._make(column[rows] for column in each)
    return out


def stacked(parts: Sequence[Columns]) -> Columns:
    """The rows of all parts, as `widened` as the widest needs; a column that is None in the first one is in all."""
    if len(parts) == 1:
        return parts[0]
    first: Any = parts[0]
    out: Columns = first._make(_below(column) for column in zip(*parts, strict=True))
    return out


def replaced(columns: Columns, which: NDArray[Any], rows: Columns) -> Columns:
    """The same with other rows in place of some, as wide as both need; in place where that is as wide."""
    each: Any = columns
    out: Columns = each._make(_replaced(column, which, new) for column, new in zip(each, rows, strict=True))  # type: ignore[call-overload]
    return out


def _replaced(column: NDArray[Any], which: NDArray[Any], rows: NDArray[Any]) -> NDArray[Any]:
    column = column if rows.ndim < 2 else widened(column, rows.shape[1])
    column[which] = rows if rows.ndim < 2 else widened(rows, column.shape[1])
    return column


def _below(parts: Sequence[Any]) -> Any:
    """Arrays or named tuples one below the other."""
    if parts[0] is None:
        return None
    if isinstance(parts[0], tuple):
        return stacked(parts)
    width = 0 if parts[0].ndim < 2 else max(part.shape[1] for part in parts)
    return np.concatenate([widened(part, width) for part in parts])


def widened(array: NDArray[Any], width: int) -> NDArray[Any]:
    """An array (N, B, ...) with at least so many columns: nan, False or -1 behind."""
    if array.ndim < 2 or array.shape[1] >= width:
        return array
    missing = {"f": np.nan, "b": False}.get(array.dtype.kind, -1)
    pads = [(0, 0), (0, width - array.shape[1]), *[(0, 0)] * (array.ndim - 2)]
    return np.pad(array, pads, constant_values=missing)
