"""The fastest law of time along a joint path, within speeds and accelerations of joints and motors.

With x = (ds/dt)^2 and u its half derivative by s, an acceleration is affine in (u, x):

    d2q/dt2 = q'(s) u + q''(s) x,      x[i+1] = x[i] + 2 h[i] u[i]

The reachable x at each grid point are an interval [0, beta] (TOPP-RA: Pham and Pham, A new approach to
time-optimal path parameterization based on reachability analysis, 2018). Their program of two variables needs no
solver here: with every row |P u + R x| <= C divided by P, the largest x from which beta[i+1] can be reached is
the least of functions that are affine in beta[i+1]. Both passes are scans over minima of such functions.

Rows stand for both ends of every interval (Pham's "interpolation" scheme), so that the motion between the grid
points keeps to the limits, too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from armkin.formula.arrays import Array
from armkin.motors import motor_accel

if TYPE_CHECKING:
    from armkin.model.arm import Arm

_TINY = 1e-300
_MOST = 1e18  # of x, where nothing bounds it
_EXCESS = 1.001  # of an acceleration, between grid points
_ROUNDS = 6
_AT_ONCE = 16_384  # intervals whose rows are in memory: some hundred numbers each
_FEW = 400  # samples of a way: the law needs more grid points
_PAIRS = 4096  # intervals whose rows are compared pair by pair at once


@dataclass(frozen=True)
class Bounds:
    """What the motion keeps to, at every grid point or for all of them."""

    speed: Array  # (N, n) or (n,) [rad/s | mm/s]
    accel: Array  # (N, n) or (n,)
    cap: Array  # (N,) of x: tool speed and whatever else bounds ds/dt


@dataclass(frozen=True)
class Knots:
    """A joint path as cubics between grid points: q, q' at the points, and q'' at both ends of every interval."""

    s: Array  # (N,)
    q: Array  # (N, n)
    d: Array  # (N, n) dq/ds

    @property
    def h(self) -> Array:
        """Lengths of the intervals: (N - 1,)."""
        return np.asarray(np.diff(self.s))

    def second(self) -> tuple[Array, Array]:
        """q'' at the left and the right end of every interval: (N - 1, n) twice."""
        h = self.h[:, None]
        chord = np.diff(self.q, axis=0) / h
        left = (6 * chord - 4 * self.d[:-1] - 2 * self.d[1:]) / h
        right = (-6 * chord + 2 * self.d[:-1] + 4 * self.d[1:]) / h
        return left, right


def knots(s: Array, q: Array, breaks: Sequence[int] = ()) -> Knots:
    """Slopes of samples from five neighbours each, none of them beyond a break (indices where q'' jumps).

    s: (N,) increasing; q: (N, n). The slopes are exact to the fourth order of the spacing; at a break it is the
    mean of both sides'.
    """
    N = len(s)
    edges = sorted({0, N - 1, *breaks})
    total, count = np.zeros_like(q), np.zeros(N)
    for lo, hi in pairwise(edges):
        part = slice(lo, hi + 1)
        total[part] += _slopes(s[part], q[part])
        count[part] += 1
    return Knots(s, q, total / count[:, None])


