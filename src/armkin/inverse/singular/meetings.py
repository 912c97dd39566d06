"""Postures in which several self-motions meet, replaced by a posture of each of these.

Two or more directions are lost where they meet, and a root there is known to the root of rounding only: it lies on all
of the self-motions and on none. A long step away on each of them one direction is lost, and the posture is right to
rounding.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool
from armkin.inverse.answers.batch import Goals
from armkin.inverse.numeric import newton
from armkin.inverse.numeric.tolerances import ACCEPTED, GROWTH, HIGH, SOLUTION
from armkin.inverse.singular.self_motions import STEP, follow, null_directions, on_surface, pushed
from armkin.inverse.tasks.task import Task
from armkin.model.units import radian_or_reach

if TYPE_CHECKING:
    from armkin.model.arm import Arm

BOW = 0.1  # of its length: a curve is no farther off its chord

Int = NDArray[np.int64]


def ways_out(
    goals: Goals, q: Array, label: Int, size: Array, V: Array, nullity: Int, none: int
) -> tuple[Array, Int, Array, Bool]:
    """Candidates (K, M, n) with their labels and residuals (K, M), and postures of self-motions for those that meet.

    The first of a target, `near`, stays where it is. Others that no self-motion leaves stay, too: roots of
    high order, and postures of surfaces. V, nullity: what they lose, (K, M, n, n) and (K, M). none: the label
    of what is no candidate. Also which of them (K, M) rest: no push takes them along a self-motion.
    """
    arm, task, target, _ = goals
    k, b = np.nonzero((size[:, 1:] <= SOLUTION) & (nullity[:, 1:] > 1))
    b += 1
    V, nullity = V[k, b], nullity[k, b]
    rounded = np.rint(newton.difference(arm, q[k, b], np.zeros(arm.n)) / HIGH)
    _, first, same = np.unique(np.column_stack([k, rounded]), axis=0, return_index=True, return_inverse=True)
    at, row = q[k[first], b[first]], k[first]
    most = np.maximum(ACCEPTED, 2.0 * size[row, b[first]])
    who, there, rests = _steps_out(arm, task, at, V[first], nullity[first], target[row], most)
    size[k, b] = np.where(np.isin(same.reshape(-1), who), np.inf, size[k, b])
    order = np.argsort(row[who], kind="stable")
    who, there = who[order], there[order]
    whose, row = label[k[first], b[first]][who], row[who]
    place = np.arange(len(row)) - np.searchsorted(row, row)
    shape = len(q), int(place.max(initial=-1)) + 1
    more, labels, sizes = np.full((*shape, arm.n), np.nan), np.full(shape, none), np.full(shape, np.inf)
    more[row, place], labels[row, place] = there, whose
    sizes[row, place] = newton.missing(arm, task, there, target[row])
    resting = np.zeros((len(q), q.shape[1] + shape[1]), bool)
    resting[k, b] = rests[same.reshape(-1)]
    return np.concatenate([q, more], 1), np.concatenate([label, labels], 1), np.concatenate([size, sizes], 1), resting


def _steps_out(
    arm: Arm, task: Task, q: Array, V: Array, nullity: Int, target: Array, most: Array
) -> tuple[Int, Array, Bool]:
    """Postures (m, n) on self-motions that leave meetings (M, n), a long step off, and whose: (m,).

    most: (M,) residual of what counts as on one: points beside a self-motion of double roots have more. Also which
    meetings (M,) all pushes fall back to.
    """
    rests = ~on_surface(arm, task, q, V, target)
    rows = np.flatnonzero(rests)
    if not len(rows):
        return rows, np.zeros((0, arm.n)), rests
    who, push = null_directions(arm.n, V[rows], nullity[rows])
    who = rows[who]
    there, size, grown = pushed(arm, task, q[who], np.full(len(who), 10 * STEP), push, target[who])
    rests[who[grown <= GROWTH]] = False
    unit, way = radian_or_reach(arm), newton.difference(arm, there, q[who])
    some = np.flatnonzero((size <= most[who]) & (np.abs(way).max(axis=1) > 3 * STEP))
    some = some[newton.null_space(arm, task, there[some], target[who[some]])[2] == 1]
    # the way there is a self-motion's, too: half way it is beside the chord by no more than a curve is
    start = q[who[some]] + 0.5 * way[some] * unit
    between, size = follow(arm, task, start, target[who[some]])
    beside = np.abs(newton.difference(arm, between, start)).max(axis=1)
    some = some[(size <= SOLUTION) & (beside < BOW * np.abs(way[some]).max(axis=1))]
    return who[some], there[some], rests
