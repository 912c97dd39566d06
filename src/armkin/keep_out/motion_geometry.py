"""A motion as its geometry alone: where the joints are, and how far each goes at most between two places.

Places are numbers: the whole part counts cells, the rest is the share of the cell.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from armkin.formula.arrays import Array


class Way(Protocol):
    """Joint values along a motion."""

    @property
    def cells(self) -> int:
        """How many: places go from 0 to this."""

    def joints_at(self, place: Array) -> Array:
        """Joint values (P, n) [rad | mm] at places (P,)."""

    def variation(self, begin: Array, end: Array) -> Array:
        """Bounds of the ways that the joints go between places (P,) and (P,), there and back counted: (P, n)."""


@dataclass(frozen=True, eq=False)
class Cubics:
    """Cubic curves one after another, by their control points (4, cells, n): joint moves, and planned paths.

    A curve goes no farther than the polygon of its control points (they shrink its variation), and any part of it
    has control points of its own, its polar form's (Ramshaw 1989).
    """

    points: Array

    @property
    def cells(self) -> int:
        """How many."""
        return int(self.points.shape[1])

    @cached_property
    def _sums(self) -> Array:
        """Variation from the beginning to every cell's end: (cells + 1, n)."""
        cell_lengths = np.abs(np.diff(self.points, axis=0)).sum(axis=0)
        return np.concatenate([np.zeros((1, cell_lengths.shape[1])), np.cumsum(cell_lengths, axis=0)])

    def joints_at(self, place: Array) -> Array:
        """Joint values (P, n) at places (P,)."""
        cell = np.clip(place.astype(int), 0, self.cells - 1)
        share = place - cell
        return self._polar_form(cell, share, share, share)

    def variation(self, begin: Array, end: Array) -> Array:
        """Bounds of the ways that the joints go between places: (P, n)."""
        first = np.clip(begin.astype(int), 0, self.cells - 1)
        last = np.clip(np.ceil(end).astype(int) - 1, 0, self.cells - 1)
        low, high = begin - first, end - last
        same = first == last
        lengths = self._part_lengths(first, low, np.where(same, high, 1.0))
        if (~same).any():
            between = self._sums[last] - self._sums[np.minimum(first + 1, last)]
            lengths += np.where(same[:, None], 0.0, between + self._part_lengths(last, np.zeros_like(high), high))
        return lengths

    def _part_lengths(self, cell: Array, low: Array, high: Array) -> Array:
        """Length of the control polygon of a cell's part, joint by joint: (P, n)."""
        a, b = (low, high)
        corners = [self._polar_form(cell, *three) for three in ((a, a, a), (a, a, b), (a, b, b), (b, b, b))]
        lengths: Array = np.abs(np.diff(corners, axis=0)).sum(axis=0)
        return lengths

    def _polar_form(self, cell: Array, *shares: Array) -> Array:
        """The polar form of a cell's cubic: three equal shares give its point."""
        points = self.points[:, cell]
        for share in shares:
            points = points[:-1] + share[:, None] * (points[1:] - points[:-1])
        return np.asarray(points[0])
