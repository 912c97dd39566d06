"""Newton corrections of joint values onto a task, for any arm and task, and a search by these from many starts."""

from collections.abc import Callable
from typing import Any, NamedTuple, Self

import numpy as np

from armkin.formula.arrays import Array, Bool, Int, wrap_angle
from armkin.forward import fk, tip_and_jacobian
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.tasks.residuals import residual, task_jacobian
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm
from armkin.model.units import radian_or_reach

STARTS = 64  # random starts of a search
STEPS, PATIENCE = 25, 8  # Newton steps of a start at most; steps without gain after which it ends
ROUND = np.pi / 4  # angle [rad] whose multiples roots of high order nearly always have: parallel axes, or such angles


def scaled_residual_and_jacobian(arm: Arm, task: Task, q: Array, target: Array) -> tuple[Array, Array]:
    """Residual (M, r) and Jacobian (M, r, n) with lengths in units of the arm's reach.

    Prismatic columns too: a joint value is then worth one radian or one reach.
    """
    T, slopes = tip_and_jacobian(arm, q)
    r = residual(task, T, q, target, arm.reach)
    J = slopes if task.orientation == "full" else task_jacobian(task, slopes, T)
    J = J * radian_or_reach(arm)
    J[:, : task.position] /= arm.reach
    return r, J


def residuals(arm: Arm, task: Task, q: Array, target: Array) -> Array:
    """Residual (M, r) alone, lengths in units of the arm's reach."""
    return residual(task, fk(arm, q), q, target, arm.reach)


def misses(arm: Arm, task: Task, q: Array, target: Array) -> Array:
    """Size of the residual (M,), lengths in units of the arm's reach; infinite where it is not known."""
    r = residual(task, fk(arm, q), q, target, arm.reach)
    size: Array = np.sqrt((r * r).sum(axis=1))
    return np.where(np.isnan(size), np.inf, size)


def correct(
    arm: Arm,
    task: Task,
    q: Array,
    target: Array,
    steps: int = 6,
    least: float = tol.LEFT_OUT_VALUE,
    patience: int = 1000,
    stalled: float = np.inf,
) -> tuple[Array, Array]:
    """Gauss-Newton with steps of least norm: q (M, n) moved onto its targets.

    Returns the best q met and its `misses`. Singular values below `least` are left out of a step, so that a singular
    posture is approached without running away. patience: steps in a row that take less than a tenth away after which a
    start is given up; one at a root of sixth order takes two thirds. stalled: residual below which such steps count.
    """
    unit = radian_or_reach(arm)
    q, best_q, best_size = q.copy(), q.copy(), np.full(len(q), np.inf)
    idle = np.zeros(len(q), int)
    active = np.arange(len(q))
    for k in range(steps + 1):
        if k < steps:
            r, J = scaled_residual_and_jacobian(arm, task, q[active], target[active])
        else:
            r = residuals(arm, task, q[active], target[active])
        size = np.sqrt((r * r).sum(axis=1))
        size[np.isnan(size)] = np.inf
        last_size = best_size[active]
        is_better = size < last_size
        best_q[active[is_better]], best_size[active[is_better]] = q[active[is_better]], size[is_better]
        # a start is done when what it misses is rounding alone
        least_gain = np.isfinite(size) & (size > tol.ROUNDING) & ((size > tol.CONVERGING) | (size < 0.5 * last_size))
        idle[active] = np.where((size < 0.9 * last_size) | (size > stalled), 0, idle[active] + 1)
        is_active = least_gain & (idle[active] < patience) if k else np.isfinite(size) & (size > 0)
        active, r, size = active[is_active], r[is_active], size[is_active]
        if k == steps or not len(active):
            break
        step = _least_step(J[is_active], r, np.maximum(least, 0.1 * size))
        # no joint moves farther than 0.3 [rad, reaches]: 76 % of 2,400 random starts on six arms solve in 25 steps, 8 %
        # with 0.1 and 83 % with 1.0; of 2,000 within 0.5 of a root 94 to 95 % reach it with each
        step *= np.minimum(1.0, 0.3 / np.maximum(np.abs(step).max(axis=1), tol.TINY))[:, None]
        q[active] += step * unit
    return best_q, best_size


