"""Steps from joint values to others: the shorter way round, and how far the tip may leave its chord on them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armkin.formula.arrays import Array
from armkin.model.units import TURN

if TYPE_CHECKING:
    from armkin.model.arm import Arm

MIN_LEVER = 30.0  # lever [mm], at least, of a turn that does not move the tip: the tool's direction counts, too


def levers(arm: Arm) -> Array:
    """Bounds of the second derivatives of the tip's position by two joints: (n, n) [mm/rad^2, ...]."""
    n = arm.n
    size = np.linalg.norm(arm.link[1:, :3, 3], axis=1)
    far = np.maximum(np.abs(arm.lower), np.abs(arm.upper))
    size = size + np.where(arm.prismatic, np.where(np.isfinite(far), far, arm.reach), 0.0)
    beyond = np.cumsum(size[::-1])[::-1]  # distance from each joint's axis to the tip, at most
    bounds = np.zeros((n, n))
    for j in range(n):
        for k in range(n):
            first, later = min(j, k), max(j, k)
            if arm.prismatic[first]:
                bounds[j, k] = 0.0
            else:
                bounds[j, k] = 1.0 if arm.prismatic[later] else max(beyond[later], MIN_LEVER)
    return np.asarray(bounds * np.outer(arm.ratio, arm.ratio))


def chord_bound(lever: Array, D: Array) -> Array:
    """How far the tip may leave its chord on straight joint steps D (..., n): (...) [mm]."""
    size = np.abs(D)
    return np.asarray(0.125 * np.einsum("...i,...i->...", size @ lever, size))


def largest_form(arm: Arm, lever: Array) -> tuple[Array | None, float]:
    """Scales of joints (n,) (None: all 1) and c, with `chord_bound` at most c |scaled D|^2: cheap to compute."""
    scale = np.where(arm.prismatic, 1.0 / arm.reach, 1.0)
    top = 0.125 * float(np.linalg.eigvalsh(lever / np.outer(scale, scale)).max())
    return (np.asarray(scale) if arm.prismatic.any() else None), top


def whole_turns(arm: Arm) -> Array:
    """What a whole turn is in commanded values, for every joint: (n,) [rad]. A joint's ratio makes it more or less."""
    return np.asarray(TURN / arm.ratio)


def joint_change(arm: Arm, a: Array, b: Array) -> Array:
    """From joint values to others, the shorter way round: (..., n)."""
    D: Array = b - a
    turn = whole_turns(arm)
    turns = D * (~arm.prismatic / turn)
    np.rint(turns, out=turns)
    turns *= turn
    D -= turns
    return D
