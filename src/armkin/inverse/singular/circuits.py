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


def on_one(arm: Arm, task: Task, q: Array, joints: Bool, postures: Array, compared: Bool, target: Array) -> Bool:
    """Which of postures (M, K, n) lie on one circuit with q (M, n), of those compared (M, K); else True.

    joints: (M, n) those that move. The curve is walked both ways at once until it closes. Where another curve crosses
    it, or it is too long, all count as on it.
    """
    same = np.ones(compared.shape, bool)
    if task.orientation == "full":
        is_linkage, joint = four_bars.dead_points(arm, q, joints)
        k, c = np.nonzero(compared & is_linkage[:, None] & (joint >= 0)[:, None])
        pair = np.concatenate([q[k], postures[k, c]])
        side = four_bars.sides(arm, pair, np.tile(joints[k], (2, 1)), np.tile(joint[k], 2)).reshape(2, -1)
        same[k, c] = side[0] == side[1]
        compared = compared & ~is_linkage[:, None]
    curve, column = np.nonzero(compared)
    ahead, crossing = curves.directions(arm, task, q, joints, target)
    met = crossing[curve]
    if len(open_ := np.flatnonzero(~met)):
        rows, place = np.unique(curve[open_], return_inverse=True)
        twice = np.tile(rows, 2)
        walk = Curves(arm, task, q[twice], joints[twice], target[twice], np.concatenate([ahead[rows], -ahead[rows]]))
        met[open_] = _met(arm, walk, place, postures[curve, column][open_])
    same[curve, column] = met
    return same


def _met(arm: Arm, walk: Curves, curve: Int, posture: Array) -> Bool:
    """Which postures (P, n) the curve-th of these curves meet, until each has met all of its own: (P,).

    The second half of `walk` are the same curves the other way: they tell nothing more once the first half has closed.
    """
    M, P = len(walk.at) // 2, len(curve)
    ways, met = np.concatenate([curve, curve + M]), np.zeros(2 * P, bool)
    while walk.going.any():
        step = walk.step()
        unsure = np.zeros(2 * M, bool)
        unsure[step.rows] = step.unsure
        unmet = np.flatnonzero(~met & np.isin(ways, step.rows))
        way = ways[unmet]
        met[unmet] = step.passes(arm, posture[unmet % P], np.searchsorted(step.rows, way)) | unsure[way]
        left = np.bincount(curve[~(met[:P] | met[P:])], minlength=M) > 0
        walk.going &= np.concatenate([left, left & ~walk.closed[:M]])
    return np.asarray(met[:P] | (met[P:] & ~walk.closed[curve]))
