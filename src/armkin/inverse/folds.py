"""Folds: postures at which two roots meet, told from self-motions by the curvature across the direction that is lost.

Where one singular value of the Jacobian vanishes, the joints can move along v without moving the tool, to first order.
To second order the tool moves along u, the direction that the Jacobian cannot reach, by half of ``bend`` times the
square of the way: if that is not zero, there is no curve of solutions, and the posture is a fold (a turning point).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from armkin.formula.arrays import Array
from armkin.inverse.numeric import newton
from armkin.inverse.tasks.task import Task

if TYPE_CHECKING:
    from armkin.model.arm import Arm

WAY = 1e-3  # [rad, reaches] of the second difference: its rounding is 1e-10
CLEAR = 1e-4  # singular value that the second smallest must have for v to be the only direction
BENT = 1e-3  # curvature of a fold; along a self-motion it is zero, and below 1e-5 where the residual hardly grows


class Folds(NamedTuple):
    """What is known of M postures.

    weakest: (M,) smallest singular value. bend: (M,) curvature, nan where no single direction is lost. lost: (M,) the
    residual along u, of which no motion takes anything away if it has the sign of bend. rest: (M,) the joint motion
    that takes away what is left.
    """

    weakest: Array
    bend: Array
    lost: Array
    rest: Array


def folds(arm: Arm, task: Task, q: Array, target: Array) -> Folds:
    """Postures q (M, n) and their targets (M, m) or (M, 4, 4)."""
    r, J = newton.scaled(arm, task, q, target)
    if J.shape[1] != J.shape[2] or task.orientation == "axis" or arm.n < 2:
        unknown = np.full(len(q), np.nan)
        return Folds(unknown, unknown, unknown, unknown)
    U, S, Vt = np.linalg.svd(J)
    u, way = U[:, :, -1], WAY * Vt[:, -1] * np.where(arm.prismatic, arm.reach, 1.0)
    both = np.concatenate([q + way, q - way])
    ahead, behind = np.split(newton.residuals(arm, task, both, np.concatenate([target, target])), 2)
    bend = (u * (ahead + behind - 2.0 * r)).sum(axis=1) / WAY**2
    lost = (u * r).sum(axis=1)
    rest = np.linalg.norm(r - lost[:, None] * u, axis=1) / np.maximum(S[:, -2], 1e-300)
    return Folds(S[:, -1], np.where(S[:, -2] > CLEAR, bend, np.nan), lost, rest)
