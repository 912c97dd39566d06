"""A motion to the board while it moves: segments in frames, frames as the queue takes them."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

from armkin.board.firmware.segments.straight_lines import UNHEARD_SHARE, Pieces
from armkin.board.firmware.wire import protocol
from armkin.board.firmware.wire.go_back_n import QUESTION_BYTES
from armkin.board.firmware.wire.motion_frame import MotionFrame, motion_size
from armkin.board.firmware.wire.protocol import Segment, State, Status

if TYPE_CHECKING:
    from armkin.board.firmware.segments.counts_to_segments import Move
    from armkin.board.firmware.wire.session import Session

# [s] that the arm stands while the queue begins to fill, beyond what the frames take; at most; on a bad line.
_LEAD_TIME, MAX_LEAD, NOISY_LEAD = 0.0015, 0.6, 0.05
_LEAD_BUSY = ((1.0, 0.25), (0.1, 0.1))  # load of each processor and lead [s]: a busy computer's next turn is not known
_TICK_CYCLES = 20_000  # length [cycles], at most, of a tick of that pause
_BATCH_SEGMENTS = (2, 6)  # segments in a frame, on a bad line or into a queue that is all but full, and on a good line
_MARGIN_FACTOR, _SPARE_TIME = 30, 0.002  # a queue is dry below 1 / 32 and 2 ms [s] more than the time to a stop
_SLOW_STOP = 0.024  # time to a stop [s] from which on a queue can be dry
_QUEUE_RATE = 1 + 33 / 32  # motion [s] that each second since rest wants in the queue
_MAX_UNHEARD = 0.045  # length [s] of a segment before the first step, at most, in which the arm may wait for its queue
_MAX_INTERVAL = 50_000  # interval [cycles] of a tick, at most
_RECKONED_SEGMENTS = 64  # segments of a beginning whose way to the board is reckoned: both ramps of a short move
# Segments of a motion's first frames: a short one is there soon, those behind it last a while.
_FIRST_BATCHES = ((1, 3, 3, 4, 4), (1, 4, 3, 6, 3), (1, 4, 4, 6, 3), (1, 5, 5, 6, 3), (1, 6))
_FAR_ANSWER = 0.005  # time [s] of the slowest answer from which on a short move cannot wait for credit
_BUSY_TIMES = 0.0003, 0.0005  # time [s] that a board is busy with a frame, and with a segment of it
_TICK_FACTOR = 2.2  # factor on these times between ticks
_ACK_BYTES = 16  # size [bytes] of an answer


def stream_frames(
    session: Session, frames: Iterator[MotionFrame | None], report_left: Callable[[float], None]
) -> Status:
    """Send frames until there are no more and the arm stands; report_left: told the seconds of motion to come."""
    more, at_rest = True, False  # whether what was submitted ends at rest
    held: MotionFrame | object | None = None  # the beginning of the next move
    while more or session.pending[0]:
        while more and session.pending[0] < 2:
            batch, held = (held or next(frames, _DONE)), None
            if isinstance(batch, MotionFrame) and at_rest and not _may_follow_rest(session, batch):
                held = batch
                break
            if batch is _DONE:
                more = False
            if batch is None or not more:
                break
            assert isinstance(batch, MotionFrame)
            session.submit(batch.payload, len(batch.segments), batch.seconds)
            at_rest = batch.at_rest
        session.pump()
        report_left(session.under_way + session.queued / 1000)
    for seconds in session.arrivals():
        report_left(seconds)
    return _status_at_rest(session)


def _status_at_rest(session: Session) -> Status:
    """The status of an arm that has come to rest: as just heard, if it was one that said so."""
    last = session.last
    if isinstance(last, Status) and last.page == 0 and last.state == State.IDLE:
        return last
    return session.status()


_DONE = object()


def _may_follow_rest(session: Session, batch: MotionFrame) -> bool:
    """Whether the queue may go on behind a rest with the beginning of the next move.

    All the way down to the rest the queue holds just the time to a stop and what follows the rest: a short beginning
    behind a long ramp would pass for a queue that runs dry.
    """
    left = session.under_way + session.queued / 1000
    return batch.at_rest or left <= 0 or left < _earliest_follow(batch.seconds)


def _earliest_follow(seconds: float) -> float:
    """Seconds before a rest, from when on a beginning of so many seconds may follow it in the queue."""
    return _MARGIN_FACTOR * (seconds - _SPARE_TIME)


def ramp_pieces(session: Session) -> Pieces:
    """How finely ramps are cut."""
    if session.line.noisy:
        return Pieces.ROUGH
    return Pieces.FEW if _processor_load(session) > 1 or session.line.slowest > _FAR_ANSWER else Pieces.FINE


def _processor_load(session: Session) -> float:
    """Programs that want to run, for each processor: above 1 this one may have to wait for its turn."""
    if session.port.simulated or not hasattr(os, "getloadavg"):
        return 0.0
    return max(float(os.getloadavg()[0]), _others_running()) / (os.cpu_count() or 1)


def _others_running() -> int:
    """Programs besides this one that run at this moment, which the mean over a minute tells late; 0 if not known."""
    try:
        return int(Path("/proc/loadavg").read_text().split()[3].partition("/")[0]) - 1
    except (OSError, LookupError, ValueError):  # Linux alone has it
        return 0


def lead_time(
    session: Session, frames: Sequence[tuple[float, int, int]], least: float = 0.0, unheard: float = 0.0
) -> float:
    """Seconds that the arm stands before a motion, at least `least`, so that the queue does not run dry.

    frames: the first of the motion: seconds, segments and bytes on the line of each. unheard: [s] of them before
    the first step.
    """
    busy = next((seconds for load, seconds in _LEAD_BUSY if _processor_load(session) > load), 0.0)
    bad = NOISY_LEAD if session.line.damaged else 0.0
    return max(least, busy, bad, min(_LEAD_TIME + _lateness(session, frames, unheard), MAX_LEAD))


def _queued_times(session: Session, frames: Sequence[tuple[float, int, int]], unheard: float) -> list[float]:
    """When the board has queued each of these frames, in seconds from the first one's first byte.

    Two frames are on their way at a time; between ticks, behind the `unheard` seconds, the board is slower.
    """
    bit = 10 / session.port.baud
    free = moves = 0.0  # free: when the line is; moves: when the arm does
    queued = list[float]()
    for k, (_, segments, size) in enumerate(frames):
        may = queued[k - 2] + session.line.slowest + _ACK_BYTES * bit if k > 1 else 0.0
        free = max(free, may) + size * bit
        begins = max(free, queued[-1] if queued else 0.0)
        ends = begins + _BUSY_TIMES[0] + segments * _BUSY_TIMES[1]
        queued.append(ends + (_TICK_FACTOR - 1) * max(0.0, ends - max(begins, moves)) if k else ends)
        moves = moves or ends + _LEAD_TIME + unheard
    return queued


def _lateness(session: Session, frames: Sequence[tuple[float, int, int]], unheard: float) -> float:
    """Seconds by which a frame would come too late, at most, if the motion began with the first.

    The board's queue holds the time to a stop at any moment (section 7), which from rest is at most the time since then
    in which the arm would have speeded up evenly; a slow arm's need only not be empty.
    """
    queued, ahead = _queued_times(session, frames, unheard), unheard * (1 / UNHEARD_SHARE - 1)
    behind = elapsed = 0.0  # done: [s] of motion in all before a frame
    for k, (seconds, _, _) in enumerate(frames):
        if k:
            stops = (elapsed - _SPARE_TIME - ahead * (_QUEUE_RATE - 1)) / _QUEUE_RATE
            behind = max(behind, queued[k] - queued[0] - min(elapsed, max(_SLOW_STOP - ahead, stops)))
        elapsed += seconds
    return behind


def _seconds_queued(session: Session) -> float:
    """Seconds of motion that the board has, or will have: a guess, by what it said last."""
    queued = 0.0 if session.state == State.IDLE else session.queued / 1000 - (session.port.now() - session.heard)
    return session.under_way + max(0.0, queued)


def motion_batches(
    session: Session, move: Move, axes: Sequence[int], clock: int, least: float = 0.0
) -> Iterator[MotionFrame]:
    """A move's segments in frames: as many as a good line takes, fewer on a bad one; least: see `lead_time`.

    Two frames may be on their way: the second one fits what the board keeps while it is busy with the first.
    """
    assert session.info is not None
    line = session.line
    moving = sorted(move.moving, key=lambda k: axes[k])
    begin_counts = [int(move.start[k]) for k in moving]
    room = min(session.info.frame - 4, session.info.receive - QUESTION_BYTES - 6)
    places = [count * protocol.STEP + protocol.HALF for count in begin_counts]
    source = (s.for_axes(moving) for s in move.segments)
    segments: list[Segment] = list(islice(source, _RECKONED_SEGMENTS))
    sizes = _insert_pause(session, segments, room, clock, least) if segments else []
    begins = not sizes
    while segments := segments + list(islice(source, max(0, _BATCH_SEGMENTS[1] + 1 - len(segments)))):
        fits = _BATCH_SEGMENTS[1] if begins else max(_BATCH_SEGMENTS[0], session.pending[1])  # more would wait for room
        fits = _BATCH_SEGMENTS[0] if line.noisy else min(fits, _BATCH_SEGMENTS[1])
        most = sizes.pop(0) if sizes else fits
        begins = False
        n = _fitting_count(segments, most, room)
        part, segments = segments[:n], segments[n:]
        if not segments:
            segments = list(islice(source, 1))
        places = [p + sum(s.ticks * s.rates[i] for s in part) for i, p in enumerate(places)]
        end = [p // protocol.STEP for p in places]
        yield MotionFrame(
            axes=[axes[k] for k in moving],
            start=begin_counts,
            end=end,
            segments=part,
            at_rest=not segments,
            clock=clock,
            brake=move.brake,
        )
        begin_counts = end


def _insert_pause(session: Session, segments: list[Segment], room: int, clock: int, least: float) -> list[int]:
    """Put the pause before a motion into its segments; how many of them its first frames have, none for no pause."""
    pause, sizes = _plan_start(session, segments, room, clock, least)
    # Behind a rest, for which it may wait until less is left there: the queue is filled while that lasts.
    waits = _earliest_follow(seconds_of(segments[: _fitting_count(segments, _BATCH_SEGMENTS[1], room)], clock))
    if not session.line.damaged and min(_seconds_queued(session), waits) >= pause:
        return []
    if longer := delay_segment(segments[0], pause, clock):
        segments[0] = longer
    else:
        ticks = math.ceil(pause * clock / _TICK_CYCLES)
        segments.insert(0, Segment(ticks, math.ceil(pause * clock / ticks), 0, (0,) * len(segments[0].rates)))
        sizes[0] += 1
    return sizes


def seconds_of(segments: Sequence[Segment], clock: int) -> float:
    """How long segments take [s]; clock: cycles a second."""
    return sum(s.units() for s in segments) * 256 / clock


def _fitting_count(segments: Sequence[Segment], most: int, room: int) -> int:
    """How many of these segments go into the next frame: `most`, `room` bytes, and of one form behind a pause."""
    n = 1
    while (
        n < min(most, len(segments))
        and (segments[n].narrow == segments[0].narrow or not any(segments[0].rates))
        and motion_size(len(segments[0].rates), segments[: n + 1]) <= room
    ):
        n += 1
    return n


def _is_unheard(first: Segment) -> bool:
    """Whether a motion's first segment makes no step: how long it lasts nobody can tell."""
    return first.add == 0 and not any(first.steps)


