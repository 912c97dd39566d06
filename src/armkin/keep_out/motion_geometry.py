"""The geometry of a motion without its time: joint values at places, and bounds of their variation between two places.

A place is a number: its whole part is the index of a cell, the rest the share of that cell.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from armkin.formula.arrays import Array


class JointMotion(Protocol):
    """Joint values along a motion."""

    @property
    def cells(self) -> int:
        """Number of cells; places go from 0 to this number."""

    def joints_at(self, place: Array) -> Array:
        """Joint values (P, n) [rad | mm] at places (P,)."""

    def variation(self, begin: Array, end: Array) -> Array:
        """Bounds of the total variation of the joints between places (P,) and (P,): (P, n)."""


@dataclass(frozen=True, eq=False)
class Cubics:
    """A sequence of cubic curves given by control points (4, cells, n): joint moves and planned paths.

    The variation of a curve is at most that of the polygon of its control points. The polar form gives the control
    points of any part of a curve (Ramshaw 1989).
    """

    points: Array

    @property
    def cells(self) -> int:
        """Number of cells."""
        return int(self.points.shape[1])

    @cached_property
    def _sums(self) -> Array:
        """Variation from the beginning to the end of every cell: (cells + 1, n)."""
        cell_lengths = np.abs(np.diff(self.points, axis=0)).sum(axis=0)
        return np.concatenate([np.zeros((1, cell_lengths.shape[1])), np.cumsum(cell_lengths, axis=0)])

    def joints_at(self, place: Array) -> Array:
        """Joint values (P, n) at places (P,)."""
        cell = np.clip(place.astype(int), 0, self.cells - 1)
        share = place - cell
        return self._polar_form(cell, share, share, share)

    def variation(self, begin: Array, end: Array) -> Array:
        """Bounds of the total variation of the joints between places: (P, n)."""
        first = np.clip(begin.astype(int), 0, self.cells - 1)
        last = np.clip(np.ceil(end).astype(int) - 1, 0, self.cells - 1)
        low, high = begin - first, end - last
        is_one = first == last
        lengths = self._part_lengths(first, low, np.where(is_one, high, 1.0))
        if (~is_one).any():
            inner = self._sums[last] - self._sums[np.minimum(first + 1, last)]
            lengths += np.where(is_one[:, None], 0.0, inner + self._part_lengths(last, np.zeros_like(high), high))
        return lengths

    def _part_lengths(self, cell: Array, low: Array, high: Array) -> Array:
        """Length of the control polygon of a part of a cell, for each joint: (P, n)."""
        a, b = low, high
        corners = [self._polar_form(cell, *shares) for shares in ((a, a, a), (a, a, b), (a, b, b), (b, b, b))]
        lengths: Array = np.abs(np.diff(corners, axis=0)).sum(axis=0)
        return lengths

    def _polar_form(self, cell: Array, *shares: Array) -> Array:
        """The polar form of the cubic of a cell; three equal shares give a point of the curve."""
        points = self.points[:, cell]
        for share in shares:
            points = points[:-1] + share[:, None] * (points[1:] - points[:-1])
        return np.asarray(points[0])
