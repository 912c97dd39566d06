"""Results of a batch in the layout of `armkin.Solutions`, with room to grow in place.

The number of columns is known only after the whole batch is solved: an elimination finds up to 16 branches, usually
fewer, and an edge may add one. Large arrays reserve memory for more columns, which the system provides only when it is
written, so that a million poses need no second copy of their results.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool
from armkin.inverse.answers.solutions import Solutions

ROOM = 24  # columns reserved for a large result, as enlarging it later would need its memory twice
MOVABLE = 32_000_000  # size [bytes] up to which a result is enlarged by a copy, as allocators reuse freed memory
BLOCK_ROWS = 4096  # rows moved together


class Results:
    """q (N, B, n), valid, within, branch (N, B), status, state, complete (N,), free (N, n)."""

    def __init__(self, N: int, B: int, n: int) -> None:
        self.N, self.B, self.n = N, B, n
        self._allocate(max(B, ROOM) if 8 * N * max(B, 1) * n > MOVABLE else B)
        self.status, self.state = np.zeros(N, np.int8), np.empty(N, np.uint8)
        self.free, self.complete = np.zeros((N, n), bool), np.ones(N, bool)

    def _allocate(self, room: int) -> None:
        """Reserve memory for `room` columns."""
        N, n = self.N, self.n
        self._room = room
        self._memory = (np.empty(N * room * n), np.empty(N * room, bool), np.empty(N * room, bool))
        self._indices = np.empty(N * room, np.int8)
        self._shape_views()

    def _shape_views(self) -> None:
        N, B, n = self.N, self.B, self.n
        q, valid, within_limits = self._memory
        self.q: Array = q[: N * B * n].reshape(N, B, n)
        self.valid: Bool = valid[: N * B].reshape(N, B)
        self.within: Bool = within_limits[: N * B].reshape(N, B)
        self.branch: NDArray[np.int8] = self._indices[: N * B].reshape(N, B)

    def widen(self, B: int) -> None:
        """Grow to at least B columns; new columns are empty."""
        if B <= self.B:
            return
        narrow_arrays: list[NDArray[Any]] = [self.q, self.valid, self.within, self.branch]
        old_count = self.B
        self.B = B
        if self._room < B:
            self._allocate(2 * B)
        else:
            self._shape_views()
        wide_arrays: list[NDArray[Any]] = [self.q, self.valid, self.within, self.branch]
        pairs = zip(narrow_arrays, wide_arrays, (math.nan, False, False, -1), strict=True)
        for old, new, empty in pairs:
            # move rows from the end on, so that no row overwrites one that is not moved yet
            for start in reversed(range(0, self.N, BLOCK_ROWS)):
                rows = old[start : start + BLOCK_ROWS].copy()
                new[start : start + BLOCK_ROWS, :old_count] = rows
                new[start : start + BLOCK_ROWS, old_count:] = empty

    def write(self, rows: slice | NDArray[np.intp], answers: Results | Solutions) -> None:
        """Write some rows, which may need more columns."""
        within_limits = answers.within if isinstance(answers, Results) else answers.within_limits
        B = answers.q.shape[-2]
        self.widen(B)
        self.q[rows, :B], self.q[rows, B:] = answers.q, math.nan
        self.valid[rows, :B], self.valid[rows, B:] = answers.valid, False
        self.within[rows, :B], self.within[rows, B:] = within_limits, False
        self.branch[rows, :B], self.branch[rows, B:] = answers.branch, -1
        self.status[rows], self.free[rows], self.complete[rows] = answers.status, answers.free, answers.complete

    def narrow(self) -> None:
        """Copy the arrays without columns that no target needs."""
        B = int(self.valid.sum(axis=1).max(initial=0))
        self.q, self.valid = self.q[:, :B].copy(), self.valid[:, :B].copy()
        self.within, self.branch = self.within[:, :B].copy(), self.branch[:, :B].copy()
        self.B = B
