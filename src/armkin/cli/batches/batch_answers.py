"""Answers to many poses: columns or JSON Lines, chunk by chunk, in the order of the input."""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import IO, Any, NamedTuple, Protocol

from armkin import __version__, files
from armkin.cli.batches.batch_pieces import InputRows, Piece, parse_piece
from armkin.cli.parsing.row_chunks import Chunk
from armkin.cli.printing import output
from armkin.cli.printing.render import to_json
from armkin.columns.csv_cells import csv_line
from armkin.columns.finished_chunks import Parts
from armkin.columns.formats import CSV, Format, format_of
from armkin.columns.table import Table
from armkin.engines.ordered_chunks import Engine, in_order
from armkin.errors import ArmkinError, FileError, NoSolutionError, UnfinishedError, UsageError

_OBJECT_ROWS = 4096  # rows converted to objects at once, which take a hundred times the memory of numbers


class Questions(Protocol):
    """The questions of a command for each row of a batch; picklable."""

    unsolvable: bool  # whether a row that is not `good` has no answer; else it is outside the limits

    def table(self, chunk: Chunk) -> tuple[Table, Any]:
        """The columns of some rows, and which rows are good (N,)."""

    def objects(self, chunk: Chunk) -> Iterator[Mapping[str, Any]]:
        """An object a row, for JSON."""


@dataclass
class Tally:
    """Counts of a batch, for the warning and the exit code."""

    rows: int = 0
    bad: int = 0  # rows outside the limits, or without a best branch
    first_bad: int = 0  # the number of the first of them
    skipped: int = 0  # rows without values

    def add(self, chunk_tally: Tally) -> None:
        """Add the counts of a chunk."""
        firsts = [first for first in (self.first_bad, chunk_tally.first_bad) if first]
        self.first_bad = min(firsts, default=0)
        self.rows, self.bad, self.skipped = (
            self.rows + chunk_tally.rows,
            self.bad + chunk_tally.bad,
            self.skipped + chunk_tally.skipped,
        )

    def conclude(self, unsolvable: bool, outside: str = "the limits") -> None:
        """Warn of rows outside the limits; raise NoSolutionError for rows without a best branch.

        outside: in words, what else rows are outside of.
        """
        if not self.bad:
            return
        first_text = f"the first is row {self.first_bad}"
        if not unsolvable:
            output.warn(f"{self.bad} of {self.rows} rows are outside {outside}; {first_text}")
            return
        raise NoSolutionError(
            f"{self.bad} of {self.rows} rows have no branch within limits; {first_text}",
            rows=self.rows,
            unsolved=self.bad,
            row=self.first_bad,
        )


class Job(NamedTuple):
    """Questions, and the form of their answers."""

    questions: Questions
    as_json: bool
    format: str  # ending of the output's name
    compiled: bool = False  # machine code prints the rows
    parts: Parts | None = None  # where a process of the pool stores finished pieces instead of returning them


class Done(NamedTuple):
    """A finished piece: its bytes and counts."""

    number: int
    input: str
    data: bytes
    heading: list[str]
    tally: Tally
    problem: ArmkinError | None = None  # a malformed row behind those that were answered
    near: list[float] | None = None  # joint values at the end, for questions that depend on the row before
    stored: bool = False  # whether the bytes are stored in a part already

    def record(self) -> dict[str, Any]:
        """The fields that are stored beside the bytes."""
        return {"input": self.input, "heading": self.heading, "near": self.near, **asdict(self.tally)}


def _well_formed(piece: Piece, malformed: list[UsageError]) -> Iterator[Chunk]:
    """The rows of a piece up to a malformed one, whose error is appended to `malformed`."""
    try:
        yield from parse_piece(piece)
    except UsageError as error:
        malformed.append(error)


def _table_encoder(job: Job) -> Callable[[Table], bytes]:
    """The function that encodes a table."""
    file_format = format_of(f"x{job.format}")
    if not (job.compiled and file_format.is_text):
        return file_format.encoded
    from armkin.compiled.table_lines import table_lines

    return partial(file_format.encoded, lines=table_lines)


