"""Paths as CSV: one row a corner, lines between them; columns are chosen by the names in the header."""

import csv
import io
import math
from itertools import islice
from typing import Any

from armkin.errors import PathFileError
from armkin.path_file.path_keys import MAX_NUMBER, MAX_POINTS, MIN_TOOL_SPEED, Move, PathFile, Source

_OPTIONS = ("blend", "tool_speed")
_TARGETS = ("x", "y", "z", "theta", "phi", "roll", "pitch", "yaw", "ax", "ay", "az")
# What a batch of `armkin ik` says beside the joints.
_OF_ANSWERS = ("row", "status", "branch", "within_limits", "residual_mm", "residual_deg", "motion")
Row = tuple[int, list[str]]  # its number in the file, its cells
_UNITS = ("_mm", "_deg", "/mm", "/deg")


def parse_csv(raw: bytes, name: str) -> PathFile:
    """Rows as moves: a point first, then lines (targets), or joint moves (joint names).

    Targets without a blend column are dense points: corners are passed by the tolerance.

    The header names the columns: x,y,z[,roll,pitch,yaw] or whatever the task's labels are, or joint names, plus
    optional blend and tool_speed, where an empty cell leaves the corner to what is said of all; what a batch of
    `armkin ik` says beside the joints is passed over. Without a header the columns are a target's, in the task's order.
    """
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise PathFileError(f"{name}: is not UTF-8 text", file=name) from None
    rows = _filled_rows(text, name)
    if not rows:
        raise PathFileError(f"{name}: has no rows: a header such as x,y,z and one row a corner", file=name)
    header, rows = _header_and_rows(rows, name)
    if len(rows) > MAX_POINTS:
        raise PathFileError(f"{name}: has more than {MAX_POINTS} rows, and a path no more: give it in parts", file=name)
    if not rows:
        raise PathFileError(f"{name}: has a header and no rows", file=name)
    moves = [_row_to_move(header, row, first=not k, line=(name, number)) for k, (number, row) in enumerate(rows)]
    places: dict[tuple[str | int, ...], int] = {("moves", k): number for k, (number, _) in enumerate(rows)}
    is_smooth = moves[0].point is not None and "blend" not in (header or ())
    return PathFile.model_construct(moves=moves, corners="tolerance" if is_smooth else None).read_from(
        Source(name, places, rows=True)
    )


def _header_and_rows(rows: list[Row], name: str) -> tuple[list[str] | None, list[Row]]:
    """The columns' names, None where the first row has numbers alone, and the rows below without a batch's words."""
    if all(_cell_number(cell) is not None for cell in rows[0][1]):
        return None, rows
    indices = [i for i, cell in enumerate(rows[0][1]) if cell.strip() not in _OF_ANSWERS]
    first, *rows_below = [(number, [row[i] for i in indices if i < len(row)]) for number, row in rows]
    return _check_header(first[1], name), rows_below


def _check_header(cells: list[str], name: str) -> list[str]:
    """The columns' names: of targets or of joints, each once."""
    header = [_cell_text(cell) for cell in cells]
    if doubled := sorted({key for key in header if header.count(key) > 1}):
        raise PathFileError(f"{name}:1: column {doubled[0]} stands twice in the header", file=name)
    unknown_keys = [key for key in header if key not in _TARGETS + _OPTIONS]
    if unknown_keys and len(unknown_keys) < len(header) - sum(key in _OPTIONS for key in header):
        raise PathFileError(
            f"{name}:1: column {unknown_keys[0] or 'without a name'} is unknown beside those of a target: "
            f"{', '.join(_TARGETS + _OPTIONS)}", file=name, line=1,
        )  # fmt: skip
    return header


def _filled_rows(text: str, name: str) -> list[Row]:
    """Rows that are neither empty nor a comment, with their numbers: at most a header, and one too many."""
    lines = csv.reader(io.StringIO(text))
    rows = (
        (number, row)
        for number, row in enumerate(lines, 1)
        if any(cell.strip() for cell in row) and not row[0].lstrip().startswith("#")
    )
    try:
        return list(islice(rows, MAX_POINTS + 2))
    except csv.Error as error:
        line = lines.line_num
        raise PathFileError(f"{name}:{line}: no row of numbers: {error}", file=name, line=line) from None


def _numbers_by_column(header: list[str] | None, row: list[str], line: tuple[str, int]) -> dict[str, float]:
    """A row's numbers by their columns, by their places without a header; an empty cell of an option is none."""
    values: dict[str, float] = {}
    columns = [str(i) for i in range(len(row))] if header is None else header
    for i, cell in enumerate(row):
        value, key = _cell_number(cell), columns[i] if i < len(columns) else ""
        if value is None and key in _OPTIONS and not cell.strip():
            continue
        if value is None or abs(value) > MAX_NUMBER:
            problem = "is no number" if value is None else f"is beyond {MAX_NUMBER:g}"
            raise PathFileError(f"{line[0]}:{line[1]}: '{cell[:40]}' {problem}", file=line[0], line=line[1])
        values[key] = value
    if len(row) != len(header or row):
        problem = f"{len(row)} cells, {len(header or [])} columns"
        raise PathFileError(f"{line[0]}:{line[1]}: {problem}", file=line[0], line=line[1])
    return values


def _row_to_move(header: list[str] | None, row: list[str], *, first: bool, line: tuple[str, int]) -> Move:
    """The move of a row: joint values, or a target by a point or a line."""
    numbers = _numbers_by_column(header, row, line)
    extra: dict[str, Any] = {key: numbers.pop(key) for key in _OPTIONS if key in numbers}
    if extra.get("blend", 0.0) < 0 or extra.get("tool_speed", 1.0) < MIN_TOOL_SPEED:
        raise PathFileError(
            f"{line[0]}:{line[1]}: blend is at least 0, tool_speed at least {MIN_TOOL_SPEED:g} mm/s", file=line[0]
        )
    if header and not set(numbers) & set(_TARGETS):
        return Move.model_construct(None, joint=numbers, **extra)
    # The header's order is kept; the planner puts a target's labels in place.
    target = [numbers[key] for key in sorted(numbers, key=_column_rank)] if header else list(numbers.values())
    return Move.model_construct(None, **{"point" if first else "line": target}, **extra)


def _column_rank(key: str) -> int:
    return _TARGETS.index(key) if key in _TARGETS else len(_TARGETS)


def _cell_text(cell: str) -> str:
    text = cell.strip()
    for unit in _UNITS:
        text = text.removesuffix(unit)
    return text


def _cell_number(cell: str) -> float | None:
    if len(cell) > 100:
        return None
    try:
        value = float(cell)
    except ValueError:
        return None
    return value if math.isfinite(value) else None
