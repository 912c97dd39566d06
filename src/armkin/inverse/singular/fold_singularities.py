"""Folds: postures at which two roots meet, told from self-motions by the curvature across the direction that is lost.

Where one singular value of the Jacobian vanishes, the joints can move along v without moving the tool, to first order.
To second order the tool moves along u, the direction that the Jacobian cannot reach, by half of ``bend`` times the
square of the way: if that is not zero, there is no curve of solutions, and the posture is a fold (a turning point).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array
from armkin.inverse.numeric import newton
from armkin.inverse.numeric.tolerances import CLEAR, FOLD_WAY, TINY
from armkin.inverse.tasks.task import Task
from armkin.model.units import radian_or_reach

if TYPE_CHECKING:
    from armkin.model.arm import Arm


class Folds(NamedTuple):
    """What is known of M postures.

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


def some(fold: Folds, rows: NDArray[Any]) -> Folds:
    """What is known of some postures."""
    return Folds(*(values[rows] for values in fold))
