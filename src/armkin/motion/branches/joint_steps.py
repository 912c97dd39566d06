"""Joint steps the shorter way round, and bounds of how far the tip leaves its chord on such a step."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armkin.formula.arrays import Array
from armkin.model.units import TURN

if TYPE_CHECKING:
    from armkin.model.arm import Arm

MIN_LEVER = 30.0  # smallest lever [mm], so that a joint that only turns the tool counts as well


def levers(arm: Arm) -> Array:
    """Bounds of the second derivatives of the tip's position by two joints: (n, n) [mm/rad^2, ...]."""
    n = arm.n
    size = np.linalg.norm(arm.link[1:, :3, 3], axis=1)
    largest = np.maximum(np.abs(arm.lower), np.abs(arm.upper))
    size = size + np.where(arm.prismatic, np.where(np.isfinite(largest), largest, arm.reach), 0.0)
    reach_beyond = np.cumsum(size[::-1])[::-1]  # distance from each joint's axis to the tip, at most
    bounds = np.zeros((n, n))
    for row in range(n):
        for column in range(n):
            first, second = min(row, column), max(row, column)
            if arm.prismatic[first]:
                bounds[row, column] = 0.0
            else:
                bounds[row, column] = 1.0 if arm.prismatic[second] else max(reach_beyond[second], MIN_LEVER)
    return np.asarray(bounds * np.outer(arm.ratio, arm.ratio))


def chord_bound(lever: Array, change: Array) -> Array:
    """How far the tip may leave its chord on straight joint steps (..., n): (...) [mm]."""
    size = np.abs(change)
    return np.asarray(0.125 * np.einsum("...i,...i->...", size @ lever, size))


def largest_form(arm: Arm, lever: Array) -> tuple[Array | None, float]:
    """Joint scales (n,) (None: all 1) and a factor c such that `chord_bound` is at most c |scaled D|^2."""
    scale = np.where(arm.prismatic, 1.0 / arm.reach, 1.0)
    factor = 0.125 * float(np.linalg.eigvalsh(lever / np.outer(scale, scale)).max())
    return (np.asarray(scale) if arm.prismatic.any() else None), factor


def whole_turns(arm: Arm) -> Array:
    """A whole turn of every joint in commanded values, which differ from joint angles by the ratio: (n,) [rad]."""
    return np.asarray(TURN / arm.ratio)


def joint_change(arm: Arm, a: Array, b: Array) -> Array:
    """The joint step from a to b, the shorter way round: (..., n)."""
    D: Array = b - a
    turn = whole_turns(arm)
    turns = D * (~arm.prismatic / turn)
    np.rint(turns, out=turns)
    turns *= turn
    D -= turns
    return D
