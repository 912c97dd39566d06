"""The fastest law of time along a joint path, within speeds and accelerations of joints and motors.

With x = (ds/dt)^2 and u its half derivative by s, an acceleration is affine in (u, x):

    d2q/dt2 = q'(s) u + q''(s) x,      x[i+1] = x[i] + 2 h[i] u[i]

The reachable x at each grid point are an interval [0, beta] (TOPP-RA: Pham and Pham, A new approach to
time-optimal path parameterization based on reachability analysis, 2018). Their program of two variables needs no
solver here: with every row |P u + R x| <= C divided by P, the largest x from which beta[i+1] can be reached is
the least of functions that are affine in beta[i+1]. Both passes are scans over minima of such functions.

Rows stand for both ends of every interval (Pham's "interpolation" scheme), so that the motion between the grid
points keeps to the limits, too. In memory the intervals come last, (rows, intervals): numpy then works on long runs
of numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool
from armkin.motion.scan import ahead, back, least_of, scan

Int = NDArray[np.intp]
TINY = 1e-300
_NEIGHBOURS = 5  # samples that give a slope
_SECTIONS = 16  # of samples, between breaks: more are worked on together
_MOST = 1e18  # of x, where nothing bounds it
_EXCESS = 1.001  # of an acceleration, or of a speed squared, between grid points
_ROUNDS = 8
_SHARED = 2  # rounds in which an interval is given less acceleration; then it is passed slower
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
    """A joint path as cubics between grid points: q, q' at the points, and q'' at both ends of every interval.

    Where a path rests in a corner the point stands twice, with the slopes before and behind it: an interval of no way.
    """

    s: Array  # (N,)
    q: Array  # (N, n)
    d: Array  # (N, n) dq/ds

    @cached_property
    def h(self) -> Array:
        """Lengths of the intervals: (N - 1,); 1 where the path rests, whatever is divided by it."""
        h = self.s[1:] - self.s[:-1]
        return np.asarray(np.where(h == 0.0, 1.0, h))

    @cached_property
    def rests(self) -> Int:
        """Intervals in which the path rests: (k,)."""
        return np.flatnonzero(self.s[1:] == self.s[:-1])

    def at(self, s: Array) -> tuple[Array, Array]:
        """q and q' at lengths s: (M,) -> (M, n) twice."""
        i = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self.s) - 2)
        h = self.h[i][:, None]
        f = (s - self.s[i])[:, None] / h
        d0, d1, chord = self.d[i] * h, self.d[i + 1] * h, self.q[i + 1] - self.q[i]
        c2, c3 = 3 * chord - 2 * d0 - d1, d0 + d1 - 2 * chord
        return self.q[i] + f * (d0 + f * (c2 + f * c3)), (d0 + f * (2 * c2 + 3 * f * c3)) / h

    def second(self) -> tuple[Array, Array]:
        """q'' at the left and the right end of every interval: (N - 1, n) twice."""
        h = self.h[:, None]
        chord = (self.q[1:] - self.q[:-1]) / h
        left = (6 * chord - 4 * self.d[:-1] - 2 * self.d[1:]) / h
        right = (-6 * chord + 2 * self.d[:-1] + 4 * self.d[1:]) / h
        return left, right


def knots(s: Array, q: Array, breaks: Sequence[int] = (), rests: Sequence[int] = ()) -> Knots:
    """Slopes of samples from five neighbours each, none of them beyond a break (indices where q'' jumps).

    s: (N,) increasing; q: (N, n). The slopes are exact to the fourth order of the spacing; at a break it is the
    mean of both sides', but for those of them where the path rests, which stand twice.
    """
    N = len(s)
    edges = np.unique([0, N - 1, *breaks])
    if len(rests) or (len(edges) > _SECTIONS and np.diff(edges).min() >= _NEIGHBOURS - 1):
        return _in_sections(s, q, edges, np.isin(edges[1:-1], rests))
    total, count = np.zeros_like(q), np.zeros(N)
    for lo, hi in pairwise(edges.tolist()):
        for some in in_parts(hi + 1 - lo):
            i = np.arange(lo + some.start, lo + some.stop)
            total[i] += _slopes_at(s, q, i, np.full(len(i), lo), np.full(len(i), hi))
        count[lo : hi + 1] += 1
    total /= count[:, None]
    return Knots(s, q, total)


