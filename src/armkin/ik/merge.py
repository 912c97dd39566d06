"""One row a branch: equal answers merged, the rest sorted and packed by pose."""

import numpy as np
from numpy.typing import NDArray

from .polish import Array, Bool, pose_error

Int = NDArray[np.int64]

SAME = 1e-6  # answers closer than this [rad, scaled length] are one
NEAR = 1e-2  # answers closer than this are examined
MOST = 16

_WEIGHTS: Array = np.random.default_rng(11).uniform(-1, 1, (2, 6))


def merge(prismatic, chain, goal, count, pose, q, residual, weakness):
    key = np.where(prismatic, q, np.cos(q)) @ _WEIGHTS[0] + np.where(prismatic, q, np.sin(q)) @ _WEIGHTS[1]
    order = np.lexsort((key, pose))
    pose, q, residual, weakness, key = pose[order], q[order], residual[order], weakness[order], key[order]
    keep = np.ones(pose.size, bool)
    merged = np.zeros(count, bool)
    widest = np.abs(_WEIGHTS).sum() * NEAR
    for gap in range(1, 64):
        if gap >= pose.size:
            break
        close = np.flatnonzero((pose[gap:] == pose[:-gap]) & (key[gap:] - key[:-gap] < widest))
        if close.size == 0:
            break
        first, second = close, close + gap
        difference = q[second] - q[first]
        difference = np.where(prismatic, difference, difference - 2 * np.pi * np.round(difference / (2 * np.pi)))
        distance = np.abs(difference).max(axis=1)
        near = distance < NEAR
        first, second, difference, distance = first[near], second[near], difference[near], distance[near]
        if first.size == 0:
            continue
        halfway = (q[first] + difference / 2).T
        target = np.ascontiguousarray(np.moveaxis(goal[pose[first], :3], 0, -1))
        size = pose_error(chain, prismatic, halfway, target)[1]
        same = (distance < SAME) | (size < np.maximum(1e-13, 4 * np.maximum(residual[first], residual[second])))
        first, second = first[same], second[same]
        worse = residual[second] > residual[first]
        both = keep[first] & keep[second]
        keep[np.where(worse, second, first)[both]] = False
        merged[pose[first[distance[same] > 1e-8]]] = True
    pose, q, weakness = pose[keep], q[keep], weakness[keep]
    number = np.bincount(pose, minlength=count)
    start = np.concatenate([[0], np.cumsum(number)[:-1]])
    column = np.arange(pose.size) - start[pose]
    out = np.full((count, int(number.max(initial=0)), 6), np.nan)
    out[pose, column] = q
    return out, merged