def _slopes(s: Array, q: Array) -> Array:
    """Derivatives of the polynomials through up to five neighbours: (M,), (M, n) -> (M, n).

    Barycentric: q'(x_i) = sum_j (l_j / l_i) (q_j - q_i) / (x_i - x_j), l_j = 1 / prod_m (x_j - x_m)
    (Berrut and Trefethen, Barycentric Lagrange interpolation, 2004, section 9).
    """
    M = len(s)
    w = min(5, M)
    at = np.clip(np.arange(M) - w // 2, 0, M - w) + np.arange(w)[:, None]  # (w, M)
    x = s[at]
    inverse = [np.prod([x[j] - x[m] for m in range(w) if m != j], axis=0) for j in range(w)]  # 1 / l_j
    own = np.arange(M) - at[0]
    mine = np.choose(own, inverse) if w > 1 else np.ones(M)
    out = np.zeros_like(q)
    for j in range(w):
        apart = x[j] - s
        there = apart != 0
        weight = np.divide(mine, inverse[j] * -apart, out=np.zeros(M), where=there)
        out += weight[:, None] * (q[at[j]] - q)
    return out


def finer(path: Knots) -> Knots:
    """The same cubics on more grid points, if there are few: u is constant between two of them.

    With 100 samples, twice as many points make the law of time 0.1 to 2 % faster.
    """
    if len(path.s) >= _FEW:
        return path
    parts = max(2, round(200 / len(path.s)))
    h = path.h[:, None, None]
    f = (np.arange(parts) / parts)[:, None]
    d0, d1 = path.d[:-1, None] * h, path.d[1:, None] * h
    chord = np.diff(path.q, axis=0)[:, None]
    c2, c3 = 3 * chord - 2 * d0 - d1, d0 + d1 - 2 * chord
    q = path.q[:-1, None] + f * (d0 + f * (c2 + f * c3))
    d = (d0 + f * (2 * c2 + 3 * f * c3)) / h
    s = path.s[:-1, None] + path.h[:, None] * f[:, 0]
    n = path.q.shape[1]
    return Knots(
        np.append(s.ravel(), path.s[-1]),
        np.concatenate([q.reshape(-1, n), path.q[-1:]]),
        np.concatenate([d.reshape(-1, n), path.d[-1:]]),
    )


@dataclass(frozen=True)
class _Motion:
    """What is bounded along the intervals: joints, and motors that turn several of them; k of them in all."""

    first: Array  # (M, k) their slopes at the left end of every interval
    left: Array  # (M, k) their second derivatives at its left end
    right: Array  # (M, k) and at its right end
    h: Array  # (M, 1)
    accel: Array  # (M, k) greatest acceleration

    def part(self, some: slice) -> _Motion:
        """The same of some of the intervals."""
        return _Motion(self.first[some], self.left[some], self.right[some], self.h[some], self.accel[some])

    def row(self, f: Array | float) -> tuple[Array, Array]:
        """P and R of the acceleration P u + R x at fractions f of the intervals, x at the left end: (M, k) each.

        With q'' = l + f (r - l) and x(f) = x + 2 u h f it is u q'(f) + q''(f) x(f).
        """
        if np.ndim(f) == 0 and f == 0:
            return self.first, self.left
        bend = self.right - self.left
        return self.first + self.h * f * (3 * self.left + 2.5 * f * bend), self.left + f * bend

    def excess(self, x: Array) -> tuple[Array, Array]:
        """Greatest share of the acceleration inside every interval, and at which fraction: (M, k) each."""
        found = [self.part(some)._excess(x[some.start : some.stop + 1]) for some in _parts(len(self.h))]
        share, where = (np.concatenate(each) for each in zip(*found, strict=True))
        return share, where

    def _excess(self, x: Array) -> tuple[Array, Array]:
        u = np.diff(x)[:, None] / (2 * self.h)
        bend = self.right - self.left
        a = u * self.first + self.left * x[:-1, None]  # a + b f + c f^2
        b = 3 * u * self.h * self.left + bend * x[:-1, None]
        c = 2.5 * u * self.h * bend
        with np.errstate(divide="ignore", invalid="ignore"):
            f = np.where(c != 0, -b / (2 * c), 0.0).clip(0.0, 1.0)
        return np.abs(a + f * (b + f * c)) / self.accel, f


def _motion(path: Knots, accel: Array, rows: tuple[Array, Array] | None) -> _Motion:
    left, right = path.second()
    first = path.d[:-1]
    low = np.minimum(accel[:-1], accel[1:])  # an interval between two limits keeps to the lower one
    if rows is not None:
        weights, most = rows
        first, left, right = (np.concatenate([x, x @ weights.T], axis=1) for x in (first, left, right))
        low = np.concatenate([low, np.broadcast_to(most, (len(low), len(most)))], axis=1)
    return _Motion(first, left, right, path.h[:, None], low)


def optimal(path: Knots, bounds: Bounds, rows: tuple[Array, Array] | None = None) -> Array:
    """x = (ds/dt)^2 of the fastest law from rest to rest: (N,).

    rows: weights (k, n) of joints and the greatest acceleration (k,) of each such sum: coupled motors.

    Accelerations are bounded at both ends of every interval; where that leaves more than the limit between them,
    there, too, and all is done again. What is left of that after some rounds, the whole law slows down for.
    """
    speed, accel = (np.broadcast_to(b, path.q.shape) for b in (bounds.speed, bounds.accel))
    with np.errstate(over="ignore"):
        cap = np.minimum(((speed / np.maximum(np.abs(path.d), _TINY)) ** 2).min(axis=1), bounds.cap)
    cap = np.minimum(cap, _MOST)
    cap[0] = cap[-1] = 0.0
    if len(cap) < 2:
        return np.asarray(cap)
    motion = _motion(path, accel, rows)
    inside: list[Array | float] = [0.0, 1.0]
    for _ in range(_ROUNDS):
        x = _fastest(cap.copy(), motion, inside)
        over, where = motion.excess(x)
        if (most := float(over.max())) <= _EXCESS:
            return x
        inside.append(np.where(over > 1.0, where, 0.0))
    return np.asarray(x / most)


def _parts(intervals: int) -> list[slice]:
    """The intervals in parts that are worked on at once."""
    return [slice(k, min(k + _AT_ONCE, intervals)) for k in range(0, max(intervals, 1), _AT_ONCE)]


def _fastest(cap: Array, motion: _Motion, inside: Sequence[Array | float]) -> Array:
    """The fastest x (N,) within cap, the accelerations kept at fractions `inside` of the intervals."""
    parts = _parts(len(motion.h))

    def made(some: slice) -> tuple[Array, Array]:
        return _affine(motion.part(some), [f if isinstance(f, float) else f[some] for f in inside])

    kept = made(parts[0]) if len(parts) == 1 else None  # of a long path they are made anew for each of three passes

    def rows(some: slice) -> tuple[Array, Array]:
        return made(some) if kept is None else kept

    for some in parts:
        slope, level = rows(some)
        h = motion.h[some]
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
            # x + 2 h u >= 0 must leave room below the upper bounds of u
            steep = slope - 0.5 / h
            room = np.where(steep > 0, level / steep, np.inf).min(axis=1)
        cap[some] = _meeting(np.minimum(cap[some], room), slope, level)
    return _forward(_backward(cap, motion.h, rows, parts), motion.h, rows, parts)


def _affine(motion: _Motion, inside: Sequence[Array | float]) -> tuple[Array, Array]:
    """Slope and level of the bounds of u, which is between -level - slope x and level - slope x: (M, k) each."""
    P, R, C = _rows(motion, inside)
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        return R / P, C / P


def _rows(motion: _Motion, inside: Sequence[Array | float]) -> tuple[Array, Array, Array]:
    """P > 0, R, C of |P u + R x| <= C, x at the left end: (N - 1, k)."""
    parts = [motion.row(f) for f in inside]
    p, r = (np.concatenate(part, axis=1) for part in zip(*parts, strict=True))
    c = np.tile(motion.accel, (1, len(inside)))
    sign = np.where(p < 0, -1.0, 1.0)
    size = np.abs(p)
    return np.asarray(np.maximum(size, 1e-12 * size.max(initial=0.0) + _TINY)), r * sign, c


def _meeting(cap: Array, slope: Array, level: Array) -> Array:
    """The largest x, up to cap, at which some u keeps to all rows: where the first two of them exclude each other.

    u is at least -level_i - slope_i x and at most level_j - slope_j x, for all i and j.
    """
    i, j = np.triu_indices(slope.shape[1], 1)
    out = cap.copy()
    for begin in range(0, len(cap), _PAIRS):
        part = slice(begin, begin + _PAIRS)
        sl, lv = np.ascontiguousarray(slope[part].T), np.ascontiguousarray(level[part].T)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            met = (lv[i] + lv[j]) / np.abs(sl[i] - sl[j])
        out[part] = np.fmin(out[part], np.fmin.reduce(met, axis=0, initial=np.inf))
    return out


class _Least(NamedTuple):
    """The least of affine functions a y + b for y from 0 to `top`, as lists over the intervals.

    Of the many rows of an interval only a few are the least anywhere: that at y = 0, that at y = top, and of the
    others at most those (`more`) that are lower where these two cross.
    """

    a0: list[float]
    b0: list[float]
    a1: list[float]
    b1: list[float]
    more: list[tuple[tuple[float, float], ...]]


def _least(a: Array, b: Array, top: Array) -> _Least:
    """Affine functions (M, k) on 0 <= y <= top (M,), pruned."""
    i = np.arange(len(a))
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        first, last = b.argmin(axis=1), (a * top[:, None] + b).argmin(axis=1)
        a0, b0, a1, b1 = a[i, first], b[i, first], a[i, last], b[i, last]
        y = ((b1 - b0) / (a0 - a1)).clip(0.0, top)
        two = np.flatnonzero((first != last) & np.isfinite(y))
        k, j = np.nonzero(a[two] * y[two, None] + b[two] < (a0 * y + b0)[two, None] * (1 - 1e-12))
    more: list[tuple[tuple[float, float], ...]] = [()] * len(a)
    k = two[k]
    for at, slope, level in zip(k.tolist(), a[k, j].tolist(), b[k, j].tolist(), strict=True):
        more[at] = (*more[at], (slope, level))
    return _Least(a0.tolist(), b0.tolist(), a1.tolist(), b1.tolist(), more)


Rows = Callable[[slice], tuple[Array, Array]]


def _backward(cap: Array, h: Array, rows: Rows, parts: Sequence[slice]) -> Array:
    """The largest x at every point from which the end can be reached: beta[i] = min(cap, e beta[i+1] + f)."""

    def functions() -> Iterator[_Least]:
        for some in reversed(parts):
            keep, gain = _ahead(h[some], *rows(some))
            with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
                e = np.where(keep > 0, 1.0 / keep, 0.0)
                f = np.where(keep > 0, gain * e, np.inf)
            yield _least(e[::-1], f[::-1], cap[some.start + 1 : some.stop + 1][::-1])

    return _scan(cap[::-1], functions())[::-1]


def _forward(beta: Array, h: Array, rows: Rows, parts: Sequence[slice]) -> Array:
    """The fastest x within beta: x[i+1] = min(beta[i+1], keep x[i] + gain)."""
    return _scan(beta, (_least(*_ahead(h[some], *rows(some)), beta[some]) for some in parts))


def _ahead(h: Array, slope: Array, level: Array) -> tuple[Array, Array]:
    """`keep` and `gain` of every row: x[i+1] <= keep x[i] + gain."""
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        return 1.0 - 2 * h * slope, 2 * h * level


def _scan(most: Array, functions: Iterable[_Least]) -> Array:
    """y[0] = most[0], y[i+1] = min(most[i+1], least_i(y[i])), not below 0."""
    y = float(most[0])
    out, at = np.empty(len(most)), 1
    out[0] = y
    for least in functions:
        found = []
        for top, a0, b0, a1, b1, more in zip(most[at : at + len(least.a0)].tolist(), *least, strict=True):
            value, other = a0 * y + b0, a1 * y + b1
            if other < value:
                value = other
            for a, b in more:
                other = a * y + b
                if other < value:
                    value = other
            y = top if top < value else value if value > 0.0 else 0.0
            found.append(y)
        out[at : at + len(found)] = found
        at += len(found)
    return out


def hold_cap(arm: Arm, path: Knots, share: float) -> Array:
    """Greatest x at which a hold on the path asks no joint for more than `share` of its max_accel: (N,).

    On a hold the board lets the leading motor m (the one with the longest way to a stop) slow down with its
    greatest acceleration, along the path: u = -a_m / |n'_m| - n''_m x / n'_m, and a joint then accelerates with
    -q'_j a_m / |n'_m| + x (q''_j - q'_j n''_m / n'_m). The two parts have their signs: where the path bends a joint
    forward and the hold slows it down they take from each other. At x = 0 the first is at most max_accel, so that
    what is kept at x is kept on the whole way down to rest.
    """
    parts = [
        _hold_cap(arm, Knots(path.s[a : b + 1], path.q[a : b + 1], path.d[a : b + 1]), share)
        for a, b in ((some.start, some.stop) for some in _parts(len(path.s) - 1))
    ]
    for before, after in pairwise(parts):
        after[0] = min(before[-1], after[0])
    return np.concatenate([*(part[:-1] for part in parts[:-1]), parts[-1]])


def _hold_cap(arm: Arm, path: Knots, share: float) -> Array:
    """`hold_cap` of a part of the way."""
    gain = arm.motor_gain
    brakes = motor_accel(arm)
    ends = path.second()
    out = np.full(len(path.s), np.inf)
    rate = path.d @ gain.T
    m = (np.abs(rate) / brakes).argmax(axis=1)
    lead = rate[np.arange(len(m)), m]
    lead = np.where(np.abs(lead) < _TINY, _TINY, lead)
    ratio = path.d / lead[:, None]  # q'_j / n'_m
    slowing = -ratio * np.sign(lead)[:, None] * brakes[m][:, None]
    most = share * arm.max_accel
    for second, part in ((ends[0], slice(None, -1)), (ends[1], slice(1, None))):
        turned = (second * gain[m[part]]).sum(axis=1)
        bend = second - ratio[part] * turned[:, None]
        left = most - np.sign(bend) * slowing[part]
        cap = np.maximum(left, 0.0) / np.maximum(np.abs(bend), _TINY)
        out[part] = np.minimum(out[part], cap.min(axis=1))
    return out
