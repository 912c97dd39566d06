"""Points of curves of answers, onto which postures are moved in all joints, and cubics between them.

By Newton's method, a tangent or held joint the last equation (Allgower, Georg: Numerical Continuation Methods, 1990).
"""

from typing import NamedTuple, Self

import numpy as np

from armkin.formula.array_tuples import stack_rows
from armkin.formula.arrays import Array, Bool, Int, slices
from armkin.formula.linear_systems import eliminate
from armkin.forward import tip_and_jacobian_columns
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.numeric.newton import nudged
from armkin.inverse.redundant.other_joints import Follower
from armkin.model.units import radian_or_reach

MAX_STEP = 0.3  # length [rad, reaches], at most, of one step of Newton's method
NEWTON = 4  # steps of Newton's method onto the curve
FEW_POSTURES = 100  # postures of which no elimination in common is faster
AT_ONCE = 3000  # postures that Newton's method works on at once: they stay in the cache


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
    unit, target = radian_or_reach(follower.arm), follower.target[row]
    q, tangent = q.copy(), last.copy()
    size, active = np.full(len(q), np.inf), np.arange(len(q))
    for _ in range(NEWTON):
        if not len(active):
            break
        part = slice(None) if len(active) == len(q) else active
        step, along = _steps(follower, q[part], target[part], last[part])
        tangent[part] = (along / np.sqrt((along * along).sum(axis=0))).T
        longest = np.abs(step).max(axis=0)
        q[part] += (step * np.minimum(1.0, MAX_STEP / np.maximum(longest, MAX_STEP))).T * unit
        size[part] = np.where(np.isnan(longest), np.inf, longest)
        active = active[~(size[part] < tolerance)]  # the residual left is the square of the step
    return Points(q, tangent, size)


def _equations(follower: Follower, q: Array, target: Array, last: Array) -> Array:
    """Equations of Newton's steps across last (M, n) and of tangents: (rows, n + 2, M), their right sides last."""
    arm, task, M = follower.arm, follower.redundant.task, len(q)
    if task.orientation == "full":
        columns = tip_and_jacobian_columns(arm, q)
        T, J = columns[:12].reshape(3, 4, M), columns[16:].reshape(6, arm.n, M)
        J *= radian_or_reach(arm)[:, None]
        J[:3] /= arm.reach
        goal = np.ascontiguousarray(target[:, :3].reshape(M, 12).T).reshape(3, 4, M)
        products = (T[:, None, :3] * goal[:, :3]).sum(axis=2)
        # half the sum of the columns' vector products is the rotation vector to third order
        sines = 0.5 * np.stack([products[k, i] - products[i, k] for i, k in ((2, 1), (0, 2), (1, 0))])
        sines[:, products[0, 0] + products[1, 1] + products[2, 2] < 1.0] = np.nan  # more than a quarter of a turn
        residual = np.concatenate([(goal[:, 3] - T[:, 3]) / arm.reach, sines])
    else:
        r, slopes = newton.scaled_residual_and_jacobian(arm, task, q, target)
        residual, J = r.T, slopes.transpose(1, 2, 0)
    equations = np.zeros((len(J) + 1, arm.n + 2, M))
    equations[:-1, :-2], equations[:-1, -2] = J, residual
    equations[-1, :-2], equations[-1, -1] = last.T, 1.0
    return equations


def _steps(follower: Follower, q: Array, target: Array, last: Array) -> Array:
    """Newton's steps and tangents (2, n, M): by the same elimination for all, one after the other where one of its
    pivots is weak or where they are few."""
    equations, n = _equations(follower, q, target, last), follower.arm.n
    if len(q) < FEW_POSTURES or len(equations) != n:
        return _one_by_one(equations)
    rows = np.flatnonzero(eliminate(equations, tol.WEAK_PIVOT))
    x = equations[:, n:].swapaxes(0, 1)
    if len(rows):
        x[:, :, rows] = _one_by_one(_equations(follower, q[rows], target[rows], last[rows]))
    return x


def _one_by_one(equations: Array) -> Array:
    """Solutions (2, n, M) of equations (rows, n + 2, M)."""
    matrices = equations.transpose(2, 0, 1)
    left, right = matrices[:, :, :-2], matrices[:, :, -2:]
    # the direction of a tool's axis is three numbers for two constraints
    x = nudged(np.linalg.solve, left, right) if left.shape[1] == left.shape[2] else np.linalg.pinv(left) @ right
    return x.transpose(2, 1, 0)


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
