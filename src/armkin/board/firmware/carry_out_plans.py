"""Carries out plans on the board, and continues a motion whose queue ran dry at its beginning."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain, islice
from typing import TYPE_CHECKING

from armkin.board.firmware.segments.remaining_plan import remaining_plans
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

    PlanTrajectory = Callable[[Trajectory, Counts], Cut]

# longest beginning [s] of a motion, and longest stop [s] in it, after which it continues by itself
_BEGINNING_TIME, _STAND_TIME = 0.7, 1.0


class _UnderWay:
    """The moves that the board may not have finished, in order."""

    def __init__(self) -> None:
        self._moves: deque[tuple[int, float, Cut, int]] = deque()  # for each: frames before it, seconds, plan, number

    def add(self, frames: int, seconds: float, plan: Cut, number: int, taken_frames: int) -> None:
        """Add a move of a plan; frames, seconds: those before it.

        taken_frames: number of frames that the board has taken; moves before the last such frame are finished.
        """
        self._moves.append((frames, seconds, plan, number))
        self._forget_finished(taken_frames)

    def _forget_finished(self, taken_frames: int) -> None:
        while len(self._moves) > 1 and self._moves[1][0] < taken_frames:
            self._moves.popleft()

    def remaining_plan(
        self, session: Session, axes: Sequence[int], plan_trajectory: PlanTrajectory, *, first: bool
    ) -> tuple[Sequence[Cut], float] | None:
        """The remaining plans of an arm whose queue ran dry, and the seconds done; None unless in a move's beginning.

        first: whether it may be the first move of all. Also None after a long stop, as somebody may be near the arm.
        """
        if not self._moves:
            return None
        start_time, status = session.port.now(), _at_rest(session)
        self._forget_finished(session.taken)
        frames, seconds, plan, number = self._moves[0]
        if not all(status.known >> axis & 1 for axis in axes) or (frames == 0 and not first):
            return None
        plans = [plan, *(plan for *_, plan, move_number in islice(self._moves, 1, None) if move_number == 0)]
        remaining = remaining_plans(plans, number, [status.counts[axis] for axis in axes], plan_trajectory)
        stop_time = session.deaf + session.port.now() - start_time
        if remaining is None or remaining[1].seconds > _BEGINNING_TIME or stop_time > _STAND_TIME:
            return None
        return remaining[0], seconds + remaining[1].elapsed


def carry_out(
    session: Session,
    plans: Iterable[Cut | None],
    axes: Sequence[int],
    progress: Progress,
    plan_trajectory: PlanTrajectory,
) -> tuple[Status, Counts | None]:
    """Carry out plans in order; a None among them means that the next plan is not there yet.

    axes: the motors' axes on the board. plan_trajectory: makes a plan for this board from a trajectory.
    Returns the status at rest, and the end of the last plan. Raises DeviceError if the board ends the session. If a
    busy computer or a bad line lets the queue run dry in a move's beginning, the remainder follows with more time to
    fill the queue, unless the arm has stopped for so long that somebody may be near it.
    """
    run = _Run(session, axes, progress)
    min_pause, plans_left = 0.0, iter(plans)
    while True:
        session.attend()
        try:
            return stream_frames(session, run.frames(plans_left, min_pause), run.report_progress), run.end
        except DeviceError as error:
            ran_dry = error.error == Error.DRY
            remaining = (
                run.under_way.remaining_plan(session, axes, plan_trajectory, first=min_pause < MAX_LEAD)
                if ran_dry
                else None
            )
            if remaining is None:
                raise
        session.reopen()
        run.begin_anew(remaining[1])
        # a bad line gets its own pause first, then four times that, and at last the longest
        min_pause = min(max(NOISY_LEAD, 4 * min_pause), MAX_LEAD) if session.line.has_damage else MAX_LEAD
        plans_left = chain(remaining[0], plans_left)


class _Run:
    """Converts plans to frames, and tracks how much of them is done."""

    def __init__(self, session: Session, axes: Sequence[int], progress: Progress) -> None:
        self._session, self._axes, self._progress = session, axes, progress
        self.under_way = _UnderWay()
        self.end: Counts | None = None  # counts at the last plan's end
        self._total = self._begun = self._done = 0.0  # [s] of all plans so far, in frames, done

    def begin_anew(self, seconds: float) -> None:
        """Begin again without moves in progress, after `seconds` of the plans."""
        self.under_way = _UnderWay()
        self._begun = self._total = seconds

    def frames(self, plans: Iterable[Cut | None], min_pause: float) -> Iterator[MotionFrame | None]:
        """The frames of plans, with None where there is no plan yet; min_pause: [s] before the first move."""
        frame_count = 0
        for plan in plans:
            if plan is None:
                yield None
                continue
            seconds_before, self._total = self._total, self._total + plan.duration
            for number, move in enumerate(plan.moves(lambda: ramp_pieces(self._session))):
                self.under_way.add(frame_count, seconds_before, plan, number, self._session.taken)
                for batch in motion_batches(self._session, move, self._axes, plan.clock, min_pause):
                    frame_count += 1
                    self._begun += batch.seconds
                    yield batch
            self.end = plan.end

    def report_progress(self, seconds_left: float) -> None:
        """Report progress; seconds_left: seconds of motion that the board has not done."""
        self._done = max(self._done, min(self._begun - seconds_left, self._total))  # an estimate must not go backwards
        self._progress(self._done, self._total)


def carry_out_axis(
    session: Session, plan_move: Callable[[int], Move | None], axis: int, count: int, clock: int
) -> Status:
    """Carry out the move of one axis, which `plan_move` makes from `count`; None: it is at its end.

    If the queue runs dry in its beginning, the remainder follows once, as in `carry_out`.
    """
    min_pause = 0.0
    while (move := plan_move(count)) is not None:
        session.attend()
        try:
            return stream_frames(session, motion_batches(session, move, (axis,), clock, min_pause), lambda left: None)
        except DeviceError as error:
            if error.error != Error.DRY or min_pause:
                raise
            start_time, status = session.port.now(), _at_rest(session)
            stop_time, count = session.deaf + session.port.now() - start_time, status.counts[axis]
            if (
                not status.known >> axis & 1
                or stop_time > _STAND_TIME
                or _seconds_to(move, count, clock) > _BEGINNING_TIME
            ):
                raise
        session.reopen()
        min_pause = MAX_LEAD
    return session.status()


def _seconds_to(move: Move, count: int, clock: int) -> float:
    """The time [s] at which a move of one axis reaches a count."""
    distance, seconds = abs(count - int(move.start[0])) * protocol.STEP, 0.0
    for segment in move.segments:
        travel = segment.ticks * abs(segment.rates[0])
        seconds += seconds_of([segment], clock) * min(1.0, distance / max(travel, 1))
        distance -= travel
        if distance <= 0:
            break
    return seconds


def _at_rest(session: Session) -> Status:
    """The status at rest of an arm whose queue ran dry; counts damage that only the board has seen."""
    status = session.wait_for_rest()
    if status.bad and not session.line.has_damage:  # damage that only the board has seen
        session.line.resent += 1
    if session.line.has_damage and not session.line.noisy:  # a single lost frame does not empty the queue
        session.line.resent += 1
    return status