def many_starts(arm: Arm, task: Task, target: Array, selected: Bool) -> Array:
    """Move the same `STARTS` random postures by Newton's method onto each selected target: a search, no proof.

    target: (N, m) or (N, 4, 4); selected: (N,) targets that may lack branches. Returns (N, STARTS, n) [rad | mm]: the
    postures that miss their target by less than `SEED_RESIDUAL`, nan elsewhere. A root of high order, which Newton's
    method only approaches, is replaced by the nearest posture of multiples of `ROUND`, if that misses by less.
    """
    rng = np.random.default_rng(13)
    start = rng.uniform(-1.0, 1.0, (STARTS, arm.n)) * np.where(arm.prismatic, arm.reach, np.pi)
    row, index = np.nonzero(np.repeat(selected[:, None], STARTS, axis=1))
    postures = np.full((len(target), STARTS, arm.n), np.nan)
    q, size = correct(arm, task, start[index], target[row], steps=STEPS, patience=PATIENCE)
    multiple = np.flatnonzero((size > tol.CONVERGING) & (size < tol.SEED_RESIDUAL))
    if len(multiple):
        rounded = np.where(arm.prismatic, q[multiple], ROUND * np.rint(q[multiple] / ROUND))
        is_better = misses(arm, task, rounded, target[row[multiple]]) < size[multiple]
        q[multiple[is_better]] = rounded[is_better]
    postures[row, index] = np.where((size < tol.SEED_RESIDUAL)[:, None], q, np.nan)
    return postures


def _least_step(J: Array, r: Array, cutoff: Array) -> Array:
    """Steps (M, n) of least norm that leave out singular values below cutoff (M,).

    One below the residual's own size would throw the step out of the linear range. Where an inverse (M, n, n) tells
    that there is none, by its Frobenius norm, it gives the step at an eighth of the cost.
    """
    step, weak = np.empty((len(J), J.shape[2])), np.ones(len(J), bool)
    if J.shape[1] == J.shape[2] > 2:
        inverse = nudged(np.linalg.inv, J)
        with np.errstate(over="ignore"):
            weak = ~(cutoff * np.sqrt((inverse * inverse).sum(axis=(1, 2))) < 1.0)
        step[~weak] = (inverse[~weak] @ r[~weak, :, None])[:, :, 0]
    rows = np.flatnonzero(weak)
    if len(rows):
        U, S, Vt = np.linalg.svd(J[rows], full_matrices=False)
        gain = np.where(cutoff[rows, None] < S, 1.0 / np.maximum(S, tol.TINY), 0.0)
        step[rows] = (Vt * (gain * (U * r[rows, :, None]).sum(axis=1))[:, :, None]).sum(axis=1)
    return step


def difference(arm: Arm, a: Array, b: Array) -> Array:
    """Joint values a less b modulo whole turns, prismatic ones in units of the reach: (..., n)."""
    d = a - b
    return np.where(arm.prismatic, d / arm.reach, wrap_angle(d))


def wrapped_distance(arm: Arm, a: Array, b: Array) -> Array:
    """The largest `difference`: (..., n) -> (...)."""
    return np.asarray(np.abs(difference(arm, a, b)).max(axis=-1))


def distances(arm: Arm, a: Array, b: Array) -> Array:
    """`wrapped_distance` of each of a (N, A, n) to each of b (N, B, n): (N, A, B)."""
    largest = np.zeros((len(a), a.shape[1], b.shape[1]))
    for i, slides in enumerate(arm.prismatic):  # one joint at a time: all at once leave the processor's cache
        d = np.ascontiguousarray(a[:, :, None, i]) - np.ascontiguousarray(b[:, None, :, i])
        np.maximum(largest, np.abs(d / arm.reach if slides else wrap_angle(d)), out=largest)
    return largest


def null_space(arm: Arm, task: Task, q: Array, target: Array) -> tuple[Array, Array, Int]:
    """Smallest singular value (M,) of the task's Jacobian, right vectors (M, n, n), and nullity (M,) below 1e-6."""
    linear = Linear.linearise(arm, task, q, target)
    sigma, nullity = _smallest(arm, task, linear.S)
    return sigma, linear.V, nullity


