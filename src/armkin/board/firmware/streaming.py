"""Plans to the board while it moves: segments in frames, frames as the queue takes them."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain, islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from armkin.board.firmware import protocol
from armkin.board.firmware.go_back_n import QUESTION
from armkin.board.firmware.motion_frame import Batch, motion_size
from armkin.board.firmware.protocol import Error, Segment, State, Status
from armkin.board.firmware.reply_checks import DeviceError
from armkin.board.firmware.straight_lines import Pieces

if TYPE_CHECKING:
    from armkin.board.backend import Progress
    from armkin.board.firmware.counts_to_segments import Counts, Move
    from armkin.board.firmware.session import Session
    from armkin.board.firmware.trajectory_to_counts import Cut

# [s] that the arm stands while the queue begins to fill: what the frames of a ramp's first 10 ms take, and 4.5 times
# the slowest answer, in which all of a queue is sent, two frames at a time; at most; on a bad line.
_LEAD, _LEAD_ANSWERS, _LEAD_MOST, _LEAD_BAD = 0.003, 4.5, 0.6, 0.51
_LEAD_BUSY = ((1.0, 0.25), (0.1, 0.1))  # load of each processor, [s] at least: a busy computer's next turn is not known
_TICK = 20_000  # [cycles]
_BATCH = (2, 6)  # segments in a frame, on a bad line or into a queue that is all but full, and on a good line
_MARGIN, _SPARE = 30, 0.002  # a queue is dry that holds less than 1 / 32 and 2 ms more than the time to a stop
_BEGUN = 0.1  # [s] after its pause, until which a motion that has made no step may begin again
_FULL = 12  # segments of room: a frame of 6 would wait for as many, and leave the queue short of a ramp's end


def carry_out(
    session: Session, plans: Iterable[Cut | None], axes: Sequence[int], progress: Progress
) -> tuple[Status, Counts | None]:
    """Carry out plans, one after another; None in between: nothing to do yet. axes: the motors' on the board.

    Returns the status at rest, and where the last plan ends. Raises DeviceError if the board ends the session. If the
    queue runs dry before the first step, it begins again, with more time to fill.
    """
    end: Counts | None = None
    total = begun = done = 0.0
    source, first = iter(plans), list[Any]()  # first: at most two plans

    def frames(plans: Iterable[Cut | None], least: float) -> Iterator[Batch | None]:
        nonlocal end, total, begun
        for plan in plans:
            if plan is None:
                yield None
                continue
            if len(first) < 2:
                first.append(plan)
            total += plan.duration
            for move in plan.moves(lambda: _pieces(session)):
                for batch in batches(session, move, axes, plan.clock, least):
                    begun += batch.seconds
                    yield batch
            end = plan.end

    def tell(left: float) -> None:
        nonlocal done
        done = max(done, min(begun - left, total))  # what is left is an estimate: never backwards
        progress(done, total)

    since, pause = session.port.now(), lead(session)
    try:
        return stream(session, frames(source, 0.0), tell), end
    except DeviceError as error:
        if error.error != Error.DRY or session.port.now() - since > pause + _BEGUN or len(first) != 1:
            raise
        status = session.rest()
        if any(status.counts[axis] != count for axis, count in zip(axes, first[0].start.tolist(), strict=True)):
            raise
        session.reopen()
        total = begun = 0.0
        return stream(session, frames(chain([first[0]], source), _LEAD_MOST), tell), end


def stream(session: Session, frames: Iterator[Batch | None], left: Callable[[float], None]) -> Status:
    """Send frames until there are no more and the arm stands; left: told the seconds of motion to come."""
    more, at_rest = True, False  # whether what was submitted ends at rest
    held: Batch | object | None = None  # the beginning of the next move
    while more or session.pending[0]:
        while more and session.pending[0] < 2:
            batch, held = (held or next(frames, _DONE)), None
            if isinstance(batch, Batch) and at_rest and not _reaches(session, batch):
                held = batch
                break
            if batch is _DONE:
                more = False
            if batch is None or not more:
                break
            assert isinstance(batch, Batch)
            session.submit(batch.payload, len(batch.segments), batch.seconds)
            at_rest = batch.at_rest
        session.pump()
        left(session.under_way + session.queued / 1000)
    for seconds in session.arrivals():
        left(seconds)
    return session.status()


_DONE = object()


def _reaches(session: Session, batch: Batch) -> bool:
    """Whether the queue may go on behind a rest with the beginning of the next move.

    All the way down to the rest the queue holds just the time to a stop and what follows the rest: a short beginning
    behind a long ramp would pass for a queue that runs dry.
    """
    left = session.under_way + session.queued / 1000
    return batch.at_rest or left <= 0 or left < _MARGIN * (batch.seconds - _SPARE)


def _pieces(session: Session) -> Pieces:
    """How finely ramps are cut."""
    if session.line.noisy:
        return Pieces.ROUGH
    return Pieces.FEW if _load(session) > 1 else Pieces.FINE


def _load(session: Session) -> float:
    """Programs that want to run, for each processor: above 1 this one may have to wait for its turn."""
    if session.port.simulated or not hasattr(os, "getloadavg"):
        return 0.0
    return max(os.getloadavg()[0], _others_running()) / (os.cpu_count() or 1)


def _others_running() -> int:
    """Programs besides this one that run at this moment, which the mean over a minute tells late; 0 if not known."""
    try:
        return int(Path("/proc/loadavg").read_text().split()[3].partition("/")[0]) - 1
    except (OSError, LookupError, ValueError):  # Linux alone has it
        return 0


def lead(session: Session, least: float = 0.0) -> float:
    """Seconds that the arm stands before a motion, at least `least`, so that the queue does not run dry."""
    if session.line.damaged:
        return _LEAD_BAD
    busy = next((seconds for load, seconds in _LEAD_BUSY if _load(session) > load), 0.0)
    return max(least, busy, min(_LEAD + _LEAD_ANSWERS * session.line.slowest, _LEAD_MOST))


def _left(session: Session) -> float:
    """Seconds of motion that the board has, or will have: a guess, by what it said last."""
    queued = 0.0 if session.state == State.IDLE else session.queued / 1000 - (session.port.now() - session.heard)
    return session.under_way + max(0.0, queued)


def batches(session: Session, move: Move, axes: Sequence[int], clock: int, least: float = 0.0) -> Iterator[Batch]:
    """A move's segments in frames: as many as a good line takes, fewer on a bad one; least: see `lead`.

    Two frames may be on their way: the second one fits what the board keeps while it is busy with the first.
    """
    assert session.info is not None
    line = session.line
    moving = sorted(move.moving, key=lambda k: axes[k])
    at = [int(move.start[k]) for k in moving]
    room = min(session.info.frame - 4, session.info.receive - QUESTION - 6)
    places = [count * protocol.STEP + protocol.HALF for count in at]
    source = (s.of(moving) for s in move.segments)
    todo: list[Segment] = []
    pause = lead(session, least)
    stands = line.damaged or _left(session) < pause
    if move.segments and stands:
        todo.append(Segment(math.ceil(pause * clock / _TICK), _TICK, 0, (0,) * len(moving)))
    begins = not stands  # behind a rest, which may wait for room
    while todo := todo + list(islice(source, _BATCH[1] + 1 - len(todo))):
        full = session.pending[1] < _FULL and not begins
        most = _BATCH[0] if stands or line.noisy or full else _BATCH[1]
        n, begins, stands = 1, False, False
        while (
            n < min(most, len(todo))
            and todo[n].narrow == todo[0].narrow
            and motion_size(len(moving), todo[: n + 1]) <= room
        ):
            n += 1
        part, todo = todo[:n], todo[n:]
        if not todo:
            todo = list(islice(source, 1))
        places = [p + sum(s.ticks * s.rates[i] for s in part) for i, p in enumerate(places)]
        end = [p // protocol.STEP for p in places]
        yield Batch([axes[k] for k in moving], at, end, part, not todo, clock, move.brake)
        at = end
