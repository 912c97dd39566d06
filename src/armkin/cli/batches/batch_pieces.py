"""Pieces of a batch's input, read in order and parsed in the process that answers them."""

from __future__ import annotations

import copy
import hashlib
import os
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from armkin import files
from armkin.cli.parsing import csv_to_numbers
from armkin.cli.parsing.csv_to_numbers import CsvColumns
from armkin.cli.parsing.number_parsing import MAX_NUMBER
from armkin.cli.parsing.row_chunks import Chunk
from armkin.errors import ArmkinError, UsageError

if TYPE_CHECKING:
    from armkin.formula.arrays import Array


class Piece(NamedTuple):
    """Some rows: lines of text with their columns, or values (N, m).

    number: from 0; first: the first row's number, from 1; source: the input's name in messages.
    """

    number: int
    first: int
    source: str
    names: tuple[str, ...]
    lines: bytes = b""
    columns: CsvColumns | None = None
    values: Array | None = None

    def digest(self) -> str:
        """A digest that identifies the input."""
        content = self.lines if self.values is None else self.values.tobytes()
        return hashlib.sha256(content).hexdigest()


class InputRows:
    """The rows of a file, of standard input ("-") or of a list, in pieces."""

    def __init__(
        self,
        source: str | None,
        names: Sequence[str],
        purpose: str,
        named: Mapping[str, Sequence[float]] | None = None,
        values: Sequence[Sequence[float]] = (),
    ) -> None:
        """source: a name, or None for given values; the others: see `csv_to_numbers.CsvColumns`."""
        self.source, self.names, self.purpose = source, tuple(names), purpose
        self.named, self.values, self.has_heading = named, values, False
        if source is not None:
            files.protect_input(0 if source == "-" else source)  # before an output of that name is opened

    @property
    def size(self) -> int | None:
        """Size of the file [bytes]; None for other inputs."""
        return os.path.getsize(self.source) if self.source is not None and os.path.isfile(self.source) else None

    def count(self) -> int | None:
        """The number of rows, for the progress; None: unknown before reading."""
        if self.source is None:
            return len(self.values)
        text = not self.source.lower().endswith((".npz", ".parquet"))
        if not text or not os.path.isfile(self.source):
            return None
        with csv_to_numbers.open_source(self.source) as file:
            return sum(block.count(b"\n") for block in iter(lambda: file.read(1 << 20), b""))

    def __iter__(self) -> Iterator[Piece]:
        if self.source is None:
            import numpy as np

            return self._of_values([np.array(self.values)])
        if self.source != "-" and not self.source.lower().endswith((".npz", ".parquet", ".jsonl")):
            return self._of_text(self.source)
        from armkin.columns.input_columns import reader_of

        read = reader_of(self.source)
        if read is None:
            return self._of_text(self.source)
        return self._of_values(read(self.source, self.names, self.named is not None, csv_to_numbers.CHUNK_ROWS))

    def empty(self, skipped: int) -> ArmkinError:
        """The error of an input without rows."""
        reason = "has no row with values" if skipped or self.has_heading else "is empty"
        name = csv_to_numbers.name_of(self.source or "-")
        return UsageError(f"{name} {reason}; it needs one row of {','.join(self.names)} per pose")

    def _of_values(self, chunks: Any) -> Iterator[Piece]:
        first = 1
        for number, values in enumerate(chunks):
            yield Piece(number, first, csv_to_numbers.name_of(self.source or "-"), self.names, values=values)
            first += len(values)

    def _of_text(self, source: str) -> Iterator[Piece]:
        """The pieces of a CSV source, in blocks of lines; the first row with values is read for the heading."""
        learner = CsvColumns(self.names, self.purpose, self.named)  # reads the heading for all later pieces
        number, first = 0, 1
        with csv_to_numbers.open_source(source) as file:
            for block in csv_to_numbers.text_blocks(file, source):
                columns = copy.copy(learner)
                columns.skipped = 0
                yield Piece(
                    number=number,
                    first=first,
                    source=csv_to_numbers.name_of(source),
                    names=self.names,
                    lines=block,
                    columns=columns,
                )
                for i, line in enumerate([] if learner.first_row_read else block.split(b"\n"), first):
                    if learner.first_row_read:
                        break
                    try:
                        learner.row(line, i)
                    except UsageError:
                        break
                self.has_heading = bool(learner.heading)
                number, first = number + 1, first + csv_to_numbers.line_count(block)


def parse_piece(piece: Piece) -> Iterator[Chunk]:
    """The rows of a piece. Raises UsageError for a malformed one, after yielding those before it."""
    if piece.values is not None:
        yield from _finite_rows(piece, piece.values)
        return
    assert piece.columns is not None
    yield from csv_to_numbers.chunk_of(piece.lines, piece.first, piece.columns, piece.source)


def _finite_rows(piece: Piece, values: Array) -> Iterator[Chunk]:
    """Rows of finite numbers; rows without numbers are skipped."""
    import numpy as np

    first, is_nan = piece.first, np.isnan(values)
    keep = np.asarray(~is_nan.all(axis=1))
    invalid = np.argwhere(~(np.abs(values) <= MAX_NUMBER) & keep[:, None])
    end = int(invalid[0, 0]) if len(invalid) else len(values)
    present = np.flatnonzero(keep[:end])
    if len(present):
        is_whole = len(present) == len(values)
        yield (
            Chunk(range(first, first + end), values) if is_whole else Chunk((first + present).tolist(), values[present])
        )
    if len(invalid):
        row, column = invalid[0].tolist()
        value = values[row, column]
        large = f"{value:g} is too large; numbers here go up to {MAX_NUMBER:g}"
        reason = "a number is missing" if np.isnan(value) else large
        raise UsageError(f"{piece.source}: row {first + row}: {piece.names[column]}: {reason}", row=first + row)
