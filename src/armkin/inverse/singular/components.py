"""Targets on an edge: merging roots, singular postures, self-motions, boundaries.

The solvers say which targets are in doubt; these few are examined here, posture by posture, with the
Jacobian: the general mechanism behind the words exact, boundary, singular and unreachable. Candidate
postures of a target are moved onto it, and grouped: what lies on one self-motion is reported by one of
its postures, two postures between which a third solves the target as well are one branch.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool
from armkin.inverse.answers.batch import Goals
from armkin.inverse.answers.solutions import Status
from armkin.inverse.numeric import newton
from armkin.inverse.numeric.many_starts import many_starts
from armkin.inverse.numeric.tolerances import (
    CLOSE_BY,
    DOUBLE,
    DOUBLE_ROOT,
    EQUAL_RESIDUALS,
    FOLDED,
    HOPELESS,
    MOVING,
    RESTING,
    ROOT_ROUNDING,
    SAME,
    SEED,
    SOLUTION,
    TINY,
    TURNED,
)
from armkin.inverse.singular import circuits, meetings, roots, self_motions
from armkin.inverse.singular.local_structure import local_structure, members
from armkin.inverse.tasks.task import Task

if TYPE_CHECKING:
    from armkin.model.arm import Arm


AT_ONCE = 128  # candidates of which it is cheaper to ask all together than one after the other
PATIENCE = 6  # steps that bring hardly anything after which a candidate is left where it is
OWN = -1  # label of a posture that comes from `near`

Int = NDArray[np.int64]
# For targets (rows of those examined) and whether branches seem lost: more postures to start from (rows, M, n), and
# their branches (M,).
More = Callable[[Int, Bool], tuple[Array, Int]]


class Examined(NamedTuple):
    """What is known of K targets.

    q: (K, W, n) branches, nan past the last.  valid: (K, W).  label: (K, W) the branch that a posture is, of the
    solver's own numbering.  status: (K,).  free: (K, n).  again: (K,) more postures had to be tried.
    """

    q: Array
    valid: Bool
    label: Int
    status: NDArray[np.int8]
    free: Bool
    again: Bool


class _Settled(NamedTuple):
    """The same; whether a loose candidate came to nothing, and whether a self-motion is a surface, (K,) each."""

    q: Array
    valid: Bool
    label: Int
    status: NDArray[np.int8]
    free: Bool
    open: Bool
    surface: Bool


def examine(goals: Goals, q: Array, label: Int, loose: Bool, more: More, unsettled: Bool | None = None) -> Examined:
    """Correct, group and classify candidate branches of doubted targets.

    goals: K targets; `near` is a branch itself where it solves its target. q: (K, B, n), nan where there is none;
    label: (B,); loose: (K, B) candidates that depend on a value preferred for a free joint; more: others, for
    targets that seem to have no branch, for those of which the preferred value leaves the other joints no solution,
    and for self-motions that may meet others; unsettled: (K,) targets whose candidates may not be all, of a solver
    that loses singular ones: more are asked for these and for what is singular.
    """
    found = _settle(goals, q, np.broadcast_to(label, q.shape[:2]), loose, SEED)
    again = found.open | found.surface | ~found.valid.any(axis=1)
    if unsettled is None:
        # a self-motion of joints more than one apart goes through postures in which others move, too
        first, last = found.free.argmax(axis=1), goals.arm.n - 1 - found.free[:, ::-1].argmax(axis=1)
        wider = again | found.free.any(axis=1) & (last - first > 2)
    else:
        wider = again | unsettled | (found.status != Status.EXACT)
    if not wider.any():
        return Examined(*found[:5], np.zeros(len(q), bool))
    rows = np.flatnonzero(wider)
    others, labels = more(rows, again[rows])
    surface = found.surface[rows]  # another self-motion may meet it along a line, or at a point
    if unsettled is None and surface.any():  # else `more` has searched from there already
        starts = many_starts(goals.arm, goals.task, goals.target[rows], surface)
        others, labels = np.concatenate([others, starts], axis=1), np.append(labels, np.zeros(starts.shape[1], int))
    there = again[rows] | ~np.isnan(others[:, :, 0]).all(axis=1)
    rows, others = rows[there], others[there]
    if not len(rows):
        return Examined(*found[:5], again)
    again[rows] &= ~np.isnan(others[:, :, 0]).all(axis=1)  # nothing anywhere near: out of reach, and known to be
    seeds = np.concatenate([found.q[rows], others], axis=1)
    whose = np.concatenate([found.label[rows], np.broadcast_to(labels, others.shape[:2])], axis=1)
    second = _settle(goals.of(rows), seeds, whose, np.zeros(seeds.shape[:2], bool), HOPELESS)
    K, n = found.free.shape
    width = max(found.q.shape[1], second.q.shape[1])
    out = Examined(
        np.full((K, width, n), np.nan), np.zeros((K, width), bool), np.full((K, width), OWN), found.status, found.free,
        again,
    )  # fmt: skip
    for some, part in ((np.arange(K), found), (rows, second)):
        out.q[some], out.valid[some], out.label[some] = np.nan, False, OWN
        own = part.q.shape[1]
        out.q[some, :own], out.valid[some, :own], out.label[some, :own] = part.q, part.valid, part.label
        out.status[some], out.free[some] = part.status, part.free
    return out


def _settle(goals: Goals, q: Array, label: Int, loose: Bool, seed: float) -> _Settled:
    """Candidates (K, M, n) with their labels (K, M), moved onto their targets and grouped; seed: see `tolerances`."""
    arm, task, target, near = goals
    K, _, n = q.shape
    q, label, size = _onto(goals, q, label, seed)
    missed = loose & (size[:, 1:] > SOLUTION)
    q, label, size = meetings.ways_out(goals, q, label, size, OWN)
    valid = size <= SOLUTION
    M = q.shape[1]
    sigma, nullity, V = np.ones((K, M)), np.zeros((K, M), np.int64), np.zeros((K, M, n, n))
    k, b = np.nonzero(valid)
    if len(k):
        sigma[k, b], V[k, b], nullity[k, b] = newton.null_space(arm, task, q[k, b], target[k])
    # where one direction alone is lost, joints that rest there and on a part of the self-motion rest on all of it
    resting = (nullity == 1)[:, :, None] & (np.abs(V[:, :, -1]) < RESTING)
    # `near` speaks for its group, else the most exact: what lies between two branches must not make them one
    rank = np.maximum(size, EQUAL_RESIDUALS)
    rank[:, 0] = 0.0
    group = np.where(valid, -1, M)  # which candidate stands for each one
    free, singular, double = np.zeros((K, n), bool), np.zeros(K, bool), np.zeros(K, bool)
    moves, which, asked = np.zeros((K, M), bool), np.zeros((K, M, n), bool), ~(valid & (sigma < FOLDED))

    known, edge = np.zeros((K, M), bool), np.zeros((K, M), bool)
    place, component = np.zeros((K, M), np.int64), np.zeros((0, M), bool)

    def ask(k: Int, b: Int) -> None:
        """What components these candidates lie on, if that is not known."""
        nonlocal component
        some = np.flatnonzero(~asked[k, b])
        if not len(some):
            return
        k, b = k[some], b[some]
        asked[k, b] = True
        one = np.flatnonzero(nullity[k, b] < 2)
        if len(one):
            i, c = k[one], b[one]
            at = local_structure(arm, task, q[i, c], target[i])
            known[i, c], moves[i, c], which[i, c], edge[i, c] = at.known, at.manifold, at.joints, at.boundary
            place[i, c] = len(component) + np.arange(len(i))
            ways = newton.difference(arm, q[i], q[i, c][:, None])
            component = np.concatenate([component, members(at, np.arange(len(i)), ways)])
        rest = np.flatnonzero(~known[k, b] & (sigma[k, b] < MOVING))
        if len(rest):
            k, b = k[rest], b[rest]
            lost = np.maximum(nullity[k, b], 1)
            moves[k, b], which[k, b] = self_motions.self_motion(arm, task, q[k, b], V[k, b], lost, target[k])

    if (~asked).sum() <= AT_ONCE:
        ask(*np.nonzero(~asked))
    chosen, curve = np.zeros((K, M), bool), np.zeros((K, M, n), bool)
    while (group < 0).any():
        k = np.flatnonzero((group < 0).any(axis=1))
        b = np.where(group[k] < 0, rank[k], np.inf).argmin(axis=1)
        ask(k, b)
        moving, joints = moves[k, b], which[k, b]
        away = np.abs(newton.difference(arm, q[k], q[k, b][:, None]))  # (k, M, n)
        rest = group[k] < 0
        # of a self-motion: whatever differs in its free joints alone; but where the residual grows along it at all,
        # its points are not equal, and the exact ones are listed
        held = np.where(joints[:, None], 0.0, away).max(axis=2)
        # (two postures of it, each off by as much as a double root)
        mine = rest & moving[:, None] & (held < 3 * TURNED) & (sigma[k] < SOLUTION)
        sure = known[k, b]
        one, some = component[place[k, b]] if len(component) else np.zeros((len(k), M), bool), np.flatnonzero(~sure)
        if len(some):
            one[some] = _joined(arm, task, q, k[some], b[some], away[some].max(axis=2), sigma, size, target)
        one &= rest
        mine |= one & (sure & moving)[:, None]
        far = mine & ~one & (joints.sum(axis=1) > 2)[:, None]
        if (some := np.flatnonzero(far.any(axis=1))).size:
            at, goal = q[k[some], b[some]], target[k[some]]
            mine[some] &= circuits.on_one(arm, task, at, joints[some], q[k[some]], far[some], goal)
            i, c = np.nonzero(far & mine & (resting[k] & joints[:, None]).any(axis=2))  # where another curve crosses
            ask(k[i], c)
            rests = resting[k[i], c] & ~which[k[i], c]
            mine[i, c] &= ~(moves[k[i], c] & (joints[i] & rests).any(axis=1))
        mine[np.arange(len(k)), b] = True
        on = mine  # but not what is one with it along a curve beside the self-motion
        mine = on | one
        group[k] = np.where(mine, b[:, None], group[k])
        other = (one & (away.max(axis=2) > SAME)).any(axis=1) | (~moving & (sigma[k, b] < DOUBLE))
        double[k] |= np.where(sure, edge[k, b], other)
        singular[k] |= moving
        free[k] |= joints & moving[:, None]
        # `near` itself comes first; else the posture of a self-motion that is closest to it, the most exact of others
        motion = np.abs(newton.difference(arm, q[k], near[k][:, None])).sum(axis=2)
        pick = np.where(moving[:, None], np.where(on, motion, np.inf), np.where(mine, size[k], np.inf)).argmin(axis=1)
        own = np.flatnonzero(label[k, b] == OWN)
        pick[own] = b[own]
        chosen[k, pick] = True
        curve[k, pick] = joints & moving[:, None]
        if len(own):  # named like the candidate of its group that is closest to it
            alike = np.where(mine[own] & (label[k[own]] != OWN), motion[own], np.inf)
            twin = alike.argmin(axis=1)
            label[k[own], b[own]] = np.where(np.isinf(alike.min(axis=1)), OWN, label[k[own], twin])
    self_motions.drop_contained(arm, task, q, sigma, resting, chosen, curve, target)
    self_motions.drop_twins(arm, task, q, chosen, curve, target)
    order = np.argsort(~chosen, axis=1, kind="stable")[:, : max(int(chosen.sum(axis=1).max(initial=0)), 1)]
    there = np.take_along_axis(chosen, order, axis=1)
    out = np.where(there[:, :, None], np.take_along_axis(q, order[:, :, None], axis=1), np.nan)
    status = np.where(there.any(axis=1), Status.EXACT, Status.UNREACHABLE).astype(np.int8)
    status[double] = Status.BOUNDARY
    status[singular] = Status.SINGULAR
    surface, (k, b) = np.zeros(K, bool), np.nonzero(chosen & (nullity == 2) & curve.any(axis=2))
    if len(k):
        surface[k[self_motions.on_surface(arm, task, q[k, b], V[k, b], target[k])]] = True
    return _Settled(
        out,
        there,
        np.where(there, np.take_along_axis(label, order, axis=1), OWN),
        status,
        free,
        np.asarray(missed.any(axis=1)),
        surface,
    )


def _onto(goals: Goals, q: Array, label: Int, seed: float) -> tuple[Array, Int, Array]:
    """`near` and candidates (K, M, n) moved onto their targets: postures, labels and residuals, (K, M + 1)."""
    arm, task, target, near = goals
    K, _, n = q.shape
    both, whose = np.concatenate([near[:, None], q], axis=1), np.insert(label, 0, OWN, axis=1)
    flat, goal = both.reshape(-1, n).copy(), np.repeat(target, both.shape[1], axis=0)
    known = np.flatnonzero(~np.isnan(flat).any(axis=1))
    size = np.full(len(flat), np.inf)
    size[known] = newton.missing(arm, task, flat[known], goal[known])
    mean = np.concatenate([near[:, None], roots.means(arm, q)], axis=1).reshape(-1, n)
    better = newton.missing(arm, task, mean[known], goal[known]) < size[known]
    flat[known[better]] = mean[known[better]]
    own = np.zeros(both.shape[:2], bool)
    own[:, 0] = True
    # `near` is taken as it is, or not at all
    some = np.flatnonzero((size < seed) & ~own.ravel())
    if len(some):
        steps = 40  # towards a root of third order each step goes a third of the way
        flat[some], size[some] = newton.correct(arm, task, flat[some], goal[some], steps=steps, patience=PATIENCE)
    flat[own.ravel() & (size > SOLUTION)] = np.nan
    return flat.reshape(K, -1, n), whose, np.where(np.isnan(size), np.inf, size).reshape(K, -1)


def _joined(
    arm: Arm, task: Task, q: Array, k: Int, b: Int, away: Array, sigma: Array, size: Array, target: Array
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
        further = roots.joined(arm, task, start, way, miss, weakest, target[k[row]])
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
