"""If `near` already solves the target within limits, it is returned unchanged, as the best branch.

The exact answer to a rounded target may be 1e-9 over the smallest singular value away from the posture that the target
was made from. Both solve it: the arm that stands there stays.
"""

import numpy as np

from armkin.formula.array_tuples import stack_rows
from armkin.formula.arrays import Array, Int
from armkin.forward import position
from armkin.inverse.answers.batch import Batch, Goals, complete_labels, empty_batch
from armkin.inverse.answers.solutions import Status
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.singular.high_order_roots import BESIDE_SHARE
from armkin.inverse.singular.self_motions import pull_back
from armkin.inverse.tasks.task import Task, targets_at
from armkin.model import limits
from armkin.model.arm import Arm
from armkin.model.units import radian_or_reach

AT_ONCE = 4096  # targets whose branches are compared with `near` together
ROOM = 2.0 * tol.SOLUTION  # distance [reaches] of the tool from a target that `near` might solve: twice, for rounding
COARSE_ROOM = 1e4 * ROOM  # distance [reaches] from a pose rounded to six digits where its rotation does not tell
ROUNDED = 1.001 * tol.SOLUTION  # residual, at least, that solves a rounded target


def put_near(goals: Goals, batch: Batch, rows: Int) -> Int:
    """Put `near` in place of the branch that it is one with; returns the targets that have to be examined.

    goals, batch: N targets and their branches; rows: those where the tool is. Two are one if the posture between them
    solves the target, too. Where there is no such branch, or another one close by, `near` still solves the target.
    """
    unsure = [_put_near_in_chunk(goals, batch, rows[start : start + AT_ONCE]) for start in range(0, len(rows), AT_ONCE)]
    return np.concatenate(unsure) if unsure else rows


def _put_near_in_chunk(goals: Goals, batch: Batch, rows: Int) -> Int:
    """`put_near` for rows whose branches fit into the cache."""
    arm, task = goals.arm, goals.task
    rows = rows[~limits.outside_limits(arm, goals.near[rows]).any(axis=1)]
    if not len(rows):
        return rows
    near, target = goals.near[rows], goals.target[rows]
    if not batch.valid.shape[1]:  # an elimination that found nothing at all
        return np.asarray(rows[newton.misses(arm, task, near, target) <= tol.SOLUTION])
    distance = newton.wrapped_distance(arm, batch.q[rows], near[:, None])
    distance = np.where(batch.valid[rows], distance, np.inf)
    place = distance.argmin(axis=1)
    least_distance = distance.min(axis=1)
    has_branch, solves = least_distance <= tol.STANDING_DISTANCE, np.ones(len(rows), bool)
    unsure = np.flatnonzero(~has_branch)
    if len(unsure):
        solves[unsure] = newton.misses(arm, task, near[unsure], target[unsure]) <= tol.SOLUTION
        unsure = unsure[solves[unsure] & ((distance[unsure] < tol.CLOSE_DISTANCE).sum(axis=1) == 1)]
        offset = newton.difference(arm, batch.q[rows[unsure], place[unsure]], near[unsure])
        between = near[unsure] + 0.5 * offset * radian_or_reach(arm)
        has_branch[unsure] = newton.misses(arm, task, between, target[unsure]) <= tol.SOLUTION
    batch.q[rows[has_branch], place[has_branch]] = near[has_branch]
    batch.within[rows[has_branch], place[has_branch]] = True
    return np.asarray(rows[solves & ~has_branch])


def solved_by_near(arm: Arm, task: Task, target: Array, near: Array, bounds: Array) -> Int:
    """Which targets (N, ...) are solved by `near` (n,) or (N, n), within limits, to within bounds (N,) [reaches, rad].

    Of those that are known better than to `SOLUTION` there are none: of these `put_near` has decided.
    """
    is_rounded = bounds > ROUNDED
    if not is_rounded.any():
        return np.flatnonzero(is_rounded)
    nears = np.broadcast_to(near, (len(target), arm.n))
    rows = targets_at(task, target, position(arm, near), np.where(is_rounded, bounds, -1.0) * arm.reach)
    rows = rows[~limits.outside_limits(arm, nears[rows]).any(axis=1)]
    return np.asarray(rows[newton.misses(arm, task, nears[rows], target[rows]) <= bounds[rows]])


def list_near(goals: Goals, batch: Batch, bounds: Array) -> Batch:
    """The branches, with `near` among them where it solves a rounded target: see `solved_by_near`.

    In place of the branch that it is one with to within the rounding, else beside the others; alone, on a boundary.
    """
    arm, task, target, near = goals
    rows = solved_by_near(arm, task, target, near, bounds)
    if not len(rows):
        return batch
    offset = newton.difference(arm, batch.q[rows], near[rows, None])
    distance = np.where(batch.valid[rows], np.abs(offset).max(axis=2), np.inf)
    distance = np.pad(distance, ((0, 0), (0, 1)), constant_values=np.inf)
    is_one, is_nearest = distance <= tol.STANDING_DISTANCE, distance == distance.min(axis=1, keepdims=True)
    has_q = distance < np.inf
    for tried, steps in (is_nearest, 0), (has_q, 0), (has_q, 6):  # in the last the component may bend
        k, b = np.nonzero(tried & has_q & ~is_one.any(axis=1, keepdims=True))
        halfway = near[rows[k]] + 0.5 * offset[k, b] * radian_or_reach(arm)
        between, size = pull_back(arm, task, halfway, target[rows[k]], steps)
        deviation = newton.wrapped_distance(arm, between, halfway)
        is_one[k, b] = (size <= bounds[rows[k]]) & (deviation <= BESIDE_SHARE * distance[k, b])
    place, has_branch = np.where(is_one, distance, np.inf).argmin(axis=1), is_one.any(axis=1)
    count = batch.valid[rows].sum(axis=1)
    place = np.where(has_branch, place, count)
    batch = stack_rows([batch, empty_batch(0, int(place.max()) + 1, arm.n)])
    batch.q[rows, place], batch.valid[rows, place], batch.within[rows, place] = near[rows], True, True
    batch.branch[rows] = complete_labels(batch.branch[rows].astype(np.int64), batch.valid[rows])
    batch.status[rows[count == 0]] = Status.BOUNDARY
    return batch
