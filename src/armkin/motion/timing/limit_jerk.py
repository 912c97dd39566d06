"""Limits the jerk of a path, and of rounded waypoints: a moving average smooths their curve in time.

Joint moves are limited in jerk by the seven phases of `profile.py` instead.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from armkin.formula.arrays import Array
from armkin.motion.timing.cubic_knots import Knots
from armkin.motion.timing.curved_stretch import Curve

# Gauss-Legendre, four points on [0, 1]: exact for polynomials up to degree 7, and q is of degree 6 in time.
_X = np.array([0.06943184420297371, 0.33000947820757187, 0.6699905217924281, 0.9305681557970263])
_W = np.array([0.17392742256872692, 0.32607257743127307, 0.32607257743127307, 0.17392742256872692])
MIN_WINDOW = 1e-5  # least window [s] of an average: a board makes some steps in it
_NEXT_SHARE, _MOST_SHARES = 0.7, 24  # shares of accelerations that are tried: down to 3e-4


def smoothing_window(accel: Array, jerk: ArrayLike) -> float:
    """The window [s] whose moving average limits the jerk: accel (n,) [rad/s2 | mm/s2], jerk (n,) [rad/s3 | mm/s3]."""
    return float((2 * accel / np.asarray(jerk, dtype=float)).max())


def share_within(distance: float, accel: Array, jerk: ArrayLike) -> float:
    """The share of accelerations (n,) at which the moving average stays within a distance of its curve at any time.

    distance, accel, jerk: in lengths that may be added up in squares. The average over T is off by at most T^2/24 times
    the greatest length of the acceleration, and T itself is in proportion to that.
    """
    farthest = smoothing_window(accel, jerk) ** 2 / 24 * float(np.linalg.norm(accel))
    return float(min(1.0, (distance / farthest) ** (1 / 3)))


def smoothed(curve: Curve, window: float) -> "Curve | Smoothed":
    """The moving average of a curve; the curve itself for a window of which differences of integrals tell nothing."""
    return Smoothed(curve, window) if window > MIN_WINDOW else curve


@dataclass(frozen=True)
class Smoothed:
    """The moving average of a curve over the last `window` seconds, whose jerk is bounded.

    q(t) is the integral of the curve over [t - window, t], divided by the window. Its speed and acceleration are at
    most the curve's, its jerk is at most twice the curve's acceleration divided by the window, and it takes exactly the
    window longer.
    """

    curve: Curve
    window: float

    @property
    def duration(self) -> float:
        """Seconds."""
        return self.curve.duration + self.window

    @property
    def waypoints(self) -> int:
        """Waypoints that it leads through, its end included."""
        return self.curve.waypoints

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

    def lengths(self, t: Array) -> Array:
        """s of the curve at the middle of the window: (T,) -> (T,)."""
        return self.curve.lengths(np.asarray(t) - self.window / 2)

    @cached_property
    def _sums(self) -> Array:
        """Integral of q - start up to every grid point's time: (N, n)."""
        times = self.curve.times
        step = np.diff(times)
        t = times[:-1, None] + step[:, None] * _X
        q = self.curve.evaluate(t.ravel()).reshape(*t.shape, len(self.start)) - self.start
        pieces = (q * _W[:, None]).sum(axis=1) * step[:, None]
        return np.concatenate([np.zeros((1, pieces.shape[1])), np.cumsum(pieces, axis=0)])

    def _integral(self, t: Array) -> Array:
        """Integral of q - start from 0 to t, at rest before and after: (T, n)."""
        curve = self.curve
        times = np.clip(t, 0.0, curve.duration)
        i = np.clip(np.searchsorted(curve.times, times, side="right") - 1, 0, len(curve.times) - 2)
        step = times - curve.times[i]
        nodes = curve.times[i][:, None] + step[:, None] * _X
        q = curve.evaluate(nodes.ravel()).reshape(*nodes.shape, len(self.start)) - self.start
        last_part = (q * _W[:, None]).sum(axis=1) * step[:, None]
        rest_part = np.maximum(t - curve.duration, 0.0)[:, None] * (self.end - self.start)
        return np.asarray(self._sums[i] + last_part + rest_part)

    def evaluate(self, t: Array, derivative: int = 0) -> Array:
        """Joint values, or their first or second derivative, at times t [s] since its beginning: (T,) -> (T, n)."""
        end = np.clip(np.asarray(t, dtype=float), 0.0, self.duration)
        begin = end - self.window
        if derivative == 0:
            return np.asarray(self.start + (self._integral(end) - self._integral(begin)) / self.window)
        change = self.curve.evaluate(end, derivative - 1) - self.curve.evaluate(begin, derivative - 1)
        if derivative == 2:  # the curve is at rest outside its duration, where evaluate clips to its ends
            is_inside = [((t >= 0) & (t <= self.curve.duration))[:, None] for t in (end, begin)]
            change = self.curve.evaluate(end, 1) * is_inside[0] - self.curve.evaluate(begin, 1) * is_inside[1]
        return np.asarray(change / self.window)


def fastest_timing(timed: Callable[[float], list[Curve | Smoothed]]) -> list[Curve | Smoothed]:
    """The fastest of the timings that shares of the accelerations give, of ever smaller ones.

    The window is in proportion to the accelerations, and what it allows in a bend to one by its square: with little
    jerk smaller accelerations are faster. The first share is 1, the search ends where a smaller one is slower.
    """
    fastest = timed(1.0)
    for k in range(1, _MOST_SHARES):
        curves = timed(_NEXT_SHARE**k)
        if sum(curve.duration for curve in curves) >= sum(curve.duration for curve in fastest):
            break
        fastest = curves
    return fastest


def joint_path(stretch: Curve | Smoothed) -> Knots:
    """The joint path of a curve, or of the curve that was smoothed."""
    return stretch.path if isinstance(stretch, Curve) else stretch.curve.path


def join_joint_paths(stretches: Sequence[Curve | Smoothed]) -> Knots:
    """The joint paths of stretches in order as one, with a rest between each two."""
    paths = [joint_path(stretch) for stretch in stretches]
    if len(paths) == 1:
        return paths[0]
    return Knots(*(np.concatenate([getattr(path, part) for path in paths]) for part in ("s", "q", "d")))
