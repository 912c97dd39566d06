"""Circuits: connected components of a one-dimensional self-motion manifold of three joints or more.

Two postures with the same values of the joints that a self-motion holds need not lie on one curve: a linkage of four
bars has two circuits, the elbow up and down, where its shortest bar can go all the way round (Grashof's condition).
The arm cannot go from one to the other without leaving its target.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool
from armkin.inverse.closed import four_bars
from armkin.inverse.numeric import newton
from armkin.inverse.numeric.tolerances import ACROSS, CROSSING, OFF_CURVE, SHORTEST_STEP, TINY
from armkin.inverse.tasks.task import Task
from armkin.model.units import radian_or_reach

if TYPE_CHECKING:
    from armkin.model.arm import Arm

STEP = 0.2  # [rad, reaches] along the curve
MOST = 250  # steps
PASSED = 0.15  # of a step: joint values this close to its chord are on the way; a curve is half as far off it
BEND = 4.0  # steps are at most so many times the second smallest singular value: a curve bends where another is near
STRAIGHT = 0.8  # cosine between the directions of two steps


def on_one(arm: Arm, task: Task, q: Array, joints: Bool, others: Array, asked: Bool, target: Array) -> Bool:
    """Which of the postures others (M, K, n) lie on one circuit with q (M, n), of those asked (M, K); else True.

    joints: (M, n) those that move. The curve is walked one way until it closes, then the other. Where another curve
    crosses it, or it is too long, all count as on it.
    """
    on = np.ones(asked.shape, bool)
    if task.orientation == "full":
        known, joint = four_bars.dead_points(arm, q, joints)
        k, c = np.nonzero(asked & known[:, None] & (joint >= 0)[:, None])
        at = np.concatenate([q[k], others[k, c]])
        side = four_bars.sides(arm, at, np.tile(joints[k], (2, 1)), np.tile(joint[k], 2)).reshape(2, -1)
        on[k, c] = side[0] == side[1]
        asked = asked & ~known[:, None]
    who, column = np.nonzero(asked)
    posture, met = others[who, column], np.zeros(len(who), bool)
    closed = np.zeros(len(q), bool)
    for way in (1.0, -1.0):
        left = np.bincount(who[~met], minlength=len(q)) > 0
        rows = np.flatnonzero(~closed & left)
        if len(rows):
            some = np.flatnonzero(~met & ~closed[who])
            place = np.searchsorted(rows, who[some])
            part = joints[rows], place, posture[some], target[rows]
            met[some], closed[rows] = _walk(arm, task, q[rows], *part, way)
    on[who, column] = met
    return on


def _walk(
    arm: Arm, task: Task, q: Array, joints: Bool, who: NDArray[np.intp], posture: Array, target: Array, way: float
) -> tuple[Bool, Bool]:
    """Which postures (P, n) are met on the way from the who-th of q (M, n): (P,); and whether the curve closes (M,)."""
    unit = radian_or_reach(arm)
    at, last, pace = q.copy(), np.zeros_like(q), np.zeros(len(q))
    met, closed, going = np.zeros(len(who), bool), np.zeros(len(q), bool), np.ones(len(q), bool)
    for step in range(MOST):
        active = np.flatnonzero(going)
        start = at[active] + pace[active, None] * last[active] * unit
        there, ahead, second, size = _across(arm, task, start, joints[active], target[active])
        turned = (ahead * last[active]).sum(axis=1)
        if not step:
            turned = way * ahead[np.arange(len(active)), np.abs(ahead).argmax(axis=1)]
        good = (size < OFF_CURVE) & ((np.abs(turned) > STRAIGHT) | (step == 0))
        before, at[active[good]] = at[active], there[good]
        last[active[good]] = (ahead * np.sign(turned)[:, None])[good]
        longest = np.minimum(STEP, BEND * second)
        pace[active] = np.minimum(longest, np.where(good, 2.0 * pace[active] if step else STEP, 0.5 * pace[active]))
        stuck = ~good & (pace[active] < SHORTEST_STEP)
        unsure = np.zeros(len(q), bool)  # nobody knows where it goes on
        unsure[active] = (second < CROSSING) | (stuck & (size < OFF_CURVE)) | (step == MOST - 1)
        open_ = np.flatnonzero(~met & going[who])
        place = np.searchsorted(active, who[open_])
        chord = newton.difference(arm, at[active], before)
        met[open_] = _on_chord(arm, posture[open_], before[place], chord[place]) | unsure[who[open_]]
        closed[active] = _on_chord(arm, q[active], before, chord) & good & (step > 2)
        more = np.bincount(who[~met], minlength=len(q)) > 0
        going[active] = more[active] & ~closed[active] & ~stuck
        if not going.any():
            break
    return met, closed


def _on_chord(arm: Arm, posture: Array, start: Array, chord: Array) -> Bool:
    """Which postures (M, n) a step along chord (M, n) from start (M, n) passes."""
    way, size = newton.difference(arm, posture, start), (chord * chord).sum(axis=1)
    part = np.clip((way * chord).sum(axis=1) / np.maximum(size, TINY), 0.0, 1.0)
    return np.asarray(np.linalg.norm(way - part[:, None] * chord, axis=1) < PASSED * np.sqrt(size))


def _across(arm: Arm, task: Task, q: Array, joints: Bool, target: Array) -> tuple[Array, Array, Array, Array]:
    """Postures (M, n) moved onto the curve beside them, at right angles to it.

    Also the curve's direction there (M, n), the second smallest singular value (M,) and what is missed (M,).
    """
    r, J = newton.scaled(arm, task, q, target)
    J = J * joints[:, None]
    L, V = np.linalg.eigh(np.swapaxes(J, 1, 2) @ J + np.where(joints[:, :, None], 0.0, np.eye(arm.n)))
    gain = np.where(L > ACROSS, 1.0 / np.maximum(L, ACROSS), 0.0)
    gain[:, 0] = 0.0
    back = (V * gain[:, None]) @ np.swapaxes(V, 1, 2) @ np.swapaxes(J, 1, 2)
    for _ in range(3):
        q = q + (back @ r[:, :, None])[:, :, 0] * radian_or_reach(arm)
        r = newton.residuals(arm, task, q, target)
    return q, V[:, :, 0], np.sqrt(np.maximum(L[:, 1], 0.0)), np.sqrt((r * r).sum(axis=1))
