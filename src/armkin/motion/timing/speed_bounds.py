"""The acceleration constraints of every interval of a path, and the two passes that give the fastest time law."""

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Int
from armkin.motion.timing.cubic_knots import Knots
from armkin.motion.timing.speed_scan import Least, backward_step, concatenate_least, forward_step, least_of, scan

TINY = 1e-300  # floor of divisors, which keeps quotients finite
_CHUNK_INTERVALS = 16_384  # intervals whose constraints are in memory at once, some hundred numbers each
_PAIRED_INTERVALS = 4096  # intervals whose constraints are compared in pairs at once

Intervals = slice | Int  # of the intervals


class Motion(NamedTuple):
    """The k bounded coordinates along M intervals: the joints, and motors that drive several of them."""

    first: Array  # (k, M) their slopes at the left end of every interval
    left_slope: Array  # (k, M) their second derivatives at its left end
    bend: Array  # (k, M) how much greater these are at its right end
    h: Array  # (M,)
    accel: Array  # (k, M) greatest acceleration

    def accel_shares(self, x0: Array, x1: Array) -> Array:
        """Greatest share of the acceleration inside every interval, with x (M,) at its ends: (k, M).

        With q'' = l + f (r - l) and x(f) = x + 2 u h f at its fraction f it is u q'(f) + q''(f) x(f).
        """
        u = (x1 - x0) / (2 * self.h)
        a = u * self.first + self.left_slope * x0  # a + b f + c f^2
        b = 3 * u * self.h * self.left_slope + self.bend * x0
        c = 2.5 * u * self.h * self.bend
        f = np.fmin(np.fmax(-b / (2 * c), 0.0), 1.0)  # 0 where the parabola is a line
        middle = np.abs(a + f * (b + f * c))
        return np.asarray(np.maximum(np.maximum(middle, np.abs(a)), np.abs(a + b + c)) / self.accel)

    def squared_speed_shares(self, x0: Array, x1: Array, speed: Array) -> Array:
        """Greatest share of the joints' speeds (n, M) inside every interval, squared: (M,).

        (q'(f))^2 x(f) is greatest at an end, which its cap holds, or where its derivative, a quadratic, is zero.
        """
        n, h = len(speed), self.h
        ends = np.maximum(
            np.abs(self.first[:n]), np.abs(self.first[:n] + h * (self.left_slope[:n] + 0.5 * self.bend[:n]))
        )
        bound = ((ends + 0.125 * h * np.abs(self.bend[:n])) / speed).max(axis=0) ** 2 * np.maximum(x0, x1)
        candidates = np.flatnonzero(bound > 1.0)
        d, left, bend = self.first[:n, candidates], self.left_slope[:n, candidates], self.bend[:n, candidates]
        h, dx, x = h[candidates], (x1 - x0)[candidates], x0[candidates]
        c = 2 * h * left * x + d * dx
        b = 2 * h * bend * x + 3 * h * left * dx
        a = 2.5 * h * bend * dx
        q = -0.5 * (b + np.copysign(np.sqrt(np.maximum(b * b - 4 * a * c, 0.0)), b))
        shares = np.zeros(len(bound))
        for root in (q / a, c / q):
            f = np.fmin(np.fmax(root, 0.0), 1.0)
            slope = d + h * f * (left + 0.5 * f * bend)
            share = np.nan_to_num((slope / speed[:, candidates]) ** 2 * (x + f * dx)).max(axis=0, initial=0.0)
            shares[candidates] = np.maximum(shares[candidates], share)
        return shares


class Bound:
    """The bounds along a path, evaluated for parts of its intervals to keep memory bounded on long paths."""

    def __init__(self, path: Knots, accel: Array, rows: tuple[Array, Array] | None) -> None:
        self.path, self.accel, self.weights = path, accel, rows
        self.count = path.q.shape[1] + (0 if rows is None else len(rows[0]))

    def motion_in(self, intervals: Intervals) -> Motion:
        """The bounded coordinates along some of the intervals."""
        first, left, right = self.path.slopes(intervals)
        low = np.minimum(self.accel[:-1][intervals], self.accel[1:][intervals]).T  # the lower limit of the ends counts
        if self.weights is not None:
            weights, max_accel = self.weights
            first, left, right = (np.concatenate([x, weights @ x]) for x in (first, left, right))
            low = np.concatenate([low, np.broadcast_to(max_accel[:, None], (len(max_accel), low.shape[1]))])
        return Motion(first, left, right - left, self.path.h[intervals], low)


