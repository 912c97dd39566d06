"""Edges within limits: a self-motion, or a root known to a hair, that has legal postures is listed by one of these.

A self-motion is listed by its posture closest to `near`, which may be outside limits where others of it are not; a
double root at a limit is off it by as much as arithmetic can tell its halves apart.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from armkin.formula.arrays import Array
from armkin.inverse.batch import Batch, Goals, wider
from armkin.inverse.branches.turns import nearest_row
from armkin.inverse.closest import closest
from armkin.inverse.numeric import newton
from armkin.inverse.numeric.tolerances import ACCEPTED, SOLUTION
from armkin.inverse.solutions import Solutions, Status
from armkin.model import limits
from armkin.model.units import radian_or_reach

OFF = 1e-7  # [rad, reaches] how far outside limits a double root may be that stands for one on them
MOVES = 1e-12  # smallest singular value of a posture on a self-motion, not in a valley


def listed(goals: Goals, out: Batch, again: Callable[[Array, Array], Solutions]) -> Batch:
    """The same branches, with legal ones for targets on an edge that have none, where such a posture is found.

    goals, out: N targets and their branches; again: the solver, for a target and another `near`.
    """
    arm, task, target, near = goals
    edge = np.flatnonzero((out.status == Status.BOUNDARY) | (out.status == Status.SINGULAR))
    for k in edge[~out.within[edge].any(axis=1)]:
        q = out.q[k, out.valid[k]]
        beyond = np.maximum(np.maximum(arm.lower - q, q - arm.upper), 0.0) / radian_or_reach(arm)
        hair = (beyond < OFF).all(axis=1)
        sigma, *_ = newton.null_space(arm, task, q, np.repeat(target[k : k + 1], len(q), axis=0))
        # a joint that is held is outside; or it is a valley, whose points are not as exact as the branches
        if not (hair | ((beyond < OFF) | out.free[k]).all(axis=1) & (sigma < MOVES)).any():
            continue
        legal = closest(arm, target[k], task.name, near=near[k]).q
        exact, _ = newton.correct(arm, task, legal[None], target[k : k + 1])
        if not limits.outside(arm, exact[0]).any():  # the correction may take a double root beyond its limit
            legal = exact[0]
        goal = np.repeat(target[k : k + 1], len(q) + 1, axis=0)
        miss, *others = newton.missing(arm, task, np.concatenate([legal[None], q]), goal)
        # of a self-motion as exact as what was listed; with a margin, for `again` has to take it as a branch
        if miss > (0.9 * SOLUTION if hair.any() else min(max(2.0 * min(others), ACCEPTED), 0.9 * SOLUTION)):
            continue
        found = again(target[k], legal)
        if found.best < 0:
            continue
        width = found.q.shape[0]
        if width > out.q.shape[1]:
            out = wider(out, width)
        out.q[k], out.valid[k], out.within[k], out.branch[k] = np.nan, False, False, -1
        copies, inside = nearest_row(arm, np.nan_to_num(found.q), near[k])
        out.q[k, :width] = np.where(found.valid[:, None], copies, np.nan)
        out.valid[k, :width], out.within[k, :width] = found.valid, inside & found.valid
        out.branch[k, :width] = found.branch
        out.status[k], out.free[k], out.complete[k] = found.status, found.free, found.complete
    return out
