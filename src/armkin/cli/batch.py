"""Answers to many poses: CSV or JSON Lines, chunk by chunk, in the order of the input."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from armkin.cli import output
from armkin.cli.render import to_json
from armkin.cli.rows import Chunk
from armkin.errors import NoSolutionError

_MOST_TEXT = 1_000_000  # characters that are written at once
Answer = TypeVar("Answer", bound=Mapping[str, Any])


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
            length = 0
            for number, answer in zip(chunk.numbers, answers(chunk), strict=True):
                tally.add(number, answer)
                new = [to_json(answer)] if as_json else list(map(csv_line, records(number, answer)))
                lines += new
                length += sum(map(len, new))
                if length > _MOST_TEXT:
                    write("\n".join([*lines, ""]))
                    lines.clear()
                    length = 0
            if lines:
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
