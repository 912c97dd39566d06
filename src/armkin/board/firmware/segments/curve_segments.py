"""Any stretch of a trajectory as device segments: straight lines in counts with a ramp of speed, made as asked for.

A segment spans so little time that its chord leaves the curve by at most the tolerance, and that its speed changes
by about an eighth near a rest; at least 10 ms, and so much that the board's queue always reaches to a stop. It ends
where the motors are then, fractions of a step included (`Cutter`); its ramp follows the speed along the way.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from armkin.board.firmware.segments.counts_to_segments import Counts, Cutter, speed_change
from armkin.board.firmware.wire.protocol import STEP, Segment
from armkin.formula.arrays import Array
from armkin.forward import jacobian
from armkin.motors import exact_pulses, motor_accel

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.motion.timing.trajectory import Stretch

_MIN_SECONDS, _MAX_SECONDS = 0.010, 0.050  # length [s] of a segment, at least and at most
_GROWTH_SHARE = 0.12  # length of a segment, at most, as a share of the time since the start, or to the end
_SAMPLE_PERIOD = 0.005  # time [s] between the samples from which the spans are chosen
_QUEUED_SEGMENTS = 25  # segments that are surely in the board's queue
_SETTLING_SHARE = 0.05  # share of the motors' accelerations with which the rounding of both ends is left behind
_JUMP_FACTOR = 1.1  # factor on the motors' accelerations that a segment has at most
_CHUNK_SAMPLES = 20_000  # samples looked at at once
_BLOCK_SEGMENTS = 512  # segments made at once


@dataclass(frozen=True)
class CurveSegments:
    """The segments of one stretch; iterating makes them anew, in bounded memory."""

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
        before, span = np.zeros(len(self.start)), 0.0  # the speed at the end of the segment before, and its time
        for first in range(0, len(bounds) - 1, _BLOCK_SEGMENTS):
            t = bounds[first : first + _BLOCK_SEGMENTS + 1]
            counts = self._places_at(t)
            if first + _BLOCK_SEGMENTS >= len(bounds) - 1:
                counts[-1] = self.end
            steps = np.diff(counts, axis=0)
            # No motor faster than its greatest rate, whatever rounding says.
            seconds = np.maximum(np.diff(t), (np.abs(steps) / self._max_rates()).max(axis=1))
            change = self._speed_changes(t, steps).tolist()
            mean = np.vstack([steps / seconds[:, None], np.zeros(len(self.start))])
            longer = np.maximum(seconds, np.append(seconds[1:], seconds[-1]))
            open_end = first + _BLOCK_SEGMENTS < len(bounds) - 1  # what follows this block is not known here
            for k in range(len(t) - 1):
                segment, before = self._smooth_segment(
                    cutter, float(seconds[k]), counts[k + 1].tolist(),
                    0.0 if open_end and k + 2 == len(t) else change[k], before,
                    max(float(seconds[k]), span), mean[k + 1], float(longer[k]),
                )  # fmt: skip
                span = float(seconds[k])
                yield segment

    def _places_at(self, t: Array) -> Array:
        """Where the motors are at times t, fractions included: (T, motors).

        Both ends are whole counts; what rounding them has moved, half a step at most, is left behind as fast as
        _SETTLING_SHARE of the motors' accelerations allow, so that in between nothing is off but the steps themselves.
        """
        duration = self.stretch.duration
        ends = exact_pulses(self.arm, self.stretch.evaluate(np.array([0.0, duration])))
        counts = exact_pulses(self.arm, self.stretch.evaluate(t))
        for offset, since in ((self.start - ends[0], t), (self.end - ends[1], duration - t)):
            span = np.sqrt(6 * np.abs(offset) / (_SETTLING_SHARE * motor_accel(self.arm)))  # f^2 (3 - 2 f) bends by 6
            f = np.clip(since[:, None] / np.clip(span, 1e-9, duration), 0.0, 1.0)
            counts = counts + offset * (1 - f * f * (3 - 2 * f))
        return np.asarray(counts)

    def _smooth_segment(
        self, cutter: Cutter, seconds: float, counts: list[float], change: float, start_speed: Array, begin_time: float,
        end_speed: Array, end_time: float,
    ) -> tuple[Segment, Array]:  # fmt: skip
        """One segment and the motors' speeds at its end, its ramp taken back as far as the board asks for it.

        start_speed: speeds at the end of the segment before; end_speed: the mean speed of the next one; begin_time,
        end_time: the longer time of each two. Without a ramp a segment always fits: its mean follows the one before
        within the greatest acceleration.
        """
        most = _JUMP_FACTOR * motor_accel(self.arm)
        state = list(cutter.places), cutter.late
        for share in (1.0, 0.75, 0.5, 0.25, 0.0):
            cutter.places, cutter.late = list(state[0]), state[1]
            segment = cutter.piece(seconds, counts, change * share)
            rate = np.array(segment.rates) * (self.clock / STEP)
            begin, end = rate / segment.interval, rate / segment.last_interval
            slow = (np.abs(begin - start_speed) <= most * begin_time).all() and (
                np.abs(end - begin) <= most * seconds
            ).all()
            if share == 0.0 or (slow and (np.abs(end_speed - end) <= most * end_time).all()):
                break
        return segment, end

    def _max_rates(self) -> Array:
        """Greatest rate of every motor: (motors,) [counts/s]."""
        return np.asarray(np.abs(self.arm.motor_gain) @ self.arm.max_speed)

    def _speed_changes(self, t: Array, steps: Array) -> Array:
        """How much the speed changes in every segment, see `Cutter.piece`: (segments,).

        As the speed along the way does, but so that no motor's speed jumps where two segments meet, nor changes in
        one, by more than 1.1 of what its greatest acceleration makes: the board refuses 1.25. On a curve motors speed
        up and slow down at once, and a segment has one ramp for all.
        """
        gain = self.arm.motor_gain.T
        speed = np.linalg.norm(self.stretch.evaluate(t, 1) @ gain, axis=1).tolist()
        change = np.array([speed_change(a, b) for a, b in pairwise(speed)])
        h = np.diff(t)[:, None]
        most = _JUMP_FACTOR * motor_accel(self.arm)
        ramp = change[:, None] * steps / h**2  # what the segment makes of each motor's acceleration
        size = np.maximum(np.abs(ramp), 1e-12)
        share = np.minimum((most / size).min(axis=1), 1.0)
        spare = np.maximum(self._max_rates() * h / np.maximum(np.abs(steps), 1e-12) - 1, 0.0).min(axis=1)
        share = np.minimum(share, 2 * spare / np.maximum(np.abs(change), 1e-12))
        for end in (self.stretch.evaluate(t[:-1] + 1e-9, 2) @ gain, self.stretch.evaluate(t[1:] - 1e-9, 2) @ gain):
            room = (np.maximum(most + end * np.sign(ramp), 0.0) / size).min(axis=1)
            share = np.minimum(share, room)
        return np.asarray(share * change)

    def __len__(self) -> int:
        return len(self.bounds()) - 1

    def bounds(self) -> Array:
        """Times where segments end, from 0 to the duration: (segments + 1,) [s]."""
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
        """How many segments a second are wanted at times t, which cover the stretch evenly: (T,)."""
        duration, step = self.stretch.duration, float(t[1])
        density, first = np.empty(len(t)), 0
        behind = np.zeros(0)  # times to a stop just before a part, as many as may reach into it
        for part in np.array_split(t, max(len(t) // _CHUNK_SAMPLES, 1)):
            span, stop = self._span_limits(part)
            span = np.minimum(span, _GROWTH_SHARE * np.minimum(part, duration - part))
            stop_times = np.concatenate([behind, stop])
            span = np.maximum(np.clip(span, _MIN_SECONDS, _MAX_SECONDS), _least_spans(stop_times, step)[len(behind) :])
            density[first : first + len(part)] = 1.0 / span
            first += len(part)
            behind = stop_times[-int(stop_times.max() / step) - 1 :]
        return density

    def _span_limits(self, t: Array) -> tuple[Array, Array]:
        """At times t: how long a chord may be [s], and the time to a stop [s] of the motor that needs longest.

        A chord that may be longer than any segment, with joints that bear on the tip no more than the arm's reach
        lets them, is not looked at more closely: it may be of any length.
        """
        arm, qd, qdd = self.arm, self.stretch.evaluate(t, 1), self.stretch.evaluate(t, 2)
        stop = (np.abs(qd @ arm.motor_gain.T) / motor_accel(arm)).max(axis=1)
        lever = np.abs(arm.ratio) * np.where(arm.prismatic, 1.0, arm.reach)
        tight = np.flatnonzero(np.abs(qdd) @ lever > 8 * self.tolerance / _MAX_SECONDS**2)
        J = jacobian(arm, self.stretch.evaluate(t[tight]))[:, :3]
        v, bend = ((J @ x[tight, :, None])[..., 0] for x in (qd, qdd))
        along = v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-9)
        across = np.linalg.norm(bend - along * (along * bend).sum(axis=1, keepdims=True), axis=1)
        span = np.full(len(t), np.inf)
        span[tight] = np.sqrt(8 * self.tolerance / np.maximum(across, 1e-9))
        return span, stop


def _least_spans(stop: Array, step: float) -> Array:
    """Least span of segments so that `_QUEUED_SEGMENTS` of them always reach to a stop; samples `step` [s] apart.

    What moves now and needs u to a stop asks that of all segments within the next u.
    """
    need = stop / _QUEUED_SEGMENTS
    least = need.copy()
    if float(need.max(initial=0.0)) <= _MIN_SECONDS:  # no segment is shorter
        return least
    for d in range(1, min(int(stop.max(initial=0.0) / step) + 1, len(stop))):
        least[d:] = np.maximum(least[d:], np.where(stop[:-d] >= d * step, need[:-d], 0.0))
    return least


def sampled_rates(arm: Arm, stretch: Stretch) -> Array:
    """Greatest rate of every motor: (motors,) [counts/s], sampled every 5 ms."""
    t = np.linspace(0.0, stretch.duration, max(int(stretch.duration / _SAMPLE_PERIOD), 16))
    parts = np.array_split(t, max(len(t) // _CHUNK_SAMPLES, 1))
    return np.asarray(
        np.max([np.abs(stretch.evaluate(part, 1) @ arm.motor_gain.T).max(axis=0) for part in parts], axis=0)
    )
