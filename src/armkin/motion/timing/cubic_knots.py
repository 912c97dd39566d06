"""A path through joint space as cubics between grid points."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from armkin.formula.arrays import Array, Int


@dataclass(frozen=True)
class Knots:
    """A joint path as cubics between grid points: q, q' at the points, and q'' at both ends of every interval.

    A corner where the path rests is two knots with the same s, one for the slope on each side.
    """

    s: Array  # (N,)
    q: Array  # (N, n)
    d: Array  # (N, n) dq/ds

    @cached_property
    def h(self) -> Array:
        """Lengths of the intervals: (N - 1,); 1 where the path rests, so that divisions stay finite."""
        h = self.s[1:] - self.s[:-1]
        return np.asarray(np.where(h == 0.0, 1.0, h))

    @cached_property
    def rests(self) -> Int:
        """Intervals in which the path rests: (k,)."""
        return np.flatnonzero(self.s[1:] == self.s[:-1])

    def evaluate(self, s: Array) -> tuple[Array, Array]:
        """q and q' at lengths s: (M,) -> (M, n) twice."""
        i = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self.s) - 2)
        h = self.h[i][:, None]
        f = (s - self.s[i])[:, None] / h
        d0, d1, chord = self.d[i] * h, self.d[i + 1] * h, self.q[i + 1] - self.q[i]
        c2, c3 = 3 * chord - 2 * d0 - d1, d0 + d1 - 2 * chord
        return self.q[i] + f * (d0 + f * (c2 + f * c3)), (d0 + f * (2 * c2 + 3 * f * c3)) / h

    def second_derivatives(self, intervals: slice | Int = slice(None)) -> tuple[Array, Array]:
        """q'' at the left and the right end of intervals, by default of all: (M, n) twice."""
        _, left, right = self.slopes(intervals)
        return left.T, right.T

    def slopes(self, intervals: slice | Int = slice(None)) -> tuple[Array, Array, Array]:
        """q' at the left end of intervals, q'' at the left and at the right end: (n, M) each."""
        (q0, q1), (d0, d1) = (self.ends(values, intervals) for values in (self.q, self.d))
        h = self.h[intervals]
        chord = (q1 - q0) / h
        return d0, (6 * chord - 4 * d0 - 2 * d1) / h, (-6 * chord + 2 * d0 + 4 * d1) / h

    @staticmethod
    def ends(values: Array, intervals: slice | Int) -> tuple[Array, Array]:
        """From values at the points (N, n), those at both ends of intervals: (n, M) twice."""
        columns = values.T
        if isinstance(intervals, slice):
            return columns[:, :-1][:, intervals], columns[:, 1:][:, intervals]
        return columns.take(intervals, axis=1), columns.take(intervals + 1, axis=1)
