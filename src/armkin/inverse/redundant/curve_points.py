"""Points of curves of answers, onto which postures are moved in all joints, and cubics between them.

By Newton's method, a tangent or held joint the last equation (Allgower, Georg: Numerical Continuation Methods, 1990).
"""

from typing import NamedTuple, Self

import numpy as np

from armkin.formula.array_tuples import stack_rows
from armkin.formula.arrays import Array, Bool, Int, slices
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.numeric.newton import nudged
from armkin.inverse.redundant.other_joints import Follower
from armkin.model.units import radian_or_reach

MAX_STEP = 0.3  # length [rad, reaches], at most, of one step of Newton's method
NEWTON = 4  # steps of Newton's method onto the curve
AT_ONCE = 1000  # postures that Newton's method works on at once: they stay in the cache


class Points(NamedTuple):
    """Postures (M, n), unit tangents (M, n) of their curves [rad, reaches], and sizes of the last steps there (M,)."""

    q: Array
    tangent: Array
    step: Array

    @property
    def settled(self) -> Bool:
        """Whether rounding is all that is left (M,)."""
        return np.asarray(self.step < tol.PAIR_STEP)


def onto_curves(follower: Follower, row: Int, q: Array, last: Array, tolerance: float = tol.PAIR_STEP) -> Points:
    """Postures q (M, n) moved onto the curves of their targets, across last (M, n): a tangent, or a joint that is held.

    The tangents point to where last does. tolerance: size of a step that is the last one.
    """
    parts = slices(max(len(q), 1), AT_ONCE)
    return stack_rows([_move_chunk(follower, row[part], q[part], last[part], tolerance) for part in parts])


def _move_chunk(follower: Follower, row: Int, q: Array, last: Array, tolerance: float) -> Points:
    """Move at most `AT_ONCE` postures q (M, n) [rad | mm], which the cache holds, onto curves as `onto_curves` does."""
    arm, task, unit = follower.arm, follower.redundant.task, radian_or_reach(follower.arm)
    target = follower.target[row]
    q, tangent = q.copy(), last.copy()
    size, active = np.full(len(q), np.inf), np.arange(len(q))
    for _ in range(NEWTON):
        if not len(active):
            break
        part = slice(None) if len(active) == len(q) else active
        residual, J = newton.scaled_residual_and_jacobian(arm, task, q[part], target[part])
        rows = np.concatenate([J, last[part, None]], axis=1)
        right = np.zeros((*rows.shape[:2], 2))
        right[:, :-1, 0], right[:, -1, 1] = residual, 1.0
        # the direction of a tool's axis is three numbers for two constraints
        x = nudged(np.linalg.solve, rows, right) if rows.shape[1] == arm.n else np.linalg.pinv(rows) @ right
        step = x[:, :, 0]
        tangent[part] = x[:, :, 1] / np.sqrt((x[:, :, 1] ** 2).sum(axis=1, keepdims=True))
        longest = np.abs(step).max(axis=1)
        q[part] += step * np.minimum(1.0, MAX_STEP / np.maximum(longest, MAX_STEP))[:, None] * unit
        size[part] = np.where(np.isnan(longest), np.inf, longest)
        active = active[~(size[part] < tolerance)]  # the residual left is the square of the step
    return Points(q, tangent, size)


class Ways(NamedTuple):
    """Cubics from postures q (M, n) along their chords (M, n), with the derivatives at both ends [rad, reaches]."""

    q: Array
    chord: Array
    begin: Array
    end: Array

    @classmethod
    def between(cls, follower: Follower, a: Points, b: Points) -> Self:
        """Cubics between points, which follow an arc of a circle to the sixth order."""
        chord = newton.difference(follower.arm, b.q, a.q)
        cosine = np.maximum((a.tangent * b.tangent).sum(axis=1), -1.0)
        size = 2.0 * np.sqrt((chord * chord).sum(axis=1)) / (1.0 + np.sqrt(0.5 * (1.0 + cosine)))
        return cls(a.q, chord, size[:, None] * a.tangent, size[:, None] * b.tangent)

    def at(self, follower: Follower, share: Array | float) -> Array:
        """Postures at shares (M,) of the way, or all at one."""
        u = np.asarray(share)[..., None]
        offset = self.chord * (u * u * (3.0 - 2.0 * u)) + (self.begin * (1.0 - u) - self.end * u) * (u * (1.0 - u))
        return np.asarray(self.q + offset * radian_or_reach(follower.arm))

    def slope(self, u: Array | float, j: int) -> Array:
        """The derivative (M,) [rad, reaches] of joint j by the share of the way, at shares u (M,) or one."""
        ends = self.begin[:, j] * (1.0 - u) * (1.0 - 3.0 * u) + self.end[:, j] * u * (3.0 * u - 2.0)
        return np.asarray(6.0 * u * (1.0 - u) * self.chord[:, j] + ends)

    def follow(self, follower: Follower, row: Int) -> Bool:
        """Which lie on the curves of their targets row (M,), as their middles tell."""
        miss = newton.misses(follower.arm, follower.redundant.task, self.at(follower, 0.5), follower.target[row])
        return miss < tol.MID_MISS
