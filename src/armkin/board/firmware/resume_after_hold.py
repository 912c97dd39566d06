"""Resumes a motion after a feed hold: reads its note, finds the arm's place on the plan, and plans the remainder.

The plan is computed again from the same start. The note is a small file beside the port's lock. It identifies the plan
by digests of the robot file and the plan and the counts at its beginning, and has the counts where the arm stopped.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from types import TracebackType
from typing import TYPE_CHECKING, Self

import numpy as np

from armkin.board.backend import StoppedError
from armkin.board.firmware.segments.remaining_plan import PlanPlace, places_on, remaining_trajectory
from armkin.board.firmware.segments.trajectory_to_counts import Cut
from armkin.board.ports import note_path, read_note, remove_note, write_note
from armkin.errors import HeldError, LinkError, NothingHeldError

if TYPE_CHECKING:
    from armkin.board.firmware.firmware_machine import FirmwareMachine

_TIME_ERROR = 1.0  # greatest error [s] of the noted time; of all places within it, the earliest is taken
_NOTE_PERIOD = 0.5  # time [s] between two notes while the arm moves
_MAX_BYTES = 65_536  # size [bytes], at most, of a note


@dataclass(frozen=True)
class MotionNote:
    """A motion that is in progress or held."""

    robot: str  # the robot file's SHA-256
    plan: str  # digest of the plan
    start: list[int]  # counts where it began
    seconds: float  # seconds of the plan that were done, approximately
    stands: list[int] | None = None  # counts where it came to rest; None: not reported before the sender ended


def plan_digest(parts: Sequence[Cut]) -> str:
    """A digest of a plan's ends, duration and sampled path, at the resolution of a board."""
    hasher = hashlib.sha256()
    for part in parts:
        q = part.trajectory.q(np.linspace(0.0, part.duration, 33))
        hasher.update(repr((part.start.tolist(), part.ends.tolist(), round(part.duration, 3))).encode())
        hasher.update(np.rint(q * 1e4).astype(np.int64).tobytes())
    return hasher.hexdigest()


class MotionNoteWriter:
    """Writes the note of a motion while it is carried out, and deletes it on arrival.

    started: the note of the motion that is resumed, and the seconds of it that were done.
    """

    def __init__(
        self, machine: FirmwareMachine, parts: Sequence[Cut], begun_note: tuple[MotionNote, float] | None = None
    ) -> None:
        self._machine, self._file = machine, note_path(machine.port.name)
        self._keeps_note = not machine.port.simulated
        start = parts[0].start.tolist() if parts else list(machine.counts())
        self._note, self._seconds_before = begun_note or (
            MotionNote(machine.arm.sha256, plan_digest(parts), start, 0.0),
            0.0,
        )
        self._note = replace(self._note, seconds=self._seconds_before, stands=None)

    def __enter__(self) -> Self:
        if self._keeps_note:
            write_note(self._file, asdict(self._note))
        return self

    def progress(self, seconds: float) -> None:
        """Record the seconds done of the remaining motion."""
        elapsed = self._seconds_before + seconds
        if elapsed - self._note.seconds >= _NOTE_PERIOD:
            self._note = replace(self._note, seconds=elapsed)
            if self._keeps_note:
                write_note(self._file, asdict(self._note))

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        if not self._keeps_note:
            return
        if isinstance(error, StoppedError) and error.status is not None:
            self._machine.status = error.status
        is_known = self._machine.position() != "lost"
        if kind is None or not is_known:
            remove_note(self._file)
        elif isinstance(error, HeldError | StoppedError):
            write_note(self._file, asdict(replace(self._note, stands=list(self._machine.counts()))))
            self._machine.resumable = True
            if isinstance(error, HeldError):
                error.fields["resumable"] = True


@contextmanager
def under_way(
    machine: FirmwareMachine, cuts: Sequence[Cut], note: MotionNote | None
) -> Iterator[tuple[Sequence[Cut], int, Callable[[float], None]]]:
    """The parts to carry out, the number of the first of them, and a function that takes the seconds done.

    note: of the motion that is resumed; None: carry out all parts.
    """
    place = None if note is None else find_place(machine, note, cuts)
    remaining = cuts if place is None else remaining_parts(machine, cuts, place)
    begun_note = None if note is None or place is None else (note, place.elapsed)
    with MotionNoteWriter(machine, cuts, begun_note) as writer:
        yield remaining, 0 if place is None else place.part, writer.progress


def recall_note(machine: FirmwareMachine) -> MotionNote:
    """The note of the motion that was held on this machine.

    Raises NothingHeldError if there is none, or it is of another robot file; LinkError if the arm has moved since.
    """
    note = _read_held_note(note_path(machine.port.name))
    if note is None or len(note.start) != len(machine.counts()):
        raise NothingHeldError(f"no motion was held on {machine.port.name}: there is nothing to go on with")
    if note.robot != machine.arm.sha256:
        raise NothingHeldError(f"{machine.arm.path} is not the robot file of the motion that was held, or has changed")
    if note.stands is not None and note.stands != list(machine.counts()):
        raise LinkError(
            f"the arm has moved since its motion was held: it stands at {list(machine.counts())} counts instead of "
            f"{note.stands}",
            advice="plan a new motion: it starts where the arm stands",
        )
    return note


def find_place(machine: FirmwareMachine, note: MotionNote, parts: Sequence[Cut]) -> PlanPlace:
    """The arm's place on the plan, which was computed again.

    Raises NothingHeldError if it is another plan, LinkError if the arm does not stand on it.
    """
    if plan_digest(parts) != note.plan:
        raise NothingHeldError("this is another motion than the one that was held")
    places = list(places_on(parts, np.array(machine.counts())))
    if not places:
        raise LinkError(
            f"the arm does not stand on the motion that was held: {machine.describe()}",
            advice="plan a new motion: it starts where the arm stands",
        )
    nearest = min(abs(place.elapsed - note.seconds) for place in places)
    return next(place for place in places if abs(place.elapsed - note.seconds) <= nearest + _TIME_ERROR)


def remaining_parts(machine: FirmwareMachine, parts: Sequence[Cut], place: PlanPlace) -> list[Cut]:
    """The parts from a place on: the first one starts at the arm's position, the others are unchanged."""
    trajectory = remaining_trajectory(parts[place.part], place, machine.joints())
    counts = np.array(machine.counts(), dtype=np.int64)
    return [machine.plan_trajectory(trajectory, counts), *parts[place.part + 1 :]]


def _read_held_note(path: str) -> MotionNote | None:
    """The note in a file, or None if it is missing or not valid."""
    fields = read_note(path, _MAX_BYTES)
    if fields is None:
        return None
    try:
        start, stands = fields["start"], fields["stands"]
        counts = [start] if stands is None else [start, stands]
        if not all(type(x) is int for row in counts for x in row) or len(counts[-1]) != len(start):
            return None
        return MotionNote(str(fields["robot"]), str(fields["plan"]), start, float(fields["seconds"]), stands)
    except (ValueError, KeyError, TypeError):
        return None
