"""Targets on an edge: merging roots, singular postures, self-motions, boundaries.

The closed forms say which targets are in doubt; these few are examined here, branch by
branch, with the Jacobian: the general mechanism behind the words exact, boundary,
singular and unreachable.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool
from armkin.inverse.numeric import newton
from armkin.inverse.solutions import Status
from armkin.inverse.tasks.task import Task

if TYPE_CHECKING:
    from armkin.model.arm import Arm


SOLUTION = 1e-9  # of the reach: what counts as a solution
WEAK = 1e-6  # smallest singular value below which a branch may be part of a self-motion
DOUBLE = 3e-7  # and below which it counts as a double root: arithmetic cannot tell its two halves apart
CLUSTER = 0.02  # [rad] candidates this close may be one root of third or fourth order
STEP = 0.03  # [rad] how far along a null direction a self-motion is followed


class Examined(NamedTuple):
    """q (K, B, n) corrected, valid (K, B), status (K,), free (K, n)."""

    q: Array
    valid: Bool
    status: NDArray[np.int8]
    free: Bool


def examine(arm: Arm, task: Task, q: Array, target: Array) -> Examined:
    """Correct, merge and classify candidate branches q (K, B, n), nan where there is none."""
    K, B, n = q.shape
    flat, goals = q.reshape(-1, n).copy(), np.repeat(target, B, axis=0)
    rough = newton.missing(arm, task, np.nan_to_num(flat), goals)
    mean = _means(arm, q).reshape(-1, n)
    closer = newton.missing(arm, task, np.nan_to_num(mean), goals) < rough
    flat[closer] = mean[closer]
    some = np.flatnonzero(~np.isnan(flat).any(axis=1) & (rough < 1e-3))
    size = np.full(len(flat), np.inf)
    if len(some):
        flat[some], size[some] = newton.correct(arm, task, flat[some], goals[some], steps=10)
    # closer than the accuracy of the arithmetic to a double root: the residual is small, not zero
    valid = (size <= SOLUTION).reshape(K, B)
    q = flat.reshape(K, B, n)
    sigma = np.ones((K, B))
    nullity = np.zeros((K, B), dtype=np.int64)
    V = np.zeros((K, B, n, n))
    found = np.argwhere(valid)
    if len(found):
        k, b = found.T
        sigma[k, b], V[k, b], nullity[k, b] = newton.null_space(arm, task, q[k, b], target[k])
    separate = valid
    valid, merged = _merge(arm, q, valid, sigma, size.reshape(K, B))
    status = np.where(valid.any(axis=1), Status.EXACT, Status.UNREACHABLE).astype(np.int8)
    double = merged | (separate & (sigma < DOUBLE))
    status[double.any(axis=1)] = Status.BOUNDARY
    free = np.zeros((K, n), bool)
    weak = np.argwhere(valid & (sigma < WEAK))
    if len(weak):
        k, b = weak.T
        moving, joints = _self_motion(arm, task, q[k, b], V[k, b], np.maximum(nullity[k, b], 1), target[k])
        status[k[moving]] = Status.SINGULAR
        for row, who in zip(k[moving], joints[moving], strict=True):
            free[row] |= who
        valid = _one_of_a_curve(arm, task, q, valid, k[moving], b[moving], free, target)
    return Examined(q, valid, status, free)


def _means(arm: Arm, q: Array) -> Array:
    """Candidates (K, B, n), the mean of its cluster for each that has two others around it.

    Of a root of third or fourth order rounding leaves three or four, off by its third or fourth root; their
    mean is right to rounding.
    """
    away = newton.difference(arm, q[:, None], q[:, :, None])  # of the third axis' candidates from the second's
    with np.errstate(invalid="ignore"):
        around = np.abs(away).max(axis=3) < CLUSTER
    count = around.sum(axis=2)
    shift = np.where(around[..., None], away, 0.0).sum(axis=2) / np.maximum(count, 1)[..., None]
    unit = np.where(arm.prismatic, arm.reach, 1.0)
    return np.asarray(q + np.where((count > 2)[..., None], shift, 0.0) * unit)


def _merge(arm: Arm, q: Array, valid: Bool, sigma: Array, size: Array) -> tuple[Bool, Bool]:
    """Keep one of each cluster, and say which were merged away.

    The radius grows where the Jacobian is weak: rounding / sigma.
    """
    before, valid = valid, valid.copy()
    radius = 1e-7 + np.minimum(1e-13 / np.maximum(sigma, 1e-300), 3e-4)
    B = q.shape[1]
    for i in range(B):
        for j in range(i + 1, B):
            both = valid[:, i] & valid[:, j]
            if not both.any():
                continue
            near = newton.wrapped_distance(arm, q[:, i], q[:, j]) < np.maximum(radius[:, i], radius[:, j])
            same = both & near
            worse_i = size[:, i] > size[:, j]
            valid[same & worse_i, i] = False
            valid[same & ~worse_i, j] = False
    return valid, before & ~valid


def _self_motion(
    arm: Arm, task: Task, q: Array, V: Array, nullity: NDArray[np.int64], target: Array
) -> tuple[Bool, Bool]:
    """Whether the joints can move while the target is kept, and which do.

    Steps along each null direction, both ways, pulled back onto the target: on a self-motion
    they stay about as far from q as they went, and apart; from a double root they fall back, and
    from a branch of weak Jacobian they may arrive at its neighbour.
    """
    unit = np.where(arm.prismatic, arm.reach, 1.0)
    moving = np.zeros(len(q), bool)
    joints = np.zeros(q.shape, bool)
    for who, direction in _null_directions(arm.n, V, nullity):
        # where several directions are lost at once, a short step would be drawn back into the corner
        for step in (STEP, 10 * STEP) if (nullity[who] > 1).any() else (STEP,):
            along, which = np.ones(len(who), bool), np.zeros((len(who), arm.n), bool)
            for way in (step, -step):
                far, size = newton.correct(arm, task, q[who] + way * direction * unit, target[who], steps=6)
                mid, size2 = newton.correct(arm, task, q[who] + 0.6 * way * direction * unit, target[who], steps=6)
                moved = np.abs(far - q[who]) / unit
                least = 0.3 * step * np.abs(direction).max(axis=1)
                apart = (np.abs(far - mid) / unit).max(axis=1) > 0.3 * least
                along &= (moved.max(axis=1) > least) & apart & (np.maximum(size, size2) < 1e-11)
                which |= moved > 1e-3 * STEP
            moving[who] |= along
            joints[who] |= along[:, None] & which
    return moving, joints


def _null_directions(n: int, V: Array, nullity: NDArray[np.int64]) -> Iterator[tuple[NDArray[np.intp], Array]]:
    """Which branches to push, and where: (m,) indices and (m, n) directions.

    In a null space of several dimensions a self-motion may hide between the basis vectors:
    there every joint is pushed as far as the null space lets it.
    """
    for index in range(int(nullity.max())):
        who = np.flatnonzero(nullity > index)
        yield who, V[who, n - 1 - index]
    many = np.flatnonzero(nullity > 1)
    for joint in range(n if len(many) else 0):
        in_null = np.arange(n) >= n - nullity[many][:, None]
        push = np.einsum("mi,mij->mj", np.where(in_null, V[many, :, joint], 0.0), V[many])
        size = np.linalg.norm(push, axis=1)
        some = size > 0.1
        if some.any():
            yield many[some], push[some] / size[some, None]


def _one_of_a_curve(
    arm: Arm,
    task: Task,
    q: Array,
    valid: Bool,
    rows: NDArray[np.intp],
    columns: NDArray[np.intp],
    free: Bool,
    target: Array,
) -> Bool:
    """A self-motion is reported by one of its points: drop singular branches that differ in free joints alone."""
    valid = valid.copy()
    for k in np.unique(rows):
        mine = columns[rows == k]
        kept: list[int] = []
        held = ~free[k]
        for b in mine:
            if not valid[k, b]:
                continue
            d = newton.difference(arm, q[k, kept], q[k, b])
            if len(kept) and (np.abs(d[:, held]).max(axis=1, initial=0.0) < 1e-5).any():
                valid[k, b] = False
            else:
                kept.append(int(b))
    return valid
