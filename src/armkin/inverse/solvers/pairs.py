"""Where corrections of single seeds leave a branch open: both branches of a fold at once.

The roots of a class stand in pairs, along an axis of its branches. On an arm close to the class a pair continues
another, wherever both are: real and apart, one, or complex. Seeds that lead to one root each need nothing more; the
others, close to their partners, are found as pairs, through folds: all roots of the class, or the target stays open.

Two roots are ``m + sqrt(w) u`` and ``m - sqrt(w) u``: real for ``w > 0``, complex for ``w < 0``, one at ``w = 0``. Half
the sum of their residuals and half the difference over ``sqrt(w)`` are smooth in m, u and w, and their Jacobian is
regular where that of one root alone is singular: at a fold.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.closed.candidates import Recorded
from armkin.inverse.closed.geometry import Rows
from armkin.inverse.closed.newton_steps import ABSENT
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm
from armkin.model.rotation import rotation_about
from armkin.model.units import radian_or_reach

AROUND_FACTOR = 10.0  # distance, in distances from the class, by which a target is moved to see if its branches stay
# square of half of what lies between complex roots, up to which they may be one real root
GAP_SQUARE = tol.APART_ROOTS**2
PAIR_SHIFT = 0.3  # distance [rad, reaches] of a pair from the class's, at most
STEPS = 8  # steps of Newton's method for a pair
MAX_STEP = 0.3  # length [rad, reaches], at most, of each step for a pair


def targets_around(arm: Arm, task: Task, target: Array, size: Array) -> Iterator[Array]:
    """The targets (N, m) or (N, 4, 4) moved by size (N,) [reaches, rad] both ways along each of their coordinates."""
    for step in (size, -size):
        if task.orientation == "full":
            for axis in range(3):
                shifted = target.copy()
                shifted[:, axis, 3] += step * arm.reach
                yield shifted
                rotated = target.copy()
                rotated[:, :3, :3] = rotation_about(axis, step) @ target[:, :3, :3]
                yield rotated
        else:
            for k in range(target.shape[1]):
                shifted = target.copy()
                shifted[:, k] += step * (arm.reach if k < task.position else 1.0)
                yield shifted


def settle_pairs(source: Recorded, gaps: Array, target: Array) -> tuple[Rows, Bool]:
    """The branches of an arm that is close to a class; gaps (N,): how close, at each target [reaches].

    source: the class. Targets in doubt are those of which two roots are one, or nearly; guesses (N, B, n): where these
    are. Also of which targets (N,) not all roots are accounted for: the class's own doubts stay open.
    """
    arm, task = source.arm, source.task
    seed, miss, is_open = source.rows(target)
    present = ~(miss >= ABSENT * gaps[:, None]) | arm.prismatic.any()  # the error grows with the slide's extension
    row, place = np.nonzero(present)
    q, guesses = np.full_like(seed, np.nan), np.full_like(seed, np.nan)
    root, size = newton.correct(arm, task, seed[row, place], target[row])
    q[row, place] = np.where((size <= tol.ANSWERED)[:, None], root, np.nan)
    # a root that Newton's method moved more than half the way to its neighbour may be the neighbour's
    spacing = (newton.distances(arm, seed, seed) + np.diag(np.full(seed.shape[1], np.inf))).min(axis=2)
    jumped = newton.wrapped_distance(arm, q, seed) > 0.5 * spacing
    doubtful = (np.isnan(q[:, :, 0]) & present) | jumped | _merged_branches(arm, q)
    doubt, complete = np.zeros((2, len(target)), bool)
    pending = np.flatnonzero(doubtful.any(axis=1) & ~is_open)
    partners = _branch_partners(source)
    if not len(pending) or task.constraints != arm.n or not len(partners):
        is_open[pending] = True
        return Rows(q, doubt, complete, None, guesses), is_open
    k, first, second = _pairs(arm, seed[pending], doubtful[pending], partners)
    row = pending[k]
    span = newton.difference(arm, seed[row, first], seed[row, second]) * radian_or_reach(arm)
    middle = seed[row, first] - 0.5 * span
    pair = _find_pairs(arm, task, middle, target[row])
    accepted = pair.converged & (newton.wrapped_distance(arm, pair.middle, middle) < PAIR_SHIFT)
    is_open[row[~accepted]] = True
    sense = np.where(_keep_sense(source, (row, first, second), gaps, target, pair.half_gap), 1.0, -1.0)[:, None]
    for place, side in ((first, sense), (second, -sense)):
        guess = pair.middle + side * pair.half_gap
        guesses[row, place] = np.where((pair.square < -GAP_SQUARE)[:, None], np.nan, guess)
        root, size = newton.correct(arm, task, guess, target[row])
        q[row, place] = np.where((accepted & (pair.square > 0.0) & (size <= tol.ANSWERED))[:, None], root, np.nan)
        doubt[row] |= np.isnan(q[row, place, 0]) & (pair.square > -GAP_SQUARE)
    doubt |= _merged_branches(arm, q).any(axis=1)
    return Rows(q, doubt & ~is_open, complete, None, guesses), is_open


def _pairs(arm: Arm, seed: Array, doubtful: Bool, partners: Int) -> tuple[Int, Int, Int]:
    """Pairs of branches (M, B, n) that may be two of one root, with a bad one (M, B) in each: of which target (P,), and
    which branches. All pairs of a target lie along one axis of branches, that of the pair which is closest together."""
    distances = newton.wrapped_distance(arm, seed[:, partners], seed[:, None])
    partner = partners[np.where(doubtful[:, None], distances, np.inf).min(axis=2).argmin(axis=1)]
    in_pair = doubtful | np.take_along_axis(doubtful, partner, axis=1)
    k, first = np.nonzero(in_pair & (np.arange(seed.shape[1]) < partner))
    return k, first, partner[k, first]


def _merged_branches(arm: Arm, q: Array) -> Bool:
    """Which branches (N, B, n) all but meet another one: (N, B)."""
    return np.asarray((newton.distances(arm, q, q) < tol.APART_ROOTS).sum(axis=2) > 1)


def _branch_partners(source: Recorded) -> Int:
    """The branches' partners along each axis of two: (A, B)."""
    number = np.arange(np.prod(source.axes)).reshape(source.axes)
    partners = [np.flip(number, axis).ravel() for axis, size in enumerate(source.axes) if size == 2]
    return np.array(partners, np.intp).reshape(len(partners), number.size)


