"""Circuits: connected components of a one-dimensional self-motion manifold of three joints or more.

Two postures with the same values of the joints that a self-motion holds need not lie on one curve: a linkage of four
bars has two circuits, the elbow up and down, where its shortest bar can go all the way round (Grashof's condition).
The arm cannot go from one to the other without leaving its target.
"""

from __future__ import annotations

import numpy as np

from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.closed import four_bars
from armkin.inverse.singular import curves
from armkin.inverse.singular.curves import Curves
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm


def on_one(arm: Arm, task: Task, q: Array, joints: Bool, others: Array, asked: Bool, target: Array) -> Bool:
    """Which of the postures others (M, K, n) lie on one circuit with q (M, n), of those asked (M, K); else True.

    joints: (M, n) those that move. The curve is walked both ways at once until it closes. Where another curve crosses
    it, or it is too long, all count as on it.
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
    ahead, crossing = curves.directions(arm, task, q, joints, target)
    met = crossing[who]
    if len(some := np.flatnonzero(~met)):
        rows, place = np.unique(who[some], return_inverse=True)
        both = np.tile(rows, 2)
        walk = Curves(arm, task, q[both], joints[both], target[both], np.concatenate([ahead[rows], -ahead[rows]]))
        met[some] = _met(arm, walk, place, others[who, column][some])
    on[who, column] = met
    return on


def _met(arm: Arm, walk: Curves, who: Int, posture: Array) -> Bool:
    """Which postures (P, n) the who-th of these curves meet, until each has met all of its own: (P,).

    The second half of `walk` are the same curves the other way: they tell nothing more once the first half has closed.
    """
    M, P = len(walk.at) // 2, len(who)
    each, met = np.concatenate([who, who + M]), np.zeros(2 * P, bool)
    while walk.going.any():
        step = walk.step()
        unsure = np.zeros(2 * M, bool)
        unsure[step.rows] = step.unsure
        some = np.flatnonzero(~met & np.isin(each, step.rows))
        at = each[some]
        met[some] = step.passes(arm, posture[some % P], np.searchsorted(step.rows, at)) | unsure[at]
        left = np.bincount(who[~(met[:P] | met[P:])], minlength=M) > 0
        walk.going &= np.concatenate([left, left & ~walk.closed[:M]])
    return np.asarray(met[:P] | (met[P:] & ~walk.closed[who]))
