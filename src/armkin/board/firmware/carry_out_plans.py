"""Plans carried out on the board, one after another; what is left of a motion whose queue ran dry follows."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain, islice
from typing import TYPE_CHECKING

from armkin.board.firmware.segments.remaining_plan import left_of
from armkin.board.firmware.streaming import MAX_LEAD, NOISY_LEAD, motion_batches, ramp_pieces, seconds_of, stream_frames
from armkin.board.firmware.wire import protocol
from armkin.board.firmware.wire.motion_frame import MotionFrame
from armkin.board.firmware.wire.protocol import Error, Status
from armkin.board.firmware.wire.reply_checks import DeviceError

if TYPE_CHECKING:
    from armkin.board.backend import Progress
    from armkin.board.firmware.segments.counts_to_segments import Counts, Move
    from armkin.board.firmware.segments.trajectory_to_counts import Cut
    from armkin.board.firmware.wire.session import Session
    from armkin.motion.timing.trajectory import Trajectory

    Lay = Callable[[Trajectory, Counts], Cut]

_BEGINNING_TIME, _STAND_TIME = 0.7, 1.0  # lengths [s] of a motion's beginning and of a stand in it that ends by itself


class _UnderWay:
    """The moves of which the board may still do a part, in order."""

    def __init__(self) -> None:
        self._moves: deque[tuple[int, float, Cut, int]] = deque()  # frames before each, seconds, its plan, its number

    def add(self, frames: int, seconds: float, plan: Cut, number: int, taken: int) -> None:
        """Add a move of a plan behind so many frames, the plan behind so many seconds.

        taken: frames that the board took; of moves before the last such frame's nothing is left.
        """
        self._moves.append((frames, seconds, plan, number))
        self._forget_finished(taken)

    def _forget_finished(self, taken: int) -> None:
        while len(self._moves) > 1 and self._moves[1][0] < taken:
            self._moves.popleft()

    def remaining_plan(
        self, session: Session, axes: Sequence[int], lay: Lay, *, first: bool
    ) -> tuple[Sequence[Cut], float] | None:
        """What is left for an arm whose queue ran dry, and the seconds done; None unless in a move's beginning.

        first: whether it may be the first move of all. None, too, if somebody may have come near the arm since.
        """
        if not self._moves:
            return None
        began, status = session.port.now(), _at_rest(session)
        self._forget_finished(session.taken)
        frames, seconds, plan, number = self._moves[0]
        if not all(status.known >> axis & 1 for axis in axes) or (frames == 0 and not first):
            return None
        plans = [plan, *(plan for *_, plan, k in islice(self._moves, 1, None) if k == 0)]
        left = left_of(plans, number, [status.counts[axis] for axis in axes], lay)
        stood = session.deaf + session.port.now() - began
        if left is None or left[1].seconds > _BEGINNING_TIME or stood > _STAND_TIME:
            return None
        return left[0], seconds + left[1].elapsed


def carry_out(
    session: Session, plans: Iterable[Cut | None], axes: Sequence[int], progress: Progress, lay: Lay
) -> tuple[Status, Counts | None]:
    """Carry out plans, one after another; None in between: nothing to do yet.

    axes: the motors' on the board. lay: a trajectory from counts as a plan for this board.
    Returns the status at rest, and where the last plan ends. Raises DeviceError if the board ends the session. If the
    queue runs dry in a move's beginning, as a busy computer or a bad line did not fill it in time, what is left
    follows, with more time to fill the queue: unless the arm stood for so long that somebody may be near.
    """
    run = _Run(session, axes, progress)
    least, plans_left = 0.0, iter(plans)
    while True:
        session.attend()
        try:
            return stream_frames(session, run.frames(plans_left, least), run.report_progress), run.end
        except DeviceError as error:
            dry = error.error == Error.DRY
            left = run.under_way.remaining_plan(session, axes, lay, first=least < MAX_LEAD) if dry else None
            if left is None:
                raise
        session.reopen()
        run.begin_anew(left[1])
        # a line that has turned out bad gets the lead of a bad line, then four times that, and at last the longest
        least = min(max(NOISY_LEAD, 4 * least), MAX_LEAD) if session.line.damaged else MAX_LEAD
        plans_left = chain(left[0], plans_left)


class _Run:
    """Plans as they are put into frames, and how much of them is done."""

    def __init__(self, session: Session, axes: Sequence[int], progress: Progress) -> None:
        self._session, self._axes, self._progress = session, axes, progress
        self.under_way = _UnderWay()
        self.end: Counts | None = None  # counts at the last plan's end
        self._total = self._begun = self._done = 0.0  # [s] of all plans so far, in frames, done

    def begin_anew(self, seconds: float) -> None:
        """No move is under way any more, so many seconds of the plans are done, and the rest is put into frames."""
        self.under_way = _UnderWay()
        self._begun = self._total = seconds

    def frames(self, plans: Iterable[Cut | None], least: float) -> Iterator[MotionFrame | None]:
        """The frames of plans, None where there is no plan yet; least: [s] that the arm stands before its first."""
        frame_count = 0
        for plan in plans:
            if plan is None:
                yield None
                continue
            before, self._total = self._total, self._total + plan.duration
            for k, move in enumerate(plan.moves(lambda: ramp_pieces(self._session))):
                self.under_way.add(frame_count, before, plan, k, self._session.taken)
                for batch in motion_batches(self._session, move, self._axes, plan.clock, least):
                    frame_count += 1
                    self._begun += batch.seconds
                    yield batch
            self.end = plan.end

    def report_progress(self, seconds_left: float) -> None:
        """Report progress; seconds_left: seconds of motion that the board has before it."""
        self._done = max(self._done, min(self._begun - seconds_left, self._total))  # an estimate: never backwards
        self._progress(self._done, self._total)


def carry_out_axis(session: Session, lay: Callable[[int], Move | None], axis: int, count: int, clock: int) -> Status:
    """Carry out the move of one axis that `lay` makes from `count`; None: it stands at its end.

    If its queue runs dry in its beginning, what is left follows once, as of `carry_out`.
    """
    least = 0.0
    while (move := lay(count)) is not None:
        session.attend()
        try:
            return stream_frames(session, motion_batches(session, move, (axis,), clock, least), lambda left: None)
        except DeviceError as error:
            if error.error != Error.DRY or least:
                raise
            began, status = session.port.now(), _at_rest(session)
            stood, count = session.deaf + session.port.now() - began, status.counts[axis]
            if not status.known >> axis & 1 or stood > _STAND_TIME or _seconds_to(move, count, clock) > _BEGINNING_TIME:
                raise
        session.reopen()
        least = MAX_LEAD
    return session.status()


def _seconds_to(move: Move, count: int, clock: int) -> float:
    """Seconds of the move of one axis until it is at a count."""
    left, seconds = abs(count - int(move.start[0])) * protocol.STEP, 0.0
    for segment in move.segments:
        way = segment.ticks * abs(segment.rates[0])
        seconds += seconds_of([segment], clock) * min(1.0, left / max(way, 1))
        left -= way
        if left <= 0:
            break
    return seconds


def _at_rest(session: Session) -> Status:
    """The status of an arm whose queue ran dry, and what it tells of the line."""
    status = session.wait_for_rest()
    if status.bad and not session.line.damaged:  # the board alone knows of it yet
        session.line.resent += 1
    if session.line.damaged and not session.line.noisy:  # one frame that is lost, and sent again, holds nothing
        session.line.resent += 1
    return status
