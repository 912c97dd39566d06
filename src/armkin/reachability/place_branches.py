"""Which branches carry a way of the tool from a place: one branch from its first target to its last.

A branch goes on from a target to the next where no joint turns by `MAX_TURN` or more between them, so that its copies
by whole turns are one way of each joint; all of it lies within the limits, and hits nothing. This asks at targets
alone: what is between them is proved when the best places are planned.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool
from armkin.model.limits import SLACK
from armkin.model.units import TURN

if TYPE_CHECKING:
    from armkin.inverse.answers.solutions import Solutions
    from armkin.model.arm import Arm

MAX_TURN = 0.5 * math.pi  # turn [rad], at most, of a joint from one target to the next


def branch_ranges(s: Solutions, free: Bool) -> tuple[Bool, Array, Array]:
    """Branches that go all the way: which ones do (B,), and the least and greatest joint values on it (B, n).

    s: answers to targets in their order (S, ...); free: (S, B) which hit nothing. Of limits nothing is said.
    """
    number = s.branch  # a branch keeps its number along a path
    S, B, n = s.q.shape
    way = np.full((S, max(B, int(number.max(initial=-1)) + 1), n), np.nan)
    branch_there = s.valid & free & (number >= 0)
    row = np.broadcast_to(np.arange(S)[:, None], (S, B))
    way[row[branch_there], number[branch_there]] = s.q[branch_there]
    step = np.diff(way, axis=0)
    turning = ~s.arm.prismatic
    step[:, :, turning] -= TURN * np.rint(step[:, :, turning] / TURN)
    with np.errstate(invalid="ignore"):
        carries = np.asarray(
            ~np.isnan(way).any(axis=(0, 2)) & ~(np.abs(step[:, :, turning]) >= MAX_TURN).any(axis=(0, 2))
        )
    along = np.concatenate([way[:1], way[:1] + np.cumsum(step, axis=0)])
    return carries, along.min(axis=0), along.max(axis=0)


def some_copy_legal(arm: Arm, low: Array, high: Array, joints: range) -> Bool:
    """Whether some copies of the ways of these joints, from low to high (..., n), are within limits: (...)."""
    inside = np.ones(low.shape[:-1], bool)
    for j in joints:
        lower, upper = float(arm.lower[j]) - SLACK, float(arm.upper[j]) + SLACK
        first = low[..., j]
        if not arm.prismatic[j] and math.isfinite(lower):
            first = first + TURN * np.ceil((lower - first) / TURN)
        elif not arm.prismatic[j] and math.isfinite(upper):
            continue  # a limit on one side alone: some copy is below it
        inside &= (first >= lower) & (first + (high[..., j] - low[..., j]) <= upper)
    return inside


def branch_arc(arm: Arm, low: Array, high: Array, count: int, sense: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Turns i 2 pi / count by which joint 1's way, from low to high (B,) plus sense times the turn, is within limits.

    Returns the first of each arc, and how many.
    """
    lower, upper = float(arm.lower[0]) - SLACK, float(arm.upper[0]) + SLACK
    if sense < 0:
        low, high = -high, -low
        lower, upper = -upper, -lower
    if not (math.isfinite(lower) and math.isfinite(upper)):
        return np.zeros(low.shape, np.intp), np.full(low.shape, count)
    step, low, high = TURN / count, np.nan_to_num(low), np.nan_to_num(high)
    first, last = np.ceil((lower - low) / step), np.floor((upper - high) / step)
    length = np.clip(last - first + 1, 0, count).astype(np.intp)
    return (first % count).astype(np.intp), length
