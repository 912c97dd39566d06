"""Rows of numbers from a CSV file or a pipe: columns by the heading's names, or in order without one.

Targets [mm, deg] become what `armkin.ik` takes in `armkin.model.target_numbers`.
"""

from __future__ import annotations

import contextlib
import csv
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import IO, TYPE_CHECKING

from armkin import files
from armkin.cli.parsing.number_parsing import MAX_NUMBER, numbers
from armkin.cli.parsing.row_chunks import CHUNK_ROWS as CHUNK_ROWS
from armkin.cli.parsing.row_chunks import Chunk
from armkin.cli.printing import output
from armkin.columns.joint_columns import places_of_columns
from armkin.errors import FileError, UsageError

if TYPE_CHECKING:
    from armkin.formula.arrays import Array

PYARROW_ROWS = 2_000  # fewest rows that justify the import of pyarrow
MAX_LINE = 100_000  # longest line of a CSV file
CHUNK_CHARACTERS = 1 << 18  # characters read at once
_PLAIN = b"0123456789+-.eE,\r\n \t"
_WORD = re.compile(r"[A-Za-z_][A-Za-z0-9_./-]{0,63}")

_TARGETS = "; targets are solved first: armkin ik ROBOT --batch FILE --continuous | this command with --batch -"


class CsvColumns:
    """Where each number stands in a line, learnt from the first line that is neither empty nor a comment.

    names: what the numbers are called; purpose: who wants them, for messages; named: values that one word stands
    for (poses); None: the numbers are no joint values. A heading may have other columns, too, and any order; `x_mm`,
    `x/mm` and a trace's `tool_x_mm` are x, a joint x is `joint_x` where there are both. A row whose wanted cells are
    all empty (a target that `ik` did not reach) is skipped and counted.
    """

    def __init__(self, names: Sequence[str], purpose: str, named: Mapping[str, Sequence[float]] | None = None) -> None:
        self.names, self.purpose, self.named = names, purpose, named or {}
        self.of_joints = named is not None
        self.places: list[int] | None = None
        self.heading: list[str] = []
        self.skipped = 0
        self.first_row_read = False

    def row(self, line: bytes, number: int) -> list[float] | None:
        """One line; None for a heading, a comment, an empty line or a row without values."""
        text = _text_of(line, "utf-8-sig" if number == 1 else "utf-8")
        if not text or text.startswith("#"):
            return None
        cells = _split_cells(text)
        if len(cells) == 1 and cells[0] in self.named:
            self.first_row_read = True
            return list(self.named[cells[0]])
        if not self.first_row_read:
            self.first_row_read = True
            if self._read_heading(cells):
                return None
        if self.places is not None:
            cells = self._wanted_cells(cells, self.places)
            if not any(cells) and len(self.heading) > len(self.names):
                self.skipped += 1
                return None
        elif len(cells) == 1 and len(self.names) > 1:
            self._check_separator(text)
        return numbers(cells, self.names, self.purpose)

    def _wanted_cells(self, cells: list[str], places: list[int]) -> list[str]:
        """The cells of the columns, of a row below a heading."""
        if len(cells) != len(self.heading):
            have, want = len(cells), len(self.heading)
            raise UsageError(f"has {have} cell{'s' * (have != 1)}, the heading has {want}")
        return [cells[i] for i in places]

    def _check_separator(self, text: str) -> None:
        """Raise UsageError for several numbers that something else than commas separates."""
        if '"' in text:
            raise UsageError("the numbers of a row stand in one pair of quotes, or behind one: leave quotes out")
        for separator in (";", "\t", " "):
            if len(text.split(separator)) == len(self.names):
                raise UsageError(f"separate the numbers with commas, not with {separator!r}")

    def all_plain(self, text: bytes) -> Array | None:
        """All numbers (N, m) of lines whose wanted cells are ordinary numbers: the fast way; None: look closer."""
        import numpy as np

        if b"\r" in text:
            text = text.replace(b"\r\n", b"\n")
        text = text.removesuffix(b"\n")
        width = len(self.heading) if self.places is not None else len(self.names)
        if not text.translate(None, _PLAIN):
            values = _regular_numbers(text, width)
            if values is not None and self.places is not None:
                values = values[:, self.places]
        elif self.places is not None and b'"' not in text and len(max(lines := text.split(b"\n"), key=len)) < MAX_LINE:
            values = _among_others([line.split(b",") for line in lines], width, self.places)
        else:
            return None
        return values if values is not None and np.abs(values).max() <= MAX_NUMBER else None

    def _read_heading(self, cells: list[str]) -> bool:
        """Take a line for a heading if it names one of the columns."""
        places_of = places_of_columns(cells, self.names, self.of_joints)
        if not any(places_of.values()):
            self._refuse_another(cells)
            return False
        doubled_names = [name for name, places in places_of.items() if len(places) > 1]
        if doubled_names:
            raise UsageError(f"the heading has two columns {doubled_names[0]}")
        missing_names = [name for name, places in places_of.items() if not places]
        if missing_names:
            names = ", ".join(missing_names)
            raise UsageError(
                f"the heading has no column{'s' * (len(missing_names) > 1)} {names}; it has {', '.join(cells)}"
            )
        self.heading = cells
        self.places = [places[0] for places in places_of.values()]
        return True

    def _refuse_another(self, cells: list[str]) -> None:
        """Raise UsageError for a line of words alone: the heading of another table."""
        if len(cells) > 1 and all(_WORD.fullmatch(cell) for cell in cells):
            hint = _TARGETS if {"x", "y"} <= {cell.lower() for cell in cells} and "x" not in self.names else ""
            raise UsageError(f"a heading without the columns {', '.join(self.names)}{hint}")


