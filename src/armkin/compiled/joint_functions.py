"""Functions of joint values in machine code: poses, positions and clearances."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from armkin import forward
from armkin.engines.threads import share_rows
from armkin.formula.arrays import Array
from armkin.keep_out.clearance import Clearance, clearance, least_clearances, name_clearances

if TYPE_CHECKING:
    from armkin.model.arm import Arm

THREAD_POSES = 8192  # poses of a closed form from which on another thread is worth starting


class JointFunctions:
    """Functions of joint values (..., n) [rad | mm] in the library of an arm."""

    def __init__(self, arm: Arm, code: ctypes.CDLL) -> None:
        self.arm = arm
        self._poses, self._points = code.arm_poses, code.arm_points
        self._clearances = code.arm_clearances if arm.keep_out and arm.whole is None else None
        for function in filter(None, (self._poses, self._points, self._clearances)):
            function.argtypes, function.restype = [ctypes.c_int64, *[ctypes.c_void_p] * 3], ctypes.c_int64

    def fk(self, q: ArrayLike, workers: int) -> Array:
        """Poses (..., 4, 4) of joint values (..., n)."""
        return self._run(self._poses, forward.fk, (4, 4), q, workers)

    def position(self, q: ArrayLike, workers: int) -> Array:
        """Positions (..., 3) of the tool for joint values (..., n)."""
        return self._run(self._points, forward.position, (3,), q, workers)

    def clearance(self, q: ArrayLike) -> Clearance:
        """Least clearances and their pairs; in Python without a table in C, or for values that are not finite."""
        values = forward.as_joints(self.arm, q)
        if self._clearances is None or not np.isfinite(values).all():
            return clearance(self.arm, values)
        pairs = self._run(self._clearances, least_clearances, (2,), values, 1).reshape(-1, 2)
        return name_clearances(self.arm, pairs[:, 0], pairs[:, 1].astype(np.intp), values.shape[:-1])

    def _run(
        self, call: Any, python: Callable[[Arm, Array], Array], shape: tuple[int, ...], q: ArrayLike, workers: int
    ) -> Array:
        """A function of joint values in C, and in Python for the large angles that C refuses."""
        values = forward.as_joints(self.arm, q)
        rows_of_q = np.ascontiguousarray(values.reshape(-1, self.arm.n))
        results, is_refused = np.empty((len(rows_of_q), *shape)), np.empty(len(rows_of_q), np.uint8)

        def run_part(rows: slice) -> int:
            pointers = (a[rows].ctypes.data for a in (rows_of_q, results, is_refused))
            return int(call(rows.stop - rows.start, *pointers))

        if sum(share_rows(run_part, len(rows_of_q), workers, THREAD_POSES)):
            refused_rows = np.flatnonzero(is_refused)
            results[refused_rows] = python(self.arm, rows_of_q[refused_rows])
        return results.reshape(*values.shape[:-1], *shape)
