"""Self-motions beside keep-outs: one whose listed posture hits something is listed by its nearest free one instead.

A self-motion is followed both ways from the posture that is listed, in steps that are filled in to 0.1 degrees.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armkin.formula.arrays import Array
from armkin.inverse.answers.batch import Batch, Goals
from armkin.inverse.answers.solutions import Status
from armkin.inverse.branches.turns import nearest_row
from armkin.inverse.numeric import newton
from armkin.inverse.numeric.tolerances import SOLUTION, WEAK
from armkin.keep_out.clearance import clear
from armkin.model.units import radian_or_reach

if TYPE_CHECKING:
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm

STEP = 0.05  # [rad, reaches] of all joints together
FINE = np.deg2rad(0.1)  # between the postures that are looked at
MOST = 600  # steps each way: more than four turns of one joint


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
    """Postures (M, n) of the self-motion through q (n,), all it has within `MOST` steps each way; none where it rests.

    Where several directions are lost, those along each of them.
    """
    unit, goal = radian_or_reach(arm), target[None]
    _, V, nullity = newton.null_space(arm, task, q[None], goal)
    pieces = [np.empty((0, arm.n))]
    for lost in V[0, arm.n - max(int(nullity[0]), 1) :]:
        forth, closed = _way(arm, task, q, lost, target)
        ways = [forth] if closed else [forth, _way(arm, task, q, -lost, target)[0]]
        for way in ways:
            count = max(int(np.ceil(STEP / FINE)), 1)
            share = (np.arange(count) / count)[None, :, None]
            apart = newton.difference(arm, way[1:], way[:-1]) * unit
            between = (way[:-1, None] + share * apart[:, None]).reshape(-1, arm.n)
            there, size = newton.correct(arm, task, between, np.repeat(goal, len(between), axis=0), steps=6, least=WEAK)
            pieces.append(there[size <= SOLUTION])
    return np.concatenate(pieces)


def _way(arm: Arm, task: Task, q: Array, ahead: Array, target: Array) -> tuple[Array, bool]:
    """Postures (M, n) that are passed from q (n,) on, q among them, and whether the way comes back to it."""
    unit, goal = radian_or_reach(arm), target[None]
    passed = [q]
    for _ in range(MOST):
        there, size = newton.correct(arm, task, (passed[-1] + STEP * ahead * unit)[None], goal, steps=8, least=WEAK)
        gone = newton.difference(arm, there[0], passed[-1])
        far = float(np.linalg.norm(gone))
        if size[0] > SOLUTION or not 0.3 * STEP < far < 3 * STEP:
            break
        passed.append(there[0])
        if len(passed) > 3 and np.linalg.norm(newton.difference(arm, there[0], q)) < 0.6 * STEP:
            return np.array([*passed, q]), True
        _, V, nullity = newton.null_space(arm, task, there, goal)
        lost = V[0, arm.n - max(int(nullity[0]), 1) :]
        ahead = lost.T @ (lost @ gone)  # on, in the directions that are lost there
        if (size_ := float(np.linalg.norm(ahead))) < 0.3 * far:
            break
        ahead /= size_
    return np.array(passed), False