def batch_rows(
    source: str, names: Sequence[str], purpose: str, named: Mapping[str, Sequence[float]] | None = None
) -> Iterator[Chunk]:
    """Rows of a CSV file, or of standard input for "-", in chunks.

    names, purpose, named: see `CsvColumns`. A malformed row raises UsageError that names its number (from 1, as an
    editor counts lines), after the complete rows before it were given out.
    """
    files.protect_input(0 if source == "-" else source)  # must precede the opening of an output of that name
    return _all_rows(source, names, purpose, named)


def _all_rows(
    source: str, names: Sequence[str], purpose: str, named: Mapping[str, Sequence[float]] | None
) -> Iterator[Chunk]:
    """Chunks of all rows of a CSV source; UsageError if there is no row with values."""
    columns = CsvColumns(names, purpose, named)
    first, empty = 1, True
    with open_source(source) as file:
        for block in text_blocks(file, source):
            for chunk in chunk_of(block, first, columns, source):
                empty = False
                yield chunk
            first += line_count(block)
    if columns.skipped:
        output.warn(f"{columns.skipped} row{'s' * (columns.skipped > 1)} without {','.join(names)} skipped")
    if empty:
        reason = "has no row with values" if columns.skipped or columns.heading else "is empty"
        raise UsageError(f"{name_of(source)} {reason}; it needs one row of {','.join(names)} per pose")


def streamed_rows(
    source: str, names: Sequence[str], purpose: str, named: Mapping[str, Sequence[float]] | None = None
) -> Iterator[tuple[int, list[float]]]:
    """Rows of a CSV file one by one, each as soon as it can be read: its number and its values."""
    columns = CsvColumns(names, purpose, named)
    with open_source(source) as file:
        for number, line in enumerate(iter(lambda: _read_line(file, source), b""), 1):
            try:
                row = columns.row(line, number)
            except UsageError as error:
                raise error.within(f"{name_of(source)}: row {number}", row=number) from None
            if row is not None:
                yield number, row


@contextlib.contextmanager
def open_source(source: str) -> Iterator[IO[bytes]]:
    """A file, or standard input for "-", as bytes."""
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


def _regular_numbers(text: bytes, width: int) -> Array | None:
    """The numbers (N, width) of lines without anything else in them; None if they are not all that wide."""
    import numpy as np

    marks = np.frombuffer(text, np.uint8)
    ends = marks[(marks == ord(",")) | (marks == ord("\n"))] == ord("\n")
    rows = int(ends.sum()) + 1
    if len(ends) + 1 != rows * width or not ends[width - 1 :: width].all():
        return None
    if (
        len(text) >= MAX_LINE
        and np.diff(np.flatnonzero(marks == ord("\n")), prepend=-1, append=len(text)).max() > MAX_LINE
    ):
        return None
    if rows >= PYARROW_ROWS and (values := _by_arrow(text, width)) is not None:
        return values
    try:
        return np.array([float(cell) for cell in text.replace(b"\n", b",").split(b",")]).reshape(rows, width)
    except ValueError:
        return None


def _among_others(rows: list[list[bytes]], width: int, places: list[int]) -> Array | None:
    """The numbers of rows that have other cells, too."""
    import numpy as np

    if any(len(row) != width for row in rows):
        return None
    cells = [row[i] for row in rows for i in places]
    if b"".join(cells).translate(None, _PLAIN):
        return None
    try:
        return np.array([float(cell) for cell in cells]).reshape(len(rows), len(places))
    except ValueError:
        return None


