"""Branch numbers that follow a path: the answers of neighbouring targets put into the same order.

A closed form numbers its branches by choices of sign, which a path keeps. An elimination returns
them in the order of its eigenvalues, which means nothing. Along a path the same branch is the one
that has moved least, as long as the targets are so close that this is beyond doubt.
"""

from __future__ import annotations

import numpy as np

from armkin.formula.arrays import Array, Bool, Int, wrap_angle
from armkin.inverse.numeric import newton
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm

CHUNK = 2048  # targets linked at once

STEP_DISTANCE = 0.2  # distance [rad or reaches] that a branch may move from one target to the next
CLEAR_RATIO = 1.5  # ratio, at least, of the distances to the second best partner and to the best one


def follow_branches(arm: Arm, task: Task, q: Array, target: Array) -> Int:
    """A number for every branch, the same along a path.

    q: (N, B, n) [rad | mm] branches of N targets (N, m) or (N, 4, 4) in their order, nan past the
    last. Returns (N, B): numbers from 0 to B - 1, each once in a row, -1 where there is no branch.

    Two branches of neighbouring targets are linked if each is the other's nearest, within
    `STEP_DISTANCE`, and clearly so. Chains of links keep the number of their first branch; branches
    without a link get the smallest free ones, in their order.
    """
    N, B, _ = q.shape
    valid = ~np.isnan(q[:, :, 0])
    numbers = np.broadcast_to(np.arange(B), (N, B)).copy()
    rows = 1 + np.flatnonzero(_is_path(arm, task, target)) if N > 1 and B > 1 else np.zeros(0, np.intp)
    for start in range(0, len(rows), CHUNK):
        part = rows[start : start + CHUNK]
        for k, before in zip(part.tolist(), _linked_branches(arm, q[part], q[part - 1]), strict=True):
            linked = before >= 0
            numbers[k] = np.where(linked, numbers[k - 1][before], -1)
            if not linked.all():
                taken = np.zeros(B, bool)
                taken[numbers[k][linked]] = True
                unlinked = np.flatnonzero(~linked)
                # real branches first, then the empty places
                numbers[k][unlinked[np.argsort(~valid[k, unlinked], kind="stable")]] = np.flatnonzero(~taken)
    return np.where(valid, numbers, -1)


def _is_path(arm: Arm, task: Task, target: Array) -> Bool:
    """Which targets lie so close to the one before that branches may be followed: (N - 1,)."""
    full = task.orientation == "full"
    moved = np.diff(target[:, :3].reshape(len(target), -1) if full else target, axis=0)
    p = [3, 7, 11] if full else list(range(task.position))
    moved[:, p] /= arm.reach
    if len(task.sums):
        turned = moved[:, task.position :]
        turned[...] = wrap_angle(turned)
    return np.asarray(np.abs(moved).max(axis=1) < STEP_DISTANCE)


def _linked_branches(arm: Arm, after: Array, before: Array) -> Int:
    """For every branch of targets (M, B, n) its partner at the target before, or -1: (M, B)."""
    apart = newton.distances(arm, after, before)
    apart[np.isnan(apart)] = np.inf
    partner, back = apart.argmin(axis=2), apart.argmin(axis=1)
    nearest, second = np.moveaxis(np.partition(apart, 1, axis=2)[:, :, :2], 2, 0)
    clear = (nearest < STEP_DISTANCE) & (second > CLEAR_RATIO * nearest)
    mutual = np.take_along_axis(back, partner, axis=1) == np.arange(after.shape[1])
    return np.where(clear & mutual, partner, -1)
