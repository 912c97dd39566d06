"""Streams a motion to the board while it moves: packs segments into frames, and sends them as the queue allows."""

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

# Pause [s] before a motion while the queue fills, beyond the time of the frames; greatest; on a bad line.
_LEAD_TIME, MAX_LEAD, NOISY_LEAD = 0.0015, 0.6, 0.05
_LEAD_BUSY = ((1.0, 0.25), (0.1, 0.1))  # load of each processor and pause [s] on a busy computer
_TICK_CYCLES = 20_000  # longest tick [cycles] of that pause
_BATCH_SEGMENTS = (2, 6)  # segments in a frame, on a bad line or with a nearly full queue, and on a good line
_MARGIN_FACTOR, _SPARE_TIME = 30, 0.002  # a queue runs dry below 33 / 32 of the time to a stop and 2 ms
_SLOW_STOP = 0.024  # shortest time to a stop [s] at which a queue can run dry
_QUEUE_RATE = 1 + 33 / 32  # motion [s] needed in the queue for each second since rest
_MAX_UNHEARD = 0.045  # longest first segment [s] without a step that may serve as pause
_MAX_INTERVAL = 50_000  # longest interval [cycles] of a tick
_RECKONED_SEGMENTS = 64  # segments whose transmission is simulated: both ramps of a short move
# Choices of segments in the first frames: a short first frame arrives early, longer ones keep the queue filled.
_FIRST_BATCHES = ((1, 3, 3, 4, 4), (1, 4, 3, 6, 3), (1, 4, 4, 6, 3), (1, 5, 5, 6, 3), (1, 6))
_FAR_ANSWER = 0.005  # slowest answer [s] at which a short move can wait for credit
_FRAME_TIME, _SEGMENT_TIME = 0.0003, 0.0005  # time [s] that the board needs for a frame, and for a segment
_TICK_FACTOR = 2.2  # factor on these times while the arm moves
_ACK_BYTES = 16  # size [bytes] of an answer


def stream_frames(
    session: Session, frames: Iterator[MotionFrame | None], report_left: Callable[[float], None]
) -> Status:
    """Send all frames and wait until the arm is at rest; report_left: takes the seconds of motion left."""
    has_more, at_rest = True, False  # whether the submitted motion ends at rest
    next_frame: MotionFrame | object | None = None  # first frame of the next move
    while has_more or session.backlog_and_credit[0]:
        while has_more and session.backlog_and_credit[0] < 2:
            batch, next_frame = (next_frame or next(frames, _DONE)), None
            if isinstance(batch, MotionFrame) and at_rest and not _may_follow_rest(session, batch):
                next_frame = batch
                break
            if batch is _DONE:
                has_more = False
            if batch is None or not has_more:
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
    """The status of an arm that has come to rest, taken from the last reply if that says so."""
    last = session.last
    if isinstance(last, Status) and last.page == 0 and last.state == State.IDLE:
        return last
    return session.status()


_DONE = object()


def _may_follow_rest(session: Session, batch: MotionFrame) -> bool:
    """Whether the first frame of the next move may be queued behind a rest already.

    While the arm slows down to the rest, the queue holds only the time to the stop and that frame. The board would take
    a short frame behind a long ramp for a queue that runs dry.
    """
    seconds_left = session.under_way + session.queued / 1000
    return batch.at_rest or seconds_left <= 0 or seconds_left < _earliest_follow(batch.seconds)


def _earliest_follow(seconds: float) -> float:
    """How long before a rest [s] a first frame of `seconds` may follow it in the queue."""
    return _MARGIN_FACTOR * (seconds - _SPARE_TIME)


def ramp_pieces(session: Session) -> Pieces:
    """The division of ramps that suits the line and the load of the computer."""
    if session.line.noisy:
        return Pieces.ROUGH
    return Pieces.FEW if _processor_load(session) > 1 or session.line.slowest > _FAR_ANSWER else Pieces.FINE


def _processor_load(session: Session) -> float:
    """Running programs for each processor; above 1 this program may have to wait for its turn."""
    if session.port.simulated or not hasattr(os, "getloadavg"):
        return 0.0
    return max(float(os.getloadavg()[0]), _others_running()) / (os.cpu_count() or 1)


def _others_running() -> int:
    """Other programs running at this moment, which the load average shows late; 0 if unknown."""
    try:
        return int(Path("/proc/loadavg").read_text().split()[3].partition("/")[0]) - 1
    except (OSError, LookupError, ValueError):  # only Linux has this file
        return 0


