"""Rows of numbers from a CSV file or a pipe: columns by the heading's names, or in order without one."""

from __future__ import annotations

import contextlib
import csv
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import IO

from armkin import files
from armkin.cli import output
from armkin.cli.numbers import LARGEST, numbers
from armkin.cli.rows import ROWS, Chunk
from armkin.errors import FileError, UsageError

LONGEST = 100_000  # characters of a line: what is longer is no CSV file
_PLAIN = b"0123456789+-.eE,\r\n \t"
_WORD = re.compile(r"[A-Za-z_][A-Za-z0-9_./-]{0,63}")

_TARGETS = "; targets are solved first: armkin ik ROBOT --batch FILE --continuous | this command with --batch -"


class Columns:
    """Where each number stands in a line, learnt from the first line that is neither empty nor a comment.

    names: what the numbers are called; what: who wants them, for messages; named: values that one word stands
    for (poses). A heading may have other columns, too, and any order; `x_mm`, `x/mm` and a trace's `tool_x_mm`
    are x. A row whose wanted cells are all empty (a target that `ik` did not reach) is skipped and counted.
    """

    def __init__(self, names: Sequence[str], what: str, named: Mapping[str, Sequence[float]] | None = None) -> None:
        self.names, self.what, self.named = names, what, named or {}
        self.places: list[int] | None = None
        self.heading: list[str] = []
        self.skipped = 0
        self.begun = False

    def row(self, line: bytes, number: int) -> list[float] | None:
        """One line; None for a heading, a comment, an empty line or a row without values."""
        try:
            text = line.decode("utf-8-sig" if number == 1 else "utf-8").strip()
        except UnicodeDecodeError:
            raise UsageError("this is no UTF-8 text") from None
        if len(line) >= LONGEST or "\0" in text:
            raise UsageError("this is no CSV of numbers")
        if not text or text.startswith("#"):
            return None
        cells = _cells(text)
        if len(cells) == 1 and cells[0] in self.named:
            self.begun = True
            return list(self.named[cells[0]])
        if not self.begun:
            self.begun = True
            if self._read_heading(cells):
                return None
        if self.places is not None:
            if len(cells) != len(self.heading):
                have, want = len(cells), len(self.heading)
                raise UsageError(f"has {have} cell{'s' * (have != 1)}, the heading has {want}")
            cells = [cells[i] for i in self.places]
            if not any(cells) and len(self.heading) > len(self.names):
                self.skipped += 1
                return None
        elif len(cells) == 1 and len(self.names) > 1:
            if '"' in text:
                raise UsageError("the numbers of a row stand in one pair of quotes, or behind one: leave quotes out")
            for separator in (";", "\t", " "):
                if len(text.split(separator)) == len(self.names):
                    raise UsageError(f"separate the numbers with commas, not with {separator!r}")
        return numbers(cells, self.names, self.what)

    def all_plain(self, lines: list[bytes]) -> list[float] | None:
        """All numbers of lines whose wanted cells are ordinary numbers: the fast way; None: look closer."""
        text = b"".join(lines)
        if not self.begun or len(lines[-1]) >= LONGEST:
            return None
        if self.places is None:
            if text.translate(None, _PLAIN) or any(line.count(b",") != len(self.names) - 1 for line in lines):
                return None
            chosen = [cell for line in lines for cell in line.split(b",")]
        else:
            rows = [line.split(b",") for line in lines]
            if b'"' in text or any(len(row) != len(self.heading) for row in rows):
                return None
            chosen = [row[i] for row in rows for i in self.places]
            if b"".join(chosen).translate(None, _PLAIN):
                return None
        try:
            values = [float(cell) for cell in chosen]
        except ValueError:
            return None
        return values if max(map(abs, values)) <= LARGEST else None

    def _read_heading(self, cells: list[str]) -> bool:
        """Take a line for a heading if it names one of the columns."""
        lower = [cell.lower() for cell in cells]
        found = {name: _places(lower, name.lower()) for name in self.names}
        if not any(found.values()):
            if len(cells) > 1 and all(_WORD.fullmatch(cell) for cell in cells):
                hint = _TARGETS if {"x", "y"} <= set(lower) and "x" not in self.names else ""
                raise UsageError(f"a heading without the columns {', '.join(self.names)}{hint}")
            return False
        double = [name for name, places in found.items() if len(places) > 1]
        if double:
            raise UsageError(f"the heading has two columns {double[0]}")
        missing = [name for name, places in found.items() if not places]
        if missing:
            names = ", ".join(missing)
            raise UsageError(f"the heading has no column{'s' * (len(missing) > 1)} {names}; it has {', '.join(cells)}")
        self.heading = cells
        self.places = [places[0] for places in found.values()]
        return True


