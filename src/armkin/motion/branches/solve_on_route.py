"""Joint values that solve a route exactly, and their slopes along it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armkin.formula.arrays import Array, Int
from armkin.forward import tip_and_jacobian
from armkin.inverse.tasks.residuals import residual, task_jacobian
from armkin.model.units import radian_or_reach
from armkin.motion.timing.cubic_knots import Knots

if TYPE_CHECKING:
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm
    from armkin.motion.tool_path.route import Route

DAMPING = (2e-4, 0.02, 0.5)  # dampings [mm/rad]: the first one, and larger ones for motions near a singularity
_BLOCK_POINTS = 8192  # points solved in one call
_SETTLED_LENGTH = 1e-8  # relative length of a Newton step that ends the iteration
_SHORT_STEP, _STEP_RATIO = 1e-5, 1e-3  # a step this short and this much shorter than the last one ends it, too
_SLOPE_DISTANCE = 1e-6  # distance [mm] along the route of the difference quotient for a slope
_SLOPE_DAMPING = 0.02  # damping [mm/rad] of slopes, which keeps rounding errors small
_DAMPED_SHARE = 1e-5  # a slope that damping changes by a larger share is near a singularity


def correct_to_route(
    arm: Arm, task: Task, q: Array, target: Array, damping: float = DAMPING[0], steps: int = 6
) -> Array:
    """Correct approximate joint values q by damped Newton steps; free joints keep their values: (N, n).

    damping: [mm/rad] a miss of e moves a joint by at most e / (2 damping), so that joints near a singularity do not
    swing round to correct a miss within the tolerance.
    """
    blocks = [slice(i, i + _BLOCK_POINTS) for i in range(0, len(q), _BLOCK_POINTS)]
    return np.concatenate([_newton(arm, task, q[part], target[part], damping, steps) for part in blocks])


def _newton(arm: Arm, task: Task, q: Array, target: Array, damping: float, steps: int) -> Array:
    """Joint values (N, n) after damped Newton steps from q to targets, each row until its step is negligible."""
    unit = radian_or_reach(arm)
    joints, active, last_size = q.copy(), np.arange(len(q)), np.full(len(q), np.inf)
    for _ in range(steps):
        q = joints[active]
        T, J = _pose_and_jacobian(arm, task, q)
        residuals = _residuals(arm, task, T, q, target[active])
        step = _damped_steps(J, residuals, (damping / arm.reach) ** 2)
        size = np.abs(step).max(axis=0)
        step *= np.where(size > 0.05, 0.05 / np.maximum(size, 1e-300), 1.0)
        joints[active] = q + step.T * unit
        # after a step much shorter than the last one the next step would be negligible
        continues = (size >= _SETTLED_LENGTH) & ((size > _SHORT_STEP) | (size > _STEP_RATIO * last_size))
        active, last_size = active[continues], size[continues]
        if not len(active):
            break
    return joints


def _row_scale(arm: Arm, task: Task) -> Array:
    """The weight of each of the task's rows, lengths in shares of the reach: (k,)."""
    scale = np.ones(task.position + len(task.sums) + (3 if task.orientation != "none" else 0))
    scale[: task.position] = 1 / arm.reach
    return scale


def _pose_and_jacobian(arm: Arm, task: Task, q: Array) -> tuple[Array, Array]:
    """The tool's poses (M, 4, 4), and the task's Jacobians without units, column by column: (n, k, M)."""
    sum_count, position_size, scale = len(task.sums), task.position, _row_scale(arm, task)
    factor = radian_or_reach(arm)[:, None, None] * scale[:, None]  # (n, k, 1)
    factor[:, position_size : position_size + sum_count] *= arm.ratio[:, None, None]
    T, J = tip_and_jacobian(arm, q)
    return T, np.multiply(task_jacobian(task, J, T).transpose(2, 1, 0), factor, order="C")


def _residuals(arm: Arm, task: Task, T: Array, q: Array, target: Array) -> Array:
    """The differences to the targets, without units: (k, M)."""
    return np.multiply(residual(task, T, q * arm.ratio, target).T, _row_scale(arm, task)[:, None], order="C")


def _damped_steps(J: Array, residuals: Array, damping: float) -> Array:
    """Solutions x (n, M) of (J'J + damping 1) x = J'r: J (n, k, M) by columns, residuals r (k, M), by Cholesky.

    Over all members at once it takes a fraction of the time of `np.linalg.solve` on small matrices.
    """
    n = len(J)
    x = (J * residuals).sum(axis=1)
    L: list[list[Array]] = []
    for i in range(n):
        L.append([])
        for j in range(i + 1):
            entry = (J[i] * J[j]).sum(axis=0)
            for a, b in zip(L[i], L[j], strict=False):
                entry -= a * b
            L[i].append(np.sqrt(np.maximum(entry + damping, 1e-300)) if i == j else entry / L[j][j])
        for j in range(i):
            x[i] -= L[i][j] * x[j]
        x[i] /= L[i][i]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            x[i] -= L[j][i] * x[j]
        x[i] /= L[i][i]
    return np.asarray(x)


def exact_cubics(
    arm: Arm, route: Route, points: Array, q: Array, rests: Int, coarser_path: Knots | None
) -> Knots | None:
    """Cubics through joint values q (N, n) that solve the route at lengths `points` (N,), with its own slopes.

    rests: the points at which the path rests, which become two knots each. coarser_path: cubics on a subset of the
    points. None: near a singularity the damped joints do not follow every target exactly.
    """
    point_numbers = np.sort(np.concatenate([np.arange(len(points)), rests]))
    s, values = points[point_numbers], np.asfortranarray(q[point_numbers])
    d, is_pending = np.empty_like(values), np.ones(len(s), bool)
    if coarser_path is not None:
        positions = np.searchsorted(s, coarser_path.s)
        positions += np.diff(coarser_path.s, prepend=-1.0) == 0
        d[positions], is_pending[positions] = coarser_path.d, False
    ends = np.append(point_numbers[1:] == point_numbers[:-1], True)  # the end takes the slope of its left side
    rows = np.flatnonzero(is_pending)
    for part in (rows[i : i + _BLOCK_POINTS] for i in range(0, len(rows), _BLOCK_POINTS)):
        slopes = _slopes(arm, route, s[part], values[part], np.where(ends[part], -_SLOPE_DISTANCE, _SLOPE_DISTANCE))
        if slopes is None:
            return None
        d[part] = slopes
    return Knots(s, values, d)


def _slopes(arm: Arm, route: Route, s: Array, q: Array, detour_slope: Array) -> Array | None:
    """dq/ds (M, n) of J dq = dx, by what misses to the targets a little aside; None: J is singular, or nearly."""
    if arm.n > len(_row_scale(arm, route.task)):
        return None
    T, J = _pose_and_jacobian(arm, route.task, q)
    s_beside = s + detour_slope
    misses, misses_aside = (_residuals(arm, route.task, T, q, route.targets(x)) for x in (s, s_beside))
    rate = (misses_aside - misses) / (s_beside - s)
    d = _damped_steps(J, rate, (_SLOPE_DAMPING / arm.reach) ** 2)
    unexplained_rate = np.abs((J * d[:, None]).sum(axis=0) - rate).max(axis=0)
    if not (unexplained_rate <= _DAMPED_SHARE * np.abs(rate).max(axis=0)).all():
        return None
    return np.asarray(d.T * radian_or_reach(arm))