def lead_time(
    session: Session, frames: Sequence[tuple[float, int, int]], min_pause: float = 0.0, unheard: float = 0.0
) -> float:
    """The pause [s] before a motion, at least `min_pause`, that keeps the queue from running dry.

    frames: seconds, segments and bytes on the line of the motion's first frames; unheard: [s] before the first step.
    """
    busy_pause = next((seconds for load, seconds in _LEAD_BUSY if _processor_load(session) > load), 0.0)
    noise_pause = NOISY_LEAD if session.line.has_damage else 0.0
    return max(min_pause, busy_pause, noise_pause, min(_LEAD_TIME + _lateness(session, frames, unheard), MAX_LEAD))


def _queued_times(session: Session, frames: Sequence[tuple[float, int, int]], unheard: float) -> list[float]:
    """The times [s] from the first byte at which the board has queued each frame.

    At most two frames are unacknowledged at a time. The board is slower while it makes ticks, behind the `unheard`
    seconds.
    """
    bit = 10 / session.port.baud
    line_free = motion_start = 0.0  # times at which the line is free, and the arm begins to move
    queue_times = list[float]()
    for number, (_, segments, size) in enumerate(frames):
        credit_time = queue_times[number - 2] + session.line.slowest + _ACK_BYTES * bit if number > 1 else 0.0
        line_free = max(line_free, credit_time) + size * bit
        work_start = max(line_free, queue_times[-1] if queue_times else 0.0)
        work_end = work_start + _FRAME_TIME + segments * _SEGMENT_TIME
        queue_times.append(
            work_end + (_TICK_FACTOR - 1) * max(0.0, work_end - max(work_start, motion_start)) if number else work_end
        )
        motion_start = motion_start or work_end + _LEAD_TIME + unheard
    return queue_times


def _lateness(session: Session, frames: Sequence[tuple[float, int, int]], unheard: float) -> float:
    """The most [s] by which a frame would be late if the motion began with the first frame.

    The board's queue must always hold the time to a stop (section 7). From rest, that is at most the time since the
    start; the queue of a slow arm need only not be empty.
    """
    queue_times, time_saved = _queued_times(session, frames, unheard), unheard * (1 / UNHEARD_SHARE - 1)
    lateness = elapsed = 0.0  # elapsed: [s] of motion before a frame
    for number, (seconds, _, _) in enumerate(frames):
        if number:
            stop_time = (elapsed - _SPARE_TIME - time_saved * (_QUEUE_RATE - 1)) / _QUEUE_RATE
            lateness = max(
                lateness, queue_times[number] - queue_times[0] - min(elapsed, max(_SLOW_STOP - time_saved, stop_time))
            )
        elapsed += seconds
    return lateness


def _seconds_queued(session: Session) -> float:
    """An estimate of the seconds of motion that the board has or will have, from its last reply."""
    seconds = 0.0 if session.state == State.IDLE else session.queued / 1000 - (session.port.now() - session.heard)
    return session.under_way + max(0.0, seconds)