class Fastest:
    """The fastest x (N,) within a cap and the accelerations, updated where either is lowered."""

    def __init__(self, bound: Bound, cap: Array) -> None:
        self.bound, self.cap = bound, cap
        M = len(cap) - 1
        self.share = np.ones((bound.count, M), np.float32)  # share of the accelerations
        parts = [self._functions(intervals) for intervals in interval_parts(M)]
        self.backward_bounds = concatenate_least([bounds for bounds, _ in reversed(parts)])
        self.forward_bounds = concatenate_least([bounds for _, bounds in parts])
        self.beta = scan(cap[::-1], self.backward_bounds)[::-1]
        self.x = scan(self.beta, self.forward_bounds)

    def lower_speeds(self, intervals: Int) -> None:
        """Update x after cap or share was lowered in some intervals (k,), ascending, or at their ends."""
        M = len(self.cap) - 1
        for part in interval_parts(len(intervals)):
            rows = intervals[part]
            backward, forward = self._functions(rows)
            self.backward_bounds = self.backward_bounds.replace_intervals(M - 1 - rows[::-1], backward)
            self.forward_bounds = self.forward_bounds.replace_intervals(rows, forward)
        self.beta = scan(np.minimum(self.beta, self.cap)[::-1], self.backward_bounds)[::-1]
        self.x = scan(self.beta, self.forward_bounds, self.x)

    def _functions(self, intervals: Intervals) -> tuple[Least, Least]:
        """Bounds of the next x and of the previous one in some of the intervals; lowers the cap where they need it."""
        motion = self.bound.motion_in(intervals)
        P, R, C = _constraint_rows(motion._replace(accel=motion.accel * self.share[:, intervals]))
        slope, level, h = R / P, C / P, motion.h
        # The bounds of u must allow x to fall by no more than half on an interval: on long intervals near a bend the
        # greatest x could otherwise force a stop, at which the time law never ends.
        excess = slope - 0.25 / h
        room = np.where(excess > 0, level / excess, np.inf).min(axis=0)
        feasible = _largest_feasible(np.minimum(self.cap[:-1][intervals], room), slope, level)
        self.cap[:-1][intervals] = feasible
        forward, count = forward_step(h, slope, level), len(h)
        a, b = (np.concatenate(terms, axis=1) for terms in zip(backward_step(*forward), forward, strict=True))
        functions = least_of(a, b, np.concatenate([self.cap[1:][intervals][::-1], feasible]))
        return functions.part(0, count), functions.part(count, 2 * count)


def interval_parts(intervals: int) -> list[slice]:
    """Slices of the intervals that are evaluated at once, to keep memory bounded on long paths."""
    return [slice(k, min(k + _CHUNK_INTERVALS, intervals)) for k in range(0, max(intervals, 1), _CHUNK_INTERVALS)]


def _constraint_rows(motion: Motion) -> tuple[Array, Array, Array]:
    """P > 0, R, C of |P u + R x| <= C, x at the left end, for both ends of the intervals: (k, M)."""
    right = motion.left_slope + motion.bend
    p = np.concatenate([motion.first, motion.first + motion.h * (3 * motion.left_slope + 2.5 * motion.bend)])
    r = np.concatenate([motion.left_slope, right])
    size = np.abs(p)
    P = np.maximum(size, 1e-12 * size.max(initial=0.0) + TINY)
    return P, np.copysign(1.0, p) * r, np.concatenate([motion.accel, motion.accel])


def _largest_feasible(cap: Array, slope: Array, level: Array) -> Array:
    """The largest x, up to cap, at which some u satisfies all constraints.

    The constraints are -level_i - slope_i x <= u <= level_j - slope_j x for all i and j; x ends where two exclude u.
    """
    feasible = cap.copy()
    change = slope * cap
    lowest, highest = -(level + change).min(axis=0), (level - change).min(axis=0)
    clear = lowest < highest - 1e-9 * np.abs(highest)  # the cap itself is feasible
    tight_intervals = (~clear).nonzero()[0]
    i, j = _index_pairs(len(slope))
    for begin in range(0, len(tight_intervals), _PAIRED_INTERVALS):
        rows = tight_intervals[begin : begin + _PAIRED_INTERVALS]
        a, b = slope.take(rows, axis=1), level.take(rows, axis=1)
        crossing = (b.take(i, axis=0) + b.take(j, axis=0)) / np.abs(a.take(i, axis=0) - a.take(j, axis=0))
        feasible[rows] = np.fmin(feasible[rows], np.fmin.reduce(crossing, axis=0, initial=np.inf))
    return feasible


@cache
def _index_pairs(k: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Every two of k rows."""
    return np.triu_indices(k, 1)