def _in_sections(s: Array, q: Array, edges: Int, rests: Bool) -> Knots:
    """`knots` of many short sections, all at once; rests: (k,) at which of the edges between two of them it rests."""
    size = np.diff(edges) + 1
    first = np.repeat(edges[:-1], size)
    begin = np.cumsum(size) - size
    i = np.arange(int(size.sum())) - np.repeat(begin, size) + first
    last = np.repeat(edges[1:], size)
    parts = [slice(some.start, some.stop) for some in in_parts(len(i))]
    slopes = np.concatenate([_slopes_at(s, q, i[some], first[some], last[some]) for some in parts])
    smooth = begin[1:][~rests]
    slopes[smooth - 1] = (slopes[smooth - 1] + slopes[smooth]) / 2
    keep = np.ones(len(i), bool)
    keep[smooth] = False
    return Knots(s[i[keep]], q[i[keep]], slopes[keep])


def _slopes_at(s: Array, q: Array, i: Int, first: Int, last: Int) -> Array:
    """Derivatives of the polynomials through up to five neighbours of samples i, from `first` to `last`: (m, n).

    Barycentric: q'(x_i) = sum_j (l_j / l_i) (q_j - q_i) / (x_i - x_j), l_j = 1 / prod_m (x_j - x_m)
    (Berrut and Trefethen, Barycentric Lagrange interpolation, 2004, section 9).
    """
    w = min(_NEIGHBOURS, int((last - first).min(initial=_NEIGHBOURS)) + 1)
    at = np.clip(i - w // 2, first, last + 1 - w) + np.arange(w)[:, None]  # (w, m)
    x = s[at]
    inverse = [np.prod([x[j] - x[m] for m in range(w) if m != j], axis=0) for j in range(w)]  # 1 / l_j
    mine = np.choose(i - at[0], inverse) if w > 1 else np.ones(len(i))
    out = np.zeros_like(q[i])
    for j in range(w):
        apart = x[j] - s[i]
        there = apart != 0
        weight = np.divide(mine, inverse[j] * -apart, out=np.zeros(len(i)), where=there)
        out += weight[:, None] * (q[at[j]] - q[i])
    return out


def finer(path: Knots) -> Knots:
    """The same cubics on more grid points, if there are few: u is constant between two of them.

    With 100 samples, twice as many points make the law of time 0.1 to 2 % faster.
    """
    if len(path.s) >= _FEW or len(path.rests):
        return path
    parts = max(2, round(200 / len(path.s)))
    h, f = path.h[:, None], (np.arange(parts) / parts)[:, None, None]
    d0, d1, chord = path.d[:-1] * h, path.d[1:] * h, path.q[1:] - path.q[:-1]
    off = d0 - chord
    c3 = off + d1 - chord
    c2 = -(off + c3)
    s = path.s[:-1] + path.h * f[..., 0]
    q = path.q[:-1] + f * (d0 + f * (c2 + f * c3))
    d = (d0 + f * (2 * c2 + 3 * f * c3)) / h
    return Knots(_woven(s, path.s[-1:]), _woven(q, path.q[-1:]), _woven(d, path.d[-1:]))


def _woven(inside: Array, last: Array) -> Array:
    """Values at each fraction of every interval, (parts, N - 1, ...), one interval after the other, and the last."""
    return np.concatenate([inside.swapaxes(0, 1).reshape(-1, *last.shape[1:]), last])


class _Motion(NamedTuple):
    """What is bounded along the M intervals: joints, and motors that turn several of them; k of them in all."""

    first: Array  # (k, M) their slopes at the left end of every interval
    left: Array  # (k, M) their second derivatives at its left end
    bend: Array  # (k, M) how much greater these are at its right end
    h: Array  # (M,)
    accel: Array  # (k, M) greatest acceleration

    def excess(self, x: Array) -> Array:
        """Greatest share of the acceleration inside every interval: (k, M).

        With q'' = l + f (r - l) and x(f) = x + 2 u h f at its fraction f it is u q'(f) + q''(f) x(f).
        """
        u = (x[1:] - x[:-1]) / (2 * self.h)
        a = u * self.first + self.left * x[:-1]  # a + b f + c f^2
        b = 3 * u * self.h * self.left + self.bend * x[:-1]
        c = 2.5 * u * self.h * self.bend
        f = np.fmin(np.fmax(-b / (2 * c), 0.0), 1.0)  # 0 where it does not bend
        inside = np.abs(a + f * (b + f * c))
        return np.asarray(np.maximum(np.maximum(inside, np.abs(a)), np.abs(a + b + c)) / self.accel)

    def rush(self, x: Array, speed: Array) -> Array:
        """Greatest share of the joints' speeds (n, M) inside every interval, squared: (M,).

        (q'(f))^2 x(f) is greatest at an end, which its cap holds, or where its derivative, a quadratic, is zero.
        """
        n, h = len(speed), self.h
        ends = np.maximum(np.abs(self.first[:n]), np.abs(self.first[:n] + h * (self.left[:n] + 0.5 * self.bend[:n])))
        bound = ((ends + 0.125 * h * np.abs(self.bend[:n])) / speed).max(axis=0) ** 2 * np.maximum(x[1:], x[:-1])
        near = np.flatnonzero(bound > 1.0)
        d, left, bend = self.first[:n, near], self.left[:n, near], self.bend[:n, near]
        h, dx, x = h[near], np.diff(x)[near], x[near]
        c = 2 * h * left * x + d * dx
        b = 2 * h * bend * x + 3 * h * left * dx
        a = 2.5 * h * bend * dx
        q = -0.5 * (b + np.copysign(np.sqrt(np.maximum(b * b - 4 * a * c, 0.0)), b))
        most = np.zeros(len(bound))
        for root in (q / a, c / q):
            f = np.fmin(np.fmax(root, 0.0), 1.0)
            slope = d + h * f * (left + 0.5 * f * bend)
            share = np.nan_to_num((slope / speed[:, near]) ** 2 * (x + f * dx)).max(axis=0, initial=0.0)
            most[near] = np.maximum(most[near], share)
        return most


Motions = Callable[[slice], _Motion]  # of some of the intervals


def _motions(path: Knots, accel: Array, rows: tuple[Array, Array] | None, share: NDArray[np.float32]) -> Motions:
    """What is bounded along a path, by shares (k, M) of the accelerations: of a long one it is made anew, in parts."""
    whole = _motion(path, accel, rows) if len(path.h) <= _AT_ONCE else None

    def part(some: slice) -> _Motion:
        ends = slice(some.start, some.stop + 1)
        made = whole or _motion(Knots(path.s[ends], path.q[ends], path.d[ends]), accel[ends], rows)
        return made._replace(accel=made.accel * share[:, some])

    return part


def _motion(path: Knots, accel: Array, rows: tuple[Array, Array] | None) -> _Motion:
    left, right = path.second()
    first = path.d[:-1]
    low = np.minimum(accel[:-1], accel[1:])  # an interval between two limits keeps to the lower one
    if rows is not None:
        weights, most = rows
        first, left, right = (np.concatenate([x, x @ weights.T], axis=1) for x in (first, left, right))
        low = np.concatenate([low, np.broadcast_to(most, (len(low), len(most)))], axis=1)
    first, left, right, low = (np.ascontiguousarray(each.T) for each in (first, left, right, low))
    return _Motion(first, left, right - left, path.h, low)


def optimal(path: Knots, bounds: Bounds, rows: tuple[Array, Array] | None = None) -> Array:
    """x = (ds/dt)^2 of the fastest law from rest to rest: (N,).

    rows: weights (k, n) of joints and the greatest acceleration (k,) of each such sum: coupled motors.

    Speeds and accelerations are bounded at both ends of every interval. Where one is above its limit in between, that
    interval is given less, and all is done again; what is left after some rounds, the whole law slows down for.
    """
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        cap = np.minimum(bounds.cap, _MOST)
        speed = np.broadcast_to(bounds.speed, path.q.shape)
        for some in in_parts(len(cap)):
            rate = np.ascontiguousarray((speed[some] / np.maximum(np.abs(path.d[some]), TINY)).T).min(axis=0)
            cap[some] = np.minimum(cap[some], rate**2)
        cap[0] = cap[-1] = cap[path.rests] = cap[path.rests + 1] = 0.0
        if len(cap) < 2:
            return np.asarray(cap)
        share = np.ones((path.q.shape[1] + (0 if rows is None else len(rows[0])), len(path.h)), np.float32)
        accel = np.broadcast_to(bounds.accel, path.q.shape)
        whole = np.broadcast_to(np.ones((), np.float32), share.shape)
        given, limits = (_motions(path, accel, rows, each) for each in (share, whole))
        worst = np.ones(len(path.h))
        for round_ in range(_ROUNDS):
            x, most = _fastest(cap.copy(), path.h, given), 0.0
            for some in in_parts(len(path.h)):
                ends = slice(some.start, some.stop + 1)
                motion = limits(some)
                over = motion.excess(x[ends])
                rush = motion.rush(x[ends], np.minimum(speed[ends][:-1], speed[ends][1:]).T)
                worst[some] = np.maximum(over.max(axis=0), rush)
                most = max(most, float(worst[some].max()))
                if round_ < _SHARED:
                    share[:, some] /= np.where(over > 1.0, over, 1.0)
                else:
                    rush = np.maximum(rush, over.max(axis=0))
                less = np.where(rush > 1.0, rush, np.nan)
                cap[some] = np.fmin(cap[some], x[some] / less)
                cap[ends][1:] = np.fmin(cap[ends][1:], x[ends][1:] / less)
            if most <= _EXCESS:
                return x
        begins = np.concatenate([[0], path.rests + 1])  # each part between two rests slows down for itself
        slower = np.maximum(np.maximum.reduceat(worst, begins), 1.0)
        return np.asarray(x / np.append(np.repeat(slower, np.diff(np.append(begins, len(worst)))), slower[-1]))


def in_parts(intervals: int) -> list[slice]:
    """The intervals in parts that are worked on at once: a long path in bounded memory."""
    return [slice(k, min(k + _AT_ONCE, intervals)) for k in range(0, max(intervals, 1), _AT_ONCE)]


def _fastest(cap: Array, h: Array, motion: Motions) -> Array:
    """The fastest x (N,) within cap, the accelerations kept at both ends of the intervals."""
    parts = in_parts(len(h))
    for some in parts:
        slope, level = _affine(motion, some)
        # x + 2 h u >= 0 must leave room below the upper bounds of u
        steep = slope - 0.5 / h[some]
        room = np.where(steep > 0, level / steep, np.inf).min(axis=0)
        cap[some] = _meeting(np.minimum(cap[some], room), slope, level)
    if len(parts) == 1:  # the rows of both passes are pruned together
        forth, M = ahead(h, slope, level), len(h)
        a, b = (np.concatenate(each, axis=1) for each in zip(back(*forth), forth, strict=True))
        both = least_of(a, b, np.concatenate([cap[:0:-1], cap[:-1]]))
        beta = scan(cap[::-1], [both.part(0, M)])[::-1]
        reach = (forth[0] * beta[:-1] + forth[1]).min(axis=0)
        return scan(beta, [both.part(M, 2 * M)._replace(reach=reach)])

    def made(some: slice) -> tuple[Array, Array]:  # of a long path made anew for each of the passes
        return ahead(h[some], *_affine(motion, some))

    behind = (least_of(*back(*made(some)), cap[some.start + 1 : some.stop + 1][::-1]) for some in reversed(parts))
    beta = scan(cap[::-1], behind)[::-1]
    return scan(beta, (least_of(*made(some), beta[some]) for some in parts))


def _affine(motion: Motions, some: slice) -> tuple[Array, Array]:
    """Slope and level of the bounds of u, which is between -level - slope x and level - slope x: (k, M) each."""
    P, R, C = _rows(motion(some))
    return R / P, C / P


def _rows(motion: _Motion) -> tuple[Array, Array, Array]:
    """P > 0, R, C of |P u + R x| <= C, x at the left end, for both ends of the intervals: (k, M)."""
    right = motion.left + motion.bend
    p = np.concatenate([motion.first, motion.first + motion.h * (3 * motion.left + 2.5 * motion.bend)])
    r = np.concatenate([motion.left, right])
    size = np.abs(p)
    P = np.maximum(size, 1e-12 * size.max(initial=0.0) + TINY)
    return P, np.copysign(1.0, p) * r, np.concatenate([motion.accel, motion.accel])


def _meeting(cap: Array, slope: Array, level: Array) -> Array:
    """The largest x, up to cap, at which some u keeps to all rows: where the first two of them exclude each other.

    u is at least -level_i - slope_i x and at most level_j - slope_j x, for all i and j.
    """
    out = cap.copy()
    turned = slope * cap
    lowest, highest = -(level + turned).min(axis=0), (level - turned).min(axis=0)
    surely = lowest < highest - 1e-9 * np.abs(highest)  # cap itself leaves room for u
    close = (~surely).nonzero()[0]
    i, j = _pairs(len(slope))
    for begin in range(0, len(close), _PAIRS):
        some = close[begin : begin + _PAIRS]
        sl, lv = slope.take(some, axis=1), level.take(some, axis=1)
        met = (lv.take(i, axis=0) + lv.take(j, axis=0)) / np.abs(sl.take(i, axis=0) - sl.take(j, axis=0))
        out[some] = np.fmin(out[some], np.fmin.reduce(met, axis=0, initial=np.inf))
    return out


@cache
def _pairs(k: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Every two of k rows."""
    return np.triu_indices(k, 1)
