"""Columns as lines of text by machine code: the bytes of `armkin.columns.csv_and_json_lines`, but faster."""

import ctypes
import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from armkin.columns.table import Column, Table, Words, row_count, take_rows
from armkin.compiled import toolchain

SOURCE = Path(__file__).parent / "parts" / "table_lines.c"
MIN_EXP, MAX_EXP = -292, 324  # least and greatest power of ten that doubles need
MAX_WIDTH = 25  # most characters of a number, such as -2.2250738585072014e-308
SPARE_CHARACTERS = 64  # characters that C may write after the last one
BLOCK_ROWS = 4_096  # rows printed together, so that their text fits the cache


def table_lines(table: Table, separators: list[str], quote: Callable[[Any], str], missing_text: str) -> bytes:
    """See `armkin.columns.csv_and_json_lines.Lines`."""
    count = row_count(table)
    print_rows = _library()
    texts = [_column_words(column, quote) for column in table.values()]
    cells = [[separator, missing_text, *cell] for separator, cell in zip(separators, texts, strict=False)]
    cells.append([separators[-1]])
    encoded = [text.encode() for parts in cells for text in parts]
    ends = np.cumsum([0, *map(len, encoded)], dtype=np.int64)
    cell_starts = np.cumsum([0, *map(len, cells[:-1])], dtype=np.int64)
    width = sum(map(len, separators)) + len(table) * max(MAX_WIDTH, *map(len, encoded))
    words, buffer = b"".join(encoded), np.empty(min(count, BLOCK_ROWS) * width + SPARE_CHARACTERS, np.uint8)
    blocks = []
    for start in range(0, count, BLOCK_ROWS):
        block = take_rows(table, slice(start, start + BLOCK_ROWS))
        kinds, values = zip(*map(_column_values, block.values()), strict=True)
        kind_array = (ctypes.c_int * len(kinds))(*kinds)
        value_pointers = (ctypes.c_void_p * len(kinds))(*(column.ctypes.data for column in values))
        pointers = ends.ctypes.data, cell_starts.ctypes.data, buffer.ctypes.data
        size = print_rows(row_count(block), len(kinds), kind_array, value_pointers, words, *pointers)
        blocks.append(buffer[:size].tobytes())
    return b"".join(blocks)


def _column_words(column: Column, quote: Callable[[Any], str]) -> list[str]:
    """The words of a column."""
    if isinstance(column, Words):
        return [quote(name) for name in column.names]
    return ["false", "true"] if column.dtype == bool else []


def _column_values(column: Column) -> tuple[int, np.ndarray[Any, Any]]:
    """The kind of a column, and its values for C."""
    if isinstance(column, Words):
        return 3, np.ascontiguousarray(column.index, np.int64)
    if column.dtype == bool:
        return 2, np.ascontiguousarray(column)
    if column.dtype.kind == "f":
        return 0, np.ascontiguousarray(column, np.float64)
    return 1, np.ascontiguousarray(column, np.int64)


@cache
def _library() -> Any:
    """`arm_lines` of parts/table_lines.c. Raises MissingExtraError without a C compiler."""
    powers = ",\n".join(
        f"    {{{_c_number(high)}, {_c_number(low)}}}" for high, low in map(_power_of_ten, range(MIN_EXP, MAX_EXP + 1))
    )
    text = SOURCE.read_text(encoding="utf-8").replace("@powers@", powers)
    text = text.replace("@least@", str(MIN_EXP)).replace("@count@", str(MAX_EXP - MIN_EXP + 1))
    text = text.replace("@pairs@", "".join(f"{i:02d}" for i in range(100)))
    content = hashlib.sha256(text.encode()).hexdigest()
    function = toolchain.load_library(text.replace("@content@", content), content, 2).arm_lines
    pointer, size = ctypes.c_void_p, ctypes.c_int64
    function.argtypes = [size, ctypes.c_int, pointer, pointer, ctypes.c_char_p, pointer, pointer, pointer]
    function.restype = size
    return function


def _power_of_ten(exponent: int) -> tuple[int, int]:
    """10^k as 128 bits with the highest bit set, rounded up."""
    top, bottom = (10**exponent, 1) if exponent >= 0 else (1, 10**-exponent)
    shift = 128 - (top.bit_length() - bottom.bit_length())
    for bits in (shift - 1, shift, shift + 1):  # the quotient may have one bit more or less
        value = -((-top << bits) // bottom) if bits >= 0 else -(-top // (bottom << -bits))
        if value.bit_length() == 128:
            return value >> 64, value & (2**64 - 1)
    raise AssertionError(exponent)


def _c_number(value: int) -> str:
    return f"0x{value:016X}ULL"
