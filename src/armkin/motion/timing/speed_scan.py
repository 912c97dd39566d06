"""Scans along a path: y at the next grid point is the least of some affine functions of y at this one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armkin.formula.arrays import Array, Int

_MIN_INTERVALS, _MAX_INTERVALS = 8, 4096  # intervals scanned one by one between two checks for the end
_MANY_RUNS = 32  # with more runs than this they are scanned side by side
_MAX_STEPS = 64  # steps side by side after which few runs are scanned one by one
_MAX_ROUNDS = 8  # rounds after which runs are scanned one by one


class Least(NamedTuple):
    """The least of affine functions a y + b for y from 0 to some greatest, in every interval.

    Of the many functions of an interval only few are the least anywhere: the least one at y = 0, the least one at the
    greatest y, and at most those that lie below the crossing of these two.
    """

    a0: Array  # (M,)
    b0: Array
    a1: Array
    b1: Array
    interval: Int  # (E,) interval of each further function, ascending
    slope: Array  # (E,)
    level: Array

    def values(self, y: Array) -> Array:
        """The least value of every interval's functions at y: (M,) -> (M,)."""
        lowest = np.minimum(self.a0 * y + self.b0, self.a1 * y + self.b1)
        np.minimum.at(lowest, self.interval, self.slope * y[self.interval] + self.level)
        return lowest

    def part(self, begin: int, end: int) -> Least:
        """The least functions of intervals `begin` to `end`."""
        first, last = np.searchsorted(self.interval, [begin, end])
        a0, b0, a1, b1 = (values[begin:end] for values in (self.a0, self.b0, self.a1, self.b1))
        return Least(a0, b0, a1, b1, self.interval[first:last] - begin, self.slope[first:last], self.level[first:last])

    def replace_intervals(self, intervals: Int, functions: Least) -> Least:
        """The least functions with others in some intervals (k,), ascending; a0 to b1 change in place."""
        for array, values in zip(self[:4], functions[:4], strict=True):
            array[intervals] = values
        replaced = np.zeros(len(self.a0), bool)
        replaced[intervals] = True
        unchanged = ~replaced[self.interval]
        intervals_after = np.concatenate([self.interval[unchanged], intervals[functions.interval]])
        order = np.argsort(intervals_after, kind="stable")
        slope, level = (np.concatenate([a[unchanged], b])[order] for a, b in zip(self[5:], functions[5:], strict=True))
        return self._replace(interval=intervals_after[order], slope=slope, level=level)


def least_of(a: Array, b: Array, top: Array) -> Least:
    """Affine functions (k, M) on 0 <= y <= top (M,), pruned."""
    i = np.arange(len(top))
    first, last = b.argmin(axis=0), (a * top + b).argmin(axis=0)
    a0, b0 = a[first, i], b[first, i]
    a1, b1 = a[last, i], b[last, i]
    y = np.minimum(np.maximum((b1 - b0) / (a0 - a1), 0.0), top)
    crossing = ((first != last) & (y >= 0.0)).nonzero()[0]
    a, b, y = a.take(crossing, axis=1), b.take(crossing, axis=1), y[crossing]
    column, row = np.nonzero((a * y + b < (a0[crossing] * y + b0[crossing]) * (1 - 1e-12)).T)
    return Least(a0, b0, a1, b1, crossing[column], a[row, column], b[row, column])


def concatenate_least(parts: list[Least]) -> Least:
    """The least functions of all parts' intervals, one part after another."""
    if len(parts) == 1:
        return parts[0]
    begin = np.cumsum([0, *(len(part.a0) for part in parts)])
    intervals = np.concatenate([part.interval + k for part, k in zip(parts, begin, strict=False)])
    a0, b0, a1, b1, _, slope, level = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    return Least(a0, b0, a1, b1, intervals, slope, level)


def forward_step(h: Array, slope: Array, level: Array) -> tuple[Array, Array]:
    """`keep` and `gain` of every row: x[i+1] is at most keep x[i] + gain, for the least of all rows."""
    return 1.0 - 2 * h * slope, 2 * h * level


def backward_step(keep: Array, gain: Array) -> tuple[Array, Array]:
    """Rows e and f from the end of the path: x[i] is at most e x[i+1] + f; the last interval comes first."""
    e = np.where(keep > 0, 1.0 / keep, 0.0)
    return e[:, ::-1], np.where(keep > 0, gain * e, np.inf)[:, ::-1]


