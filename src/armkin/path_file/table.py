"""Paths as CSV: one row a corner, lines between them; columns are chosen by the names in the header."""

from __future__ import annotations

import csv
import io
import math
from itertools import islice
from typing import Any

from armkin.errors import PathFileError
from armkin.path_file.model import LARGEST, LEAST_TOOL_SPEED, MOST_POINTS, Move, PathFile, Source

_OPTIONS = ("blend", "tool_speed")
_TARGETS = ("x", "y", "z", "theta", "phi", "roll", "pitch", "yaw", "ax", "ay", "az")
# What a batch of `armkin ik` says beside the joints.
_OF_ANSWERS = ("row", "status", "branch", "within_limits", "residual_mm", "residual_deg", "motion")
_UNITS = ("_mm", "_deg", "/mm", "/deg")


def parse(raw: bytes, name: str) -> PathFile:
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
    rows = _filled(text, name)
    if not rows:
        raise PathFileError(f"{name}: has no rows: a header such as x,y,z and one row a corner", file=name)
    header: list[str] | None = None
    if any(_value(cell) is None for cell in rows[0][1]):
        kept = [i for i, cell in enumerate(rows[0][1]) if cell.strip() not in _OF_ANSWERS]
        rows = [(number, [row[i] for i in kept if i < len(row)]) for number, row in rows]
        header = [_bare(cell) for cell in rows.pop(0)[1]]
        doubled = sorted({key for key in header if header.count(key) > 1})
        if doubled:
            raise PathFileError(f"{name}:1: column {doubled[0]} stands twice in the header", file=name)
        strange = [key for key in header if key not in _TARGETS + _OPTIONS]
        if strange and len(strange) < len(header) - sum(key in _OPTIONS for key in header):
            raise PathFileError(
                f"{name}:1: column {strange[0] or 'without a name'} is unknown beside those of a target: "
                f"{', '.join(_TARGETS + _OPTIONS)}", file=name, line=1,
            )  # fmt: skip
    if len(rows) > MOST_POINTS:
        raise PathFileError(
            f"{name}: has more than {MOST_POINTS} rows, and a path no more: give it in parts", file=name
        )
    moves: list[Move] = []
    spared = {i for i, key in enumerate(header or ()) if key in _OPTIONS}
    for number, row in rows:
        values = [_value(cell) for cell in row]
        empty = {i for i in spared if i < len(row) and not row[i].strip()}
        bad = [i for i, v in enumerate(values) if (v is None or abs(v) > LARGEST) and i not in empty]
        if bad or len(values) != len(header or values):
            wrong = row[bad[0]] if bad else None
            what = (
                f"'{wrong[:40]}' is {'no number' if values[bad[0]] is None else f'beyond {LARGEST:g}'}"
                if wrong is not None
                else f"{len(values)} cells, {len(header or [])} columns"
            )
            raise PathFileError(f"{name}:{number}: {what}", file=name, line=number)
        keys = None if header is None else [key for i, key in enumerate(header) if i not in empty]
        moves.append(_move(keys, [v for v in values if v is not None], first=not moves, where=(name, number)))
    if not moves:
        raise PathFileError(f"{name}: has a header and no rows", file=name)
    places: dict[tuple[str | int, ...], int] = {("moves", k): number for k, (number, _) in enumerate(rows)}
    smooth = moves[0].point is not None and "blend" not in (header or ())
    return PathFile.model_construct(moves=moves, corners="tolerance" if smooth else None).read_from(
        Source(name, places, rows=True)
    )


def _filled(text: str, name: str) -> list[tuple[int, list[str]]]:
    """Rows that are neither empty nor a comment, with their numbers: at most a header, and one too many."""
    lines = csv.reader(io.StringIO(text))
    filled = (
        (number, row)
        for number, row in enumerate(lines, 1)
        if any(cell.strip() for cell in row) and not row[0].lstrip().startswith("#")
    )
    try:
        return list(islice(filled, MOST_POINTS + 2))
    except csv.Error as error:
        line = lines.line_num
        raise PathFileError(f"{name}:{line}: no row of numbers: {error}", file=name, line=line) from None


def _move(header: list[str] | None, values: list[float], *, first: bool, where: tuple[str, int]) -> Move:
    named = dict(zip(header, values, strict=True)) if header else {}
    extra: dict[str, Any] = {key: named.pop(key) for key in _OPTIONS if key in named}
    if extra.get("blend", 0.0) < 0 or extra.get("tool_speed", 1.0) < LEAST_TOOL_SPEED:
        raise PathFileError(
            f"{where[0]}:{where[1]}: blend is at least 0, tool_speed at least {LEAST_TOOL_SPEED:g} mm/s", file=where[0]
        )
    if header and not set(named) & set(_TARGETS):
        return Move.model_construct(None, joint=named, **extra)
    # The header's order is kept; the planner puts a target's labels in place.
    target = [named[key] for key in sorted(named, key=_order)] if header else values
    return Move.model_construct(None, **{"point" if first else "line": target}, **extra)


def _order(key: str) -> int:
    return _TARGETS.index(key) if key in _TARGETS else len(_TARGETS)


def _bare(cell: str) -> str:
    text = cell.strip()
    for unit in _UNITS:
        text = text.removesuffix(unit)
    return text


def _value(cell: str) -> float | None:
    if len(cell) > 100:
        return None
    try:
        value = float(cell)
    except ValueError:
        return None
    return value if math.isfinite(value) else None