def _smallest(arm: Arm, task: Task, S: Array) -> tuple[Array, Int]:
    """The singular value that decides (M,), of S (M, k), and how many directions are lost (M,)."""
    full = np.zeros((len(S), arm.n))
    full[:, : S.shape[1]] = S
    # a task with an axis has one more row than constraints
    count = min(task.constraints, arm.n)
    nullity = arm.n - (full > tol.WEAK).sum(axis=1)
    return full[:, count - 1], nullity - (arm.n - count)


class Linear(NamedTuple):
    """Residuals (M, rows) at postures, and their Jacobians' U (M, rows, rows), singular values S, and V' (M, n, n)."""

    r: Array
    U: Array
    S: Array
    V: Array

    @classmethod
    def linearise(cls, arm: Arm, task: Task, q: Array, target: Array) -> Self:
        """The residuals and Jacobians of postures (M, n) and their targets."""
        r, J = scaled_residual_and_jacobian(arm, task, q, target)
        return cls(r, *np.linalg.svd(J))


class LostDirections(NamedTuple):
    """Joint motions that Jacobians of candidates (K, M) lose; weak are those with sigma perhaps below `FOLD_VALUE`."""

    sigma: Array  # (K, M) smallest singular value; of one that is not weak a lower bound, 1 if not selected
    nullity: Int  # (K, M) number of directions lost, 0 if not weak
    V: Array  # (K, M, n, n) right singular vectors, 0 where not weak
    weak: Linear  # residuals and singular value decompositions of the weak candidates alone
    place: Int  # (K, M) row of `weak`, -1 for the others


def lost_directions(arm: Arm, task: Task, q: Array, selected: Bool, target: Array) -> LostDirections:
    """Find the directions that candidates q (K, M, n) lose where they are selected (K, M) and solve their targets."""
    K, M, n = q.shape
    sigma, nullity, V = np.ones((K, M)), np.zeros((K, M), np.int64), np.zeros((K, M, n, n))
    place, none = np.full((K, M), -1), np.zeros((0, 0))
    k, b = np.nonzero(selected)
    if not len(k):
        return LostDirections(sigma, nullity, V, Linear(none, none, none, none), place)
    r, J = scaled_residual_and_jacobian(arm, task, q[k, b], target[k])
    if J.shape[1] == n == task.constraints:
        # the Frobenius norm of the inverse is no smaller than its largest singular value
        inverse = nudged(np.linalg.inv, J)
        sigma[k, b] = bound = 1.0 / np.sqrt((inverse * inverse).sum(axis=(1, 2)))
        rows = bound < tol.FOLD_VALUE
        k, b = k[rows], b[rows]
        r, J = r[rows], J[rows]
    weak = Linear(r, *np.linalg.svd(J))
    V[k, b], place[k, b] = weak.V, np.arange(len(k))
    sigma[k, b], nullity[k, b] = _smallest(arm, task, weak.S)
    return LostDirections(sigma, nullity, V, weak, place)


def nudged(function: Callable[..., Any], matrix: Array, *arguments: Array) -> Array:
    """``function(matrix, *arguments)``, with noise of rounding size added to members that are singular.

    Numpy raises for a whole stack of matrices if one of them has a zero pivot. The others are left as they are.

    Args:
        function: `np.linalg.inv`, `np.linalg.solve` and the like.
        matrix: (M, k, k).
    """
    try:
        return np.asarray(function(matrix, *arguments))
    except np.linalg.LinAlgError:
        noise, nudge = np.random.default_rng(0), matrix.copy()
        size = tol.NOISE * (1 + np.abs(matrix).max(axis=(1, 2), keepdims=True))
        for _ in range(8):  # the noise may itself cancel what is left of a pivot
            singular = np.linalg.slogdet(nudge).sign == 0
            nudge[singular] = (matrix + size * noise.standard_normal(matrix.shape[1:]))[singular]
            try:
                return np.asarray(function(nudge, *arguments))
            except np.linalg.LinAlgError:
                size *= 3
        raise
