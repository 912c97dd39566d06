"""Branches that move by themselves, brought within the joint limits where their self-motion passes through these.

A self-motion is listed by the posture on it that is closest to `near`, which may lie outside limits that other postures
of it keep. From some postures within the limits alternating projections lead to one that both keeps the limits and
solves the target: onto the limits by clipping, onto the target by steps of least norm.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armkin.inverse import circuits
from armkin.inverse.branches.turns import nearest_row
from armkin.inverse.numeric import newton
from armkin.inverse.numeric.tolerances import SOLUTION, TURNED, WEAK
from armkin.model import limits

if TYPE_CHECKING:
    from armkin.formula.arrays import Array, Bool
    from armkin.inverse.batch import Goals

STARTS = 8  # postures that each branch is sought from
ROUNDS = 40  # projections onto the limits and onto the target
SLOW = 1e-3  # a joint that moves by less than this of the fastest is held
MARGIN = 1e-3  # [rad, mm] inside of limits that is aimed at, so that it takes finitely many rounds
INSIDE = np.random.default_rng(11).uniform(0.0, 1.0, (STARTS - 2, 64))  # places between limits to start from


def into_limits(goals: Goals, q: Array, valid: Bool, free: Bool) -> Array:
    """Branches (K, B, n), those outside limits moved along their free joints (K, n) to within, where that can be."""
    arm = goals.arm
    k = np.flatnonzero(free.any(axis=1) & valid.any(axis=1))
    if not len(k):
        return q
    rows, legal = nearest_row(arm, q[k], goals.near[k, None])
    some, b = np.nonzero(valid[k] & ~legal)
    sigma, V, lost = newton.null_space(arm, goals.task, q[k[some], b], goals.target[k[some]])
    way = np.abs(V[:, -1])
    # the branch's own joints: others may move on other self-motions of the target; where two meet, neither is followed
    own = (way > SLOW * way.max(axis=1, keepdims=True)) & free[k[some]]
    stuck = (limits.outside(arm, rows[some, b]) & ~own).any(axis=1)
    # exact answers beside a self-motion may be several: moved, one of them would be another within limits
    apart = np.abs(newton.difference(arm, q[k[some]], q[k[some], b][:, None]))
    with np.errstate(invalid="ignore"):
        beside = np.where(own[:, None], 0.0, apart).max(axis=2) < 3 * TURNED
    twin = (beside & (valid[k] & legal)[some]).any(axis=1)
    able = (sigma < WEAK) & (lost == 1) & ~stuck & ~twin & (own.sum(axis=1) > 1)
    some, b, own = some[able], b[able], own[able]
    if not len(some):
        return q
    at = goals.of(k[some])
    moved = _moved(at, rows[some, b], own)
    # a curve of two joints is one piece; of more it may have several, of which others are other branches
    far = ~np.isnan(moved[:, 0]) & (own.sum(axis=1) > 2)
    on = circuits.on_one(arm, at.task, rows[some, b], own, moved[:, None], far[:, None], at.target)[:, 0]
    moved[~on] = np.nan
    out = q.copy()
    found = ~np.isnan(moved[:, 0])
    out[k[some[found]], b[found]] = moved[found]
    return out


def _moved(goals: Goals, q: Array, free: Bool) -> Array:
    """Postures (M, n) on the self-motions of others, within limits and closest to `near` of those found; else nan."""
    arm, task, target, near = goals
    M, n = q.shape
    width = arm.upper - arm.lower
    margin = np.minimum(MARGIN, width / 8)
    low, high, bounded = arm.lower + margin, arm.upper - margin, np.isfinite(width)
    between = np.where(bounded, low, -np.pi) + INSIDE[:, :n] * np.where(bounded, width - 2 * margin, 2 * np.pi)
    starts = np.concatenate([q[:, None], near[:, None], np.broadcast_to(between, (M, *between.shape))], axis=1)
    starts = np.where(free[:, None], starts, q[:, None]).reshape(-1, n)
    held, whose = np.repeat(q, STARTS, axis=0), np.repeat(np.arange(M), STARTS)
    best, least = np.full((M, n), np.nan), np.full(M, np.inf)
    active = np.arange(len(starts))
    for _ in range(ROUNDS):
        at = whose[active]
        clipped = np.where(free[at], np.clip(starts[active], low, high), starts[active])
        onto, size = newton.correct(arm, task, clipped, target[at], steps=6)
        rows, legal = nearest_row(arm, onto, near[at])
        turned = np.abs(newton.difference(arm, onto, held[active]))
        same = (np.where(free[at], 0.0, turned).max(axis=1) < 3 * TURNED) & (size <= SOLUTION)
        motion = np.where(legal & same, np.abs(rows - near[at]).sum(axis=1), np.inf)
        for row in np.flatnonzero(motion < np.inf):
            if motion[row] < least[at[row]]:
                best[at[row]], least[at[row]] = rows[row], motion[row]
        starts[active] = rows
        active = active[~(legal & same)]
        if not len(active):
            break
    return best
