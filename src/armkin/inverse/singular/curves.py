"""One-dimensional solution sets, followed from given postures, all at once; which postures are on one circuit.

A step along the direction that is lost, pulled back at right angles to it (Allgower and Georg, Numerical Continuation
Methods, 1990, ch. 2). Its length is bounded by the second smallest singular value: a curve bends where another is near.
"""

from typing import NamedTuple

import numpy as np

from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.closed import four_bars
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm
from armkin.model.units import radian_or_reach

STEP = 0.3  # step [rad, reaches] along a curve
MAX_STEPS = 250  # steps, at most, along a curve
PASSED_SHARE = 0.15  # share of a step: joint values this close to its chord are passed; a curve is half as far off it
SECOND_VALUES = 4.0  # length of a step, at most, in second smallest singular values
CROSSING_STEP = 0.05  # step [rad, reaches] over a crossing
MIN_COSINE = 0.8  # cosine, at least, between the directions of two steps


class Step(NamedTuple):
    """A step of some curves."""

    rows: Int  # (A,) which curves
    start: Array  # (A, n)
    chord: Array  # (A, n) its way [rad, reaches]
    unsure: Bool  # (A,) whether another curve crosses, or this is too long, or steps become too short to go on

    def passes(self, arm: Arm, posture: Array, place: Int) -> Bool:
        """Which postures (P, n) the place-th of these steps pass: (P,)."""
        offset, chord = newton.difference(arm, posture, self.start[place]), self.chord[place]
        chord_squared = (chord * chord).sum(axis=1)
        share = np.clip((offset * chord).sum(axis=1) / np.maximum(chord_squared, tol.TINY), 0.0, 1.0)
        beside = offset - share[:, None] * chord
        return np.asarray((beside * beside).sum(axis=1) < PASSED_SHARE**2 * chord_squared)


class Curves:
    """Curves through postures q (M, n), followed along heading (M, n); joints: (M, n) those that move.

    q: (M, n) how far they are followed. active: (M,) those that are not at their end; a caller may end others. closed:
    (M,) those that came back. Where several directions are lost a curve goes straight on.
    """

    def __init__(self, arm: Arm, task: Task, q: Array, joints: Bool, target: Array, heading: Array) -> None:
        self._arm, self._task = arm, task
        self._joints, self._target = joints, target
        self._start, self._heading, self._steps = q, heading, np.zeros(len(q), int)
        self._length = _longest_steps(_onto_curve(arm, task, q, joints, target)[2])
        self.q, self.active, self.closed = q.copy(), np.ones(len(q), bool), np.zeros(len(q), bool)

    def step(self) -> Step:
        """One step of all that are active; one that leads off its curve is not taken, and the next is half as long."""
        rows = np.flatnonzero(self.active)
        arm, joints = self._arm, self._joints[rows]
        last_heading, length = self._heading[rows], self._length[rows]
        start = self.q[rows] + length[:, None] * last_heading * radian_or_reach(arm)
        landed, V, second, size = _onto_curve(arm, self._task, start, joints, self._target[rows])
        heading = _next_directions(V, second, last_heading)
        cosine = np.linalg.norm(heading, axis=1)
        good = (size < tol.OFF_CURVE_RESIDUAL) & (cosine > MIN_COSINE)
        last_q = self.q[rows]
        self.q[rows[good]], self._heading[rows[good]] = landed[good], heading[good] / cosine[good, None]
        self._length[rows] = length = np.minimum(_longest_steps(second), np.where(good, 2.0, 0.5) * length)
        self._steps[rows] += 1
        is_stuck, is_long = ~good & (length < tol.SHORTEST_STEP), self._steps[rows] == MAX_STEPS
        unsure = (second < tol.CROSSING_VALUE) | (is_stuck & (size < tol.OFF_CURVE_RESIDUAL)) | is_long
        step = Step(rows, last_q, newton.difference(arm, self.q[rows], last_q), np.asarray(unsure))
        at_start = step.passes(arm, self._start[rows], np.arange(len(rows)))
        self.closed[rows] = at_start & good & (self._steps[rows] > 2)
        self.active[rows] = ~(self.closed[rows] | is_stuck | is_long)
        return step


def _longest_steps(second: Array) -> Array:
    """Steps (M,) beside a second smallest singular value; where another curve crosses, one over the crossing."""
    return np.asarray(np.where(second < tol.CROSSING_VALUE, CROSSING_STEP, np.minimum(STEP, SECOND_VALUES * second)))