def delay_segment(first: Segment, pause: float, clock: int) -> Segment | None:
    """The first segment of a motion, `pause` seconds longer for one in front of it; None where that would be felt."""
    interval = first.interval + math.ceil(pause * clock / first.ticks)
    fits = interval <= _MAX_INTERVAL and first.ticks * interval < _MAX_UNHEARD * clock
    return replace(first, interval=interval) if fits and _is_unheard(first) else None


def _plan_start(
    session: Session, segments: Sequence[Segment], room: int, clock: int, least: float
) -> tuple[float, list[int]]:
    """How long the arm stands before a motion from rest, and the segments of its first frames: it begins soonest so."""
    ways = list[tuple[float, float, list[int]]]()
    unheard = seconds_of(segments[:1], clock) if _is_unheard(segments[0]) else 0.0
    for sizes in [(_BATCH_SEGMENTS[0] - 1,)] if session.line.noisy else _FIRST_BATCHES:
        frames = _first_frames(segments, sizes, room, clock, paused=not unheard)
        pause = lead_time(session, frames, least, unheard)
        ways.append((_queued_times(session, frames, unheard)[0] + pause, pause, list(sizes)))
    return min(ways)[1:]


def _first_frames(
    segments: Sequence[Segment], sizes: Sequence[int], room: int, clock: int, *, paused: bool
) -> list[tuple[float, int, int]]:
    """The first frames of a motion from rest, behind a pause or not: seconds, segments and bytes of each."""
    frames, first = list[tuple[float, int, int]](), 0
    while first < len(segments):
        most = sizes[len(frames)] if len(frames) < len(sizes) else _BATCH_SEGMENTS[1]
        n = max(1, _fitting_count(segments[first:], most, room))
        part, more = segments[first : first + n], paused and first == 0
        size = motion_size(len(part[0].rates), part) + 6 + more * 17
        frames.append((seconds_of(part, clock), n + more, size))
        first += n
    return frames
