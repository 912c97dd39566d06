"""Tables as CSV and JSON Lines: every number with the fewest digits that read back to the same double.

The digits are those of Python's `repr`. Where pyarrow is installed it prints whole columns, several times as fast; what
it prints in another way (whole numbers, small and large ones) is printed by Python, so that the bytes are the same.
"""

import json
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armkin.columns.csv_cells import csv_cell
from armkin.columns.table import Column, Table, Words, row_count, take_rows

PYARROW_ROWS = 2_000  # rows from which on pyarrow is worth its import
ROWS = 8_192  # rows printed at once: their texts stay in the cache, and no memory is asked for again


# Prints all rows of a table: separators[i] stands before column i, the last one at the end; how words are quoted, and
# what stands for nan.
Lines = Callable[[Table, list[str], Callable[[Any], str], str], bytes]


def to_csv(table: Table, lines: Lines | None = None) -> bytes:
    """The rows of a table as CSV, without a heading; lines: what prints them, by default what is quickest here."""
    names = list(table)
    separators = ["", *[","] * (len(names) - 1), "\n"]
    return (lines or _print_lines)(table, separators, csv_cell, "")


def to_json_lines(table: Table, lines: Lines | None = None) -> bytes:
    """The rows of a table as flat JSON objects, one a line."""
    separators = [("{" if i == 0 else ", ") + json.dumps(name) + ": " for i, name in enumerate(table)]
    return (lines or _print_lines)(table, [*separators, "}\n"], json.dumps, "null")


def _print_lines(table: Table, separators: list[str], quote: Callable[[Any], str], missing_text: str) -> bytes:
    """See `Lines`."""
    count = row_count(table)
    if count >= PYARROW_ROWS and (arrow := _import_arrow()) is not None:
        parts = (table if count <= ROWS else take_rows(table, slice(i, i + ROWS)) for i in range(0, count, ROWS))
        return b"".join([_print_by_arrow(arrow, block, separators, quote, missing_text) for block in parts])
    columns = [_column_texts(column, quote, missing_text) for column in table.values()]
    if not count:
        return b""
    line = "%s".join(text.replace("%", "%%") for text in separators)
    return "".join([line % row for row in zip(*columns, strict=True)]).encode()


def _column_texts(column: Column, quote: Callable[[Any], str], missing_text: str) -> list[str]:
    """The texts of a column; missing_text: what stands for nan."""
    if isinstance(column, Words):
        names = [*map(quote, column.names), missing_text]
        return [names[i] for i in column.index.tolist()]
    if column.dtype == bool:
        return ["true" if value else "false" for value in column.tolist()]
    if column.dtype.kind != "f":
        return list(map(str, column.tolist()))
    texts = list(map(repr, column.tolist()))
    for row in np.flatnonzero(np.isnan(column)).tolist():
        texts[row] = missing_text
    return texts


@cache
def _import_arrow() -> Any:
    """pyarrow with its functions, or None where it is not installed."""
    try:
        import pyarrow
        import pyarrow.compute
    except ImportError:
        return None
    return pyarrow


def _print_by_arrow(
    pa: Any, table: Table, separators: list[str], quote: Callable[[Any], str], missing_text: str
) -> bytes:
    """The rows as bytes, texts joined by Arrow; separators: what stands around each column."""
    pieces = [_arrow_texts(pa, column, quote, missing_text) for column in table.values()]
    if len(set(separators[1:-1])) <= 1 and not separators[0]:  # one separator: half as many pieces to join
        lines = pa.compute.binary_join_element_wise(*pieces, pa.scalar(separators[1]))
        lines = pa.compute.binary_join_element_wise(lines, pa.scalar(""), pa.scalar(separators[-1]))
    else:
        parts = [piece for pair in zip(map(pa.scalar, separators), pieces, strict=False) for piece in pair]
        lines = pa.compute.binary_join_element_wise(*parts, pa.scalar(separators[-1]), pa.scalar(""))
    _, offsets, buffer = lines.buffers()
    ends = np.frombuffer(offsets, np.int32, len(lines) + 1, 4 * lines.offset)
    return bytes(memoryview(buffer)[ends[0] : ends[-1]])


def _arrow_texts(pa: Any, column: Column, quote: Callable[[Any], str], missing_text: str) -> Any:
    if isinstance(column, Words):
        names = pa.array([*map(quote, column.names), missing_text], pa.string())
        return names.take(pa.array(np.where(column.index < 0, len(column.names), column.index)))
    if column.dtype == bool:
        return pa.array(["false", "true"]).take(pa.array(column.astype(np.int64)))
    values = np.ascontiguousarray(column)
    texts = pa.array(values).cast(pa.string())
    if values.dtype.kind != "f":
        return texts
    by_python = _needs_python_digits(values)
    if by_python.any():
        words = [missing_text if value != value else repr(value) for value in values[by_python].tolist()]
        texts = pa.compute.replace_with_mask(texts, pa.array(by_python), pa.array(words, pa.string()))
    return texts


def _needs_python_digits(values: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Where pyarrow's digits are not laid out as Python's: 1 for 1.0, 1e-7 for 1e-07, 1e+10 for 10000000000.0, nan."""
    magnitudes = np.abs(values)
    is_plain = (values != np.rint(values)) & (
        ((magnitudes >= 1e-3) & (magnitudes < 1e9)) | ((magnitudes < 1e-10) & (magnitudes > 1e-99))
    )
    return np.asarray(~is_plain)
