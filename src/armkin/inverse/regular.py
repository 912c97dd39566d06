"""Targets in doubt that are regular after all, and those of which two roots merge.

Of the targets that a closed form doubts, most are neither singular nor out of reach: two of their branches lie some
1e-4 rad apart. This tells them from the others all at once, from the Jacobian at every candidate and the posture
between every two neighbours; what it cannot tell is left to `armkin.inverse.singularities`, whose criteria these are.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from armkin.formula.arrays import Array, Bool
from armkin.inverse.clusters import means
from armkin.inverse.folds import BENT, folds
from armkin.inverse.numeric import newton
from armkin.inverse.numeric.linalg import nudged
from armkin.inverse.numeric.tolerances import CLUSTER, DOUBLE, HAIR, MOVING, NEARBY, SAME, SEED, SOLUTION
from armkin.inverse.tasks.task import Task

if TYPE_CHECKING:
    from armkin.model.arm import Arm

CLOSED = 1e-12  # residual of a branch that needs no correction
SHORT = 1e-6  # [rad, reaches] a step whose square is below rounding


class Regular(NamedTuple):
    """What is known of K targets: known (K,) whether anything is, branch (K, B) candidates that are its branches.

    double: (K,) a branch stands for two roots, or arithmetic cannot tell it from another. q: (K, B, n) the candidates,
    those of changed targets (K,) corrected.
    """

    known: Bool
    branch: Bool
    double: Bool
    q: Array
    changed: Bool


def settle(arm: Arm, task: Task, q: Array, valid: Bool, target: Array, near: Array) -> Regular:
    """Candidates (K, B, n), of which valid ones (K, B) were accepted; target: (K, m) or (K, 4, 4); near: (K, n)."""
    K, B, n = q.shape
    both = np.concatenate([near[:, None], q], axis=1).reshape(-1, n)
    r, J = newton.scaled(arm, task, both, np.repeat(target, B + 1, axis=0))
    size = np.sqrt((r * r).sum(axis=1)).reshape(K, B + 1)
    q, valid, changed = _corrected(arm, task, q, valid, r, J, size[:, 1:], target)
    # `near` is no branch itself, accepted candidates need no correction, and others are beyond it
    known = (size[:, 0] > SOLUTION) & valid.any(axis=1)
    known &= ~(valid & ~(size[:, 1:] < CLOSED)).any(axis=1)
    sigma = np.ones((K, B))
    sigma[valid] = _weakest(arm, task, J.reshape(K, B + 1, *J.shape[1:])[:, 1:][valid])
    known &= ~_open(arm, task, q, valid, size[:, 1:], sigma, target)
    with np.errstate(invalid="ignore"):
        away = newton.wrapped_distance(arm, q[:, :, None], q[:, None])
        clusters = ((away < CLUSTER).sum(axis=2) > 2) & (size[:, 1:] < SEED)
    if clusters.any():  # roots of third or fourth order: their mean is right to rounding
        mean = means(arm, q)[clusters]
        clusters[clusters] = newton.missing(arm, task, mean, target[np.nonzero(clusters)[0]]) < size[:, 1:][clusters]
    two = valid[:, :, None] & valid[:, None]
    close = np.triu(two & (away < HAIR) & known[:, None, None], 1)
    same = 2 * SAME + np.minimum(2e-13 / np.maximum(sigma, 1e-300), 4e-4)
    known &= ~clusters.any(axis=1) & ~(close & (away < np.maximum(same[:, :, None], same[:, None]))).any(axis=(1, 2))
    one = np.zeros((K, B, B), bool)
    k, i, j = np.nonzero(close)
    if len(k):
        unit = np.where(arm.prismatic, arm.reach, 1.0)
        middle = q[k, i] + 0.5 * newton.difference(arm, q[k, j], q[k, i]) * unit
        joined = newton.missing(arm, task, middle, target[k]) <= SOLUTION
        one[k[joined], i[joined], j[joined]] = True
    merged = np.asarray(one.any(axis=(1, 2)))
    known &= ((one | one.swapaxes(1, 2)).sum(axis=2) < 2).all(axis=1)
    second = size[:, None, 1:] < size[:, 1:, None]  # the more exact of two stays
    branch = valid & ~(one & second).any(axis=2) & ~(one & ~second).any(axis=1)
    return Regular(known, branch, merged | (branch & (sigma < DOUBLE)).any(axis=1), q, changed)


def _corrected(
    arm: Arm, task: Task, q: Array, valid: Bool, r: Array, J: Array, size: Array, target: Array
) -> tuple[Array, Bool, Bool]:
    """Candidates, accepted ones and changed targets, after one step of those that are only just not accepted.

    r, J: of `near` and the candidates; size: (K, B) residuals, those of corrected candidates are written into it.
    """
    B = valid.shape[1]
    k, b = np.nonzero(~valid & (size < NEARBY))
    changed = np.zeros(len(q), bool)
    if not len(k):
        return q, valid, changed
    at = k * (B + 1) + b + 1
    step = (np.linalg.pinv(J[at]) @ r[at, :, None])[:, :, 0]
    better = q[k, b] + step * np.where(arm.prismatic, arm.reach, 1.0)
    left = newton.missing(arm, task, better, target[k])
    good = (np.abs(step).max(axis=1) < SHORT) & (left < CLOSED)
    k, b = k[good], b[good]
    q, valid = q.copy(), valid.copy()
    q[k, b], valid[k, b], size[k, b], changed[k] = better[good], True, left[good], True
    return q, valid, changed


def _open(arm: Arm, task: Task, q: Array, valid: Bool, size: Array, sigma: Array, target: Array) -> Bool:
    """Targets (K,) of which a branch may lie on a self-motion, or a candidate may yet become a branch."""
    weak, near = valid & (sigma < 1.1 * MOVING), ~valid & (size < SEED)
    k, b = np.nonzero(weak | near)
    open_ = np.zeros(len(q), bool)
    if len(k):
        at = folds(arm, task, q[k, b], target[k])
        bent = np.abs(at.bend) > BENT
        # beyond a fold, and what else is missing is so little that putting it right does not lead back
        beyond = (at.weakest < 1e-6) & (at.lost * at.bend > 0) & (np.abs(at.lost) > 10 * SOLUTION)
        beyond &= (at.rest < 1e-3) & (100 * at.rest**2 < np.abs(at.lost))
        np.logical_or.at(open_, k, ~(bent & (weak[k, b] | beyond)))
    return open_


def _weakest(arm: Arm, task: Task, J: Array) -> Array:
    """Smallest singular values of Jacobians (M, r, n) for the task, or lower bounds that are above `DOUBLE`: (M,)."""
    bound = np.zeros(len(J))
    if J.shape[1] == J.shape[2] and task.orientation != "axis":
        inverse = nudged(np.linalg.inv, J)  # its Frobenius norm is no smaller than its largest singular value
        bound = 1.0 / np.sqrt((inverse * inverse).sum(axis=(1, 2)))
    few = np.flatnonzero(bound < 1.1 * DOUBLE)
    if len(few):
        bound[few] = np.linalg.svd(J[few], compute_uv=False)[:, min(task.constraints, arm.n) - 1]
    return bound
