"""Scans along a path: from each grid point to the next one comes as far as the least of some affine functions says."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from armkin.formula.arrays import Array

_FEWEST, _MOST = 8, 4096  # intervals that are followed one by one before it is asked whether that can end


class Least(NamedTuple):
    """The least of affine functions a y + b for y from 0 to `top`, in every interval.

    Of the many rows of an interval only a few are the least anywhere: that at y = 0, that at y = top, and of the
    others at most those (`more`) that are lower where these two cross.
    """

    reach: Array  # (M,) its value at y = top
    a0: Array
    b0: Array
    a1: Array
    b1: Array
    more: dict[int, list[tuple[float, float]]]

    def part(self, lo: int, hi: int) -> Least:
        """The same of intervals lo to hi."""
        more = {i - lo: rows for i, rows in self.more.items() if lo <= i < hi}
        reach, a0, b0, a1, b1 = (each[lo:hi] for each in (self.reach, self.a0, self.b0, self.a1, self.b1))
        return Least(reach, a0, b0, a1, b1, more)


def least_of(a: Array, b: Array, top: Array) -> Least:
    """Affine functions (k, M) on 0 <= y <= top (M,), pruned."""
    i = np.arange(len(top))
    first, last = b.argmin(axis=0), (a * top + b).argmin(axis=0)
    a0, b0, a1, b1 = a[first, i], b[first, i], a[last, i], b[last, i]
    y = np.minimum(np.maximum((b1 - b0) / (a0 - a1), 0.0), top)
    two = ((first != last) & (y >= 0.0)).nonzero()[0]
    a, b, y = a.take(two, axis=1), b.take(two, axis=1), y[two]
    j, k = np.nonzero(a * y + b < (a0[two] * y + b0[two]) * (1 - 1e-12))
    more: dict[int, list[tuple[float, float]]] = {}
    for at, slope, level in zip(two[k].tolist(), a[j, k].tolist(), b[j, k].tolist(), strict=True):
        more.setdefault(at, []).append((slope, level))
    return Least(a1 * top + b1, a0, b0, a1, b1, more)


def ahead(h: Array, slope: Array, level: Array) -> tuple[Array, Array]:
    """`keep` and `gain` of every row: from x[i] one comes to keep x[i] + gain at most, and the least of all counts."""
    return 1.0 - 2 * h * slope, 2 * h * level


def back(keep: Array, gain: Array) -> tuple[Array, Array]:
    """The same from the end of the path: x[i+1] is reached from e x[i+1] + f at most; the last interval is first."""
    e = np.where(keep > 0, 1.0 / keep, 0.0)
    return e[:, ::-1], np.where(keep > 0, gain * e, np.inf)[:, ::-1]


def scan(most: Array, functions: Iterable[Least]) -> Array:
    """y[0] = most[0], y[i+1] = min(most[i+1], least_i(y[i])), not below 0.

    Where y is at `most` and from there reaches the next of it, nothing has to be done: in most intervals.
    """
    out, at = most.copy(), 0
    for least in functions:
        part = out[at : at + len(least.reach) + 1]
        below = (~(least.reach >= part[1:])).nonzero()[0].tolist()
        done = _follow(part, least, 0) if part[0] < most[at] else 0
        for k in below:
            if k >= done:
                done = _follow(part, least, k)
        at += len(least.reach)
    return out


def _follow(y: Array, least: Least, k: int) -> int:
    """Write y[k+1], ... where `most` stands, up to some place where y is at `most` again, and return that."""
    now, more, size = float(y[k]), least.more, _FEWEST
    while True:
        end = min(k + size, len(y) - 1)
        most, found = y[k + 1 : end + 1].tolist(), []
        rows = (each[k:end].tolist() for each in (least.a0, least.b0, least.a1, least.b1))
        for i, top, a0, b0, a1, b1 in zip(range(k, end), most, *rows, strict=True):
            value, other = a0 * now + b0, a1 * now + b1
            if other < value:
                value = other
            if i in more:
                for a, b in more[i]:
                    other = a * now + b
                    if other < value:
                        value = other
            now = top if top < value else value if value > 0.0 else 0.0
            found.append(now)
        y[k + 1 : end + 1] = found
        if now == most[-1] or end == len(y) - 1:
            return end
        k, size = end, min(2 * size, _MOST)
