"""Valleys: near a root of high order the residual hardly grows along a curve, and rounding makes several roots of one.

Two of them are one branch if a posture between them solves the target as well: the one half way, or, where the valley
is curved, the one beside it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armkin.formula.arrays import Array, Bool
from armkin.inverse.numeric import newton
from armkin.inverse.numeric.tolerances import HIGH, SOLUTION
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
    Steps back into the valley leave out directions weaker than `HIGH`.
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