def _next_directions(V: Array, second: Array, directions: Array) -> Array:
    """What is lost of the directions (M, n) of steps: V (M, n, n) the smallest singular value's first."""
    components = np.einsum("mij,mi->mj", V, directions)
    components[:, 2:] = 0.0
    components[second >= tol.CROSSING_VALUE, 1] = 0.0
    return np.asarray(np.einsum("mij,mj->mi", V, components))


def _onto_curve(arm: Arm, task: Task, q: Array, joints: Bool, target: Array) -> tuple[Array, Array, Array, Array]:
    """Postures (M, n) moved onto the curve beside them, at right angles to it.

    Also right singular vectors there (M, n, n), the curve's first, second smallest singular values and misses (M,).
    """
    r, J = newton.scaled_residual_and_jacobian(arm, task, q, target)
    J = J * joints[:, None]
    L, V = np.linalg.eigh(np.swapaxes(J, 1, 2) @ J + np.where(joints[:, :, None], 0.0, np.eye(arm.n)))
    gain = np.where(L > tol.STEP_VALUE_SQUARED, 1.0 / np.maximum(L, tol.STEP_VALUE_SQUARED), 0.0)
    gain[:, 0] = 0.0
    pull_back = (V * gain[:, None]) @ np.swapaxes(V, 1, 2) @ np.swapaxes(J, 1, 2)
    for _ in range(3):
        step = (pull_back @ r[:, :, None])[:, :, 0]
        step[np.abs(step).max(axis=1) < tol.ARRIVED_STEP] = 0.0
        if not step.any():
            break
        q = q + step * radian_or_reach(arm)
        r = newton.residuals(arm, task, q, target)
    return q, V, np.sqrt(np.maximum(L[:, 1], 0.0)), np.sqrt((r * r).sum(axis=1))


def share_circuit(arm: Arm, task: Task, q: Array, joints: Bool, postures: Array, compared: Bool, target: Array) -> Bool:
    """Which of postures (M, K, n) lie on one circuit with q (M, n), of those compared (M, K); else True.

    Two postures with the same values of the joints that a self-motion holds need not lie on one: a linkage of four bars
    has two circuits where its shortest bar can go all the way round (Grashof's condition). joints: (M, n) those that
    move. The curve is walked both ways at once until it closes. Where another crosses, or it is too long, all are.
    """
    on_circuit = np.ones(compared.shape, bool)
    if task.orientation == "full":
        is_linkage, joint = four_bars.dead_points(arm, q, joints)
        k, c = np.nonzero(compared & is_linkage[:, None] & (joint >= 0)[:, None])
        pair = np.concatenate([q[k], postures[k, c]])
        side = four_bars.sides(arm, pair, np.tile(joints[k], (2, 1)), np.tile(joint[k], 2)).reshape(2, -1)
        on_circuit[k, c] = side[0] == side[1]
        compared = compared & ~is_linkage[:, None]
    curve, column = np.nonzero(compared)
    _, V, second, _ = _onto_curve(arm, task, q, joints, target)
    direction, met = V[:, :, 0], np.asarray(second < tol.CROSSING_VALUE)[curve]
    if len(walked := np.flatnonzero(~met)):
        rows, place = np.unique(curve[walked], return_inverse=True)
        twin, directions = np.tile(rows, 2), np.concatenate([direction[rows], -direction[rows]])
        walk = Curves(arm, task, q[twin], joints[twin], target[twin], directions)
        met[walked] = _met_postures(arm, walk, place, postures[curve, column][walked])
    on_circuit[curve, column] = met
    return on_circuit


def _met_postures(arm: Arm, walk: Curves, curve: Int, posture: Array) -> Bool:
    """Which postures (P, n) the curve-th of these curves meet, until each has met all of its own: (P,).

    The second half of `walk` are the same curves the other way: they tell nothing more once the first half has closed.
    """
    M, P = len(walk.q) // 2, len(curve)
    curve_way, met = np.concatenate([curve, curve + M]), np.zeros(2 * P, bool)
    while walk.active.any():
        step = walk.step()
        place = np.full(2 * M, -1)
        place[step.rows] = np.arange(len(step.rows))
        unmet = np.flatnonzero(~met & (place[curve_way] >= 0))
        row = place[curve_way[unmet]]
        met[unmet] = step.passes(arm, posture[unmet % P], row) | step.unsure[row]
        has_unmet = np.bincount(curve[~(met[:P] | met[P:])], minlength=M) > 0
        walk.active &= np.concatenate([has_unmet, has_unmet & ~walk.closed[:M]])
    return np.asarray(met[:P] | (met[P:] & ~walk.closed[curve]))