def _keep_sense(source: Recorded, branches: tuple[Int, ...], gaps: Array, target: Array, half_gap: Array) -> Bool:
    """Whether half_gap (M, n) leads from branch `second` to `first` of targets row: as they do where the class's lie
    farthest apart, among the targets around; branches: row, first, second, (M,) each."""
    arm, (row, first, second) = source.arm, branches
    M = np.arange(len(row))
    half_gap = half_gap / radian_or_reach(arm)
    widest, gap = np.zeros(len(row)), half_gap.copy()
    for goal in targets_around(arm, source.task, target[row], AROUND_FACTOR * gaps[row]):
        q = source.rows(goal)[0]
        span = newton.difference(arm, q[M, first], q[M, second])
        size = np.nan_to_num(np.abs(span).max(axis=1))
        gap[size > widest] = span[size > widest]
        widest = np.maximum(widest, size)
    return np.asarray((gap * half_gap).sum(axis=1) >= 0.0)


class _RootPair(NamedTuple):
    """middle (M, n) [rad | mm]; half_gap (M, n): half of what lies between the roots, if both are real; square (M,): w,
    negative of complex ones [rad^2, reaches^2]; converged (M,)."""

    middle: Array
    half_gap: Array
    square: Array
    converged: Bool


def _pair_system(A: Array, B: Array, w: Array, curved: Array, third: Array, axis: Array) -> Array:
    """The Newton system (M, 2 n + 1, 2 n + 1) of a pair's middle, half gap and its square w (M,).

    A, B: (M, n, n) mean and difference of the Jacobians; curved, third: (M, n) derivatives by w of the mean residual
    and of the slope; axis: (M, n) along which the half gap keeps its length.
    """
    M, n = axis.shape
    system = np.zeros((M, 2 * n + 1, 2 * n + 1))
    system[:, :n, :n] = system[:, n:-1, n:-1] = A
    system[:, :n, n:-1], system[:, n:-1, :n] = w[:, None, None] * B, B
    system[:, :n, -1], system[:, n:-1, -1] = curved, third
    system[:, -1, n:-1] = axis
    return system


def _find_pairs(arm: Arm, task: Task, q: Array, target: Array) -> _RootPair:
    """The pairs of roots about postures q (M, n), whose weakest direction is the pairs', on targets.

    Of tasks with as many residuals as joints. Complex pairs are found to the second order of what lies between them.
    """
    unit, (M, n) = radian_or_reach(arm), q.shape
    middle, square = q.copy(), np.zeros(M)
    _, J = newton.scaled_residual_and_jacobian(arm, task, middle, target)
    axis = np.linalg.svd(np.where(np.isfinite(J), J, 0.0))[2][:, -1]
    half_gap, size = axis.copy(), np.full(M, np.inf)
    active = np.arange(M)
    for _ in range(STEPS):
        goal, m = target[active], middle[active]
        u, w = half_gap[active], square[active]
        h = np.sqrt(np.maximum(np.abs(w), tol.PAIR_WAY**2))[:, None]
        plus, minus, at_m = (
            newton.scaled_residual_and_jacobian(arm, task, m + side * h * u * unit, goal) for side in (1.0, -1.0, 0.0)
        )
        curvature = (plus[0] + minus[0] - 2.0 * at_m[0]) / h**2
        mean, slope = at_m[0] + 0.5 * w[:, None] * curvature, (plus[0] - minus[0]) / (2.0 * h)
        A, B = 0.5 * (plus[1] + minus[1]), (plus[1] - minus[1]) / (2.0 * h[:, :, None])
        curved = (B @ u[:, :, None])[:, :, 0]
        third = ((A @ u[:, :, None])[:, :, 0] + slope) / (2.0 * h**2)
        system = _pair_system(A, B, w, 0.5 * curved, third, axis[active])
        residual = np.concatenate([mean, slope, np.zeros((len(active), 1))], axis=1)
        with np.errstate(all="ignore"):
            step = newton.nudged(np.linalg.solve, np.nan_to_num(system), np.nan_to_num(residual)[:, :, None])[:, :, 0]
        step *= np.minimum(1.0, MAX_STEP / np.maximum(np.abs(step).max(axis=1), MAX_STEP))[:, None]
        middle[active] += step[:, :n] * unit
        half_gap[active] += step[:, n:-1]
        square[active] += step[:, -1]
        size[active] = np.abs(step).max(axis=1)
        active = active[~(size[active] < tol.PAIR_STEP)]
        if not len(active):
            break
    half_gap *= np.sqrt(np.abs(square))[:, None] * unit
    return _RootPair(middle, half_gap, square, size < tol.PAIR_STEP)