def answer_piece(job: Job, piece: Piece) -> Done:
    """Answer one piece of the input; a pure function that may run in any process."""
    tally, encoded_parts, heading = Tally(), list[bytes](), list[str]()
    encoded, malformed = _table_encoder(job), list[UsageError]()
    for chunk in _well_formed(piece, malformed):
        if job.as_json:
            encoded_parts.append(_json_lines(job.questions, chunk, tally))
        else:
            table, has_best = job.questions.table(chunk)
            heading = list(table)
            _count_bad_rows(tally, chunk, has_best)
            encoded_parts.append(encoded(table))
    problem = malformed[0] if malformed else None
    if piece.columns is not None:
        tally.skipped = piece.columns.skipped
    elif piece.values is not None and problem is None:
        tally.skipped = len(piece.values) - tally.rows
    near = getattr(job.questions, "near", None)
    finished = Done(
        number=piece.number,
        input=piece.digest(),
        data=b"".join(encoded_parts),
        heading=heading,
        tally=tally,
        problem=problem,
        near=near,
    )
    if job.parts is None or problem is not None:
        return finished
    job.parts.keep(finished.number, finished.record(), finished.data)
    return finished._replace(data=b"", stored=True)


def _json_lines(questions: Questions, chunk: Chunk, tally: Tally) -> bytes:
    """A chunk's answers as JSON Lines."""
    lines = []
    for start in range(0, len(chunk.values), _OBJECT_ROWS):
        span = slice(start, start + _OBJECT_ROWS)
        part = Chunk(chunk.numbers[span], chunk.values[span])
        for number, answer in zip(part.numbers, questions.objects(part), strict=True):
            is_bad = (
                answer["best"] is None
                if questions.unsolvable
                else bool(answer["violations"] or answer.get("outside_travel"))
            )
            tally.add(Tally(1, int(is_bad), number if is_bad else 0))
            lines.append(to_json(answer))
    return "\n".join([*lines, ""]).encode()


def _count_bad_rows(tally: Tally, chunk: Chunk, has_best: Any) -> None:
    bad_rows = (~has_best).nonzero()[0]
    tally.add(Tally(len(has_best), len(bad_rows), int(chunk.numbers[int(bad_rows[0])]) if len(bad_rows) else 0))


@dataclass
class BatchRun:
    """A batch of questions and where its answers go."""

    questions: Questions
    out: str | None
    as_json: bool
    workers: int
    cluster: str | None
    resume: bool
    settings: Mapping[str, Any]  # settings that change the bytes, checked by --resume

    @property
    def compiled(self) -> bool:
        """Whether machine code may be used."""
        return bool(self.settings.get("compiled"))

    @property
    def engine(self) -> Engine:
        """The engine for the work."""
        return Engine(self.workers, self.cluster)

    def run(self, pieces: InputRows) -> Tally:
        """Answer all pieces."""
        to_file = self.out is not None and self.out != "-"
        file_format = format_of(self.out if to_file else None)
        if self.as_json and not file_format.is_text:
            raise UsageError(f"--json and --out {self.out}: JSON is text; leave one away, or end the name with .jsonl")
        if self.resume and not to_file:
            raise UsageError("--resume goes on with --out FILE; give the file")
        if (
            to_file
            and file_format is CSV
            and not self.as_json
            and Path(str(self.out)).suffix.lower() not in ("", ".csv")
        ):
            output.note(
                f"{self.out}: rows are written as CSV; a name that ends in .npz, .parquet or .jsonl says otherwise"
            )
        ending = "" if file_format.name == "csv" else f".{file_format.name}"
        job = Job(self.questions, self.as_json, ending, self.compiled)
        tally = Tally()
        if to_file and _is_file(str(self.out)):
            _ToFile(self, file_format, job, tally, pieces.size).run(pieces)
        else:
            self._stream(file_format, job, pieces, tally)
        if tally.skipped:
            names = ",".join(pieces.names)
            output.warn(f"{tally.skipped} row{'s' * (tally.skipped > 1)} without {names} skipped")
        return tally

    def _stream(self, file_format: Format, job: Job, pieces: InputRows, tally: Tally) -> None:
        """Write to a pipe piece by piece, or a binary format at the end."""
        binary_parts: list[bytes] = []
        with _binary_writer(self.out) as write, output.progress("rows", pieces.count) as tick:
            for finished in in_order(self.engine, answer_piece, job, pieces):
                if file_format.is_text:
                    write(_heading_bytes(finished, job, file_format, tally) + finished.data)
                elif finished.tally.rows:
                    binary_parts.append(finished.data)
                tally.add(finished.tally)
                tick(tally.rows)
                if finished.problem is not None:
                    raise finished.problem
            if not tally.rows:
                raise pieces.empty(tally.skipped)
            if binary_parts:
                stream = io.BytesIO()
                file_format.write_parts(stream, lambda: map(io.BytesIO, binary_parts))
                write(stream.getvalue())


def _heading_bytes(finished: Done, job: Job, file_format: Format, tally: Tally) -> bytes:
    """The heading of a CSV, before its first rows."""
    lacks_heading = file_format.name == "csv" and not job.as_json and finished.tally.rows and not tally.rows
    return (csv_line(finished.heading) + "\n").encode() if lacks_heading else b""


