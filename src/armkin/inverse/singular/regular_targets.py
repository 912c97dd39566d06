"""Targets in doubt that are regular after all, and those of which two roots merge.

Of the targets that a closed form doubts, most are neither singular nor out of reach: two of their branches lie some
1e-4 rad apart. This tells them from the others all at once, from the Jacobian at every candidate and the posture
between every two neighbours; what it cannot tell is left to `singular.components`, whose criteria these are.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool
from armkin.inverse.answers.batch import Goals
from armkin.inverse.numeric import newton
from armkin.inverse.numeric.linalg import nudged
from armkin.inverse.numeric.tolerances import (
    BENT,
    CLEAR,
    CLOSE_BY,
    CLOSED,
    CLUSTER,
    FOLD_WAY,
    FOLDED,
    MERGED_ROOTS,
    MERGED_ROUNDING,
    NEARBY,
    NEARBY_STEP,
    SAME,
    SEED,
    SHORT_STEP,
    SOLUTION,
    TINY,
    WEAK,
)
from armkin.inverse.singular import self_motions
from armkin.inverse.singular.local_structure import local_structure, members
from armkin.inverse.tasks.task import Task
from armkin.model.units import radian_or_reach

if TYPE_CHECKING:
    from armkin.model.arm import Arm


ANGLES = np.linspace(0.0, np.pi, 128, endpoint=False)  # [rad] of directions in a plane


class Regular(NamedTuple):
    """What is known of K targets: known (K,) whether anything is, branch (K, B) candidates that are its branches.

    double: (K,) a branch stands for two roots, or arithmetic cannot tell it from another. free: (K, n) joints that
    move along a self-motion. q: (K, B, n) the candidates, those of changed targets (K,) corrected. firm: (K, B) no
    branch beside it can be one with it.
    """

    known: Bool
    branch: Bool
    double: Bool
    free: Bool
    q: Array
    changed: Bool
    firm: Bool
    beyond: Bool


class Folds(NamedTuple):
    """Postures at which two roots meet: M of them.

    To second order the tool moves along u, the direction that the Jacobian cannot reach, by half of `bend` times the
    square of the way: if that is not zero, there is no curve of solutions, and the posture is a turning point.

    weakest, second: (M,) smallest singular values. bend: (M,) curvature, nan where no single direction is lost. lost:
    (M,) the residual along u, of which no motion takes anything away if it has the sign of bend. rest: (M,) the joint
    motion that takes away what is left. miss: (M,) the whole residual's size. u: (M, n), V: (M, n, n) right singular
    vectors, v the last one. bow: (M, n) the second derivative of the curve that leaves along v, on which nothing is
    missing but along u.
    """

    weakest: Array
    second: Array
    bend: Array
    lost: Array
    rest: Array
    miss: Array
    u: Array
    V: Array
    bow: Array


class Linear(NamedTuple):
    """Residuals r (M, k) of M postures and their Jacobian, J = U diag(S) V, as `newton.scaled` has them."""

    r: Array
    U: Array
    S: Array
    V: Array


def square(arm: Arm, task: Task) -> bool:
    """Whether folds can be told: as many rows as joints, all of them constraints."""
    return task.constraints == arm.n > 1 and task.orientation != "axis"


def folds(arm: Arm, task: Task, q: Array, target: Array, linear: Linear | None = None) -> Folds:
    """Postures q (M, n), their targets (M, m) or (M, 4, 4); linear: if known. Everything is nan if not `square`."""
    if not square(arm, task):
        none = np.full(len(q), np.nan)
        return Folds(*[none] * 9)
    if linear is None:
        r, J = newton.scaled(arm, task, q, target)
        linear = Linear(r, *np.linalg.svd(J))
    r, U, S, V = linear
    u, way = U[:, :, -1], FOLD_WAY * V[:, -1] * radian_or_reach(arm)
    both = np.concatenate([q + way, q - way])
    ahead, behind = np.split(newton.residuals(arm, task, both, np.concatenate([target, target])), 2)
    turn = (ahead + behind - 2.0 * r) / FOLD_WAY**2
    bend = (u * turn).sum(axis=1)
    lost, clear = (u * r).sum(axis=1), np.maximum(S[:, :-1], TINY)
    rest = np.linalg.norm(r - lost[:, None] * u, axis=1) / clear[:, -1]
    bow = ((turn[:, None] @ U[:, :, :-1] / clear[:, None]) @ V[:, :-1])[:, 0]
    return Folds(
        S[:, -1], S[:, -2], np.where(S[:, -2] > CLEAR, bend, np.nan), lost, rest, np.linalg.norm(r, axis=1), u, V, bow
    )


def _twice_folded(arm: Arm, task: Task, q: Array, target: Array, linear: Linear, rows: NDArray[np.intp]) -> Array:
    """How far the components of postures q (M, n) reach that lose two directions: (M,), nan where that is not known.

    To second order the residual along the two directions u that the Jacobian cannot reach is a quadratic form of the
    way in the plane that it loses. If that is zero in no direction of the plane the root is isolated, and a multiple
    one. linear: of more postures, of which these are rows (M,).
    """
    out = np.full(len(q), np.nan)
    some = np.flatnonzero((linear.S[rows, -3] > CLEAR) & square(arm, task)) if arm.n > 2 else rows[:0]
    if not len(some):
        return out
    r, U, V = linear.r[rows[some]], linear.U[rows[some]], linear.V[rows[some]]
    first, second, unit = V[:, -1], V[:, -2], radian_or_reach(arm)
    bends = []
    for way in (first, second, (first + second) / 2**0.5):
        both = np.concatenate([q[some] + FOLD_WAY * way * unit, q[some] - FOLD_WAY * way * unit])
        ahead, behind = np.split(newton.residuals(arm, task, both, np.concatenate([target[some]] * 2)), 2)
        bends.append(np.einsum("mik,mi->mk", U[:, :, -2:], (ahead + behind - 2.0 * r) / FOLD_WAY**2))
    c, s = np.cos(ANGLES)[:, None, None], np.sin(ANGLES)[:, None, None]
    mixed = bends[2] - 0.5 * (bends[0] + bends[1])
    size = np.linalg.norm(c * c * bends[0] + s * s * bends[1] + 2.0 * c * s * mixed, axis=2)  # (angles, M)
    least = size.min(axis=0)
    sure = (least > 10 * BENT) & (least > 2 * (ANGLES[1] - ANGLES[0]) * size.max(axis=0))
    out[some[sure]] = 2.0 * np.sqrt(2.0 * SOLUTION / least[sure])
    return out


class _Slopes(NamedTuple):
    """Residuals of candidates, r (K, B, k) and their size (K, B), and the Jacobian J (K, B, k, n)."""

    r: Array
    size: Array
    J: Array


class _Weak(NamedTuple):
    """What the weak ones of K targets' candidates are.

    open: (K,) one may lie on a self-motion that others share, or may yet become a branch. moving, edge: (K, B) it lies
    on a self-motion manifold, or is a boundary. joints: (K, B, n) those that the manifold moves.
    same: (K, B, B) candidates on one's component. beyond: (K,) one lies beyond a fold.
    """

    open: Bool
    moving: Bool
    edge: Bool
    joints: Bool
    same: Bool
    beyond: Bool


def settle(goals: Goals, q: Array, valid: Bool) -> Regular:
    """Candidates (K, B, n) of K targets, nan where there is none, of which valid ones (K, B) were accepted.

    That `near` solves its target itself is for others to decide.
    """
    arm, task, target, _ = goals
    K, B, _ = q.shape
    there = ~np.isnan(q[..., 0])
    r, J = newton.scaled(arm, task, q[there], np.repeat(target, there.sum(axis=1), axis=0))
    at = _Slopes(np.zeros((K, B, *r.shape[1:])), np.full((K, B), np.inf), np.zeros((K, B, *J.shape[1:])))
    at.r[there], at.size[there], at.J[there] = r, np.sqrt((r * r).sum(axis=1)), J
    q, valid, changed = _corrected(arm, task, q, valid, at, target)
    # accepted candidates need no correction, and others are beyond it
    known = ~(valid & ~(at.size < CLOSED)).any(axis=1)
    sigma, weak = _weak(arm, task, q, valid, at, target)
    known &= ~weak.open
    with np.errstate(invalid="ignore"):
        away = newton.wrapped_distance(arm, q[:, :, None], q[:, None])
    near_by = away < CLUSTER
    clusters = (near_by.sum(axis=2) > 2) & (at.size < SEED)
    close = np.triu(valid[:, :, None] & valid[:, None] & (away < CLOSE_BY) & known[:, None, None], 1)
    # roots of third or fourth order: their mean is right to rounding
    k, i = np.nonzero(clusters)
    if len(k):
        ways = np.where(near_by[k, i][:, :, None], newton.difference(arm, q[k], q[k, i][:, None]), 0.0)
        mean = ways.sum(axis=1) / near_by[k, i].sum(axis=1, keepdims=True)
        clusters[k, i] = newton.missing(arm, task, q[k, i] + mean * radian_or_reach(arm), target[k]) < at.size[k, i]
    one = np.triu((weak.same | weak.same.swapaxes(1, 2)) & valid[:, :, None] & valid[:, None], 1)
    same = 2 * SAME + np.minimum(MERGED_ROUNDING / np.maximum(sigma, TINY), MERGED_ROOTS)
    either = one | one.swapaxes(1, 2)
    clusters &= (near_by & ~either & ~np.eye(B, dtype=bool)).any(axis=2)
    known &= ~clusters.any(axis=1)
    known &= ~(close & ~one & (away < np.maximum(same[:, :, None], same[:, None]))).any(axis=(1, 2))
    one &= known[:, None, None]
    either &= known[:, None, None]
    # what is one with two makes them one
    known &= ~((either @ either) & ~either & ~np.eye(B, dtype=bool)).any(axis=(1, 2))
    known &= ~(either & weak.moving[:, :, None]).any(axis=(1, 2))
    for row in np.flatnonzero(known & weak.moving.any(axis=1)):
        known[row] = self_motions.distinct(arm, task, q[row], weak.joints[row], target[row])
    branch = valid & ~one.any(axis=1)  # the first of two stays
    double, free = either.any(axis=(1, 2)) | (branch & weak.edge).any(axis=1), weak.joints.any(axis=1)
    return Regular(known, branch, np.asarray(double), np.asarray(free), q, changed, sigma >= FOLDED, weak.beyond)


def _corrected(arm: Arm, task: Task, q: Array, valid: Bool, at: _Slopes, target: Array) -> tuple[Array, Bool, Bool]:
    """Candidates, accepted ones and changed targets, after one step of those that are only just not accepted.

    at: of the candidates; what changes with a correction is written into it.
    """
    k, b = np.nonzero(~valid & (at.size < NEARBY))
    changed = np.zeros(len(q), bool)
    if not len(k):
        return q, valid, changed
    step = (np.linalg.pinv(at.J[k, b]) @ at.r[k, b, :, None])[:, :, 0]
    better = q[k, b] + step * radian_or_reach(arm)
    r, J = newton.scaled(arm, task, better, target[k])
    size = np.sqrt((r * r).sum(axis=1))
    good = (np.abs(step).max(axis=1) < SHORT_STEP) & (size < CLOSED)
    k, b = k[good], b[good]
    q, valid = q.copy(), valid.copy()
    q[k, b], valid[k, b], changed[k] = better[good], True, True
    at.r[k, b], at.size[k, b], at.J[k, b] = r[good], size[good], J[good]
    return q, valid, changed


def _bounds(J: Array) -> tuple[Array, Bool]:
    """Lower bounds of the smallest singular values of Jacobians (M, n, n), and of which more must be known (M,).

    The Frobenius norm of the inverse is no smaller than its largest singular value.
    """
    inverse = nudged(np.linalg.inv, J)
    bound = 1.0 / np.sqrt((inverse * inverse).sum(axis=(1, 2)))
    return bound, bound < FOLDED


def _weak(arm: Arm, task: Task, q: Array, valid: Bool, at: _Slopes, target: Array) -> tuple[Array, _Weak]:
    """Smallest singular values (K, B) of accepted candidates, or bounds above `FOLDED`; and what weak ones are."""
    K, B, n = q.shape
    sigma = np.ones((K, B))
    plain = square(arm, task)
    asked = valid.copy()
    if plain:
        bound, asked[valid] = _bounds(at.J[valid])
        sigma[valid] = bound
    k, b = np.nonzero(asked | (~valid & (at.size < SEED)))
    found = _Weak(
        np.zeros(K, bool),
        np.zeros((K, B), bool),
        np.zeros((K, B), bool),
        np.zeros((K, B, n), bool),
        np.zeros((K, B, B), bool),
        np.zeros(K, bool),
    )
    if not len(k):
        return sigma, found
    U, S, V = np.linalg.svd(at.J[k, b])
    own = valid[k, b]
    sigma[k[own], b[own]] = S[own, min(task.constraints, n) - 1]
    some = np.flatnonzero(~own | (sigma[k, b] < FOLDED))
    k, b, U, S, V, own = k[some], b[some], U[some], S[some], V[some], own[some]
    if not len(k):
        return sigma, found
    fold = folds(arm, task, q[k, b], target[k], Linear(at.r[k, b], U, S, V))
    # beyond a fold, and what else is missing is so little that putting it right does not lead back
    beyond = (np.abs(fold.bend) > BENT) & (fold.weakest < WEAK)
    beyond &= (fold.lost * fold.bend > 0) & (np.abs(fold.lost) > 10 * SOLUTION)
    beyond &= (fold.rest < NEARBY_STEP) & (100 * fold.rest**2 < np.abs(fold.lost))
    found.open[k[~own & ~beyond]] = True
    found.beyond[k[~own & beyond]] = True
    own &= ~found.open[k]
    several = own & (S[:, -2] < WEAK)
    two = np.flatnonzero(several)
    if len(two):
        radius = _twice_folded(arm, task, q[k[two], b[two]], target[k[two]], Linear(at.r[k, b], U, S, V), two)
        found.open[k[two[np.isnan(radius)]]] = True
        found.edge[k[two], b[two]] = True
        with np.errstate(invalid="ignore"):
            away = newton.wrapped_distance(arm, q[k[two]], q[k[two], b[two]][:, None])
            found.same[k[two], b[two]] = away < radius[:, None]
    rest = np.flatnonzero(own & ~several)
    if len(rest):
        k, b, S = k[rest], b[rest], S[rest]
        one = local_structure(arm, task, q[k, b], target[k])
        found.moving[k, b], found.joints[k, b], found.edge[k, b] = one.manifold, one.joints, one.boundary
        found.same[k, b] = members(one, np.arange(len(k)), newton.difference(arm, q[k], q[k, b][:, None]))
        # others of its postures may be listed
        found.open[k[~one.known | (one.manifold & (S[:, -1] < 2 * SOLUTION))]] = True
    return sigma, found
