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

from armkin.board.firmware.protocol import Segment
from armkin.board.firmware.segments import Counts, Cutter, changing
from armkin.formula.arrays import Array
from armkin.forward import jacobian
from armkin.motors import motor_accel, places

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.motion.trajectory import Stretch

_LEAST, _MOST = 0.010, 0.050  # [s] a segment
_GROWTH = 0.12  # of the time since the start, or to the end
_FINE = 0.005  # [s] between the samples from which the spans are chosen
_QUEUED = 25  # segments that are surely in the board's queue
_JUMP = 1.1  # of the greatest acceleration
_BLOCK = 512  # segments that are made at once


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
        for first in range(0, len(bounds) - 1, _BLOCK):
            t = bounds[first : first + _BLOCK + 1]
            at = places(self.arm, self.stretch.at(t))
            if first + _BLOCK >= len(bounds) - 1:
                at[-1] = self.end
            change = self._changes(t, np.diff(at, axis=0)).tolist()
            for k in range(len(t) - 1):
                yield cutter.piece(float(t[k + 1] - t[k]), at[k + 1].tolist(), change[k])

    def _changes(self, t: Array, steps: Array) -> Array:
        """How much the speed changes in every segment, see `Cutter.piece`: (segments,).

        As the speed along the way does, but so that no motor's speed jumps where two segments meet, nor changes in
        one, by more than 1.1 of what its greatest acceleration makes: the board refuses 1.25. On a curve motors speed
        up and slow down at once, and a segment has one ramp for all.
        """
        gain = self.arm.motor_gain.T
        speed = np.linalg.norm(self.stretch.at(t, 1) @ gain, axis=1).tolist()
        change = np.array([changing(a, b) for a, b in pairwise(speed)])
        h = np.diff(t)[:, None]
        most = _JUMP * motor_accel(self.arm)
        ramp = change[:, None] * steps / h**2  # what the segment makes of each motor's acceleration
        size = np.maximum(np.abs(ramp), 1e-12)
        share = np.minimum((most / size).min(axis=1), 1.0)
        for end in (self.stretch.at(t[:-1] + 1e-9, 2) @ gain, self.stretch.at(t[1:] - 1e-9, 2) @ gain):
            room = (np.maximum(most + end * np.sign(ramp), 0.0) / size).min(axis=1)
            share = np.minimum(share, room)
        return np.asarray(share * change)

    def __len__(self) -> int:
        return len(self.bounds()) - 1

    def bounds(self) -> Array:
        """Times where segments end, from 0 to the duration: (segments + 1,) [s]."""
        whole = self.stretch.duration
        t = np.linspace(0.0, whole, max(int(whole / _FINE), 16))
        parts = [self._spans(part) for part in np.array_split(t, max(len(t) // 20_000, 1))]
        span, stop = (np.concatenate(x) for x in zip(*parts, strict=True))
        span = np.minimum(span, _GROWTH * np.minimum(t, whole - t))
        span = np.maximum(np.clip(span, _LEAST, _MOST), _reaching(stop, float(t[1])))
        density = 1.0 / span
        level = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2 * np.diff(t))])
        number = max(int(level[-1]), 1)
        out = np.interp(np.linspace(0.0, level[-1], number + 1), level, t)
        out[-1] = whole
        return np.asarray(out)

    def _spans(self, t: Array) -> tuple[Array, Array]:
        """At times t: how long a chord may be [s], and the time to a stop [s] of the motor that needs longest."""
        q, qd = self.stretch.at(t), self.stretch.at(t, 1)
        J = jacobian(self.arm, q)[:, :3]
        v, bend = ((J @ x[:, :, None])[..., 0] for x in (qd, self.stretch.at(t, 2)))
        along = v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-9)
        across = np.linalg.norm(bend - along * (along * bend).sum(axis=1, keepdims=True), axis=1)
        stop = (np.abs(qd @ self.arm.motor_gain.T) / motor_accel(self.arm)).max(axis=1)
        return np.sqrt(8 * self.tolerance / np.maximum(across, 1e-9)), stop


def _reaching(stop: Array, step: float) -> Array:
    """Least span of segments so that `_QUEUED` of them always reach to a stop; samples `step` [s] apart.

    What moves now and needs u to a stop asks that of all segments within the next u.
    """
    need = stop / _QUEUED
    out = need.copy()
    for d in range(1, min(int(stop.max(initial=0.0) / step) + 1, len(stop))):
        out[d:] = np.maximum(out[d:], np.where(stop[:-d] >= d * step, need[:-d], 0.0))
    return out


def rates(arm: Arm, stretch: Stretch) -> Array:
    """Greatest rate of every motor: (motors,) [counts/s], sampled every 5 ms."""
    t = np.linspace(0.0, stretch.duration, max(int(stretch.duration / _FINE), 16))
    return np.asarray(np.abs(stretch.at(t, 1) @ arm.motor_gain.T).max(axis=0))
