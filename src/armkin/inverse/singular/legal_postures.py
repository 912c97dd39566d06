"""Self-motion manifolds whose listed posture is outside limits or hits a keep-out: others on them that are not.

A self-motion is listed by its posture closest to `near`, which may be outside limits where others of it are not; a
double root at a limit is off it by as much as arithmetic can tell its halves apart. Beside keep-outs a self-motion is
followed both ways from the posture that is listed, by `curves`, and filled in to 0.1 degrees.
"""

import numpy as np

from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.answers.batch import Batch, Goals, Seeds, write_branches
from armkin.inverse.answers.closest import closest_from_every_start
from armkin.inverse.answers.solutions import Status
from armkin.inverse.branches.whole_turns import nearest_row
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.singular import groups, surfaces
from armkin.inverse.singular.curves import Curves
from armkin.inverse.tasks.task import Task
from armkin.keep_out.clearance import hits_nothing
from armkin.model.arm import Arm
from armkin.model.units import radian_or_reach

FINE_STEP = np.deg2rad(0.1)  # step [rad] between the postures of a self-motion that are looked at


def with_legal_postures(goals: Goals, batch: Batch, rows: Int) -> Batch:
    """The branches, with legal ones for targets rows on an edge that have none, where such a posture is found.

    goals, batch: N targets and their branches. The legal one takes the place of one on its self-motion, as `near`.
    """
    arm, task, target, near = goals
    for k in rows[_may_be_legal(goals, batch, rows)]:
        q = batch.q[k, batch.valid[k]]
        at_limit = _at_limits(arm, q).all(axis=1).any()
        legal = closest_from_every_start(arm, task, target[k : k + 1], near[k : k + 1]).q
        exact, _ = newton.correct(arm, task, legal[None], target[k : k + 1])
        # the correction may take a double root beyond its limit
        if ((exact[0] >= arm.lower) & (exact[0] <= arm.upper)).all():
            legal = exact[0]
        goal = np.repeat(target[k : k + 1], len(q) + 1, axis=0)
        miss, *listed = newton.misses(arm, task, np.concatenate([legal[None], q]), goal)
        # it must be as exact as what was listed, with a margin, as it is to count as a branch
        if miss > (0.9 * tol.SOLUTION if at_limit else min(max(2.0 * min(listed), tol.ACCEPTED), 0.9 * tol.SOLUTION)):
            continue
        subset = Goals(arm, task, target[k : k + 1], legal[None])
        label = batch.branch[k, batch.valid[k]].astype(np.int64)
        decision = surfaces.list_swept(subset, groups.examine(subset, Seeds.of(q[None], label), surfaces.no_more))
        _, inside = nearest_row(arm, np.nan_to_num(decision.q[0]), near[k])
        if not (inside & decision.valid[0]).any():
            continue
        row = np.array([k])
        batch = write_branches(arm, batch, row, decision.q, decision.valid, decision.label, near[row])
        batch.status[k] = max(batch.status[k], decision.status[0])  # one of two roots in one was listed
        batch.free[k] |= decision.free[0]
    return batch


def _at_limits(arm: Arm, q: Array) -> Bool:
    """Which joints of postures (..., n) are within limits or at one."""
    excess = np.maximum(np.maximum(arm.lower - q, q - arm.upper), 0.0) / radian_or_reach(arm)
    return np.asarray(excess < tol.ROUNDING_DISTANCE)


def _may_be_legal(goals: Goals, batch: Batch, rows: Int) -> Bool:
    """Which targets have a posture at a limit, or on a self-motion that may lead within limits: (len(rows),)."""
    arm, task, target, _ = goals
    k, b = np.nonzero(batch.valid[rows])
    inside = _at_limits(arm, batch.q[rows[k], b])
    # otherwise a held joint is outside its limits, or the curve is less exact than the branches
    undecided = np.flatnonzero((inside | batch.free[rows[k]]).all(axis=1))
    legal: Bool = np.asarray(inside.all(axis=1))
    undecided = undecided[~legal[undecided]]
    if len(undecided):
        sigma, *_ = newton.null_space(arm, task, batch.q[rows[k[undecided]], b[undecided]], target[rows[k[undecided]]])
        legal[undecided] = sigma < tol.ROUNDING_RESIDUAL
    return np.bincount(k[legal], minlength=len(rows)) > 0


def with_free_postures(goals: Goals, batch: Batch) -> Batch:
    """The branches; of singular targets each that hits something or is outside limits, at the nearest posture of
    its self-motion that is neither, if there is one to 0.1 degrees."""
    arm, task, target, near = goals
    is_free = hits_nothing(arm, batch.q) & batch.within
    for k, b in np.argwhere((batch.status == Status.SINGULAR)[:, None] & batch.valid & ~is_free):
        rows, inside = nearest_row(arm, follow_self_motion(arm, task, batch.q[k, b], target[k]), near[k])
        candidates = np.flatnonzero(inside)
        candidates = candidates[hits_nothing(arm, rows[candidates])]
        if len(candidates):
            unit = np.where(arm.prismatic, 1.0, 180.0 / np.pi)
            nearest = candidates[np.argmin((np.abs(rows[candidates] - near[k]) * unit).sum(axis=1))]
            batch.q[k, b], batch.within[k, b] = rows[nearest], True
    return batch


def follow_self_motion(arm: Arm, task: Task, q: Array, target: Array) -> Array:
    """Postures (M, n) of the self-motion through q (n,), as far as it is followed; none where it rests.

    Where several directions are lost, those along each of them.
    """
    unit = radian_or_reach(arm)
    _, V, nullity = newton.null_space(arm, task, q[None], target[None])
    null_vectors = V[0, arm.n - max(int(nullity[0]), 1) :]
    directions = np.concatenate([null_vectors, -null_vectors])
    goal = np.repeat(target[None], len(directions), axis=0)
    walk = Curves(arm, task, np.tile(q, (len(directions), 1)), np.ones(directions.shape, bool), goal, directions)
    stretches = [np.empty((0, arm.n))]
    while walk.active.any():
        step = walk.step()
        count = max(int(np.ceil(np.abs(step.chord).max() / FINE_STEP)), 1)
        share = (np.arange(count) / count)[:, None, None]
        between = (step.start + share * step.chord * unit).reshape(-1, arm.n)
        goal = np.repeat(target[None], len(between), axis=0)
        landed, size = newton.correct(arm, task, between, goal, steps=6, least=tol.WEAK)
        on_target = size <= tol.SOLUTION
        stretches.append(landed[on_target])
        walk.active[step.rows] &= on_target.reshape(count, -1).all(axis=0)  # what else is near is no part of it
    return np.concatenate(stretches)
