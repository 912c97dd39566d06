"""Rows of an elimination by machine code, for targets on an edge that Python examines.

Examining a target solves it and many targets around it, which takes a hundredth of the time in C.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool
from armkin.inverse.closed.geometry import Rows
from armkin.inverse.solvers.nearly_special import name_branches

if TYPE_CHECKING:
    from armkin.inverse.closed.geometry import Geometry

UNSURE_STATE = 2  # least state of `arm_rows` whose branches may lack one or be double: export/c/parts/candidates.c


class CompiledElimination:
    """A geometry whose rows come from `arm_rows` of parts/elimination_rows.c, and unsure ones from Python."""

    def __init__(
        self, geometry: Geometry, without_names: Geometry, call: Callable[..., Any], branches: int, joints: int
    ) -> None:
        """without_names: the elimination without names; branches, joints: the size of a row in C."""
        self._complete, self._slow = without_names.complete, geometry.unmoved or without_names.rows
        self._call, self._shape = call, (branches, joints)
        rows = name_branches(self._rows, geometry) if geometry.places else self._rows
        self.geometry = replace(geometry, rows=rows, unmoved=None)

    def is_complete(self, target: Array) -> Bool:
        """Which targets (N, 4, 4) have complete and isolated branches in C: (N,)."""
        return np.asarray(self._call_c(target)[1] < UNSURE_STATE)

    def answers(self, target: Array) -> Array:
        """Branches (N, B, n) of targets, nan for none; unsure ones as C has found them, not examined by Python."""
        return self._call_c(target)[0]

    def _call_c(self, target: Array) -> tuple[Array, NDArray[np.uint8]]:
        """Branches (N, B, n) of targets, nan after the last, and the states (N,) of the targets."""
        goal = np.ascontiguousarray(target)
        q, states = np.empty((len(goal), *self._shape)), np.empty(len(goal), np.uint8)
        self._call(len(goal), goal.ctypes.data, q.ctypes.data, states.ctypes.data)
        return q, states

    def _rows(self, target: Array) -> Rows:
        N, n = len(target), self._shape[1]
        q, states = self._call_c(target)
        doubt, lost, complete = states > 0, np.zeros(N, bool), np.full(N, self._complete)
        guesses = np.empty((N, 0, n))
        if len(unsure_rows := np.flatnonzero(states >= UNSURE_STATE)):
            assert self._slow is not None
            slow_rows = self._slow(target[unsure_rows])
            assert slow_rows.lost is not None
            assert slow_rows.guesses is not None
            guesses = np.full((N, slow_rows.guesses.shape[1], n), np.nan)
            q[unsure_rows] = np.nan
            q[unsure_rows, : slow_rows.q.shape[1]], guesses[unsure_rows] = slow_rows.q, slow_rows.guesses
            doubt[unsure_rows], lost[unsure_rows] = slow_rows.doubt, slow_rows.lost
            complete[unsure_rows] = slow_rows.complete
        width = int((~np.isnan(q[:, :, 0])).sum(axis=1).max(initial=0))
        return Rows(q[:, :width], doubt, complete, lost, guesses)
