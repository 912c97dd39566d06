"""Roots of high order: what rounding makes of one, which of those are one branch, and what shows that none is in reach.

Near such a root the residual hardly grows along a curve, and rounding leaves as many candidates as its order. Two are
one branch if a posture between them solves the target, too: that half way or, where the curve bends, one beside it.
"""

import numpy as np

from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm
from armkin.model.units import radian_or_reach

BESIDE_SHARE = 0.1  # share of the distance of two roots, up to which a posture may stand from the one halfway
ROOT = 0.03  # share of that distance: the next Newton step of an exact root is shorter, beside one of order 16 longer


def solves_between(arm: Arm, task: Task, q: Array, offset: Array, miss: Array, sigma: Array, target: Array) -> Bool:
    """Whether a posture between q (M, n) and q + offset (M, n), in scaled units, solves the target: (M,).

    miss, sigma: (M,) residual and smallest singular value of the one whose Newton step, their quotient, is longer.
    Beside the posture half way is looked only where this one is no exact root: isolated roots have none in between.
    Steps back onto the curve leave out directions weaker than `HIGH_ORDER`.
    """
    halfway = q + 0.5 * offset * radian_or_reach(arm)
    solves = newton.misses(arm, task, halfway, target) <= tol.SOLUTION
    distance = np.abs(offset).max(axis=1)
    doubtful = np.flatnonzero(~solves & (sigma < tol.HIGH_ORDER) & (miss > ROOT * distance * sigma))
    if len(doubtful):
        beside, beside_miss = newton.correct(
            arm, task, halfway[doubtful], target[doubtful], steps=3, least=tol.HIGH_ORDER
        )
        moved = np.abs(newton.difference(arm, beside, halfway[doubtful])).max(axis=1)
        solves[doubtful] = (moved < BESIDE_SHARE * distance[doubtful]) & (beside_miss <= tol.SOLUTION)
    return np.asarray(solves)


def equal_candidates(
    arm: Arm, task: Task, q: Array, k: Int, b: Int, sigma: Array, size: Array, target: Array
) -> tuple[Bool, Array]:
    """Which candidates of targets k (m,) equal the b-th (m,), and how far they are from it [rad, reaches]: (m, M).

    Two are equal if rounding explains their distance, or if the posture halfway between them solves the target.
    """
    distance = newton.wrapped_distance(arm, q[k], q[k, b][:, None])
    alike = distance < _rounding_radius(np.minimum(sigma[k], sigma[k, b][:, None]))
    row, column = np.nonzero(~alike & (distance < tol.CLOSE_DISTANCE))
    if len(row):
        start = q[k[row], b[row]]
        offset = newton.difference(arm, q[k[row], column], start)
        # the longer Newton step of each pair; where it is rounding alone the quotient says nothing
        first, second = (k[row], b[row]), (k[row], column)
        longer = size[second] * sigma[first] > size[first] * sigma[second]
        miss, weakest = (np.where(longer, values[second], values[first]) for values in (size, sigma))
        solves = solves_between(arm, task, start, offset, miss, weakest, target[k[row]])
        alike[row, column] = solves
        for i in np.unique(row[solves]):  # candidates that rounding alone parts from these are of that root, too
            postures, equals = q[k[i]], np.flatnonzero(alike[i])
            distances = newton.wrapped_distance(arm, postures[:, None], postures[equals])
            close = distances < _rounding_radius(np.minimum(sigma[k[i]][:, None], sigma[k[i], equals]))
            alike[i] |= close.any(axis=1)
    return np.asarray(alike), distance


def _rounding_radius(sigma: Array) -> Array:
    """How far rounding may part two candidates of one root, the smaller of whose smallest singular values is sigma."""
    return np.asarray(tol.ROUNDING_DISTANCE + np.minimum(tol.ERROR / np.maximum(sigma, tol.TINY), tol.DOUBLE_DISTANCE))


def beyond_folds(arm: Arm, task: Task, q: Array, target: Array) -> Bool:
    """Which postures (M, n), close to their targets, show that these are out of reach there: (M,).

    To second order the tool moves along the direction u that the Jacobian cannot reach by half of `bend` times the
    square of the way. A residual along u of the same sign is one that no motion takes anything away of; what else is
    missing must be so little that putting it right does not lead back.
    """
    if not (task.constraints == arm.n > 1 and task.orientation != "axis" and len(q)):
        return np.zeros(len(q), bool)
    r, J = newton.scaled_residual_and_jacobian(arm, task, q, target)
    U, S, V = np.linalg.svd(J)
    u, step = U[:, :, -1], tol.FOLD_WAY * V[:, -1] * radian_or_reach(arm)
    ends = np.concatenate([q + step, q - step])
    forward, backward = np.split(newton.residuals(arm, task, ends, np.concatenate([target, target])), 2)
    bend = (u * (forward + backward - 2.0 * r)).sum(axis=1) / tol.FOLD_WAY**2
    along_u = (u * r).sum(axis=1)
    remainder = np.linalg.norm(r - along_u[:, None] * u, axis=1) / np.maximum(S[:, -2], tol.HIGH_ORDER)
    is_fold = (S[:, -2] > tol.HIGH_ORDER) & (S[:, -1] < tol.WEAK) & (np.abs(bend) > tol.FOLD_BEND)
    has_no_root = (along_u * bend > 0.0) & (np.abs(along_u) > 10.0 * tol.SOLUTION)
    return np.asarray(is_fold & has_no_root & (remainder < tol.FOLD_WAY) & (100.0 * remainder**2 < np.abs(along_u)))
