"""The position of an arm on GRBL, and whether it can be trusted.

GRBL counts steps from its last reset, and obeys every program. A record beside the port's lock has the arm's position
and all offsets of GRBL; the position is trusted while none of these differ. A mark in the volatile offset G92, which a
reset clears, shows whether GRBL was reset since.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armkin.board.backend.motion_start import why_impossible
from armkin.board.backend.position_record import Record
from armkin.errors import LinkError

if TYPE_CHECKING:
    from armkin.board.grbl.grbl_session import Session
    from armkin.board.grbl.replies import Report
    from armkin.board.grbl.settings import Axis
    from armkin.model.arm import Arm

MARK_OFFSET = 1000  # smallest mark [units] in G92; a random part makes it unique, and 0 means a reset
Kept = dict[str, list[float] | str]
_LASTING_OFFSETS = "G54", "G55", "G56", "G57", "G58", "G59"  # offsets that outlive a reset


class BelievedPosition:
    """The arm's position on the GRBL of a session, as last read."""

    def __init__(self, session: Session, arm: Arm, axes: Sequence[Axis]) -> None:
        self._session, self._arm, self._axes = session, arm, axes
        self.record = Record(session.port, arm)
        self.loss_reason = "it was not read"  # why the position is lost; empty: it is known
        self.offset: NDArray[np.int64] = np.zeros(len(axes), dtype=np.int64)  # machine steps less counts
        self._steps = self.offset
        self._offsets_left: Kept = {}

    def counts(self) -> tuple[int, ...]:
        """Counts of the arm's motors, which are meaningless while the position is lost."""
        machine_steps = self._steps if self._session.report is None else self._machine_steps(self._session.report)
        return tuple(int(n) for n in machine_steps - self.offset)

    def read(self) -> None:
        """Read the position, which is known if GRBL's offsets are those that armkin left."""
        status = self._session.sure_status()
        self._session.demand_rest(status)
        if status.position is None:
            self.loss_reason = "GRBL reports no machine position: armkin setup writes $10, which asks for it"
            return
        if max(axis.index for axis in self._axes) >= len(status.position):
            letter = self._axes[-1].letter
            raise LinkError(f"GRBL has {len(status.position)} axes; {self._arm.name} needs {letter}, too")
        motion = self._read_offsets()
        reason, note = self.record.differs(self._offsets_left), self.record.note
        if status.state == "Alarm":
            reason = "GRBL is in an alarm"
        elif reason is None and note is not None:
            self.offset = np.asarray(note.offset, dtype=np.int64)
            counts = self.counts()
            reason = self.record.moved_text(counts) or why_impossible(self._arm, counts)
            if reason is None and note.plan is not None and list(counts) != note.counts and motion != "G1":
                reason = "GRBL was reset in a motion, or another program has spoken to it there"
        self.loss_reason = reason or ""

    def vouch(self, counts: NDArray[np.int64]) -> None:
        """Accept the operator's statement of the motors' counts: set the mark, and record GRBL's offsets."""
        self._session.ask("G21G54G49")
        steps = self._machine_steps(self._session.sure_status())
        mark = MARK_OFFSET + random.randrange(MARK_OFFSET)
        self._read_offsets()
        values = zip(steps, self._axes, np.asarray(self._offsets_left["G54"], dtype=float), strict=True)
        words = [f"{axis.letter}{n / axis.steps - g54 - mark:.5f}" for n, axis, g54 in values]
        self._session.ask(f"G92{''.join(words)}")
        self._read_offsets()
        if (
            any(abs(float(value) - mark) > 0.01 for value in self._offsets_left["G92"])
            or self._offsets_left["system"] != "G54"
        ):
            raise LinkError("GRBL did not take the mark that tells its resets: was a line damaged on its way?")
        self.offset, self.loss_reason = steps - counts, why_impossible(self._arm, counts.tolist()) or ""
        self.record.write_position(self._offsets_left, counts.tolist(), self.offset.tolist())

    def record_arrival(self) -> None:
        """Record the position that was read last, at rest."""
        self.record.write_position(self._offsets_left, self.counts(), self.offset.tolist())

    def after_reset(self, counts: Sequence[int], reason: str) -> None:
        """Set the mark again after a reset at rest, if the offsets that outlive a reset are unchanged.

        reason: why the position was lost before; empty: it was known.
        """
        if not reason:
            self._read_offsets()
            note = self.record.note
            if note is None or any(note.marks.get(name) != self._offsets_left[name] for name in _LASTING_OFFSETS):
                reason = "another program has set an offset while the arm moved"
        if reason:
            self.forget(reason)
        else:
            self.vouch(np.asarray(counts, dtype=np.int64))

    def forget(self, reason: str) -> None:
        """Mark the position as lost, and delete the record."""
        self.loss_reason = reason
        self.record.forget()

    def _read_offsets(self) -> str:
        """Read GRBL's offsets for the arm's axes, and return the active motion mode."""
        offsets, words = self._session.stable_offsets()
        indices = [axis.index for axis in self._axes]
        own_offsets: Kept = {
            name: list(values) if name == "TLO" else [values[k] for k in indices if k < len(values)]
            for name, values in offsets.items()
        }
        systems = (word for word in words if word.partition(".")[0] in _LASTING_OFFSETS)
        scale_words = (word for word in words if word.startswith("G51"))
        self._offsets_left = {**own_offsets, "system": next(systems, "none"), "scale": next(scale_words, "G50")}
        return words[0]

    def _machine_steps(self, report: Report) -> NDArray[np.int64]:
        """GRBL's machine position in steps, from its report."""
        if report.position is not None:
            values = [report.position[axis.index] * axis.steps for axis in self._axes]
            self._steps = np.rint(values).astype(np.int64)
        return self._steps
