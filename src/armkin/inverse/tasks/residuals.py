"""Residuals of targets and their Jacobians: the equations of every Newton step."""

import numpy as np

from armkin.formula.arrays import Array, wrap_angle
from armkin.inverse.tasks.task import NO_DIRECTION, Task
from armkin.model.rotation import SMALL_TURN, rotation_vectors_of_sines

ABOVE, BELOW = np.array([5, 6, 1]), np.array([7, 2, 3])  # where rotations (3, 3) have the sines of their axes
TINY = 1e-300  # floor of divisors, which keeps quotients finite


def residual(task: Task, T: Array, q: Array, target: Array, unit: float = 1.0) -> Array:
    """The differences to the targets: (M, position + sums + orientation), lengths in units [mm] first, then rad.

    T: (M, 4, 4) the tool's poses; q: (M, n); target: (M, m) or (M, 4, 4).
    """
    if task.orientation == "full":
        difference = np.empty((len(T), 6))
        difference[:, :3] = (target[:, :3, 3] - T[:, :3, 3]) / unit
        # half the sum of the columns' vector products is the rotation vector to third order
        R, back = T[:, :3, :3], np.swapaxes(target[:, :3, :3], 1, 2)
        C = (np.ascontiguousarray(R) @ np.ascontiguousarray(back)).reshape(-1, 9)  # views take three times as long
        difference[:, 3:] = 0.5 * (C.take(ABOVE, axis=1) - C.take(BELOW, axis=1))
        trace = C[:, 0] + C[:, 4] + C[:, 8]
        if (trace < 3.0 - SMALL_TURN).any():
            difference[:, 3:] = rotation_vectors_of_sines(difference[:, 3:], trace, C)
        return difference
    parts = [(target[:, : task.position] - T[:, : task.position, 3]) / unit]
    if len(task.sums):
        sums = target[:, task.position : task.position + len(task.sums)]
        angle = sums - q @ task.sums.T - task.offsets
        parts.append(wrap_angle(angle))
    if task.orientation == "axis":
        z = T[:, :3, 2]
        w = np.cross(z, target[:, 3:])
        sine = np.linalg.norm(w, axis=1)
        cosine = np.einsum("mi,mi->m", z, target[:, 3:])
        angle = np.arctan2(sine, cosine)
        w = np.where(sine[:, None] > NO_DIRECTION, w * (angle / np.maximum(sine, TINY))[:, None], w)
        is_opposed = (sine <= NO_DIRECTION) & (cosine < 0)  # opposed: any perpendicular axis
        w[is_opposed] = np.pi * T[is_opposed][:, :3, 0]
        parts.append(w)
    return np.concatenate(parts, axis=1)


def task_jacobian(task: Task, J: Array, T: Array) -> Array:
    """The task's rows (M, rows, n) of geometric Jacobians (M, 6, n) at poses T (M, 4, 4), in the order of `residual`.

    For a task that prescribes an axis, the rotation about the tool's z axis is left out.
    """
    if task.orientation == "full":
        return J
    parts = [J[:, : task.position]]
    if len(task.sums):
        parts.append(np.broadcast_to(task.sums, (len(J), *task.sums.shape)))
    if task.orientation == "axis":
        z = T[:, :3, 2]
        parts.append(J[:, 3:] - z[:, :, None] * np.einsum("mi,min->mn", z, J[:, 3:])[:, None])
    return np.concatenate(parts, axis=1)
