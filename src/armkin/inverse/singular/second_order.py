"""Curves through singular postures to second order, and the components that these decide.

Along the direction that is lost the residual is g = sigma t + b t^2 / 2 as long as third and fourth differences of the
pose stay small: most boundaries and isolated roots need no more (docs/solution.md).
"""

from typing import NamedTuple, Self

import numpy as np

from armkin.formula.arrays import Array, Bool
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm
from armkin.model.units import radian_or_reach

BOTH_SENSES = np.array([1.0, -1.0])[:, None, None]
BACK = 5  # steps, at most, back onto the curve
MAX_DISTANCE = 0.04  # distance [rad, reaches], at most, at which the series is compared with g
CHANGE_SHARE = 0.2  # change of g'', at most, as a share of b: up to 0.27 |g| passes `SOLUTION` within h both ways
CHORD_SHARE = 0.1  # distance of a curve from its tangent, at most, as a share of h; others have polynomials


class Series(NamedTuple):
    """Curves to second order, x = v t + w t^2 / 2 and g = sigma t + b t^2 / 2, of M postures."""

    v: Array  # (M, n)
    w: Array  # (M, n)
    sigma: Array  # (M,)
    b: Array  # (M,)
    across: Array  # (M, n - 1, n) motions that move the pose by one along each of the directions in reach

    @classmethod
    def at(cls, arm: Arm, task: Task, q: Array, target: Array, linear: newton.Linear) -> Self:
        """The series at postures q (M, n), by differences: x keeps what other directions reach to second order."""
        S, V = linear.S, linear.V
        both_ways = BOTH_SENSES * tol.FOLD_WAY * V[:, -1]
        second_derivative = _moved_pose(arm, task, q, both_ways, target, linear).sum(axis=0) / tol.FOLD_WAY**2
        across = V[:, :-1] / np.maximum(S[:, :-1], tol.WEAK)[:, :, None]
        w = -(across * second_derivative[:, :-1, None]).sum(axis=1)
        return cls(V[:, -1], w, S[:, -1], second_derivative[:, -1], across)

    @property
    def bend(self) -> Array:
        """The size of b (M,), never zero."""
        return np.maximum(np.abs(self.b), tol.TINY)

    def turns(self, change: Array | float = 0.0) -> Bool:
        """Where g turns before it passes `SOLUTION`, if g'' is less than b by `change` (M,)."""
        return np.asarray(self.sigma**2 < 2.0 * tol.SOLUTION * (self.bend - change))

    def outcome(self, h: Array, g: Array, offset: Array) -> tuple[Bool, Bool]:
        """Which curves (M,) surely turn before they pass `SOLUTION`, and which surely pass it first.

        g: (2, M) residuals at distances h (M,) both ways, of postures offset (M,) beside the curves.
        """
        cubic = np.abs(0.5 * (g[0] - g[1]) - self.sigma * h)
        quartic = np.abs(0.5 * (g[0] + g[1]) - 0.5 * self.b * h**2) + self.v.shape[1] * h * offset
        change = (6.0 * cubic + 12.0 * quartic) / h**2  # of g'', at most
        turns = self.turns() & (change < CHANGE_SHARE * self.bend) & self.turns(change)
        return np.asarray(turns), ~self.turns() & (self.sigma**2 > 2.0 * tol.SOLUTION * (self.bend + change))

    def ends(self) -> Array:
        """Where |g| is `SOLUTION`: (2, M), first against v."""
        sigma, bend = self.sigma, self.bend
        # first where g has the sign of b, else at `other_exit`, or beyond the turn
        exit_distance = 2.0 * tol.SOLUTION / (sigma + np.sqrt(sigma**2 + 2.0 * tol.SOLUTION * bend))
        root = np.sqrt(np.maximum(sigma**2 - 2.0 * tol.SOLUTION * bend, 0.0))
        other_exit = 2.0 * tol.SOLUTION / np.maximum(sigma + root, tol.TINY)
        other_exit = np.where(self.turns(), exit_distance + 2.0 * sigma / bend, other_exit)
        return np.where(self.b > 0.0, [-other_exit, exit_distance], [-exit_distance, other_exit])


def _moved_pose(arm: Arm, task: Task, q: Array, way: Array, target: Array, linear: newton.Linear) -> Array:
    """How far the pose goes along U's columns, (2, M, rows), where the joints go a way (2, M, n)."""
    ends = (q + way * radian_or_reach(arm)).reshape(-1, arm.n)
    goals = np.concatenate([target, target])
    moved = linear.r - newton.residuals(arm, task, ends, goals).reshape(2, *linear.r.shape)
    return np.asarray((moved[..., None] * linear.U).sum(axis=2))


def decide(arm: Arm, task: Task, q: Array, target: Array, linear: newton.Linear, series: Series) -> tuple[Bool, Bool]:
    """Which components (M,) the curvature decides, as far as that tells, at most `MAX_DISTANCE`; which are boundaries.

    g changes by what third and fourth differences say, after steps back onto the curve; what these miss is counted.
    Where sigma^2 > 2 SOLUTION |g''| as far as 2 SOLUTION / sigma, |g| passes `SOLUTION` there without a turn; where
    sigma^2 < 2 SOLUTION |g''| as far as 4 sqrt(SOLUTION / b), it turns before, and passes it on both sides.
    """
    r, _, S, _ = linear
    v, w, sigma, _, across = series
    turn_distance = 4.0 * np.sqrt(tol.SOLUTION / series.bend)
    h = np.where(series.turns(), turn_distance, 2.0 * tol.SOLUTION / np.maximum(sigma, tol.TINY))
    undecided = (h <= MAX_DISTANCE) & ((r * r).sum(axis=1) < tol.ROUNDING_RESIDUAL**2)
    undecided &= S[:, -2] * h > 4.0 * tol.SOLUTION  # what solves the target beside the curve must not pass for its ends
    h, (decided, boundary) = np.minimum(h, MAX_DISTANCE), np.zeros((2, len(q)), bool)
    correction, last_offset = np.zeros((2, *v.shape)), np.inf
    for _ in range(BACK):
        if not undecided.any():
            break
        way = 0.5 * (h * h)[:, None] * w + BOTH_SENSES * h[:, None] * v + correction
        moved = _moved_pose(arm, task, q, way, target, linear)
        offset = np.linalg.norm(moved[:, :, :-1], axis=2).max(axis=0) / np.maximum(S[:, -2], tol.TINY)
        turns, passes = series.outcome(h, moved[:, :, -1], offset)
        chord_error = 0.5 * h**2 * np.linalg.norm(w, axis=1) + np.linalg.norm(correction, axis=2).max(axis=0) + offset
        newly = undecided & (turns | passes) & (chord_error < CHORD_SHARE * h)
        decided, boundary = decided | newly, boundary | (newly & turns)
        undecided &= ~newly & (offset < 0.5 * last_offset)  # the next step must come closer to tell more
        last_offset, correction = offset, correction - (across * moved[:, :, :-1, None]).sum(axis=2)
    return decided, boundary
