"""The nearest pose within limits, for targets without a legal branch."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from armkin.errors import UsageError
from armkin.formula.arrays import Array, Bool, slices
from armkin.forward import fk, one_pose
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.tasks.choose_task import task_for
from armkin.inverse.tasks.residuals import residual
from armkin.inverse.tasks.task import Task, read_targets, targets_of
from armkin.model.arm import Arm
from armkin.model.units import radian_or_reach

POOL = 4000  # random postures within limits; each target starts from the nearest of them
STARTS = 14  # starts taken from the pool for each target
STEPS = 10  # most iterations of `closest_from_every_start`
Rounds = tuple[tuple[int, int], ...]  # iterations of a round, and starts kept after it
ROUNDS: Rounds = (3, 6), (7, 3)  # rounds for each target
AT_ONCE = 256  # targets in one call


@dataclass(frozen=True, eq=False)
class Closest:
    """The nearest pose within limits.

    Attributes:
        q: (n,) [rad | mm] its joint values.
        position: (3,) [mm] of the tool there.
        distance: [mm] to the target's position.
        angle: [rad] to what else the target prescribes; 0 where it prescribes nothing else.
        converged: it is a local minimum: along joints that no limit stops the gradient vanishes and none curves down.
    """

    q: Array
    position: Array
    distance: float
    angle: float
    converged: bool


def closest(arm: Arm, target: ArrayLike, task: str | None = None, *, near: ArrayLike | None = None) -> Closest:
    """The pose within limits that misses the target least.

    What is minimised is the squared distance plus the squared angle times the square of a quarter of the reach, so that
    a radian weighs as much as a quarter of the reach. Projected Levenberg-Marquardt from some starts (`near`, home and
    the nearest of many postures within limits); the best minimum is returned, of equal ones the nearest to `near`.

    Args:
        arm: the arm, as `armkin.load` gives it.
        target: (m,) [mm, rad] by the task, or (4, 4) [mm] for task "pose": one target.
        task: what the target prescribes; by default the arm's own task.
        near: (n,) [rad | mm] joint values to stay close to; by default home.

    Returns:
        The pose, what it misses [mm, rad], and whether it is a proved local minimum.

    Raises:
        UsageError: the task does not fit the arm, the target is malformed or several, or near is no finite (n,).

    >>> import armkin
    >>> found = closest(armkin.load("robots/planar_2dof.yaml"), [600, 0])
    >>> float(found.position[0].round(6)), round(found.distance, 6)
    (500.0, 100.0)
    """
    definition = task_for(arm, task)
    goal, lead, _ = read_targets(definition, target)
    if lead:
        raise UsageError("closest takes one target at a time; closest_each takes many")
    reference = one_pose(arm, arm.home if near is None else near, "near")
    return _of_chunk(arm, definition, goal, reference[None])[0]


def closest_each(
    arm: Arm, targets: ArrayLike, task: str | None = None, *, near: ArrayLike | None = None
) -> list[Closest]:
    """`closest` for each of many targets (N, m) or (N, 4, 4); near: (n,) or (N, n)."""
    definition = task_for(arm, task)
    goal, *_ = read_targets(definition, targets)
    reference = np.broadcast_to(arm.home if near is None else np.asarray(near, float), (len(goal), arm.n))
    parts = slices(len(goal), AT_ONCE)
    return [nearest for part in parts for nearest in _of_chunk(arm, definition, goal[part], reference[part])]


def closest_from_every_start(arm: Arm, task: Task, target: Array, near: Array) -> Closest:
    """The nearest pose of one target, (1, m) or (1, 4, 4), from every start; near: (1, n)."""
    return _of_chunk(arm, task, target, near, ((STEPS, STARTS // 3),))[0]


def _of_chunk(arm: Arm, task: Task, target: Array, near: Array, rounds: Rounds = ROUNDS) -> list[Closest]:
    """The nearest poses of targets (N, m) or (N, 4, 4); near: (N, n)."""
    N, n = near.shape
    pool, features = _pool(arm, task)
    goal = _target_features(arm, task, target)
    distances = (features * features).sum(axis=1) - 2.0 * (goal @ features.T)  # the goal's square keeps the order
    nearest = np.argpartition(distances, STARTS, axis=1)[:, :STARTS]
    nearest.sort(axis=1)
    home = np.broadcast_to(np.clip(arm.home, arm.lower, arm.upper), (N, 1, n))
    starts = np.concatenate([np.clip(near, arm.lower, arm.upper)[:, None], home, pool[nearest]], axis=1)
    for steps, kept in rounds:
        count = starts.shape[1]
        goals = np.repeat(target, count, axis=0)
        q = _descend_by_damped_steps(arm, task, starts.reshape(-1, n).copy(), goals, steps)
        order = np.argsort(_cost(arm, task, q, goals).reshape(N, count), axis=1, kind="stable")[:, :kept]
        starts = np.take_along_axis(q.reshape(N, count, n), order[:, :, None], axis=1)
    goals = np.repeat(target, kept, axis=0)
    q, converged = _finish_by_newton(arm, task, starts.reshape(-1, n), goals)
    cost = _cost(arm, task, q, goals).reshape(N, kept)
    motion = np.abs((q.reshape(N, kept, n) - near[:, None]) / radian_or_reach(arm)).sum(axis=2)
    equal = cost <= cost.min(axis=1, keepdims=True) * (1 + tol.EQUAL_COST) + tol.NO_COST
    best = np.arange(N) * kept + np.where(equal, motion, np.inf).argmin(axis=1)
    T = fk(arm, q[best])
    residuals, p = residual(task, T, q[best], target), task.position
    return [
        Closest(
            q=q[row],
            position=T[i, :3, 3],
            distance=float(np.linalg.norm(residuals[i, :p])),
            angle=float(np.linalg.norm(residuals[i, p:])),
            converged=bool(converged[row]),
        )
        for i, row in enumerate(best)
    ]


def random_postures(arm: Arm, rng: np.random.Generator, count: int) -> Array:
    """Random postures (count, n) within limits; where a joint has none within half a turn, or a reach, of home."""
    span = np.where(arm.prismatic, arm.reach, np.pi)
    low = np.where(np.isfinite(arm.lower), arm.lower, np.minimum(-span, arm.home - span))
    high = np.where(np.isfinite(arm.upper), arm.upper, np.maximum(span, arm.home + span))
    return rng.uniform(low, high, (count, arm.n))


@lru_cache(maxsize=16)
def _pool(arm: Arm, task: Task) -> tuple[Array, Array]:
    """Random postures within limits (P, n), and their features for the comparison with targets."""
    q = random_postures(arm, np.random.default_rng(11), POOL)
    return q, _target_features(arm, task, targets_of(task, fk(arm, q), q))


def _target_features(arm: Arm, task: Task, target: Array) -> Array:
    """Features (N, f) of targets, whose squared distance approximates the minimised cost."""
    full = task.orientation == "full"
    point = target[:, :3, 3] if full else target[:, : task.position]
    sums = target[:, task.position : task.position + len(task.sums)] if not full else np.zeros((len(target), 0))
    parts = [point / arm.reach, 0.25 * np.cos(sums), 0.25 * np.sin(sums)]
    if full:
        parts.append((0.25 / 2**0.5) * target[:, :3, :3].reshape(-1, 9))
    elif task.orientation == "axis":
        parts.append(0.25 * target[:, 3:])
    return np.concatenate(parts, axis=1)


def _weighted_residual(arm: Arm, task: Task, q: Array, target: Array) -> tuple[Array, Array]:
    """Residual and Jacobian with lengths in units of the reach and angles weighing a quarter of it."""
    r, J = newton.scaled_residual_and_jacobian(arm, task, q, target)
    r[:, task.position :] *= 0.25
    J[:, task.position :] *= 0.25
    return r, J


def _downhill_direction(arm: Arm, task: Task, q: Array, target: Array) -> Array:
    """Half the negative gradient of the squared residual (M, n), joints in rad or reaches."""
    r, J = _weighted_residual(arm, task, q, target)
    return np.asarray((r[:, None] @ J)[:, 0])


def _stopped_joints(arm: Arm, q: Array, downhill: Array) -> Bool:
    """Whether a joint stands at a limit and would move beyond it."""
    return ((q <= arm.lower) & (downhill < 0)) | ((q >= arm.upper) & (downhill > 0))


def _finish_by_newton(arm: Arm, task: Task, q: Array, target: Array) -> tuple[Array, Bool]:
    """Newton's method with the full Hessian (differences of the gradient), and whether a minimum was reached.

    Levenberg-Marquardt alone converges slowly far beyond the reach, where the residual is large.
    """
    n, unit = arm.n, radian_or_reach(arm)
    shifts = np.concatenate([np.eye(n), -np.eye(n)]) * tol.GRADIENT_WAY * unit
    q, converged, cost = q.copy(), np.zeros(len(q), bool), _cost(arm, task, q, target)
    active = np.arange(len(q))
    for _ in range(40):
        points, goal = q[active], target[active]
        downhill = _downhill_direction(arm, task, points, goal)
        free = ~_stopped_joints(arm, points, downhill)
        nearby = (points[:, None, :] + shifts).reshape(-1, n)
        slopes = _downhill_direction(arm, task, nearby, np.repeat(goal, 2 * n, axis=0)).reshape(len(points), 2, n, n)
        H = -(slopes[:, 0] - slopes[:, 1]) / (2 * tol.GRADIENT_WAY)
        H = 0.5 * (H + np.swapaxes(H, 1, 2))
        values, vectors = np.linalg.eigh(np.where(free[:, :, None] & free[:, None, :], H, np.eye(n)))
        slope = np.abs(np.where(free, downhill, 0.0)).max(axis=1)
        is_flat = slope <= tol.FLAT_GRADIENT * (np.sqrt(cost[active]) + cost[active]) + tol.ERROR
        is_minimum = is_flat & (values[:, 0] > -tol.UPHILL_CURVATURE)
        converged[active] = is_minimum
        active, rows_left = active[~is_minimum], np.flatnonzero(~is_minimum)
        if not len(active):
            break
        # a step downhill along each eigenvector, whatever its curvature; a short one where it is flat
        values, vectors = values[rows_left], vectors[rows_left]
        components = np.einsum("mij,mi->mj", vectors, np.where(free, downhill, 0.0)[rows_left])
        step = np.einsum("mij,mj->mi", vectors, components / np.maximum(np.abs(values), tol.LEVEL_VALUE))
        step *= np.minimum(1.0, 0.3 / np.maximum(np.abs(step).max(axis=1), tol.TINY))[:, None]
        pending = np.arange(len(active))
        for shrink in (1.0, 0.25, 0.05, tol.SHORTENED_SHARE):
            rows = active[pending]
            trial = np.clip(q[rows] + shrink * step[pending] * unit, arm.lower, arm.upper)
            new_cost = _cost(arm, task, trial, target[rows])
            # accept a cost equal to rounding, since the gradient may still decrease
            accepted = new_cost <= cost[rows] + tol.EQUAL_BUT_ROUNDING * (cost[rows] + np.sqrt(cost[rows]))
            q[rows[accepted]], cost[rows[accepted]] = trial[accepted], new_cost[accepted]
            pending = pending[~accepted]
            if not len(pending):
                break
    return q, converged


def _descend_by_damped_steps(arm: Arm, task: Task, q: Array, target: Array, steps: int) -> Array:
    """Projected Levenberg-Marquardt on all starts at once."""
    unit = radian_or_reach(arm)
    damping = np.full(len(q), 1e-2)
    cost = _cost(arm, task, q, target)
    active = np.arange(len(q))
    for _ in range(steps):
        r, J = _weighted_residual(arm, task, q[active], target[active])
        downhill = (r[:, None] @ J)[:, 0]
        at_limit = _stopped_joints(arm, q[active], downhill)
        J = np.where(at_limit[:, None, :], 0.0, J)
        H = J.swapaxes(1, 2) @ J + damping[active][:, None, None] * np.eye(arm.n)
        step = np.linalg.solve(H, np.where(at_limit, 0.0, downhill)[:, :, None])[:, :, 0]
        step *= np.minimum(1.0, 0.5 / np.maximum(np.abs(step).max(axis=1), tol.TINY))[:, None]
        trial = np.clip(q[active] + step * unit, arm.lower, arm.upper)
        new_cost = _cost(arm, task, trial, target[active])
        improved = new_cost < cost[active]
        gain = cost[active] - new_cost
        size = np.abs(trial - q[active]).max(axis=1)
        q[active[improved]] = trial[improved]
        cost[active[improved]] = new_cost[improved]
        damping[active] = np.where(improved, np.maximum(damping[active] * 0.2, tol.MIN_DAMPING), damping[active] * 6.0)
        is_small_gain = gain <= tol.GAINS_NOTHING * np.maximum(cost[active], tol.MIN_COST)
        idle = improved & is_small_gain & (size < tol.LAST_STEP)
        active = active[~(idle | (damping[active] > 1e8))]
        if not len(active):
            break
    return q


def _cost(arm: Arm, task: Task, q: Array, target: Array) -> Array:
    """Squared weighted residual (M,)."""
    r = newton.residuals(arm, task, q, target)
    r[:, task.position :] *= 0.25
    return np.asarray(np.einsum("mr,mr->m", r, r))
