"""Converts a curved stretch of a trajectory to device segments: straight lines in counts with a ramp of speed.

A segment is short enough that its chord leaves the curve by at most the tolerance and that its speed changes by about
an eighth near a rest. It lasts at least 10 ms, and long enough that the board's queue always reaches to a stop. It may
end at a fraction of a step (`Cutter`), and its ramp follows the speed along the path. Segments are made on iteration.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from armkin.board.firmware.segments.counts_to_segments import Counts, Cutter, speed_change
from armkin.board.firmware.wire.protocol import STEP, Segment
from armkin.formula.arrays import Array
from armkin.forward import jacobian
from armkin.motors import exact_pulses, motor_accel

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.motion.timing.trajectory import Stretch

_MIN_SECONDS, _MAX_SECONDS = 0.010, 0.050  # shortest and longest segment [s]
_GROWTH_SHARE = 0.12  # longest segment as a share of the time since the start, or to the end
_SAMPLE_PERIOD = 0.005  # time [s] between the samples that determine the segments' lengths
_QUEUED_SEGMENTS = 25  # segments that are always in the board's queue
_SETTLING_SHARE = 0.05  # share of the motors' accelerations that removes the rounding of both ends
_JUMP_FACTOR = 1.1  # largest factor on the motors' accelerations in a segment
_CHUNK_SAMPLES = 20_000  # samples evaluated at once
_BLOCK_SEGMENTS = 512  # segments computed at once


class _Part(NamedTuple):
    """What one segment is for, and the speeds (motors,) [counts/s] of the segments beside it."""

    seconds: float
    counts: list[float]  # at its end
    change: float  # relative change of speed, see `Cutter.piece`
    start_speed: Array  # at the end of the last segment
    start_time: float  # [s] the longer of the last segment and this one
    next_speed: Array  # the mean speed of the next segment
    next_time: float  # [s] the longer of this segment and the next one

    def admits(self, begin: Array, end: Array, max_accel: Array) -> bool:
        """Whether a ramp from `begin` to `end` (motors,) [counts/s] keeps every motor's acceleration, jumps too."""
        return bool(
            (np.abs(begin - self.start_speed) <= max_accel * self.start_time).all()
            and (np.abs(end - begin) <= max_accel * self.seconds).all()
            and (np.abs(self.next_speed - end) <= max_accel * self.next_time).all()
        )