def _is_file(path: str) -> bool:
    """Whether a name is that of a regular file, or of none yet: what is no pipe and no device."""
    return os.path.isfile(path) or not os.path.exists(path)


@contextmanager
def _binary_writer(out: str | None) -> Iterator[Callable[[bytes], object]]:
    if out is None or out == "-":
        with output.destination(out) as write:
            yield lambda encoded: write(encoded.decode())
        return

    with files.write_whole(out, "wb") as file:
        yield file.write


class _ToFile:
    """A batch whose answers become a file: more than one piece keep their answers beside it until all are there."""

    def __init__(self, batch: BatchRun, file_format: Format, job: Job, tally: Tally, size: int | None) -> None:
        self.batch, self.format = batch, file_format
        self.job, self.tally = job, tally
        self.path = str(batch.out)
        files.check_writable(self.path)
        identity = {"armkin": __version__, "format": file_format.name, "json": batch.as_json, "input size": size}
        self.parts = Parts(self.path, {**batch.settings, **identity})
        self.first: Done | None = None  # the only piece so far: it may be the last
        self.count = 0

    def run(self, pieces: InputRows) -> None:
        """Answer what is missing, and make the file."""
        if not self.batch.resume:
            self.parts.refuse_begun()
        pool = self.batch.engine.uses_pool
        if pool or self.parts.is_begun:
            self.parts.begin()
        job = self.job._replace(parts=self.parts) if pool else self.job
        try:
            with output.progress("rows", pieces.count) as tick:
                for finished in in_order(self.batch.engine, answer_piece, job, self._missing_pieces(pieces)):
                    self._keep_piece(finished)
                    tick(self.tally.rows)
            if not self.tally.rows:
                raise pieces.empty(self.tally.skipped)
            self._write_file()
        except BaseException as error:
            of_no_use = isinstance(error, UsageError) or not self.parts.has_any
            if of_no_use and not self.batch.resume and self.parts.is_held:
                self.parts.remove()
            raise
        finally:
            self.parts.leave()

    def _missing_pieces(self, pieces: Iterable[Piece]) -> Iterator[Piece]:
        """The pieces that no earlier run has finished; those that one has are counted."""
        for piece in pieces:
            self.count = piece.number + 1
            piece_record = self.parts.record_of(piece.number) if self.parts.is_held and self.batch.resume else None
            if piece_record is None:
                yield piece
                continue
            if piece_record["input"] != piece.digest():
                raise UsageError(
                    f"the input has changed since {self.path}.parts was begun; "
                    f"give it as it was, or remove {self.parts.folder}",
                    file=self.path,
                )
            self.tally.add(Tally(*(piece_record[name] for name in ("rows", "bad", "first_bad", "skipped"))))
            if piece_record["near"] is not None:
                self.job.questions.near = piece_record["near"]  # type: ignore[attr-defined]

    def _keep_piece(self, finished: Done) -> None:
        """Count a finished piece and keep its answers: the first in memory, from the second on all on disk."""
        if finished.problem is not None:
            raise finished.problem
        if self.first is None and finished.number == 0 and not self.parts.is_held:
            self.first = finished
        elif not finished.stored:
            if not self.parts.is_held:
                self.parts.begin()
                assert self.first is not None
                self.parts.keep(0, self.first.record(), self.first.data)
            self.parts.keep(finished.number, finished.record(), finished.data)
        self.tally.add(finished.tally)

    def _write_file(self) -> None:
        held = self.parts.is_held
        try:
            with files.write_whole(self.path, "wb") as file:
                self._put_parts(file)
        except FileError as error:
            if held:
                raise UnfinishedError(
                    f"{error.message}; what is finished stays in {self.path}.parts",
                    file=self.path,
                    parts=str(self.parts.folder),
                ) from None
            raise
        if held:
            self.parts.remove()

    def _put_parts(self, file: IO[bytes]) -> None:
        """Write the heading, if the format has one, and the answers of all pieces to a file."""
        if self.parts.is_held:
            headings = (
                piece_record["heading"]
                for i in range(self.count)
                if (piece_record := self.parts.record_of(i)) is not None
            )
            heading: list[str] = next((names for names in headings if names), [])
        else:
            assert self.first is not None
            heading = self.first.heading
        if self.format.name == "csv" and not self.job.as_json:
            file.write((csv_line(heading) + "\n").encode())
        first = self.first
        if self.parts.is_held or first is None:
            self.format.write_parts(file, lambda: self.parts.open_parts(self.count))
        else:
            self.format.write_parts(file, lambda: [io.BytesIO(first.data)])