def _by_arrow(text: bytes, width: int) -> Array | None:
    """Numbers (rows, width) of a text by pyarrow; None where it is missing or takes a cell for no number."""
    import numpy as np

    try:
        import pyarrow
        import pyarrow.csv as table
    except ImportError:
        return None
    # Its reader takes SIGINT and SIGTERM for itself and hands them back through a thread: a read that ends before that
    # thread has run loses the signal (160 of 3,000 with pyarrow 26).
    pyarrow.enable_signal_handlers(False)
    names = [str(i) for i in range(width)]
    read = table.ReadOptions(column_names=names, use_threads=False, block_size=len(text) + 1)
    convert = table.ConvertOptions(column_types=dict.fromkeys(names, pyarrow.float64()))
    try:
        columns = table.read_csv(pyarrow.BufferReader(text), read, convert_options=convert)
    except pyarrow.ArrowInvalid:
        return None
    if any(column.null_count for column in columns.columns):
        return None
    return np.column_stack([column.to_numpy() for column in columns.columns])


def text_blocks(file: IO[bytes], source: str) -> Iterator[bytes]:
    """The text in blocks of CHUNK_ROWS lines, each as soon as it can be read; a line of MAX_LINE characters ends it."""
    held: list[bytes] = []
    lines = open_length = 0  # lines that end in what is held, and characters behind them
    while text := _read_available(file, source):
        ends = text.count(b"\n")
        while lines + ends >= CHUNK_ROWS:
            cut = _end_of_lines(text, CHUNK_ROWS - lines)
            yield b"".join([*held, text[:cut]])
            text, ends, held = text[cut:], ends - (CHUNK_ROWS - lines), []
            lines = open_length = 0
        held.append(text)
        lines, open_length = lines + ends, len(text) - text.rfind(b"\n") - 1 if ends else open_length + len(text)
        if open_length >= MAX_LINE:  # no use in reading on
            break
    if last := b"".join(held):
        yield last


def _read_available(file: IO[bytes], source: str) -> bytes:
    """What can be read now; nothing at the end."""
    try:
        return bytes(file.read1(CHUNK_CHARACTERS))  # type: ignore[attr-defined]
    except (OSError, ValueError) as error:  # ValueError: closed
        raise _read_error(source, error) from None


def _end_of_lines(text: bytes, lines: int) -> int:
    """Where so many lines have ended."""
    end = 0
    for _ in range(lines):
        end = text.index(b"\n", end) + 1
    return end


def line_count(block: bytes) -> int:
    """How many lines a block has."""
    return block.count(b"\n") + (not block.endswith(b"\n"))


def _read_line(file: IO[bytes], source: str) -> bytes:
    try:
        return file.readline(MAX_LINE)
    except (OSError, ValueError) as error:  # ValueError: closed
        raise _read_error(source, error) from None


def _read_error(source: str, error: Exception) -> FileError:
    return FileError(f"{name_of(source)}: cannot read: {getattr(error, 'strerror', None) or error}")


def name_of(source: str) -> str:
    """What messages call a source of rows."""
    return "standard input" if source == "-" else source


def chunk_of(text: bytes, first: int, columns: CsvColumns, source: str) -> Iterator[Chunk]:
    """Rows of some text, whose first line has the number `first`; a malformed one is raised behind those before it."""
    import numpy as np

    index: list[int] = []
    parsed_rows: list[list[float]] = []
    problem: UsageError | None = None
    begin, number, is_tried = 0, first, False
    while begin < len(text):
        if columns.first_row_read and not is_tried:  # what the columns are is known: the rest in one go, if it is plain
            is_tried, values = True, columns.all_plain(text[begin:])
            if values is not None:
                rows_left = range(number, number + len(values))
                yield (
                    Chunk([*index, *rows_left], np.concatenate([parsed_rows, values]))
                    if parsed_rows
                    else Chunk(rows_left, values)
                )
                return
        end = text.find(b"\n", begin) + 1 or len(text)
        try:
            row = columns.row(text[begin:end], number)
        except UsageError as error:
            problem = error.within(f"{name_of(source)}: row {number}", row=number)
            break
        if row is not None:
            index.append(number)
            parsed_rows.append(row)
        begin, number = end, number + 1
    if parsed_rows:
        yield Chunk(index, np.array(parsed_rows))
    if problem is not None:
        raise problem


def _text_of(line: bytes, encoding: str) -> str:
    """A line's text. Raises UsageError for bytes that are none."""
    try:
        text = line.decode(encoding).strip()
    except UnicodeDecodeError:
        raise UsageError("this is no UTF-8 text") from None
    if "\0" in text:
        raise UsageError("this is no CSV of numbers: it holds a NUL byte")
    if len(line) >= MAX_LINE:
        raise UsageError(f"this is no CSV of numbers: a line has at most {MAX_LINE - 1:,} bytes")
    return text


def _split_cells(text: str) -> list[str]:
    """The cells of one line; quotes hold commas."""
    if '"' not in text:
        return [cell.strip() for cell in text.split(",")]
    try:
        if text.count('"') % 2 == 0:
            return [cell.strip() for cell in next(csv.reader([text], skipinitialspace=True))]
    except csv.Error:
        pass
    raise UsageError("this is no CSV of numbers: its quotes do not match; leave quotes out")
