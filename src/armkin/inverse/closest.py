"""The nearest pose within limits, for targets without a legal branch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.forward import fk, one_pose
from armkin.inverse.numeric import newton
from armkin.inverse.tasks.fitting import task_for
from armkin.inverse.tasks.residuals import residual
from armkin.inverse.tasks.task import Task, read_targets
from armkin.model.units import radian_or_reach

if TYPE_CHECKING:
    from armkin.model.arm import Arm

STARTS = 40
STEPS = 60
FINALISTS = 6
FLAT = 1e-8  # largest component of the gradient at a minimum; cost in squared reaches


@dataclass(frozen=True, eq=False)
class Closest:
    """The nearest pose within limits.

    q: (n,) [rad | mm]; position: (3,) of the tool [mm]; distance: to the target's position
    [mm]; angle: to what else the target prescribes [rad]; converged: it is a local minimum: the
    gradient vanishes along every joint that no limit stops, and no such motion curves down.
    """

    q: Array
    position: Array
    distance: float
    angle: float
    converged: bool


def closest(arm: Arm, target: ArrayLike, task: str | None = None, *, near: ArrayLike | None = None) -> Closest:
    """The pose within limits that misses the target least.

    target: one target (m,) or (4, 4). What is minimised is the squared distance plus the
    squared angle times the square of a quarter of the reach, so that a radian weighs as much
    as a quarter of the reach. Projected Levenberg-Marquardt from many starts (`near`, home
    and a fixed spread within limits); the best local minimum is returned, ties going to the
    one nearest to `near`.

    >>> import armkin
    >>> found = closest(armkin.load("robots/planar_2dof.yaml"), [600, 0])
    >>> float(found.position[0].round(6)), round(found.distance, 6)
    (500.0, 100.0)
    """
    definition = task_for(arm, task)
    goal, lead, _ = read_targets(definition, target)
    if lead:
        raise UsageError("closest takes one target at a time")
    rng = np.random.default_rng(11)
    span = np.where(arm.prismatic, arm.reach, np.pi)
    low = np.where(np.isfinite(arm.lower), arm.lower, np.minimum(-span, arm.home - span))
    high = np.where(np.isfinite(arm.upper), arm.upper, np.maximum(span, arm.home + span))
    close = one_pose(arm, arm.home if near is None else near, "near")
    starts = np.concatenate([[close, arm.home], rng.uniform(low, high, (STARTS, arm.n))])
    q = np.clip(starts, arm.lower, arm.upper)
    q = _descend(arm, definition, q, np.repeat(goal, len(q), axis=0))
    cost = _cost(arm, definition, q, np.repeat(goal, len(q), axis=0))
    q = q[np.argsort(cost, kind="stable")[:FINALISTS]]
    q, converged = _finish(arm, definition, q, np.repeat(goal, len(q), axis=0))
    cost = _cost(arm, definition, q, np.repeat(goal, len(q), axis=0))
    unit = radian_or_reach(arm)
    moved = np.abs((q - close) / unit).sum(axis=1)
    best = np.flatnonzero(cost <= cost.min() * (1 + 1e-9) + 1e-18)
    k = int(best[np.argmin(moved[best])])
    missing = residual(definition, fk(arm, q[k : k + 1]), q[k : k + 1], goal)[0]
    p = definition.position
    return Closest(
        q=q[k],
        position=fk(arm, q[k])[:3, 3],
        distance=float(np.linalg.norm(missing[:p])),
        angle=float(np.linalg.norm(missing[p:])),
        converged=bool(converged[k]),
    )


def _weighted(arm: Arm, task: Task, q: Array, target: Array) -> tuple[Array, Array]:
    """Residual and Jacobian with lengths in units of the reach and angles weighing a quarter of it."""
    r, J = newton.scaled(arm, task, q, target)
    r[:, task.position :] *= 0.25
    J[:, task.position :] *= 0.25
    return r, J


def _downhill(arm: Arm, task: Task, q: Array, target: Array) -> Array:
    """Half the negative gradient of the squared residual (M, n), joints in rad or reaches."""
    r, J = _weighted(arm, task, q, target)
    downhill: Array = np.einsum("mrn,mr->mn", J, r)
    return downhill


def _stopped(arm: Arm, q: Array, downhill: Array) -> NDArray[np.bool_]:
    """Joints that stand on a limit and would go beyond."""
    return ((q <= arm.lower) & (downhill < 0)) | ((q >= arm.upper) & (downhill > 0))


def _finish(arm: Arm, task: Task, q: Array, target: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Newton's method with the full Hessian (differences of the gradient), and whether a minimum was reached.

    Far beyond the reach the residual is large and Levenberg-Marquardt alone creeps.
    """
    n, h = arm.n, 1e-5
    unit = radian_or_reach(arm)
    converged = np.zeros(len(q), bool)
    cost = _cost(arm, task, q, target)
    for _ in range(40):
        downhill = _downhill(arm, task, q, target)
        free = ~_stopped(arm, q, downhill)
        shifts = np.concatenate([np.eye(n), -np.eye(n)]) * h
        around = (q[:, None, :] + shifts * unit).reshape(-1, n)
        slopes = _downhill(arm, task, around, np.repeat(target, 2 * n, axis=0)).reshape(len(q), 2, n, n)
        H = -(slopes[:, 0] - slopes[:, 1]) / (2 * h)
        H = 0.5 * (H + np.swapaxes(H, 1, 2))
        both = free[:, :, None] & free[:, None, :]
        H = np.where(both, H, np.eye(n))
        values, vectors = np.linalg.eigh(H)
        slope = np.abs(np.where(free, downhill, 0.0)).max(axis=1)
        converged = (slope <= FLAT * (1.0 + cost)) & (values[:, 0] > -1e-6)
        if converged.all():
            break
        # a step downhill along every eigenvector, whatever its curvature; flat ones gently
        along = np.einsum("mij,mi->mj", vectors, np.where(free, downhill, 0.0))
        step = np.einsum("mij,mj->mi", vectors, along / np.maximum(np.abs(values), 1e-5))
        step *= np.minimum(1.0, 0.3 / np.maximum(np.abs(step).max(axis=1), 1e-300))[:, None]
        for shrink in (1.0, 0.25, 0.05, 0.005):
            trial = np.clip(q + shrink * step * unit, arm.lower, arm.upper)
            now = _cost(arm, task, trial, target)
            # equal but for rounding is still a step towards a vanishing gradient
            better = (now <= cost * (1.0 + 1e-14)) & ~converged
            q = np.where(better[:, None], trial, q)
            cost = np.where(better, now, cost)
            step[better] = 0.0
    return q, converged