def batch_rows(
    source: str, names: Sequence[str], what: str, named: Mapping[str, Sequence[float]] | None = None
) -> Iterator[Chunk]:
    """Rows of a CSV file, or of standard input for "-", in chunks.

    names, what, named: see `Columns`. A malformed row raises UsageError that names its number (from 1, as an
    editor counts lines), after the complete rows before it were given out.
    """
    files.keep(0 if source == "-" else source)  # before an output of that name is opened
    return _batch_rows(source, names, what, named)


def _batch_rows(
    source: str, names: Sequence[str], what: str, named: Mapping[str, Sequence[float]] | None
) -> Iterator[Chunk]:
    columns = Columns(names, what, named)
    first, empty = 1, True
    with _opened(source) as file:
        while lines := _lines(file, source):
            for chunk in _chunk(lines, first, columns, source):
                empty = False
                yield chunk
            first += len(lines)
    if columns.skipped:
        output.warn(f"{columns.skipped} row{'s' * (columns.skipped > 1)} without {','.join(names)} skipped")
    if empty:
        why = "has no row with values" if columns.skipped else "is empty"
        raise UsageError(f"{_name(source)} {why}; it needs one row of {','.join(names)} per pose")


def streamed_rows(
    source: str, names: Sequence[str], what: str, named: Mapping[str, Sequence[float]] | None = None
) -> Iterator[tuple[int, list[float]]]:
    """Rows of a CSV file one by one, each as soon as it can be read: its number and its values."""
    columns = Columns(names, what, named)
    with _opened(source) as file:
        for number, line in enumerate(iter(lambda: _line(file, source), b""), 1):
            try:
                row = columns.row(line, number)
            except UsageError as error:
                raise error.within(f"{_name(source)}: row {number}", row=number) from None
            if row is not None:
                yield number, row


@contextlib.contextmanager
def _opened(source: str) -> Iterator[IO[bytes]]:
    if source == "-":
        if sys.stdin is None:
            raise FileError("standard input is closed; give --batch a file")
        yield sys.stdin.buffer
        return
    try:
        file = open(source, "rb")  # noqa: SIM115
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise FileError(f"{source}: cannot read: {reason}", file=source) from None
    with file:
        yield file


def _lines(file: IO[bytes], source: str) -> list[bytes]:
    lines: list[bytes] = []
    while len(lines) < ROWS and (line := _line(file, source)):
        lines.append(line)
        if len(line) >= LONGEST:  # no use in reading on
            break
    return lines


def _line(file: IO[bytes], source: str) -> bytes:
    try:
        return file.readline(LONGEST)
    except (OSError, ValueError) as error:  # ValueError: closed
        reason = getattr(error, "strerror", None) or error
        raise FileError(f"{_name(source)}: cannot read: {reason}") from None


def _name(source: str) -> str:
    return "standard input" if source == "-" else source


def _chunk(lines: list[bytes], first: int, columns: Columns, source: str) -> Iterator[Chunk]:
    import numpy as np

    index: list[int] = []
    good: list[list[float]] = []
    problem: UsageError | None = None
    tried = False
    for number, line in enumerate(lines, first):
        if columns.begun and not tried:  # what the columns are is known: the rest in one go, if it is plain
            tried, rest = True, lines[number - first :]
            values = columns.all_plain(rest)
            if values is not None:
                index += range(number, first + len(lines))
                good += np.array(values).reshape(len(rest), -1).tolist() if good else []
                yield Chunk(index, np.array(good or values).reshape(len(index), len(columns.names)))
                return
        try:
            row = columns.row(line, number)
        except UsageError as error:
            problem = error.within(f"{_name(source)}: row {number}", row=number)
            break
        if row is not None:
            index.append(number)
            good.append(row)
    if good:
        yield Chunk(index, np.array(good))
    if problem is not None:
        raise problem


def _cells(text: str) -> list[str]:
    """The cells of one line; quotes hold commas."""
    if '"' not in text:
        return [cell.strip() for cell in text.split(",")]
    try:
        return [cell.strip() for cell in next(csv.reader([text], skipinitialspace=True))]
    except csv.Error:
        raise UsageError("this is no CSV of numbers") from None


def _places(heading: Sequence[str], name: str) -> list[int]:
    """Columns of a name: those of exactly this name, or those with a unit behind it."""
    exact = [i for i, cell in enumerate(heading) if cell == name]
    others = (f"{name}_mm", f"{name}_deg", f"{name}/mm", f"{name}/deg", f"tool_{name}_mm")
    return exact or [i for i, cell in enumerate(heading) if cell in others]
