"""Branch numbers along a path: puts the answers of neighbouring targets into the same order.

A closed form numbers its branches by signs, which do not change along a path. An elimination
returns branches in the arbitrary order of its eigenvalues. Between neighbouring targets the same
branch is the one that moves least, provided that the targets are close enough to be certain.
"""

import numpy as np

from armkin.formula.arrays import Array, Bool, Int, wrap_angle
from armkin.inverse.numeric import newton
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm

CHUNK = 2048  # targets linked at once

STEP_DISTANCE = 0.2  # largest motion [rad or reaches] of a branch between two targets
CLEAR_RATIO = 1.5  # least ratio of the distances to the second best and to the best partner


def follow_branches(arm: Arm, task: Task, q: Array, target: Array) -> Int:
    """A number for every branch, the same along a path.

    q: (N, B, n) [rad | mm] branches of N targets (N, m) or (N, 4, 4) in their order, nan past the
    last. Returns (N, B): numbers from 0 to B - 1, each once in a row, -1 where there is no branch.

    Two branches of neighbouring targets are linked if each is the other's nearest, within
    `STEP_DISTANCE`, and clearly so. Chains of links keep the number of their first branch; others get the least free.
    """
    N, B, _ = q.shape
    valid = ~np.isnan(q[:, :, 0])
    numbers = np.broadcast_to(np.arange(B), (N, B)).copy()
    rows = 1 + np.flatnonzero(_is_path(arm, task, target)) if N > 1 and B > 1 else np.zeros(0, np.intp)
    for start in range(0, len(rows), CHUNK):
        part = rows[start : start + CHUNK]
        for row, partners in zip(part.tolist(), _linked_branches(arm, q[part], q[part - 1]), strict=True):
            linked = partners >= 0
            numbers[row] = np.where(linked, numbers[row - 1][partners], -1)
            if not linked.all():
                used = np.zeros(B, bool)
                used[numbers[row][linked]] = True
                unlinked = np.flatnonzero(~linked)
                # branches get numbers before empty places
                numbers[row][unlinked[np.argsort(~valid[row, unlinked], kind="stable")]] = np.flatnonzero(~used)
    return np.where(valid, numbers, -1)


def _is_path(arm: Arm, task: Task, target: Array) -> Bool:
    """Whether each target is close enough to its predecessor to follow branches: (N - 1,)."""
    full = task.orientation == "full"
    change = np.diff(target[:, :3].reshape(len(target), -1) if full else target, axis=0)
    p = [3, 7, 11] if full else list(range(task.position))
    change[:, p] /= arm.reach
    if len(task.sums):
        angle_change = change[:, task.position :]
        angle_change[...] = wrap_angle(angle_change)
    return np.asarray(np.abs(change).max(axis=1) < STEP_DISTANCE)


def _linked_branches(arm: Arm, current: Array, previous: Array) -> Int:
    """The partner of every branch of targets (M, B, n) at the previous target, or -1: (M, B)."""
    distances = newton.distances(arm, current, previous)
    distances[np.isnan(distances)] = np.inf
    partner, back_partner = distances.argmin(axis=2), distances.argmin(axis=1)
    nearest, second = np.moveaxis(np.partition(distances, 1, axis=2)[:, :, :2], 2, 0)
    clear = (nearest < STEP_DISTANCE) & (second > CLEAR_RATIO * nearest)
    mutual = np.take_along_axis(back_partner, partner, axis=1) == np.arange(current.shape[1])
    return np.where(clear & mutual, partner, -1)
