"""Postures in which several self-motions meet, replaced by a posture of each of these.

Two or more directions are lost where they meet, and a root there is known to the root of rounding only: it lies on all
of the self-motions and on none. A long step away on each of them one direction is lost, and the posture is right to
rounding.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array
from armkin.inverse.answers.batch import Goals
from armkin.inverse.numeric import newton
from armkin.inverse.numeric.tolerances import ACCEPTED, HIGH, SOLUTION
from armkin.inverse.singular.self_motions import STEP, follow, null_directions, on_surface
from armkin.inverse.tasks.task import Task
from armkin.model.units import radian_or_reach

if TYPE_CHECKING:
    from armkin.model.arm import Arm

BOW = 0.1  # of its length: a curve is no farther off its chord

Int = NDArray[np.int64]


def ways_out(
    goals: Goals, q: Array, label: Int, size: Array, V: Array, nullity: Int, none: int
) -> tuple[Array, Int, Array]:
    """Candidates (K, M, n) with their labels and residuals (K, M), and postures of self-motions for those that meet.

    The first of a target, `near`, stays where it is. Others that no self-motion leaves stay, too: roots of
    high order, and postures of surfaces. V, nullity: what they lose, (K, M, n, n) and (K, M). none: the label
    of what is no candidate.
    """
    arm, task, target, _ = goals
    k, b = np.nonzero((size[:, 1:] <= SOLUTION) & (nullity[:, 1:] > 1))
    b += 1
    V, nullity = V[k, b], nullity[k, b]
    rounded = np.rint(newton.difference(arm, q[k, b], np.zeros(arm.n)) / HIGH)
    _, first, same = np.unique(np.column_stack([k, rounded]), axis=0, return_index=True, return_inverse=True)
    at, row = q[k[first], b[first]], k[first]
    most = np.maximum(ACCEPTED, 2.0 * size[row, b[first]])
    who, there = _steps_out(arm, task, at, V[first], nullity[first], target[row], most)
    left = np.isin(same.reshape(-1), who)
    size[k[left], b[left]] = np.inf
    order = np.argsort(row[who], kind="stable")
    who, there = who[order], there[order]
    row, whose = row[who], label[k[first], b[first]][who]
    place = np.arange(len(row)) - np.searchsorted(row, row)
    shape = len(q), int(place.max(initial=-1)) + 1
    more, labels, sizes = np.full((*shape, arm.n), np.nan), np.full(shape, none), np.full(shape, np.inf)
    more[row, place], labels[row, place] = there, whose
    sizes[row, place] = newton.missing(arm, task, there, target[row])
    return np.concatenate([q, more], 1), np.concatenate([label, labels], 1), np.concatenate([size, sizes], 1)


def _steps_out(arm: Arm, task: Task, q: Array, V: Array, nullity: Int, target: Array, most: Array) -> tuple[Int, Array]:
    """Postures (m, n) on self-motions that leave meetings (M, n), a long step off, and whose: (m,).

    most: (M,) residual of what counts as on one: points beside a self-motion of double roots have more.
    """
    rows = np.flatnonzero(~on_surface(arm, task, q, V, target))
    if not len(rows):
        return rows, np.zeros((0, arm.n))
    who, push = null_directions(arm.n, V[rows], nullity[rows])
    who = rows[who]
    unit = radian_or_reach(arm)
    there, size = follow(arm, task, q[who] + 10 * STEP * push * unit, target[who])
    way = newton.difference(arm, there, q[who])
    some = np.flatnonzero((size <= most[who]) & (np.abs(way).max(axis=1) > 3 * STEP))
    some = some[newton.null_space(arm, task, there[some], target[who[some]])[2] == 1]
    # the way there is a self-motion's, too: half way it is beside the chord by no more than a curve is
    start = q[who[some]] + 0.5 * way[some] * unit
    between, size = follow(arm, task, start, target[who[some]])
    beside = np.abs(newton.difference(arm, between, start)).max(axis=1)
    some = some[(size <= SOLUTION) & (beside < BOW * np.abs(way[some]).max(axis=1))]
    return who[some], there[some]
