"""Newton's method for two roots at once, which does not slow down where they meet.

Two roots are ``m + sqrt(w) u`` and ``m - sqrt(w) u``: real for ``w > 0``, complex for ``w < 0``, one at ``w = 0``. Half
the sum of their residuals and half the difference over ``sqrt(w)`` are smooth in m, u and w, and their Jacobian is
regular where that of one root alone is singular: at a fold.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armkin.formula.arrays import Array, Bool
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm
from armkin.model.units import radian_or_reach

STEPS = 8
LARGEST = 0.3  # [rad, reaches] of a step


class RootPair(NamedTuple):
    """middle (M, n) [rad | mm]; way (M, n): half of what lies between the roots, or would if they were real; square
    (M,): w, negative of complex ones [rad^2, reaches^2]; found (M,)."""

    middle: Array
    way: Array
    square: Array
    found: Bool


def meet(arm: Arm, task: Task, q: Array, target: Array) -> RootPair:
    """The pairs of roots about postures q (M, n), whose weakest direction is the pairs', on targets.

    Of tasks with as many residuals as joints. Complex pairs are found to the second order of what lies between them.
    """
    unit, (M, n) = radian_or_reach(arm), q.shape
    middle, square = q.copy(), np.zeros(M)
    _, J = newton.scaled(arm, task, middle, target)
    along = np.linalg.svd(np.where(np.isfinite(J), J, 0.0))[2][:, -1]
    way, size = along.copy(), np.full(M, np.inf)
    active = np.arange(M)
    for _ in range(STEPS):
        goal, m, u, w = target[active], middle[active], way[active], square[active]
        half = np.sqrt(np.maximum(np.abs(w), tol.PAIR_WAY**2))[:, None]
        ahead, behind, there = (newton.scaled(arm, task, m + side * half * u * unit, goal) for side in (1.0, -1.0, 0.0))
        bent = (ahead[0] + behind[0] - 2.0 * there[0]) / half**2
        even, odd = there[0] + 0.5 * w[:, None] * bent, (ahead[0] - behind[0]) / (2.0 * half)
        A, B = 0.5 * (ahead[1] + behind[1]), (ahead[1] - behind[1]) / (2.0 * half[:, :, None])
        curved = (B @ u[:, :, None])[:, :, 0]
        third = ((A @ u[:, :, None])[:, :, 0] + odd) / (2.0 * half**2)
        system = np.zeros((len(active), 2 * n + 1, 2 * n + 1))
        system[:, :n, :n] = system[:, n:-1, n:-1] = A
        system[:, :n, n:-1], system[:, n:-1, :n] = w[:, None, None] * B, B
        system[:, :n, -1], system[:, n:-1, -1] = 0.5 * curved, third
        system[:, -1, n:-1] = along[active]
        missing = np.concatenate([even, odd, np.zeros((len(active), 1))], axis=1)
        with np.errstate(all="ignore"):
            step = newton.nudged(np.linalg.solve, np.nan_to_num(system), np.nan_to_num(missing)[:, :, None])[:, :, 0]
        step *= np.minimum(1.0, LARGEST / np.maximum(np.abs(step).max(axis=1), LARGEST))[:, None]
        middle[active] += step[:, :n] * unit
        way[active] += step[:, n:-1]
        square[active] += step[:, -1]
        size[active] = np.abs(step).max(axis=1)
        active = active[~(size[active] < tol.PAIR_SETTLED)]
        if not len(active):
            break
    way *= np.sqrt(np.abs(square))[:, None] * unit
    return RootPair(middle, way, square, size < tol.PAIR_SETTLED)