def _descend(arm: Arm, task: Task, q: Array, target: Array) -> Array:
    """Projected Levenberg-Marquardt on all starts at once."""
    unit = radian_or_reach(arm)
    damping = np.full(len(q), 1e-2)
    cost = _cost(arm, task, q, target)
    active = np.arange(len(q))
    for _ in range(STEPS):
        r, J = _weighted(arm, task, q[active], target[active])
        downhill = np.einsum("mrn,mr->mn", J, r)
        held = _stopped(arm, q[active], downhill)
        J = np.where(held[:, None, :], 0.0, J)
        H = np.einsum("mri,mrj->mij", J, J) + damping[active][:, None, None] * np.eye(arm.n)
        step = np.linalg.solve(H, np.where(held, 0.0, downhill)[:, :, None])[:, :, 0]
        step *= np.minimum(1.0, 0.5 / np.maximum(np.abs(step).max(axis=1), 1e-300))[:, None]
        trial = np.clip(q[active] + step * unit, arm.lower, arm.upper)
        now = _cost(arm, task, trial, target[active])
        better = now < cost[active]
        gained = cost[active] - now
        size = np.abs(trial - q[active]).max(axis=1)
        q[active[better]] = trial[better]
        cost[active[better]] = now[better]
        damping[active] = np.where(better, np.maximum(damping[active] * 0.2, 1e-12), damping[active] * 6.0)
        done = (better & (gained <= 1e-17 * np.maximum(cost[active], 1e-30)) & (size < 1e-9)) | (damping[active] > 1e8)
        active = active[~done]
        if not len(active):
            break
    return q


def _cost(arm: Arm, task: Task, q: Array, target: Array) -> Array:
    """Squared weighted residual (M,)."""
    r = residual(task, fk(arm, q), q, target)
    r[:, : task.position] /= arm.reach
    r[:, task.position :] *= 0.25
    cost: Array = np.einsum("mr,mr->m", r, r)
    return cost
