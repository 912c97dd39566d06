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
from armkin.inverse.singular import curves
from armkin.inverse.singular.curves import Curves
from armkin.inverse.tasks.task import Task

if TYPE_CHECKING:
    from armkin.model.arm import Arm


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
    (ahead, crossing), closed = curves.directions(arm, task, q, joints, target), np.zeros(len(q), bool)
    posture, met = others[who, column], crossing[who]
    for way in (ahead, -ahead):
        left = np.bincount(who[~met], minlength=len(q)) > 0
        rows = np.flatnonzero(~closed & left)
        if len(rows):
            some = np.flatnonzero(~met & ~closed[who])
            walk = Curves(arm, task, q[rows], joints[rows], target[rows], way[rows])
            met[some] = _met(arm, walk, np.searchsorted(rows, who[some]), posture[some])
            closed[rows] = walk.closed
    on[who, column] = met
    return on


def _met(arm: Arm, walk: Curves, who: NDArray[np.intp], posture: Array) -> Bool:
    """Which postures (P, n) the who-th of these curves meet, until each has met all of its own: (P,)."""
    met = np.zeros(len(who), bool)
    while walk.going.any():
        step = walk.step()
        unsure = np.zeros(len(walk.at), bool)
        unsure[step.rows] = step.unsure
        some = np.flatnonzero(~met & np.isin(who, step.rows))
        met[some] = step.passes(arm, posture[some], np.searchsorted(step.rows, who[some])) | unsure[who[some]]
        walk.going &= np.bincount(who[~met], minlength=len(walk.at)) > 0
    return met
