"""Self-motions beside keep-outs: one whose listed posture hits something is listed by its nearest free one instead.

A self-motion is followed both ways from the posture that is listed, by `curves`, and filled in to 0.1 degrees.
"""

from __future__ import annotations

import numpy as np

from armkin.formula.arrays import Array
from armkin.inverse.answers.batch import Batch, Goals
from armkin.inverse.answers.solutions import Status
from armkin.inverse.branches.whole_turns import nearest_row
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.singular.curves import Curves
from armkin.inverse.tasks.task import Task
from armkin.keep_out.clearance import clear
from armkin.model.arm import Arm
from armkin.model.units import radian_or_reach

FINE = np.deg2rad(0.1)  # between the postures that are looked at


def with_free_postures(goals: Goals, out: Batch) -> Batch:
    """The same branches; of singular targets each that hits something or is outside limits, at the nearest posture of
    its self-motion that is neither, if there is one to 0.1 degrees.
    """
    arm, task, target, near = goals
    good = clear(arm, out.q) & out.within
    for k, b in np.argwhere((out.status == Status.SINGULAR)[:, None] & out.valid & ~good):
        on_it = followed(arm, task, out.q[k, b], target[k])
        rows, inside = nearest_row(arm, on_it, near[k])
        free = np.flatnonzero(inside)
        free = free[clear(arm, rows[free])]
        if len(free):
            unit = np.where(arm.prismatic, 1.0, 180.0 / np.pi)
            nearest = free[np.argmin((np.abs(rows[free] - near[k]) * unit).sum(axis=1))]
            out.q[k, b], out.within[k, b] = rows[nearest], True
    return out


def followed(arm: Arm, task: Task, q: Array, target: Array) -> Array:
    """Postures (M, n) of the self-motion through q (n,), as far as it is followed; none where it rests.

    Where several directions are lost, those along each of them.
    """
    unit = radian_or_reach(arm)
    _, V, nullity = newton.null_space(arm, task, q[None], target[None])
    lost = V[0, arm.n - max(int(nullity[0]), 1) :]
    ahead = np.concatenate([lost, -lost])
    goal = np.repeat(target[None], len(ahead), axis=0)
    walk = Curves(arm, task, np.tile(q, (len(ahead), 1)), np.ones(ahead.shape, bool), goal, ahead)
    pieces = [np.empty((0, arm.n))]
    while walk.going.any():
        step = walk.step()
        count = max(int(np.ceil(np.abs(step.chord).max() / FINE)), 1)
        share = (np.arange(count) / count)[:, None, None]
        between = (step.before + share * step.chord * unit).reshape(-1, arm.n)
        goal = np.repeat(target[None], len(between), axis=0)
        there, size = newton.correct(arm, task, between, goal, steps=6, least=tol.WEAK)
        good = size <= tol.SOLUTION
        pieces.append(there[good])
        walk.going[step.rows] &= good.reshape(count, -1).all(axis=0)  # what else is near is no part of it
    return np.concatenate(pieces)
