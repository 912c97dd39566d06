"""A record, beside the port's lock, of the state in which armkin left a board that other programs use, too.

Such a board (GRBL, Klipper) obeys every program and does not say which one moved it. Its position counts as known only
while its settings and position are those that armkin left, or while it stands on the path of armkin's motion. The
record outlives the process. Marks that a reset clears show whether the board was reset since.
"""

from __future__ import annotations

import base64
import hashlib
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from armkin.board.backend.sent_positions import piece_times
from armkin.board.ports import read_note, record_path, remove_note, write_note
from armkin.motors import pulses

if TYPE_CHECKING:
    from armkin.board.backend.sent_positions import Job
    from armkin.board.ports import Port
    from armkin.model.arm import Arm

Marks = Mapping[str, Sequence[float] | str]  # values that a board keeps, by name
_MAX_BYTES = 64_000_000  # largest size [bytes] of a record and of its plan
_PLAN_DISTANCE = 1.0 + 1e-9  # largest distance [counts] of each motor from a plan that the arm is on


@dataclass(frozen=True)
class BoardNote:
    """The state in which a board was left."""

    arm: str  # digest of the conversion from counts to joint values
    marks: dict[str, list[float] | str]
    offset: list[int]  # the board's own steps at which the arm's counts are 0
    counts: list[int]  # position of the arm, or the start of its motion
    plan: NDArray[np.int64] | None = None  # (points, motors) [counts] corners of the motion in progress


class Record:
    """The record of one arm on one port; that of a simulated board is not written to a file."""

    def __init__(self, port: Port, arm: Arm) -> None:
        self._path = None if port.simulated else record_path(port.name)
        self._arm = arm
        self.note = None if self._path is None else _read_record(self._path)

    def write_position(self, marks: Marks, counts: Sequence[int], offset: Sequence[int]) -> None:
        """Record the arm's position, reached by armkin or stated by the operator."""
        marks_copy = {name: value if isinstance(value, str) else list(value) for name, value in marks.items()}
        self._write(BoardNote(_arm_digest(self._arm), marks_copy, list(map(int, offset)), list(map(int, counts))))

    def write_motion(self, job: Job, piece: float) -> None:
        """Record that a motion begins, whose curves are sent in pieces of `piece` seconds."""
        assert self.note is not None
        note = self.note
        self._write(BoardNote(note.arm, note.marks, note.offset, job.start.tolist(), path_corners(job, piece)))

    def forget(self) -> None:
        """Delete the record: the position is unknown."""
        self.note = None
        if self._path is not None:
            remove_note(self._path)

    def differs(self, marks: Marks) -> str | None:
        """How the board's values differ from those that armkin left, in words; None: they do not."""
        cause = "the board was reset, or another program has set it"
        note = self.note
        if note is None:
            return "nobody has told armkin on this computer where it stands"
        if note.arm != _arm_digest(self._arm) or len(note.offset) != len(self._arm.motor_gain):
            return "the robot file's drives or home pose are others than when it was told"
        for name in sorted({*marks, *note.marks}):
            value, value_left = _comparable_value(marks.get(name)), _comparable_value(note.marks.get(name))
            if value != value_left:
                return f"{name} is {_value_text(value)}, and armkin left {_value_text(value_left)}: {cause}"
        return None

    def moved_text(self, counts: Sequence[int]) -> str | None:
        """How the arm's position differs from where armkin left it, in words; None: it does not."""
        note = self.note
        assert note is not None
        present = np.asarray(counts, dtype=np.int64)
        if present.tolist() == note.counts or (note.plan is not None and is_on_path(note.plan, present)):
            return None
        last_place = (
            f"at {note.counts}" if note.plan is None else f"on a motion from {note.counts} to {note.plan[-1].tolist()}"
        )
        return f"it stands at {present.tolist()} steps, and armkin left it {last_place}: another program has moved it"

    def _write(self, note: BoardNote) -> None:
        self.note = note
        if self._path is not None:
            plan = None if note.plan is None else _pack_plan(note.plan)
            record = {"arm": note.arm, "marks": note.marks, "offset": note.offset, "counts": note.counts, "plan": plan}
            write_note(self._path, record)


def path_corners(job: Job, piece: float) -> NDArray[np.int64]:
    """Corners (points, motors) [counts] of a job that is sent in pieces of `piece` seconds, see `piece_times`."""
    arm, points = job.trajectory.arm, [np.asarray(job.start, dtype=np.int64)[None]]
    for stretch in job.trajectory.stretches:
        points.append(pulses(arm, stretch.evaluate(piece_times(stretch, piece))))
    return np.concatenate(points)


def is_on_path(points: NDArray[np.int64], counts: NDArray[np.int64]) -> bool:
    """Whether every motor is within one step of some point of the lines between corners (points, motors).

    >>> corners = np.array([[0, 0], [10, 5]])
    >>> is_on_path(corners, np.array([4, 3])), is_on_path(corners, np.array([4, 5]))
    (True, False)
    """
    if len(points) == 1:
        return bool(np.abs(counts - points[0]).max(initial=0) <= _PLAN_DISTANCE)
    line, offset = np.diff(points, axis=0), counts - points[:-1]
    with np.errstate(divide="ignore"):
        # shares of each line between which a motor is near it
        ends = np.stack([(offset - _PLAN_DISTANCE) / line, (offset + _PLAN_DISTANCE) / line])
    first, last = ends.min(axis=0).max(axis=1, initial=0.0), ends.max(axis=0).min(axis=1, initial=1.0)
    return bool((first <= last).any())


def _arm_digest(arm: Arm) -> str:
    parts = arm.motor_gain, arm.home, arm.motor_bias
    return hashlib.sha256(repr([np.round(part, 9).tolist() for part in parts]).encode()).hexdigest()[:16]


def _comparable_value(value: Sequence[float] | str | None) -> list[float] | str | None:
    return value if value is None or isinstance(value, str) else [x + 0.0 for x in value]


def _value_text(value: list[float] | str | None) -> str:
    if value is None:
        return "not told"
    return value if isinstance(value, str) else " ".join(f"{x:.10g}" for x in value)


def _pack_plan(plan: NDArray[np.int64]) -> str:
    rows = np.diff(plan, axis=0, prepend=np.zeros_like(plan[:1])).astype("<i8")
    return base64.b64encode(zlib.compress(rows.tobytes())).decode()


def _unpack_plan(text: str, motors: int) -> NDArray[np.int64]:
    raw = zlib.decompressobj().decompress(base64.b64decode(text), _MAX_BYTES)
    rows = np.frombuffer(raw, dtype="<i8").reshape(-1, motors)
    if not len(rows):
        raise ValueError(text)
    return np.cumsum(rows, axis=0).astype(np.int64)


def _read_record(path: str) -> BoardNote | None:
    """The note in a record file, or None if it is not valid."""
    record = read_note(path, _MAX_BYTES)
    if record is None:
        return None
    try:
        offset, counts, plan = record["offset"], record["counts"], record["plan"]
        if not all(type(x) is int for x in (*offset, *counts)) or len(offset) != len(counts):
            return None
        marks: dict[str, Any] = {
            name: value if isinstance(value, str) else [float(x) for x in value]
            for name, value in record["marks"].items()
        }
        rows = None if plan is None else _unpack_plan(plan, len(counts))
        return BoardNote(str(record["arm"]), marks, offset, counts, rows)
    except (ValueError, KeyError, TypeError, AttributeError, zlib.error):
        return None
