"""The fastest time law along a joint path, within the speeds and accelerations of joints and motors.

With x = (ds/dt)^2 and u its half derivative by s, an acceleration is affine in (u, x):

    d2q/dt2 = q'(s) u + q''(s) x,      x[i+1] = x[i] + 2 h[i] u[i]

The reachable x at each grid point are an interval [0, beta] (TOPP-RA: Pham and Pham, A new approach to
time-optimal path parameterization based on reachability analysis, 2018). Their linear program of two variables needs
no solver here: with every row |P u + R x| <= C divided by P, the largest x from which beta[i+1] can be reached is
the least of functions that are affine in beta[i+1]. Both passes are scans over minima of such functions.

Every interval has rows for both of its ends (Pham's "interpolation" scheme), so that the motion between the grid
points keeps to the limits, too. Arrays have the shape (rows, intervals), since numpy is fast along a long last axis.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from armkin.formula.arrays import Array, Bool, Int, numbers_within
from armkin.motion.timing.cubic_knots import Knots
from armkin.motion.timing.speed_bounds import TINY, Bound, Fastest, interval_parts

_SLOPE_SAMPLES = 5  # neighbouring samples that determine a slope
_MIN_SECTIONS = 16  # with more sections than this, all are computed at once
_UNBOUNDED_X = 1e18  # bound of x where no limit applies
_EXCESS_FACTOR = 1.001  # allowed factor on accelerations and squared speeds between grid points
_SMALL_EXCESS = 1.0002  # smaller excesses are mostly rounding and stay
_MAX_ROUNDS = 8  # most rounds that remove excesses
_SHARED_ROUNDS = 2  # rounds that lower the acceleration of an interval; later ones lower its speed
_FEW_SAMPLES = 400  # paths with fewer samples get more grid points


@dataclass(frozen=True)
class Bounds:
    """The limits of a motion, for every grid point or the same for all."""

    speed: Array  # (N, n) or (n,) [rad/s | mm/s]
    accel: Array  # (N, n) or (n,)
    cap: Array  # (N,) greatest x, from the tool speed and other bounds of ds/dt


def knots_of_samples(s: Array, q: Array, breaks: Sequence[int] = (), rests: Sequence[int] = ()) -> Knots:
    """Samples as knots, with slopes from five neighbours each, none of them beyond a break (where q'' jumps).

    s: (N,) increasing; q: (N, n). The slopes are exact to the fourth order of the spacing. A break has the mean slope
    of its two sides; a break where the path rests becomes two knots, one for each slope.
    """
    N = len(s)
    edges = np.unique([0, N - 1, *breaks])
    if len(rests) or (len(edges) > _MIN_SECTIONS and np.diff(edges).min() >= _SLOPE_SAMPLES - 1):
        return _knots_in_sections(s, q, edges, np.isin(edges[1:-1], rests))
    total, count = np.zeros_like(q), np.zeros(N)
    for first, last in pairwise(edges.tolist()):
        for part in interval_parts(last + 1 - first):
            samples = np.arange(first + part.start, first + part.stop)
            total[samples] += _slopes_at(s, q, samples, np.full(len(samples), first), np.full(len(samples), last))
        count[first : last + 1] += 1
    total /= count[:, None]
    return Knots(s, q, total)


def _knots_in_sections(s: Array, q: Array, edges: Int, rests: Bool) -> Knots:
    """`knots_of_samples` for many short sections at once.

    rests: (k,) whether the path rests at the edge between two sections.
    """
    sample_counts = np.diff(edges) + 1
    first = np.repeat(edges[:-1], sample_counts)
    begin = np.cumsum(sample_counts) - sample_counts
    i = numbers_within(sample_counts) + first
    last = np.repeat(edges[1:], sample_counts)
    parts = [slice(part.start, part.stop) for part in interval_parts(len(i))]
    slopes = np.concatenate([_slopes_at(s, q, i[part], first[part], last[part]) for part in parts])
    smooth_begins = begin[1:][~rests]
    slopes[smooth_begins - 1] = (slopes[smooth_begins - 1] + slopes[smooth_begins]) / 2
    keep = np.ones(len(i), bool)
    keep[smooth_begins] = False
    return Knots(s[i[keep]], q[i[keep]], slopes[keep])


def _slopes_at(s: Array, q: Array, i: Int, first: Int, last: Int) -> Array:
    """Derivatives of the polynomials through up to five neighbours of samples i, from `first` to `last`: (m, n).

    Barycentric: q'(x_i) = sum_j (l_j / l_i) (q_j - q_i) / (x_i - x_j), l_j = 1 / prod_m (x_j - x_m)
    (Berrut and Trefethen, Barycentric Lagrange interpolation, 2004, section 9).
    """
    w = min(_SLOPE_SAMPLES, int((last - first).min(initial=_SLOPE_SAMPLES)) + 1)
    neighbours = np.clip(i - w // 2, first, last + 1 - w) + np.arange(w)[:, None]  # (w, m)
    x = s[neighbours]
    inverse = [np.prod([x[j] - x[m] for m in range(w) if m != j], axis=0) for j in range(w)]  # 1 / l_j
    own_inverse = np.choose(i - neighbours[0], inverse) if w > 1 else np.ones(len(i))
    slopes = np.zeros_like(q[i])
    for j in range(w):
        difference = x[j] - s[i]
        distinct = difference != 0
        weight = np.divide(own_inverse, inverse[j] * -difference, out=np.zeros(len(i)), where=distinct)
        slopes += weight[:, None] * (q[neighbours[j]] - q[i])
    return slopes


def refine_knots(path: Knots) -> Knots:
    """Put the same cubics on more grid points if there are few, since u is constant between two of them.

    With 100 samples, twice as many points make the law of time 0.1 to 2 % faster.
    """
    if len(path.s) >= _FEW_SAMPLES or len(path.rests):
        return path
    parts = max(2, round(200 / len(path.s)))
    h, f = path.h[:, None], (np.arange(parts) / parts)[:, None, None]
    d0, d1, chord = path.d[:-1] * h, path.d[1:] * h, path.q[1:] - path.q[:-1]
    excess = d0 - chord
    c3 = excess + d1 - chord
    c2 = -(excess + c3)
    s = path.s[:-1] + path.h * f[..., 0]
    q = path.q[:-1] + f * (d0 + f * (c2 + f * c3))
    d = (d0 + f * (2 * c2 + 3 * f * c3)) / h
    return Knots(_interleave(s, path.s[-1:]), _interleave(q, path.q[-1:]), _interleave(d, path.d[-1:]))


def _interleave(parts: Array, last: Array) -> Array:
    """Values at fractions of every interval, (parts, N - 1, ...), interval by interval, then the last value."""
    return np.concatenate([parts.swapaxes(0, 1).reshape(-1, *last.shape[1:]), last])


def optimal_law(path: Knots, bounds: Bounds, rows: tuple[Array, Array] | None = None) -> Array:
    """x = (ds/dt)^2 of the fastest law from rest to rest: (N,).

    rows: weights (k, n) of joints and the greatest acceleration (k,) of each such sum: coupled motors.

    Speeds and accelerations are bounded at both ends of every interval. If one exceeds its limit in between, the limit
    of that interval is lowered and the law is updated. An excess that remains after all rounds slows the whole part
    between two rests down.
    """
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        cap = np.minimum(bounds.cap, _UNBOUNDED_X)
        speed = np.broadcast_to(bounds.speed, path.q.shape)
        for points in interval_parts(len(cap)):
            rate = np.ascontiguousarray((speed[points] / np.maximum(np.abs(path.d[points]), TINY)).T).min(axis=0)
            cap[points] = np.minimum(cap[points], rate**2)
        cap[0] = cap[-1] = cap[path.rests] = cap[path.rests + 1] = 0.0
        if len(cap) < 2:
            return np.asarray(cap)
        limits = Bound(path, np.broadcast_to(bounds.accel, path.q.shape), rows)
        law = Fastest(limits, cap)
        excess, changed_intervals = np.ones(len(path.h)), np.arange(len(path.h))
        for count in range(_MAX_ROUNDS):
            for part in interval_parts(len(changed_intervals)):
                excess[changed_intervals[part]] = _lower_law(
                    law, limits, speed, changed_intervals[part], share=count < _SHARED_ROUNDS
                )
            if excess.max() <= _EXCESS_FACTOR:
                return law.x
            if count < _MAX_ROUNDS - 1:
                excessive_intervals, x = np.flatnonzero(excess > _SMALL_EXCESS), law.x
                law.lower_speeds(_add_neighbours(excessive_intervals, len(excess)))
                x_changed = law.x != x
                changed_intervals = np.flatnonzero(x_changed[1:] | x_changed[:-1] | (excess > _SMALL_EXCESS))
        begins = np.concatenate([[0], path.rests + 1])  # each part between two rests has its own factor
        slowdown = np.maximum(np.maximum.reduceat(excess, begins), 1.0)
        return np.asarray(law.x / np.append(np.repeat(slowdown, np.diff(np.append(begins, len(excess)))), slowdown[-1]))


def _lower_law(law: Fastest, limits: Bound, speed: Array, intervals: Int, *, share: bool) -> Array:
    """Greatest shares of the limits in some intervals (k,); lowers the limits of those above 1."""
    motion, x0, x1 = limits.motion_in(intervals), law.x[intervals], law.x[intervals + 1]
    accel_shares = motion.accel_shares(x0, x1)
    speed_shares = motion.squared_speed_shares(x0, x1, np.minimum(speed[intervals], speed[intervals + 1]).T)
    shares = np.maximum(accel_shares.max(axis=0), speed_shares)
    if share:
        law.share[:, intervals] /= np.where(accel_shares > _SMALL_EXCESS, accel_shares, 1.0)
    excess = speed_shares if share else shares
    rows = np.flatnonzero(excess > _SMALL_EXCESS)
    for points, x in ((intervals[rows], x0[rows]), (intervals[rows] + 1, x1[rows])):
        np.fmin.at(law.cap, points, x / excess[rows])
    return np.asarray(shares)


def _add_neighbours(intervals: Int, count: int) -> Int:
    """The given intervals (k,) and their neighbours, of `count` in all."""
    is_selected = np.zeros(count + 2, bool)
    for k in (0, 1, 2):
        is_selected[intervals + k] = True
    return np.flatnonzero(is_selected[1:-1])
