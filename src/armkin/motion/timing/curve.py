"""A curved way through joint space with a law of time, and the same made smooth by a moving average."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array
from armkin.motion.timing.cubics import Knots

# Gauss-Legendre, four points on [0, 1]: exact for polynomials up to degree 7, and q is of degree 6 in time.
_X = np.array([0.06943184420297371, 0.33000947820757187, 0.6699905217924281, 0.9305681557970263])
_W = np.array([0.17392742256872692, 0.32607257743127307, 0.32607257743127307, 0.17392742256872692])


@dataclass(frozen=True)
class Curve:
    """Cubics q(s) between grid points, ds/dt from x: exact in between, sampled at will."""

    path: Knots
    x: Array  # (N,) (ds/dt)^2 at the grid points
    waypoints: int = 1  # that it leads through, its end included

    @cached_property
    def times(self) -> Array:
        """When every grid point is passed: (N,) [s]."""
        root = np.sqrt(self.x)
        step = 2 * self.path.h / np.maximum(root[:-1] + root[1:], 1e-300)
        return np.concatenate([[0.0], np.cumsum(step)])

    @cached_property
    def _u(self) -> Array:
        return np.asarray(np.diff(self.x) / (2 * self.path.h))

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

    def place(self, t: Array) -> tuple[NDArray[np.intp], Array, Array, Array]:
        """Interval, way into it, ds/dt and d2s/dt2 at times t: (T,) each."""
        when = np.clip(t, 0.0, self.duration)
        i = np.clip(np.searchsorted(self.times, when, side="right") - 1, 0, len(self._u) - 1)
        tau = when - self.times[i]
        v, u = np.sqrt(self.x[i]), self._u[i]
        return i, np.clip(tau * (v + tau * u / 2), 0.0, self.path.h[i]), np.maximum(v + tau * u, 0.0), u

    def way(self, t: Array) -> Array:
        """s at times t: (T,) -> (T,)."""
        i, along, _, _ = self.place(t)
        return np.asarray(self.path.s[i] + along)

    def at(self, t: Array, order: int = 0) -> Array:
        """Joint values (order 0), speeds (1) or accelerations (2) at seconds since its beginning: (T,) -> (T, n)."""
        i, along, v, u = self.place(np.asarray(t, dtype=float))
        h, w = self.path.h[i][:, None], along[:, None]
        d0, d1 = self.path.d[i], self.path.d[i + 1]
        chord = (self.path.q[i + 1] - self.path.q[i]) / h
        c2, c3 = (3 * chord - 2 * d0 - d1) / h, (d0 + d1 - 2 * chord) / h**2
        if order == 0:
            return np.asarray(self.path.q[i] + w * (d0 + w * (c2 + w * c3)))
        first = d0 + w * (2 * c2 + 3 * w * c3)
        if order == 1:
            return np.asarray(first * v[:, None])
        return np.asarray((2 * c2 + 6 * w * c3) * (v**2)[:, None] + first * u[:, None])


@dataclass(frozen=True)
class Smoothed:
    """A curve's mean over the last `window` seconds: bounded jerk, no more speed, no more acceleration.

    q(t) is the integral of the curve over [t - window, t], by the window. Its jerk is at most twice the curve's
    acceleration by the window; it takes exactly the window longer.
    """

    curve: Curve
    window: float

    @property
    def duration(self) -> float:
        """Seconds."""
        return self.curve.duration + self.window

    @property
    def start(self) -> Array:
        """Joint values at the beginning: (n,)."""
        return self.curve.start

    @property
    def end(self) -> Array:
        """Joint values at the end: (n,)."""
        return self.curve.end

    @property
    def top_speed(self) -> Array:
        """Upper bound of the speed of every joint: (n,)."""
        return self.curve.top_speed

    def way(self, t: Array) -> Array:
        """s of the curve at the middle of the window: (T,) -> (T,)."""
        return self.curve.way(np.asarray(t) - self.window / 2)

    @cached_property
    def _sums(self) -> Array:
        """Integral of q - start up to every grid point's time: (N, n)."""
        times = self.curve.times
        step = np.diff(times)
        t = times[:-1, None] + step[:, None] * _X
        q = self.curve.at(t.ravel()).reshape(*t.shape, -1) - self.start
        pieces = (q * _W[:, None]).sum(axis=1) * step[:, None]
        return np.concatenate([np.zeros((1, pieces.shape[1])), np.cumsum(pieces, axis=0)])

    def _integral(self, t: Array) -> Array:
        """Integral of q - start from 0 to t, at rest before and after: (T, n)."""
        curve = self.curve
        inside = np.clip(t, 0.0, curve.duration)
        i = np.clip(np.searchsorted(curve.times, inside, side="right") - 1, 0, len(curve.times) - 2)
        step = inside - curve.times[i]
        at = curve.times[i][:, None] + step[:, None] * _X
        q = curve.at(at.ravel()).reshape(*at.shape, -1) - self.start
        part = (q * _W[:, None]).sum(axis=1) * step[:, None]
        beyond = np.maximum(t - curve.duration, 0.0)[:, None] * (self.end - self.start)
        return np.asarray(self._sums[i] + part + beyond)

    def at(self, t: Array, order: int = 0) -> Array:
        """Joint values (order 0), speeds (1) or accelerations (2) at seconds since its beginning: (T,) -> (T, n)."""
        now = np.clip(np.asarray(t, dtype=float), 0.0, self.duration)
        then = now - self.window
        if order == 0:
            return np.asarray(self.start + (self._integral(now) - self._integral(then)) / self.window)
        change = self.curve.at(now, order - 1) - self.curve.at(then, order - 1)
        if order == 2:  # speeds before and after the curve are 0, whatever the clipped ends say
            inside = [((t >= 0) & (t <= self.curve.duration))[:, None] for t in (now, then)]
            change = self.curve.at(now, 1) * inside[0] - self.curve.at(then, 1) * inside[1]
        return np.asarray(change / self.window)


def way_of(stretch: Curve | Smoothed) -> Knots:
    """The way through joint space of a curve, or of the one that was made smooth."""
    return stretch.path if isinstance(stretch, Curve) else stretch.curve.path


def ways_of(stretches: Sequence[Curve | Smoothed]) -> Knots:
    """The ways of stretches one after another as one, with a rest between each two."""
    ways = [way_of(one) for one in stretches]
    if len(ways) == 1:
        return ways[0]
    return Knots(*(np.concatenate([getattr(way, part) for way in ways]) for part in ("s", "q", "d")))
