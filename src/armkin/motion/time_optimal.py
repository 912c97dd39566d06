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

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from armkin.formula.arrays import Array
from armkin.motors import motor_accel

if TYPE_CHECKING:
    from armkin.model.arm import Arm

_TINY = 1e-300
_MOST = 1e18  # of x, where nothing bounds it


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
    """Derivatives of the polynomials through up to five neighbours: (M,), (M, n) -> (M, n)."""
    M = len(s)
    w = min(5, M)
    base = np.clip(np.arange(M) - w // 2, 0, M - w)
    at = base[:, None] + np.arange(w)
    own = np.arange(M) - base
    x = s[at] - s[:, None]  # (M, w), the own one is 0
    out = np.zeros_like(q)
    for j in range(w):
        # derivative of the j-th Lagrange polynomial at the own point
        others = [k for k in range(w) if k != j]
        denominator = np.prod(x[:, [j]] - x[:, others], axis=1)
        mine = own == j
        numerator = np.zeros(M)
        for k in others:
            rest = [m for m in others if m != k]
            numerator += np.prod(-x[:, rest], axis=1) if rest else 1.0
        single = np.stack([np.where(own == k, 1.0, -x[:, k]) for k in others], axis=1).prod(axis=1)
        weight = np.where(mine, numerator, single) / denominator
        out += weight[:, None] * q[at[:, j]]
    return out


def optimal(path: Knots, bounds: Bounds, rows: tuple[Array, Array] | None = None) -> Array:
    """x = (ds/dt)^2 of the fastest law from rest to rest: (N,).

    rows: weights (k, n) of joints and the greatest acceleration (k,) of each such sum: coupled motors.
    """
    h = path.h
    N = len(path.s)
    speed, accel = (np.broadcast_to(b, path.q.shape) for b in (bounds.speed, bounds.accel))
    with np.errstate(over="ignore"):
        cap = np.minimum(((speed / np.maximum(np.abs(path.d), _TINY)) ** 2).min(axis=1), bounds.cap)
    cap = np.minimum(cap, _MOST)
    cap[0] = cap[-1] = 0.0
    if N < 2:
        return np.asarray(cap)
    P, R, C = _rows(path, accel, rows)
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        slope, level = R / P, C / P  # u between -level - slope x and level - slope x
        # x + 2 h u >= 0 must leave room below the upper bounds of u
        steep = slope - 0.5 / h[:, None]
        room = np.where(steep > 0, level / steep, np.inf).min(axis=1)
    cap[:-1] = np.minimum(cap[:-1], room)
    cap[:-1] = _meeting(cap[:-1], slope, level)
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        coefficient = 1.0 - 2 * h[:, None] * slope
        e = np.where(coefficient > 0, 1.0 / coefficient, 0.0)
        f = np.where(coefficient > 0, 2 * h[:, None] * level * e, np.inf)
    beta = _backward(cap, e, f)
    return _forward(beta, 1.0 - 2 * h[:, None] * slope, 2 * h[:, None] * level)


def within(path: Knots, bounds: Bounds, rows: tuple[Array, Array] | None = None) -> Array:
    """The same, and within the accelerations between the grid points, too, where q'' changes much from one to the next.

    An interval that exceeds them at a quarter of its way, or two, or three, is asked for that much less.
    """
    accel = np.broadcast_to(bounds.accel, path.q.shape).copy()
    most = accel.copy()
    for _ in range(4):
        x = optimal(path, Bounds(bounds.speed, accel, bounds.cap), rows)
        over = _excess(path, x, most)
        if over.max(initial=0.0) <= 1.001:
            break
        each = np.maximum(np.append(over, 1.0), np.append(1.0, over))
        accel /= np.where(each > 1.001, each, 1.0)[:, None]
    return x


def _excess(path: Knots, x: Array, accel: Array) -> Array:
    """Greatest share of the accelerations inside every interval: (N - 1,)."""
    left, right = path.second()
    h = path.h[:, None]
    u = (np.diff(x) / (2 * path.h))[:, None]
    out = np.zeros(len(u))
    for f in (0.25, 0.5, 0.75):
        second = left + f * (right - left)
        first = path.d[:-1] + f * h * (left + second) / 2
        here = first * u + second * (x[:-1, None] + 2 * u * f * h)
        out = np.maximum(out, (np.abs(here) / np.maximum(accel[:-1], accel[1:])).max(axis=1))
    return out


def _rows(path: Knots, accel: Array, rows: tuple[Array, Array] | None) -> tuple[Array, Array, Array]:
    """P >= 0, R, C of |P u + R x| <= C, x at the left end: (N - 1, k)."""
    left, right = path.second()
    h = path.h[:, None]
    p0, p1 = path.d[:-1], path.d[1:]
    c0, c1 = accel[:-1], accel[1:]
    # An interval between two limits keeps to the lower one at both ends.
    low = np.minimum(c0, c1)
    P = [p0, p1 + 2 * h * right]
    R = [left, right]
    C = [low, low]
    if rows is not None:
        weights, most = rows
        P += [part @ weights.T for part in P]
        R += [part @ weights.T for part in R]
        C += [np.broadcast_to(most, (len(h), len(most)))] * 2
    p, r, c = (np.concatenate(part, axis=1) for part in (P, R, C))
    sign = np.where(p < 0, -1.0, 1.0)
    return np.asarray(np.maximum(np.abs(p), 1e-12 * np.abs(p).max(initial=0.0) + _TINY)), r * sign, c


def _meeting(cap: Array, slope: Array, level: Array) -> Array:
    """The largest x, up to cap, at which some u keeps to all rows: Newton on the least of affine functions."""
    x = cap.copy()
    open_ = np.arange(len(x))
    for _ in range(50):
        sl, lv, here = slope[open_], level[open_], x[open_]
        low, high = -lv - sl * here[:, None], lv - sl * here[:, None]
        j, k = low.argmax(axis=1), high.argmin(axis=1)
        i = np.arange(len(open_))
        wrong = low[i, j] > high[i, k] + 1e-12 * np.abs(high[i, k])
        if not wrong.any():
            break
        open_, i, j, k = open_[wrong], i[wrong], j[wrong], k[wrong]
        x[open_] = np.minimum((lv[i, k] + lv[i, j]) / (sl[i, k] - sl[i, j]), here[wrong])
    return x


def _backward(cap: Array, e: Array, f: Array) -> Array:
    """The largest x at every point from which the end can be reached: beta[i] = min(cap, e beta[i+1] + f)."""
    beta = 0.0
    out = [beta]
    for most, slopes, levels in zip(cap[-2::-1].tolist(), e[::-1].tolist(), f[::-1].tolist(), strict=True):
        value = most
        for a, b in zip(slopes, levels, strict=True):
            y = a * beta + b
            if y < value:
                value = y
        beta = value
        out.append(beta)
    return np.array(out[::-1])


def _forward(beta: Array, keep: Array, gain: Array) -> Array:
    """The fastest x within beta: x[i+1] = min(beta[i+1], keep x[i] + gain)."""
    x = float(beta[0])
    out = [x]
    for most, slopes, levels in zip(beta[1:].tolist(), keep.tolist(), gain.tolist(), strict=True):
        value = most
        for a, b in zip(slopes, levels, strict=True):
            y = a * x + b
            if y < value:
                value = y
        x = value if value > 0.0 else 0.0
        out.append(x)
    return np.array(out)


def hold_cap(arm: Arm, path: Knots, share: float) -> Array:
    """Greatest x at which a hold on the path asks no joint for more than `share` of its max_accel: (N,).

    On a hold the board lets the leading motor m (the one with the longest way to a stop) slow down with its
    greatest acceleration, along the path: u = (-a_m - n''_m x) / n'_m, and a joint then accelerates with
    -q'_j a_m / n'_m + x (q''_j - q'_j n''_m / n'_m).
    """
    gain = arm.motor_gain
    brakes = motor_accel(arm)
    ends = path.second()
    out = np.full(len(path.s), np.inf)
    rate = path.d @ gain.T
    m = (np.abs(rate) / brakes).argmax(axis=1)
    i = np.arange(len(m))
    lead = rate[i, m]
    lead = np.where(np.abs(lead) < _TINY, _TINY, lead)
    ratio = path.d / lead[:, None]  # q'_j / n'_m
    left = share * arm.max_accel - np.abs(ratio) * brakes[m][:, None]
    for second, part in ((ends[0], slice(None, -1)), (ends[1], slice(1, None))):
        turned = (second * gain[m[part]]).sum(axis=1)
        bend = np.abs(second - ratio[part] * turned[:, None])
        cap = np.maximum(left[part], 0.0) / np.maximum(bend, _TINY)
        out[part] = np.minimum(out[part], cap.min(axis=1))
    return out
