"""Roots of high order: what rounding makes of one, and which of those are one branch.

Near such a root the residual hardly grows along a curve. Of a root of third or fourth order rounding leaves three or
four candidates, whose mean is right; two are one branch if a posture between them solves the target as well: the one
half way, or, where the curve bends, the one beside it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool
from armkin.inverse.numeric import newton
from armkin.inverse.numeric.tolerances import (
    CLOSE_BY,
    CLUSTER,
    DOUBLE_ROOT,
    HIGH,
    ROOT_ROUNDING,
    SAME,
    SOLUTION,
    TINY,
)
from armkin.inverse.tasks.task import Task
from armkin.model.units import radian_or_reach

if TYPE_CHECKING:
    from armkin.model.arm import Arm

BESIDE = 0.1  # of the distance between two: as far as a posture beside the one half way may be from it
ROOT = 0.03  # of that distance: an exact root's next Newton step is shorter, that of a point off one of order 16 longer


def joined(arm: Arm, task: Task, q: Array, way: Array, miss: Array, sigma: Array, target: Array) -> Bool:
    """Whether a posture between q (M, n) and q + way (M, n), in scaled units, solves the target: (M,).

    miss, sigma: (M,) residual and smallest singular value of the one whose Newton step, their quotient, is longer.
    Beside the posture half way is looked only where this one is no exact root: isolated roots have none in between.
    Steps back onto the curve leave out directions weaker than `HIGH`.
    """
    halfway = q + 0.5 * way * radian_or_reach(arm)
    out = newton.missing(arm, task, halfway, target) <= SOLUTION
    far = np.abs(way).max(axis=1)
    some = np.flatnonzero(~out & (sigma < HIGH) & (miss > ROOT * far * sigma))
    if len(some):
        third, size = newton.correct(arm, task, halfway[some], target[some], steps=3, least=HIGH)
        off = np.abs(newton.difference(arm, third, halfway[some])).max(axis=1)
        out[some] = (off < BESIDE * far[some]) & (size <= SOLUTION)
    return np.asarray(out)


def means(arm: Arm, q: Array) -> Array:
    """Candidates (K, B, n), the mean of its cluster for each that has two others around it.

    Of a root of third or fourth order rounding leaves three or four, off by its third or fourth root; their
    mean is right to rounding. Neighbours are found along a key that clusters hardly change, whatever B is.
    """
    weight = np.sqrt(np.arange(1, arm.n + 1))
    feature = np.where(arm.prismatic, q / arm.reach, np.sin(q - 0.3 * weight))  # changes no faster than q
    key = (feature * weight).sum(axis=2)
    order = np.argsort(key, axis=1)  # nan come last
    key, there = np.take_along_axis(key, order, axis=1), np.take_along_axis(q, order[:, :, None], axis=1)
    total, count = np.zeros_like(there), np.isfinite(key).astype(int)
    for step in range(1, q.shape[1]):
        row, one = np.nonzero(key[:, step:] - key[:, :-step] < CLUSTER * weight.sum())
        if not len(row):
            break
        away = newton.difference(arm, there[row, one + step], there[row, one])
        near = np.abs(away).max(axis=1) < CLUSTER
        row, one, away = row[near], one[near], away[near]
        for at, way in ((one, away), (one + step, -away)):
            total[row, at] += way
            count[row, at] += 1
    shift = np.where((count > 2)[..., None], total / np.maximum(count, 1)[..., None], 0.0)
    out = np.empty_like(q)
    np.put_along_axis(out, order[:, :, None], there + shift * radian_or_reach(arm), axis=1)
    return out


def alike(
    arm: Arm,
    task: Task,
    q: Array,
    k: NDArray[np.int64],
    b: NDArray[np.int64],
    away: Array,
    sigma: Array,
    size: Array,
    target: Array,
) -> Bool:
    """Which candidates are one with the b-th of their target: (k, M).

    Those that rounding explains, and those between which and it the posture in the middle solves the target.
    """
    with np.errstate(invalid="ignore"):
        same = away < _radius(np.minimum(sigma[k], sigma[k, b][:, None]))
        row, column = np.nonzero(~same & (away < CLOSE_BY))
    if len(row):
        start = q[k[row], b[row]]
        way = newton.difference(arm, q[k[row], column], start)
        # a pair's longer Newton step; of rounding alone the quotient says nothing
        one, other = (k[row], b[row]), (k[row], column)
        longer = size[other] * sigma[one] > size[one] * sigma[other]
        miss, weakest = (np.where(longer, values[other], values[one]) for values in (size, sigma))
        further = joined(arm, task, start, way, miss, weakest, target[k[row]])
        same[row, column] = further
        for i in np.unique(row[further]):  # and those that rounding alone parts from these
            there, some = q[k[i]], np.flatnonzero(same[i])
            with np.errstate(invalid="ignore"):
                apart = newton.wrapped_distance(arm, there[:, None], there[some])
                close = apart < _radius(np.minimum(sigma[k[i]][:, None], sigma[k[i], some]))
            same[i] |= close.any(axis=1)
    return np.asarray(same)


def _radius(sigma: Array) -> Array:
    """How far rounding may part two candidates of one root, the smaller of whose smallest singular values is sigma."""
    return SAME + np.minimum(ROOT_ROUNDING / np.maximum(sigma, TINY), DOUBLE_ROOT)