@dataclass(frozen=True)
class CurveSegments:
    """The segments of one stretch, computed on each iteration in bounded memory."""

    arm: Arm
    stretch: Stretch
    start: Counts  # (motors,)
    end: Counts
    clock: int
    min_interval: int
    tolerance: float  # [mm]

    def __iter__(self) -> Iterator[Segment]:
        """The segments in order."""
        bounds = self.bounds()
        cutter = Cutter(self.start.tolist(), self.clock, self.min_interval)
        last_speed, span = np.zeros(len(self.start)), 0.0  # end speed and time of the last segment
        for first in range(0, len(bounds) - 1, _BLOCK_SEGMENTS):
            t = bounds[first : first + _BLOCK_SEGMENTS + 1]
            counts = self._places_at(t)
            if first + _BLOCK_SEGMENTS >= len(bounds) - 1:
                counts[-1] = self.end
            steps = np.diff(counts, axis=0)
            # Rounding must not make a motor faster than its greatest rate.
            seconds = np.maximum(np.diff(t), (np.abs(steps) / self._max_rates()).max(axis=1))
            change = self._speed_changes(t, steps).tolist()
            mean = np.vstack([steps / seconds[:, None], np.zeros(len(self.start))])
            next_times = np.maximum(seconds, np.append(seconds[1:], seconds[-1]))
            open_end = first + _BLOCK_SEGMENTS < len(bounds) - 1  # the segment behind this block is not known yet
            for i in range(len(t) - 1):
                part = _Part(
                    seconds=float(seconds[i]),
                    counts=counts[i + 1].tolist(),
                    change=0.0 if open_end and i + 2 == len(t) else change[i],
                    start_speed=last_speed,
                    start_time=max(float(seconds[i]), span),
                    next_speed=mean[i + 1],
                    next_time=float(next_times[i]),
                )
                segment, last_speed = self._smooth_segment(cutter, part)
                span = part.seconds
                yield segment

    def _places_at(self, t: Array) -> Array:
        """The motors' fractional counts at times t: (T, motors).

        Both ends are rounded to whole counts. The offset of at most half a step fades out as fast as _SETTLING_SHARE
        of the motors' accelerations allows, so that positions between are exact.
        """
        duration = self.stretch.duration
        ends = exact_pulses(self.arm, self.stretch.evaluate(np.array([0.0, duration])))
        counts = exact_pulses(self.arm, self.stretch.evaluate(t))
        for offset, time_to_end in ((self.start - ends[0], t), (self.end - ends[1], duration - t)):
            # fraction^2 (3 - 2 fraction) bends by 6
            span = np.sqrt(6 * np.abs(offset) / (_SETTLING_SHARE * motor_accel(self.arm)))
            fraction = np.clip(time_to_end[:, None] / np.clip(span, 1e-9, duration), 0.0, 1.0)
            counts = counts + offset * (1 - fraction * fraction * (3 - 2 * fraction))
        return np.asarray(counts)

    def _smooth_segment(self, cutter: Cutter, part: _Part) -> tuple[Segment, Array]:
        """One segment and the motors' speeds at its end, its ramp reduced as far as the board needs.

        A segment without a ramp always fits, since its mean speed follows the last one within the greatest
        acceleration. Moves the cutter on.
        """
        max_accel = _JUMP_FACTOR * motor_accel(self.arm)
        places, late = list(cutter.places), cutter.late
        for share in (1.0, 0.75, 0.5, 0.25, 0.0):
            cutter.places, cutter.late = list(places), late
            segment = cutter.piece(part.seconds, part.counts, part.change * share)
            rate = np.array(segment.rates) * (self.clock / STEP)
            begin, end = rate / segment.interval, rate / segment.last_interval
            if share == 0.0 or part.admits(begin, end, max_accel):
                break
        return segment, end

    def _max_rates(self) -> Array:
        """Greatest rate of every motor: (motors,) [counts/s]."""
        return np.asarray(np.abs(self.arm.motor_gain) @ self.arm.max_speed)

    def _speed_changes(self, t: Array, steps: Array) -> Array:
        """The relative change of speed in every segment, see `Cutter.piece`: (segments,).

        It follows the speed along the path, but is limited so that no motor's speed changes within a segment, or jumps
        between two, by more than 1.1 of its greatest acceleration; the board refuses 1.25. The limit is needed since on
        a curve some motors speed up while others slow down, and a segment has one ramp for all.
        """
        gain = self.arm.motor_gain.T
        speed = np.linalg.norm(self.stretch.evaluate(t, 1) @ gain, axis=1).tolist()
        change = np.array([speed_change(a, b) for a, b in pairwise(speed)])
        interval = np.diff(t)[:, None]
        max_accel = _JUMP_FACTOR * motor_accel(self.arm)
        ramp = change[:, None] * steps / interval**2  # each motor's acceleration in the segment
        size = np.maximum(np.abs(ramp), 1e-12)
        share = np.minimum((max_accel / size).min(axis=1), 1.0)
        reserve = np.maximum(self._max_rates() * interval / np.maximum(np.abs(steps), 1e-12) - 1, 0.0).min(axis=1)
        share = np.minimum(share, 2 * reserve / np.maximum(np.abs(change), 1e-12))
        for end in (self.stretch.evaluate(t[:-1] + 1e-9, 2) @ gain, self.stretch.evaluate(t[1:] - 1e-9, 2) @ gain):
            room = (np.maximum(max_accel + end * np.sign(ramp), 0.0) / size).min(axis=1)
            share = np.minimum(share, room)
        return np.asarray(share * change)

    def __len__(self) -> int:
        return len(self.bounds()) - 1

    def bounds(self) -> Array:
        """The times between segments, from 0 to the duration: (segments + 1,) [s]."""
        duration = self.stretch.duration
        t = np.linspace(0.0, duration, max(int(duration / _SAMPLE_PERIOD), 16))
        level = self._density(t)  # segments a second, then segments since the beginning
        level[1:] += level[:-1].copy()
        level[0] = 0.0
        level /= 2
        level[1:] *= np.diff(t)
        np.cumsum(level, out=level)
        number = max(int(level[-1]), 1)
        times = np.interp(np.linspace(0.0, level[-1], number + 1), level, t)
        times[-1] = duration
        return np.asarray(times)

    def _density(self, t: Array) -> Array:
        """The number of segments a second needed at evenly spaced times t over the stretch: (T,)."""
        duration, step = self.stretch.duration, float(t[1])
        density, first = np.empty(len(t)), 0
        earlier_stops = np.zeros(0)  # stopping times before a part that reach into it
        for part in np.array_split(t, max(len(t) // _CHUNK_SAMPLES, 1)):
            span, stop = self._span_limits(part)
            span = np.minimum(span, _GROWTH_SHARE * np.minimum(part, duration - part))
            stop_times = np.concatenate([earlier_stops, stop])
            span = np.maximum(
                np.clip(span, _MIN_SECONDS, _MAX_SECONDS), _least_spans(stop_times, step)[len(earlier_stops) :]
            )
            density[first : first + len(part)] = 1.0 / span
            first += len(part)
            earlier_stops = stop_times[-int(stop_times.max() / step) - 1 :]
        return density

    def _span_limits(self, t: Array) -> tuple[Array, Array]:
        """The longest chord [s] and the longest stopping time [s] of a motor, at times t: (T,) each.

        A chord counts as unlimited (inf) where a bound from the arm's reach shows that it may be longer than any
        segment.
        """
        arm, dq, ddq = self.arm, self.stretch.evaluate(t, 1), self.stretch.evaluate(t, 2)
        stop = (np.abs(dq @ arm.motor_gain.T) / motor_accel(arm)).max(axis=1)
        lever = np.abs(arm.ratio) * np.where(arm.prismatic, 1.0, arm.reach)
        limited_rows = np.flatnonzero(np.abs(ddq) @ lever > 8 * self.tolerance / _MAX_SECONDS**2)
        J = jacobian(arm, self.stretch.evaluate(t[limited_rows]))[:, :3]
        v, accel = ((J @ x[limited_rows, :, None])[..., 0] for x in (dq, ddq))
        tangent = v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-9)
        normal_accel = np.linalg.norm(accel - tangent * (tangent * accel).sum(axis=1, keepdims=True), axis=1)
        span = np.full(len(t), np.inf)
        span[limited_rows] = np.sqrt(8 * self.tolerance / np.maximum(normal_accel, 1e-9))
        return span, stop


def _least_spans(stop: Array, step: float) -> Array:
    """The shortest segments of which `_QUEUED_SEGMENTS` always reach to a stop, at samples `step` [s] apart.

    A stopping time u at some moment applies to all segments within the following time u.
    """
    needed_spans = stop / _QUEUED_SEGMENTS
    shortest = needed_spans.copy()
    if float(needed_spans.max(initial=0.0)) <= _MIN_SECONDS:  # segments are never shorter
        return shortest
    for shift in range(1, min(int(stop.max(initial=0.0) / step) + 1, len(stop))):
        shortest[shift:] = np.maximum(
            shortest[shift:], np.where(stop[:-shift] >= shift * step, needed_spans[:-shift], 0.0)
        )
    return shortest


def sampled_rates(arm: Arm, stretch: Stretch) -> Array:
    """Greatest rate of every motor: (motors,) [counts/s], sampled every 5 ms."""
    t = np.linspace(0.0, stretch.duration, max(int(stretch.duration / _SAMPLE_PERIOD), 16))
    parts = np.array_split(t, max(len(t) // _CHUNK_SAMPLES, 1))
    return np.asarray(
        np.max([np.abs(stretch.evaluate(part, 1) @ arm.motor_gain.T).max(axis=0) for part in parts], axis=0)
    )
