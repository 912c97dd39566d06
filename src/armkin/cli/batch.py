"""Many poses at once: CSV in, CSV or JSON Lines out, chunk by chunk, in the order of the input."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import IO, TYPE_CHECKING, Any, NamedTuple, TypeVar

from armkin.cli import output
from armkin.cli.numbers import LARGEST, numbers
from armkin.cli.render import to_json
from armkin.errors import FileError, NoSolutionError, UsageError

if TYPE_CHECKING:
    from armkin.formula.arrays import Array

Answer = TypeVar("Answer", bound=Mapping[str, Any])

ROWS = 4096  # rows in memory at a time
LONGEST = 100_000  # characters of a line: what is longer is no CSV file
_PLAIN = b"0123456789+-.eE,\r\n \t"


class Chunk(NamedTuple):
    """Some rows: their numbers in the file, from 1, and their values (N, m)."""

    numbers: Sequence[int]
    values: Array


def one_row(values: Sequence[float]) -> Chunk:
    """A chunk of the one row that the command line gives."""
    import numpy as np

    return Chunk([1], np.array([values]))


def batch_rows(source: str, names: Sequence[str], what: str) -> Iterator[Chunk]:
    """Rows of a CSV file, or of standard input for "-", in chunks.

    names: what each column is, for messages and to recognise a heading; what: who wants them. Empty
    lines, comments (#) and a heading of names are skipped. A malformed row raises UsageError that names
    its number (from 1, as an editor counts lines), after the complete rows before it were given out.
    """
    first, empty = 1, True
    with _opened(source) as file:
        while lines := _lines(file, source):
            for chunk in _chunk(lines, first, names, what, source):
                empty = False
                yield chunk
            first += len(lines)
    if empty:
        raise UsageError(f"{_name(source)} is empty; it needs one row of {','.join(names)} per pose")


def streamed_rows(source: str, names: Sequence[str], what: str) -> Iterator[tuple[int, list[float]]]:
    """The same row by row, each as soon as it is there: its number and its values."""
    with _opened(source) as file:
        for number, line in enumerate(iter(lambda: file.readline(LONGEST), b""), 1):
            try:
                row = _row(line, number, names, what)
            except UsageError as error:
                raise error.within(f"{_name(source)}: row {number}", row=number) from None
            if row is not None:
                yield number, row


@dataclass
class Tally:
    """What a batch came to, for the warning and the exit code."""

    rows: int = 0
    outside: int = 0  # rows outside the limits
    unsolved: int = 0  # rows without a best branch
    first_outside: int = 0  # their row number
    first_unsolved: int = 0

    def add(self, number: int, answer: Mapping[str, Any]) -> None:
        """Count one answer."""
        self.rows += 1
        if answer.get("violations"):
            self.first_outside = self.first_outside or number
            self.outside += 1
        if "best" in answer and answer["best"] is None:
            self.first_unsolved = self.first_unsolved or number
            self.unsolved += 1

    def warn_of_limits(self) -> None:
        """Say how many rows are outside the limits."""
        if self.outside:
            first = f"the first is row {self.first_outside}"
            output.warn(f"{self.outside} of {self.rows} rows are outside the limits; {first}")

    def refuse_unsolved(self) -> None:
        """Raise NoSolutionError if rows have no best branch."""
        if self.unsolved:
            raise NoSolutionError(
                f"{self.unsolved} of {self.rows} rows have no branch within limits; "
                f"the first is row {self.first_unsolved}",
                rows=self.rows,
                unsolved=self.unsolved,
                row=self.first_unsolved,
            )


def run_batch(
    chunks: Iterable[Chunk],
    out: str | None,
    as_json: bool,
    answers: Callable[[Chunk], Iterable[Answer]],
    heading: Sequence[str],
    records: Callable[[int, Answer], Iterable[Sequence[Any]]],
) -> Tally:
    """Answer all chunks: each row's answer as a line of JSON, or its `records` as CSV under a `heading`."""
    tally = Tally()
    with output.destination(out) as write, output.progress("rows") as tick:
        for chunk in chunks:
            lines: list[str] = []
            if not as_json and not tally.rows:  # nothing is written before the first row is read
                lines.append(csv_line(heading))
            for number, answer in zip(chunk.numbers, answers(chunk), strict=True):
                tally.add(number, answer)
                lines += [to_json(answer)] if as_json else map(csv_line, records(number, answer))
            write("\n".join([*lines, ""]))
            tick(tally.rows)
    return tally


def csv_line(record: Iterable[Any]) -> str:
    """One line of CSV: numbers at full precision, text quoted where it holds a comma or a quote.

    >>> csv_line([1.5, "left, elbow up", True, None])
    '1.5,"left, elbow up",true,'
    """
    return ",".join([repr(value) if type(value) is float else _cell(value) for value in record])


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    text = str(value)
    if any(mark in text for mark in ',"\r\n'):
        return '"' + text.replace('"', '""') + '"'
    return text


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
    try:
        while len(lines) < ROWS and (line := file.readline(LONGEST)):
            lines.append(line)
            if len(line) >= LONGEST:  # no use in reading on
                break
        return lines
    except OSError as error:
        raise FileError(f"{_name(source)}: cannot read: {error.strerror or error}") from None


def _name(source: str) -> str:
    return "standard input" if source == "-" else source


def _chunk(lines: list[bytes], first: int, names: Sequence[str], what: str, source: str) -> Iterator[Chunk]:
    import numpy as np

    values = _all_plain(lines, len(names))
    if values is not None:
        yield Chunk(range(first, first + len(lines)), np.array(values).reshape(-1, len(names)))
        return
    index: list[int] = []
    good: list[list[float]] = []
    problem: UsageError | None = None
    for number, line in enumerate(lines, first):
        try:
            row = _row(line, number, names, what)
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


def _all_plain(lines: list[bytes], count: int) -> list[float] | None:
    """All numbers of lines that hold nothing but the right count of ordinary numbers: the fast way."""
    text = b"".join(lines)
    if len(lines[-1]) >= LONGEST or text.translate(None, _PLAIN):
        return None
    if any(line.count(b",") != count - 1 for line in lines):
        return None
    try:
        values = [float(cell) for line in lines for cell in line.split(b",")]
    except ValueError:
        return None
    return values if max(map(abs, values)) <= LARGEST else None


def _row(line: bytes, number: int, names: Sequence[str], what: str) -> list[float] | None:
    """One line with a closer look; None for a heading, a comment or an empty line."""
    try:
        text = line.decode("utf-8-sig" if number == 1 else "utf-8").strip()
    except UnicodeDecodeError:
        raise UsageError("this is no UTF-8 text") from None
    if len(line) >= LONGEST or "\0" in text:
        raise UsageError("this is no CSV of numbers")
    if not text or text.startswith("#"):
        return None
    cells = [_unquoted(cell.strip()) for cell in text.split(",")]
    if number == 1 and [cell.lower() for cell in cells] == [name.lower() for name in names]:
        return None
    if len(cells) == 1 and len(names) > 1:
        for separator in (";", "\t", " "):
            if len(text.split(separator)) == len(names):
                raise UsageError(f"separate the numbers with commas, not with {separator!r}")
    return numbers(cells, names, what)


def _unquoted(cell: str) -> str:
    """A quote on one side alone stays: what it quotes has a comma in it, and is no number."""
    return cell[1:-1].strip() if len(cell) >= 2 and cell[0] == cell[-1] == '"' else cell
