"""A curved path through joint space with its time law."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array
from armkin.motion.timing.cubic_knots import Knots


class CurvePlaces(NamedTuple):
    """Places along a path and the motion there: (T,) each."""

    interval: NDArray[np.intp]
    offset: Array  # length into the interval
    speed: Array  # ds/dt
    accel: Array  # d2s/dt2


@dataclass(frozen=True)
class Curve:
    """Cubics q(s) between grid points, ds/dt from x: exact in between, sampled at will."""

    path: Knots
    x: Array  # (N,) (ds/dt)^2 at the grid points
    waypoints: int = 1  # waypoints that it leads through, its end included

    @cached_property
    def times(self) -> Array:
        """The time at every grid point: (N,) [s]."""
        root = np.sqrt(self.x)
        step = 2 * self.path.h / np.maximum(root[:-1] + root[1:], 1e-300)
        return np.concatenate([[0.0], np.cumsum(step)])

    @cached_property
    def _u(self) -> Array:
        return np.asarray(np.diff(self.x) / (2 * self.path.h))

    @cached_property
    def _bends(self) -> tuple[Array, Array]:
        """The cubics' coefficients of the second and third power: (N - 1, n) each."""
        h, d0, d1 = self.path.h[:, None], self.path.d[:-1], self.path.d[1:]
        chord = np.diff(self.path.q, axis=0) / h
        return (3 * chord - 2 * d0 - d1) / h, (d0 + d1 - 2 * chord) / h**2

    @property
    def duration(self) -> float:
        """Seconds."""
        return float(self.times[-1])

    @property
    def start(self) -> Array:
        """Joint values at the beginning: (n,)."""
        return np.asarray(self.path.q[0])

    @property
    def end(self) -> Array:
        """Joint values at the end: (n,)."""
        return np.asarray(self.path.q[-1])

    @cached_property
    def top_speed(self) -> Array:
        """Greatest speed of every joint at the grid points: (n,)."""
        return np.asarray(np.abs(self.path.d * np.sqrt(self.x)[:, None]).max(axis=0))

    def locate(self, t: Array) -> CurvePlaces:
        """The places along the path at times t (T,)."""
        times = np.clip(t, 0.0, self.duration)
        i = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self._u) - 1)
        tau = times - self.times[i]
        v, u = np.sqrt(self.x[i]), self._u[i]
        return CurvePlaces(i, np.clip(tau * (v + tau * u / 2), 0.0, self.path.h[i]), np.maximum(v + tau * u, 0.0), u)

    def lengths(self, t: Array) -> Array:
        """The path parameter s at times t [s] since the beginning: (T,) -> (T,)."""
        place = self.locate(t)
        return np.asarray(self.path.s[place.interval] + place.offset)

    def evaluate(self, t: Array, derivative: int = 0) -> Array:
        """Joint values, or their first or second derivative, at times t [s] since its beginning: (T,) -> (T, n)."""
        i, offset, v, u = self.locate(np.asarray(t, dtype=float))
        w, c2, c3 = offset[:, None], *(part.take(i, axis=0) for part in self._bends)
        d0 = self.path.d.take(i, axis=0)
        if derivative == 0:
            return np.asarray(self.path.q.take(i, axis=0) + w * (d0 + w * (c2 + w * c3)))
        first = d0 + w * (2 * c2 + 3 * w * c3)
        if derivative == 1:
            return np.asarray(first * v[:, None])
        return np.asarray((2 * c2 + 6 * w * c3) * (v**2)[:, None] + first * u[:, None])
