"""The answer of `armkin.ik`: all branches of a batch of targets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.tasks.residuals import residual
from armkin.inverse.tasks.task import Task
from armkin.keep_out.clearance import hits_nothing
from armkin.model.arm import Arm


class Status(IntEnum):
    """What the geometry says of a target, limits apart.

    Attributes:
        EXACT: isolated branches.
        BOUNDARY: two branches merge: the target lies on the edge of what that posture reaches.
        SINGULAR: a whole curve of joint values answers: some joints are free.
        UNREACHABLE: no joint values answer.
        POSITION: of `ik(..., position_first=True)`: the tool's position is exact, its rotation the nearest there is.
    """

    EXACT = 0
    BOUNDARY = 1
    SINGULAR = 2
    UNREACHABLE = 3
    POSITION = 4


@dataclass(frozen=True, eq=False, repr=False)
class Solutions:
    """All branches of a batch of targets; leading axes (...) are the batch's.

    Attributes:
        arm: the arm that was asked.
        task: what the targets prescribe.
        target: (..., m) [mm, rad] or (..., 4, 4) [mm] the targets, rotations made orthonormal.
        near: (..., n) [rad | mm] the joint values to stay close to.
        q: (..., B, n) [rad | mm], one row a branch modulo whole turns, the legal copy nearest `near`; nan past the
            last.
        valid: (..., B) the row reaches the target to 1e-9 of the arm's reach.
        within_limits: (..., B) the row is within the joints' limits, too.
        branch: (..., B) index into `names`, -1 past the last.
        status: (...) of `Status`.
        free: (..., n) joints that a singular target leaves free.
        names: of the branches that the arm has.
        method: the solver class, as `armkin.method` names it.
        why: the reason why it applies.
        complete: (...) every isolated real branch of this target is guaranteed to be there (never of a sliding arm's
            targets more than 20 reaches away).
        rounding: (...) [reaches, rad] how far the numbers given may be off, as `ik` was told, else how far the columns
            of a pose's rotation were from orthonormal, and of float32 its last place; `target` holds the rotation next
            to it, which the branches answer.
        angle: (..., B) [rad] how far each row's rotation is off, of `ik(..., position_first=True)` alone: rows are then
            sorted by it, and `status` tells of the first.
        interval: (..., B, 2) [rad] where an arm has one joint more than the target asks for: the values of the
            redundant joint (`armkin.inverse.redundant.families`) along which a row's posture moves within limits; of
            rows outside limits those of its whole family.
    """

    arm: Arm
    task: Task
    target: Array
    near: Array
    q: Array
    valid: Bool
    within_limits: Bool
    branch: NDArray[np.int8]
    status: NDArray[np.int8]
    free: Bool
    names: tuple[str, ...]
    method: str
    why: str
    complete: Bool
    rounding: Array
    angle: Array | None = None
    interval: Array | None = None

    def __repr__(self) -> str:
        batch, sure = self.status.shape, "complete" if self.complete.all() else "not all proved complete"
        return f"<Solutions {batch} of {self.arm.name}, {self.task.name}: {self.valid.sum()} branches, {sure}>"

    @cached_property
    def motion(self) -> Array:
        """(..., B) [deg + mm] sum of |change| from `near`; nan where there is no branch."""
        unit = np.where(self.arm.prismatic, 1.0, 180.0 / np.pi)
        return np.asarray((np.abs(self.q - self.near[..., None, :]) * unit).sum(axis=-1))

    @property
    def _rank(self) -> Array:
        """(..., B) what rows are sorted by: motion, or their place where they come sorted by angle."""
        if self.angle is None:
            return self.motion
        return np.broadcast_to(np.arange(self.q.shape[-2], dtype=float), self.valid.shape)

    @cached_property
    def clear(self) -> Bool:
        """(..., B) branches that hit no keep-out, limits apart; all, where the arm has no keep-outs."""
        return hits_nothing(self.arm, self.q) & self.valid if self.arm.keep_out else self.valid

    @cached_property
    def order(self) -> Int:
        """(..., B) branches by rank: within limits first, of them free ones, then by motion, missing ones last."""
        key = _rounded_motion(np.where(self.valid, self._rank, np.inf))
        by_motion = np.argsort(key, axis=-1, kind="stable")
        outside = ~np.take_along_axis(self.within_limits, by_motion, axis=-1)
        if self.arm.keep_out:
            hit = ~np.take_along_axis(self.clear, by_motion, axis=-1)
            outside = np.where(outside, 2, hit)
        by_limits = np.argsort(outside, axis=-1, kind="stable")
        return np.take_along_axis(by_motion, by_limits, axis=-1)

    @cached_property
    def best(self) -> Int:
        """(...) index of the branch within limits and free that moves the joints least, the first of several, or -1."""
        legal = self.within_limits & self.clear if self.arm.keep_out else self.within_limits
        key = np.where(legal, self._rank, np.inf)
        if not key.shape[-1]:  # no target of the batch has a branch
            return np.full(self.status.shape, -1)
        index = np.argmin(_rounded_motion(key), axis=-1)
        return np.where(np.isfinite(np.min(key, axis=-1)), index, -1)

    def residual(self) -> tuple[Array, Array]:
        """What each branch misses, recomputed from its joint values.

        Returns:
            (..., B) [mm] of the position, nan where there is no branch, and (..., B) [rad] of what else the task
            prescribes, 0 where that is nothing.
        """
        from armkin.forward import fk

        B, n = self.q.shape[-2:]
        q = self.q.reshape(-1, n)
        rows = self.target.reshape(-1, *self.target.shape[self.status.ndim :])
        missing = residual(self.task, fk(self.arm, q), q, np.repeat(rows, B, axis=0))
        p = self.task.position
        mm = np.linalg.norm(missing[:, :p], axis=1).reshape(self.valid.shape)
        rad = np.linalg.norm(missing[:, p:], axis=1).reshape(self.valid.shape)
        return mm, rad


Ik = Callable[..., Solutions]  # `armkin.ik`; functions that `inverse.solve` imports take it as an argument


def _rounded_motion(motion: Array) -> Array:
    """How much more than the least (..., B) of each target, inf where there is none: equal if rounding explains it."""
    least = motion.min(axis=-1, initial=np.inf, keepdims=True)
    return (motion - np.where(np.isfinite(least), least, 0.0)).round(tol.EQUAL_DECIMALS)
