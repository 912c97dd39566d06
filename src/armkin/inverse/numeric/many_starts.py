"""Solutions from many starts, for targets that the elimination could not settle as they stand: a search, no proof."""

from __future__ import annotations

import numpy as np

from armkin.formula.arrays import Array, Bool
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm

STARTS = 64
STEPS, PATIENCE = 25, 8
ROUND = np.pi / 4  # [rad] roots of high order nearly always stand where axes are parallel or at such angles


def many_starts(arm: Arm, task: Task, target: Array, lost: Bool) -> Array:
    """What Newton's method leads to from the same random postures for each target that may lack branches.

    target: (N, m) or (N, 4, 4); lost: (N,), some. Returns (N, STARTS, n) postures that miss their target by less than
    `SEED`, nan elsewhere. Of roots that Newton's method only approaches, the nearest round posture, if that is better.
    """
    rng = np.random.default_rng(13)
    start = rng.uniform(-1.0, 1.0, (STARTS, arm.n)) * np.where(arm.prismatic, arm.reach, np.pi)
    row, which = np.nonzero(np.repeat(lost[:, None], STARTS, axis=1))
    out = np.full((len(target), STARTS, arm.n), np.nan)
    q, size = newton.correct(arm, task, start[which], target[row], steps=STEPS, patience=PATIENCE)
    slow = np.flatnonzero((size > tol.CONVERGING) & (size < tol.SEED))
    if len(slow):
        even = np.where(arm.prismatic, q[slow], ROUND * np.rint(q[slow] / ROUND))
        better = newton.missing(arm, task, even, target[row[slow]]) < size[slow]
        q[slow[better]] = even[better]
    out[row, which] = np.where((size < tol.SEED)[:, None], q, np.nan)
    return out
