"""Branches that follow all targets of a path from a place.

A branch continues from a target to the next if no joint turns by `MAX_TURN` or more between them, so that the motion of
each joint is unique up to whole turns. It has to be within the limits and to hit nothing at all targets; the motion
between targets is checked when the best places are planned.
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

MAX_TURN = 0.5 * math.pi  # turn [rad] of a joint between targets from which on a branch is interrupted


def branch_ranges(solutions: Solutions, is_free: Bool) -> tuple[Bool, Array, Array]:
    """Which branches follow all targets (B,), and their least and greatest joint values (B, n), whatever the limits.

    solutions: of the targets in their order (S, ...); is_free: (S, B) which postures hit nothing.
    """
    number = solutions.branch  # a branch keeps its number along a path
    S, B, n = solutions.q.shape
    values = np.full((S, max(B, int(number.max(initial=-1)) + 1), n), np.nan)
    is_usable = solutions.valid & is_free & (number >= 0)
    row = np.broadcast_to(np.arange(S)[:, None], (S, B))
    values[row[is_usable], number[is_usable]] = solutions.q[is_usable]
    step = np.diff(values, axis=0)
    revolute = ~solutions.arm.prismatic
    step[:, :, revolute] -= TURN * np.rint(step[:, :, revolute] / TURN)
    with np.errstate(invalid="ignore"):
        is_complete = np.asarray(
            ~np.isnan(values).any(axis=(0, 2)) & ~(np.abs(step[:, :, revolute]) >= MAX_TURN).any(axis=(0, 2))
        )
    unwrapped_values = np.concatenate([values[:1], values[:1] + np.cumsum(step, axis=0)])
    return is_complete, unwrapped_values.min(axis=0), unwrapped_values.max(axis=0)


def some_copy_legal(arm: Arm, low: Array, high: Array, joints: range) -> Bool:
    """Whether the motions of these joints from low to high (..., n) have copies within limits: (...)."""
    is_legal = np.ones(low.shape[:-1], bool)
    for joint in joints:
        lower, upper = float(arm.lower[joint]) - SLACK, float(arm.upper[joint]) + SLACK
        first = low[..., joint]
        if not arm.prismatic[joint] and math.isfinite(lower):
            first = first + TURN * np.ceil((lower - first) / TURN)
        elif not arm.prismatic[joint] and math.isfinite(upper):
            continue  # with an upper limit only, some copy is below it
        is_legal &= (first >= lower) & (first + (high[..., joint] - low[..., joint]) <= upper)
    return is_legal


def branch_arc(arm: Arm, low: Array, high: Array, count: int, sense: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Turns i 2 pi / count for which the motion of joint 1, low to high (B,) plus sense times the turn, is legal.

    Returns the first index and the length of each arc.
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