def scan(top: Array, functions: Least, previous: Array | None = None) -> Array:
    """y[0] = top[0], y[i+1] = min(top[i+1], least_i(y[i])), not below 0.

    previous: the y of another top and least that differ in some intervals. Most intervals are still consistent: y[i+1]
    follows from y[i]. Runs are scanned from the others on, side by side as long as there are many.
    """
    y = (top if previous is None else previous).copy()
    y[0] = top[0]
    # The index of each interval's first function.
    first = np.append(0, np.cumsum(np.bincount(functions.interval, minlength=len(top) - 1)))
    for _ in range(_MAX_ROUNDS):
        next_values = functions.values(y[:-1])
        changed_intervals = (np.minimum(top[1:], np.where(next_values > 0.0, next_values, 0.0)) != y[1:]).nonzero()[0]
        heads = changed_intervals[
            np.diff(changed_intervals, prepend=-2) > 1
        ]  # a run passes the intervals right behind its head
        if len(heads) <= _MANY_RUNS:
            break
        _follow_runs(y, functions, first, heads, top)
    end = 0
    for begin in changed_intervals.tolist():
        if begin >= end:
            end = _follow_run(y, functions, first, begin, top)
    return y


def _follow_runs(y: Array, functions: Least, first: Int, heads: Int, top: Array) -> None:
    """Scan runs from their heads (r,) until they meet y, and write those that no earlier run has passed."""
    k, current = heads, y[heads]
    run, end = np.arange(len(heads)), len(y) - 1
    ends = np.full(len(heads), end)
    steps: list[tuple[Int, Int, Array]] = []
    while len(k):
        value = np.minimum(functions.a0[k] * current + functions.b0[k], functions.a1[k] * current + functions.b1[k])
        begin = first[k]
        count = first[k + 1] - begin
        for i in range(int(count.max())):
            rows = (count > i).nonzero()[0]
            row = begin[rows] + i
            value[rows] = np.minimum(value[rows], functions.slope[row] * current[rows] + functions.level[row])
        k = k + 1
        current = np.minimum(top[k], np.where(value > 0.0, value, 0.0))
        differs = current != y[k]
        ends[run[~differs]] = k[~differs]
        k, current, run = k[differs], current[differs], run[differs]
        steps.append((run, k, current))
        goes_on = k < end
        k, current, run = k[goes_on], current[goes_on], run[goes_on]
        if len(steps) > _MAX_STEPS and len(k) <= _MANY_RUNS:  # the others are scanned one by one
            ends[run] = k
            break
    end_of_last, written = 0, np.zeros(len(heads), bool)
    for i, (begin_, end_) in enumerate(zip(heads.tolist(), ends.tolist(), strict=True)):
        if begin_ >= end_of_last:
            written[i], end_of_last = True, end_
    for run, k, current in steps:
        rows = written[run]
        y[k[rows]] = current[rows]


def _functions_by_interval(functions: Least, intervals: slice) -> dict[int, list[tuple[float, float]]]:
    """The further functions of some intervals, by interval."""
    by_interval: dict[int, list[tuple[float, float]]] = {}
    for interval, slope, level in zip(*(column[intervals].tolist() for column in functions[4:]), strict=True):
        by_interval.setdefault(interval, []).append((slope, level))
    return by_interval


def _follow_run(y: Array, functions: Least, first: Int, k: int, caps: Array) -> int:
    """Update y[k+1], ... until a value is unchanged, and return its index."""
    current, size = float(y[k]), _MIN_INTERVALS
    while True:
        end = min(k + size, len(y) - 1)
        by_interval = _functions_by_interval(functions, slice(first[k], first[end]))
        values = _scan_intervals(current, functions, by_interval, range(k, end), caps)
        current, old_value = values[-1], y[end]
        y[k + 1 : end + 1] = values
        if current == old_value or end == len(y) - 1:
            return end
        k, size = end, min(2 * size, _MAX_INTERVALS)


def _scan_intervals(
    current: float, functions: Least, by_interval: dict[int, list[tuple[float, float]]], intervals: range, caps: Array
) -> list[float]:
    """What the scan reaches behind each of the intervals from `current` before the first; functions: further ones."""
    values: list[float] = []
    tops = caps[intervals.start + 1 : intervals.stop + 1].tolist()
    rows = (column[intervals.start : intervals.stop].tolist() for column in functions[:4])
    for i, top, a0, b0, a1, b1 in zip(intervals, tops, *rows, strict=True):
        value, candidate = a0 * current + b0, a1 * current + b1
        if candidate < value:
            value = candidate
        for a, b in by_interval.get(i, ()):
            candidate = a * current + b
            if candidate < value:
                value = candidate
        value = value if value > 0.0 else 0.0
        current = top if top < value else value
        values.append(current)
    return values
