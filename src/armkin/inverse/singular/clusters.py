"""Clusters of candidates: what rounding makes of one root of third or fourth order."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armkin.formula.arrays import Array
from armkin.inverse.numeric import newton
from armkin.inverse.numeric.tolerances import CLUSTER
from armkin.model.units import radian_or_reach

if TYPE_CHECKING:
    from armkin.model.arm import Arm


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