def motion_batches(
    session: Session, move: Move, axes: Sequence[int], clock: int, min_pause: float = 0.0
) -> Iterator[MotionFrame]:
    """The frames of a move's segments, with fewer segments each on a bad line; min_pause: see `lead_time`.

    Two frames may be unacknowledged, as the board can store the second one while it handles the first.
    """
    assert session.info is not None
    line = session.line
    motors = sorted(move.moving_motors, key=lambda k: axes[k])
    begin_counts = [int(move.start[k]) for k in motors]
    room = min(session.info.frame - 4, session.info.receive - QUESTION_BYTES - 6)
    places = [count * protocol.STEP + protocol.HALF for count in begin_counts]
    source = (segment.for_axes(motors) for segment in move.segments)
    segments: list[Segment] = list(islice(source, _RECKONED_SEGMENTS))
    sizes = _insert_pause(session, segments, room, clock, min_pause) if segments else []
    is_start = not sizes
    while segments := segments + list(islice(source, max(0, _BATCH_SEGMENTS[1] + 1 - len(segments)))):
        # a larger frame would have to wait for space
        fits = _BATCH_SEGMENTS[1] if is_start else max(_BATCH_SEGMENTS[0], session.backlog_and_credit[1])
        fits = _BATCH_SEGMENTS[0] if line.noisy else min(fits, _BATCH_SEGMENTS[1])
        max_size = sizes.pop(0) if sizes else fits
        is_start = False
        n = _fitting_count(segments, max_size, room)
        part, segments = segments[:n], segments[n:]
        if not segments:
            segments = list(islice(source, 1))
        places = [place + sum(segment.ticks * segment.rates[i] for segment in part) for i, place in enumerate(places)]
        end = [place // protocol.STEP for place in places]
        yield MotionFrame(
            axes=[axes[k] for k in motors],
            start=begin_counts,
            end=end,
            segments=part,
            at_rest=not segments,
            clock=clock,
            brake=move.brake,
        )
        begin_counts = end


def _insert_pause(session: Session, segments: list[Segment], room: int, clock: int, min_pause: float) -> list[int]:
    """Insert the pause before a motion, and return the segments in its first frames; an empty list for no pause."""
    pause, sizes = _plan_start(session, segments, room, clock, min_pause)
    # Behind a rest no pause is needed, as the queue fills while the earlier motion lasts.
    follow_time = _earliest_follow(seconds_of(segments[: _fitting_count(segments, _BATCH_SEGMENTS[1], room)], clock))
    if not session.line.has_damage and min(_seconds_queued(session), follow_time) >= pause:
        return []
    if delayed_segment := delay_segment(segments[0], pause, clock):
        segments[0] = delayed_segment
    else:
        ticks = math.ceil(pause * clock / _TICK_CYCLES)
        segments.insert(0, Segment(ticks, math.ceil(pause * clock / ticks), 0, (0,) * len(segments[0].rates)))
        sizes[0] += 1
    return sizes


def seconds_of(segments: Sequence[Segment], clock: int) -> float:
    """The duration [s] of segments; clock: cycles a second."""
    return sum(segment.units() for segment in segments) * 256 / clock


def _fitting_count(segments: Sequence[Segment], limit: int, room: int) -> int:
    """The number of segments in the next frame: at most `limit`, in `room` bytes, all of one form."""
    n = 1
    while (
        n < min(limit, len(segments))
        and (segments[n].narrow == segments[0].narrow or not any(segments[0].rates))
        and motion_size(len(segments[0].rates), segments[: n + 1]) <= room
    ):
        n += 1
    return n


def _is_unheard(first: Segment) -> bool:
    """Whether a motion's first segment makes no step, so that its duration does not matter."""
    return first.add == 0 and not any(first.steps)


def delay_segment(first: Segment, pause: float, clock: int) -> Segment | None:
    """The first segment of a motion extended by a pause [s]; None if it makes a step or becomes too long."""
    interval = first.interval + math.ceil(pause * clock / first.ticks)
    fits = interval <= _MAX_INTERVAL and first.ticks * interval < _MAX_UNHEARD * clock
    return replace(first, interval=interval) if fits and _is_unheard(first) else None


def _plan_start(
    session: Session, segments: Sequence[Segment], room: int, clock: int, min_pause: float
) -> tuple[float, list[int]]:
    """The pause before a motion from rest and the sizes of its first frames that let it begin earliest."""
    choices = list[tuple[float, float, list[int]]]()
    unheard = seconds_of(segments[:1], clock) if _is_unheard(segments[0]) else 0.0
    for sizes in [(_BATCH_SEGMENTS[0] - 1,)] if session.line.noisy else _FIRST_BATCHES:
        frames = _first_frames(segments, sizes, room, clock, paused=not unheard)
        pause = lead_time(session, frames, min_pause, unheard)
        choices.append((_queued_times(session, frames, unheard)[0] + pause, pause, list(sizes)))
    return min(choices)[1:]


def _first_frames(
    segments: Sequence[Segment], sizes: Sequence[int], room: int, clock: int, *, paused: bool
) -> list[tuple[float, int, int]]:
    """Seconds, segments and bytes of the first frames of a motion from rest; paused: behind a pause."""
    frames, first = list[tuple[float, int, int]](), 0
    while first < len(segments):
        max_size = sizes[len(frames)] if len(frames) < len(sizes) else _BATCH_SEGMENTS[1]
        n = max(1, _fitting_count(segments[first:], max_size, room))
        part, has_pause = segments[first : first + n], paused and first == 0
        size = motion_size(len(part[0].rates), part) + 6 + has_pause * 17
        frames.append((seconds_of(part, clock), n + has_pause, size))
        first += n
    return frames
