"""Targets on an edge: merging roots, singular postures, self-motions, boundaries.

The solvers say which targets are in doubt. One pass over them, with the Jacobian, is the mechanism behind the words
exact, boundary, singular and unreachable. Candidate postures are moved onto their targets, and grouped: those on one
component of the solution set are one branch. Regular postures with none close by need no more than an inverse; of weak
ones `local_structure` tells the component.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import NamedTuple

import numpy as np

from armkin.formula.array_tuples import replace_rows, rows_of, widen_columns
from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.answers.batch import OWN_LABEL, Examined, Goals, Seeds
from armkin.inverse.answers.solutions import Status
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.singular import chains, curves, high_order_roots, meetings, self_motions
from armkin.inverse.singular.local_structure import local_structure

AT_ONCE = 128  # candidates from which on asking all together is cheaper than one after the other
FEW_CANDIDATES = 24  # candidates of a target that are compared all with all
PATIENCE = 6  # steps with hardly any gain after which a candidate is left where it is

# For targets (R, ...), preferred values (R, n) and whether branches seem lost (R,): more postures (R, M, n), their
# branches (M,), and of which targets (R,) these may not lead to all.
More = Callable[[Array, Array, Bool], tuple[Array, Int, Bool]]


def examine(
    goals: Goals, seeds: Seeds, more: More, unsettled: Bool | None = None, incomplete: Bool | None = None
) -> Examined:
    """Correct, group and classify candidate branches of doubted targets.

    goals: K targets; `near` is a branch itself where it solves its target. more: other candidates, for
    targets that seem to have no branch, for those of which the preferred value leaves the other joints no solution,
    and for self-motions that may meet others; unsettled: (K,) targets whose candidates may not be all, of a solver
    that loses singular ones: more are asked for these and for what is singular, as of lost ones for incomplete (K,).
    """
    state = _settle(goals, seeds, tol.SEED)
    again = state.again | state.surface | ~(state.valid.any(axis=1) | (state.beyond & (unsettled is None)))
    if unsettled is None:
        # a self-motion of joints more than one apart goes through postures in which others move, too
        first, last = state.moved.argmax(axis=1), goals.arm.n - 1 - state.moved[:, ::-1].argmax(axis=1)
        more_of = again | state.moved.any(axis=1) & (last - first > 2)
    else:
        more_of = again | unsettled | (state.status != Status.EXACT)
    if not more_of.any():
        return state._replace(again=again)
    rows = np.flatnonzero(more_of)
    lost = again if incomplete is None else again | incomplete
    more_q, labels, open_ = more(goals.target[rows], goals.near[rows], lost[rows])
    if unsettled is None:  # another self-motion may meet a surface along a line, or at a point
        open_ |= state.surface[rows]
    if open_.any():
        starts = newton.many_starts(goals.arm, goals.task, goals.target[rows], open_)
        more_q, labels = np.concatenate([more_q, starts], axis=1), np.append(labels, np.zeros(starts.shape[1], int))
    present = again[rows] | ~np.isnan(more_q[:, :, 0]).all(axis=1)
    rows, more_q = rows[present], more_q[present]
    if not len(rows):
        return state._replace(again=again)
    again[rows] &= ~np.isnan(more_q[:, :, 0]).all(axis=1)  # nothing anywhere near: out of reach, and known to be
    whose = np.concatenate([state.label[rows], np.broadcast_to(labels, more_q.shape[:2])], axis=1)
    second = _settle(goals.of(rows), Seeds.of(np.concatenate([state.q[rows], more_q], axis=1), whose), tol.HOPELESS)
    return replace_rows(state, rows, second)._replace(again=again)


class _Candidates(NamedTuple):
    """Candidates q (K, M, n), `near` the first, with labels and residuals (K, M).

    sure: (K, M, n) joints that move along those that are known to lie on a self-motion, one posture of each.
    simple: (K, M) branches as they stand.
    """

    q: Array
    label: Int
    size: Array
    sure: Bool
    simple: Bool


class _Groups:
    """Which candidates are one, and what: a candidate of each target at a time leads those that are one with it."""

    def __init__(self, goals: Goals, at: _Candidates, lost: newton.Lost, rests: Bool) -> None:
        """rests: (K, M) those that no push takes along a self-motion."""
        self.goals, self.at = goals, at
        self.lost, self.rests = lost, rests
        K, M, n = at.q.shape
        self.valid: Bool = np.asarray(at.size <= tol.SOLUTION)
        on_motion: Bool = np.asarray(at.sure.any(axis=2))
        # where one direction alone is lost a joint that rests there and on a part of the self-motion rests on all of it
        self.resting: Bool = (lost.nullity == 1)[:, :, None] & (np.abs(lost.V[:, :, -1]) < tol.SOLUTION)
        # `near` leads its group, else the most exact candidate: one between two branches must not join them
        self.rank = np.maximum(at.size, tol.EQUAL_RESIDUALS)
        self.rank[:, 0] = 0.0
        self.open: Bool = self.valid & ~at.simple  # candidates of no group yet
        self.weak: Bool = (lost.place >= 0) & (lost.sigma < tol.FOLDED) & ~on_motion
        lost.sigma[on_motion] = 0.0
        self.asked: Bool = ~(self.open & self.weak)  # what component it is on; pushed: whether pushes move it
        self.known, self.moves, self.pushed = on_motion.copy(), on_motion.copy(), self.asked.copy()
        self.which, self.edge = at.sure.copy(), np.zeros((K, M), bool)
        self.ended, self.alone = np.zeros((K, M), bool), on_motion.copy()
        # which candidates are one with each: rows of `component`, the first for those of which that is not known
        self.place, self.component = np.zeros((K, M), np.int64), np.zeros((1, M), bool)
        self.chosen, self.curve = at.simple.copy(), np.zeros((K, M, n), bool)
        self.free, self.singular, self.double = np.zeros((K, n), bool), np.zeros(K, bool), np.zeros(K, bool)

    @cached_property
    def tube(self) -> Array:
        """How far a posture of residual `SOLUTION` may be off the curve through candidates (K, M) [rad, reaches]:
        `SOLUTION` over the second smallest singular value, where that is small."""
        place, S, n = self.lost.place, self.lost.weak.S, self.goals.arm.n
        widths, weak = np.zeros(place.shape), place >= 0
        if S.shape[1] >= n > 1:
            widths[weak] = tol.SOLUTION / np.maximum(S[place[weak], n - 2], tol.WEAK)
        return widths

    def _plain(self) -> None:
        """What needs no comparison one by one: regular candidates with none close by, isolated roots and boundaries
        that are alone on their components or two, and self-motions that were known where nothing else may be on them.
        """
        self.open &= ~(self.component[self.place] & self.at.simple[:, None]).any(axis=2)  # branches as they stand
        valid, sigma, M = self.open, self.lost.sigma, self.open.shape[1]
        sure: Bool = np.asarray(self.at.sure.any(axis=2))
        mine, apart = valid & ~sure, ~np.eye(M, dtype=bool)
        close = np.zeros((len(valid), M, M), bool)
        k, i, j = np.nonzero(mine[:, :, None] & mine[:, None] & apart)
        away = np.abs(newton.difference(self.goals.arm, self.at.q[k, i], self.at.q[k, j])).max(axis=1, initial=0.0)
        close[k, i, j] = away < tol.CLOSE_BY
        weak = mine & self.weak
        decided = weak & (self.place > 0) & ~self.moves
        doubtful = weak & ~(decided & self.known & (sigma >= tol.SOLUTION))  # may be on a self-motion
        alone = valid & np.where(sure, ~doubtful.any(axis=1, keepdims=True), ~weak & ~close.any(axis=2))
        undecided = (weak & (self.moves | ~self.pushed)).any(axis=1) | (sure.any(axis=1) & doubtful.any(axis=1))
        decided &= ~np.asarray(undecided)[:, None]
        rows = np.flatnonzero(decided.any(axis=1))
        if len(rows):
            mine, certain = decided[rows], self.known[rows]
            alike = self.component[self.place[rows]] & valid[rows, None] & apart & mine[:, :, None]
            mine &= (alike == alike.swapaxes(1, 2)).all(axis=2) & ~(close[rows] & ~mine[:, None]).any(axis=2)
            mine &= ~(alike & (certain[:, :, None] != certain[:, None])).any(axis=2)
            mine &= (alike.sum(axis=2) < 2) & ~alike[:, :, 0]
            mine &= (~alike | mine[:, None]).all(axis=2)
            # the most exact of each, the first of those that need no correction: the same in all arithmetics
            size = np.maximum(self.at.size[rows], np.where(certain, tol.CLOSED, 0.0))
            rank = np.argsort(np.argsort(size, axis=1, kind="stable"), axis=1)
            leads = mine & ~(alike & (rank[:, None] < rank[:, :, None])).any(axis=2)
            self.chosen[rows] |= leads
            self.double[rows] |= (leads & self.edge[rows]).any(axis=1)
            decided[rows] = mine
        self.chosen |= alone
        self.open &= ~(alone | decided)
        self.curve |= alone[:, :, None] & self.which & sure[:, :, None]
        self.singular |= (alone & sure).any(axis=1)
        self.free |= self.curve.any(axis=1)

    def _ask(self, k: Int, b: Int) -> None:
        """What components these candidates lie on that lose one direction, if that is not known."""
        (arm, task, target, _), q = self.goals, self.at.q
        unasked = ~self.asked[k, b]
        if not unasked.any():
            return
        k, b = k[unasked], b[unasked]
        self.asked[k, b] = True
        single = self.lost.nullity[k, b] < 2
        if single.any():
            i, c = k[single], b[single]
            local = local_structure(arm, task, q[i, c], target[i], rows_of(self.lost.weak, self.lost.place[i, c]))
            same, self.ended[i, c], self.alone[i, c], joints = chains.follow(arm, task, local, q[i, c], q[i], target[i])
            self.known[i, c], self.moves[i, c], self.which[i, c] = local.known, local.manifold, joints
            self.edge[i, c] = local.boundary
            self.place[i, c] = np.where(local.known, len(self.component) + np.arange(len(i)), 0)
            self.component = np.concatenate([self.component, same])
        self.pushed[k, b] = self.known[k, b] | self.rests[k, b] | ~(self.lost.sigma[k, b] < tol.MOVING)
        self.rank[k, b] += np.where(self.pushed[k, b] | (b == 0), 0.0, 1.0)  # it may be on a component that is known

    def _push(self, k: Int, b: Int) -> None:
        """Whether these candidates move, of which `_ask` did not tell."""
        self._ask(k, b)
        unpushed = ~self.pushed[k, b]
        if unpushed.any():
            k, b = k[unpushed], b[unpushed]
            self.pushed[k, b] = True
            (arm, task, target, _), lost = self.goals, np.maximum(self.lost.nullity[k, b], 1)
            motion = self_motions.self_motion(arm, task, self.at.q[k, b], self.lost.V[k, b], lost, target[k])
            self.moves[k, b], self.which[k, b] = motion

    def _compare(self, k: Int, b: Int) -> None:
        """Which candidates are one with these, whose component is not known."""
        candidates, (arm, task, target, _), sigma = self.at, self.goals, self.lost.sigma
        self.place[k, b] = len(self.component) + np.arange(len(k))
        alike, away = high_order_roots.equal_candidates(arm, task, candidates.q, k, b, sigma, candidates.size, target)
        self.edge[k, b] = (alike & self.valid[k] & (away > tol.SAME)).any(axis=1) | (sigma[k, b] < tol.DOUBLE)
        self.component = np.concatenate([self.component, alike])

    def _lead(self, k: Int, b: Int) -> None:
        """One group of each of targets k (m,): those that are one with their b-th candidate (m,)."""
        self._push(k, b)
        if (uncompared := ~self.known[k, b] & (self.place[k, b] == 0)).any():
            self._compare(k[uncompared], b[uncompared])
        arm, near = self.goals.arm, self.goals.near
        q, label, size = self.at.q, self.at.label, self.at.size
        sure = self.known[k, b]
        exact = np.where(sure[:, None], np.maximum(size[k], tol.CLOSED), size[k])  # a known component's as in `_plain`
        away = np.abs(newton.difference(arm, q[k], q[k, b][:, None]))  # (m, M, n)
        group: Bool = np.asarray(self.component[self.place[k, b]])
        unlisted = ~(group & self.at.simple[k]).any(axis=1)
        self._inherit(k, b, group)
        moving, joints = self.moves[k, b], self.which[k, b]
        group &= self.open[k]
        on = self._on_motion(k, b, away, group | ~self.open[k]) | (group & (sure & moving)[:, None])
        on[np.arange(len(k)), b] = True
        mine = on | group  # what is one with it along a curve beside the self-motion is not on that
        self.open[k] &= ~mine
        self.double[k] |= self.edge[k, b]
        self.singular[k] |= moving
        self.free[k] |= joints & moving[:, None]
        # `near` itself comes first; else the posture of a self-motion that is closest to it, the most exact of others
        motion = np.abs(newton.difference(arm, q[k], near[k][:, None])).sum(axis=2)
        pick = np.where(moving[:, None], np.where(on, motion, np.inf), np.where(mine, exact, np.inf)).argmin(axis=1)
        leads = np.flatnonzero(label[k, b] == OWN_LABEL)
        pick[leads] = b[leads]
        self.chosen[k, pick] = unlisted
        self.curve[k, pick] = joints & moving[:, None]
        for array in (self.known, self.moves, self.place, self.ended, self.alone):
            array[k, pick] = array[k, b]
        if len(leads):  # named like the candidate of its group that is closest to it
            alike = np.where(mine[leads] & (label[k[leads]] != OWN_LABEL), motion[leads], np.inf)
            twin = alike.argmin(axis=1)
            label[k[leads], b[leads]] = np.where(np.isinf(alike.min(axis=1)), OWN_LABEL, label[k[leads], twin])

    def _inherit(self, k: Int, b: Int, alike: Bool) -> None:
        """Components (m, M) that a manifold begun at another of their candidates has as its own are that manifold.

        Where a second direction is all but lost the curve through a candidate beside a manifold may leave it.
        """
        beside = (self.tube[k, b] > tol.TURNED) & self.known[k, b] & ~self.moves[k, b]
        if not beside.any():
            return
        i, c = np.nonzero(alike & beside[:, None] & (self.tube[k] > tol.TURNED))
        self._ask(k[i], c)
        inherits = alike & beside[:, None] & self.known[k] & self.moves[k]
        i, c = np.nonzero(inherits)
        back = self.component[self.place[k[i], c], b[i]]
        i, first = np.unique(i[back], return_index=True)
        k, b, c = k[i], b[i], c[back][first]
        alike[i] |= self.component[self.place[k, c]]
        for array in (self.moves, self.which, self.ended, self.alone):
            array[k, b] = array[k, c]

    def _on_motion(self, k: Int, b: Int, away: Array, group: Bool) -> Bool:
        """Which candidates (m, M) lie on the self-motions of those that lead, besides those `group` with them (m, M).

        Whatever differs in its free joints alone; but where the residual grows along it at all, its points are not
        equal, and the exact ones are listed.
        """
        arm, task, target, _ = self.goals
        q, joints = self.at.q, self.which[k, b]
        held = np.where(joints[:, None], 0.0, away).max(axis=2)
        # two postures of one self-motion may each be off by as much as a double root
        moving = self.moves[k, b] & ~self.ended[k, b]  # all that is on other components is one with them
        mine: Bool = moving[:, None] & (held < 3 * tol.TURNED) & (self.lost.sigma[k] < tol.SOLUTION) & self.open[k]
        far = mine & ~group & (joints.sum(axis=1) > 2)[:, None]
        rows = np.flatnonzero(far.any(axis=1))
        if len(rows):
            leaders, goal = q[k[rows], b[rows]], target[k[rows]]
            mine[rows] &= curves.share_circuit(arm, task, leaders, joints[rows], q[k[rows]], far[rows], goal)
            i, c = np.nonzero(far & mine & (self.resting[k] & joints[:, None]).any(axis=2))  # another curve crosses
            self._push(k[i], c)
            rests = self.resting[k[i], c] & ~self.which[k[i], c]
            mine[i, c] &= ~(self.moves[k[i], c] & (joints[i] & rests).any(axis=1))
        return np.asarray(mine)

    def settle(self, missed: Bool, beyond: Bool) -> Examined:
        """All candidates grouped; missed, beyond: (K,) of which targets a loose one came to nothing, and of which all
        that are near lie beyond a fold."""
        small = self.valid.shape[1] <= FEW_CANDIDATES
        # candidates that lose several directions are asked once they lead; among many, those that lose one, too
        asking = ~self.asked & (self.lost.nullity < 2)
        if asking.any() and (small or asking.sum() <= AT_ONCE):
            self._ask(*np.nonzero(asking))
        if small:
            asking = self.open & self.asked & ~self.pushed  # eight of one target in a row take five times as long
            if 0 < asking.sum() <= AT_ONCE:
                self._push(*np.nonzero(asking))
            asking = self.open & self.weak & self.pushed & ~self.known & ~self.moves
            if asking.any():
                self._compare(*np.nonzero(asking))
            self._plain()
        while self.open.any():
            k = np.flatnonzero(self.open.any(axis=1))
            self._lead(k, np.where(self.open[k], self.rank[k], np.inf).argmin(axis=1))
        arm, task, target, _ = self.goals
        q, sigma = self.at.q, self.lost.sigma
        chosen, every = self.chosen, np.arange(len(self.open))[:, None]
        # a root of high order may also lie beside a self-motion
        moving = np.asarray(self.curve.any(axis=2))
        beside = (chosen & (sigma < tol.HIGH) & ~moving).any(axis=1) & moving.any(axis=1)
        rows = np.flatnonzero((self.curve & ~self.at.sure).any(axis=(1, 2)) | beside)
        if len(rows):
            goals, postures = self.goals.of(rows), q[rows]
            stay, curve = chosen[rows], self.curve[rows]
            self_motions.drop_contained(goals, postures, sigma[rows], self.resting[rows], stay, curve)
            # where two directions are lost several manifolds may have a posture
            linked = (self.known & self.moves)[rows, :, None] & (~self.ended & (self.lost.nullity < 2))[rows, None]
            linked &= self.component[self.place[rows]]
            self_motions.drop_twins(goals, postures, stay, curve, self.ended[rows], linked, self.tube[rows])
            chosen[rows] = stay
        order = np.argsort(~chosen, axis=1, kind="stable")[:, : max(int(chosen.sum(axis=1).max(initial=0)), 1)]
        present = chosen[every, order]
        status = np.where(present.any(axis=1), Status.EXACT, Status.UNREACHABLE).astype(np.int8)
        status[self.double] = Status.BOUNDARY
        status[self.singular] = Status.SINGULAR
        surface, (k, b) = np.zeros(len(q), bool), np.nonzero(chosen & (self.lost.nullity > 1) & self.curve.any(axis=2))
        if len(k):
            lost = self.lost.V[k, b], self.lost.nullity[k, b]
            surface[k[self_motions.on_surface(arm, task, q[k, b], *lost, target[k])[0]]] = True
        listed = np.where(present[:, :, None], q[every, order], np.nan)
        label = np.where(present, self.at.label[every, order], OWN_LABEL)
        moved = np.asarray((self.curve & ~self.alone[:, :, None]).any(axis=1))
        return Examined(listed, present, label, status, self.free, missed, surface, moved, beyond)


def _settle(goals: Goals, seeds: Seeds, most: float) -> Examined:
    """Candidates moved onto their targets, those that miss by less than `most`, and grouped."""
    arm, task, target, near = goals
    K, _, n = seeds.q.shape
    present, every = ~np.isnan(seeds.q).any(axis=2), np.arange(K)[:, None]
    order = np.argsort(~present, axis=1, kind="stable")[:, : int(present.sum(axis=1).max(initial=0))]
    q = np.concatenate([near[:, None], seeds.q[every, order]], axis=1)
    label = np.concatenate([np.full((K, 1), OWN_LABEL), seeds.label[every, order]], axis=1)
    sure = np.concatenate([np.zeros((K, 1, n), bool), seeds.sure[every, order]], axis=1)
    loose = (seeds.loose & present)[every, order]
    simple = np.concatenate([np.zeros((K, 1), bool), (seeds.simple & present)[every, order]], axis=1)
    flat, goal = q.reshape(-1, n).copy(), np.repeat(np.arange(K), q.shape[1])
    size, rows = np.where(np.isnan(flat[:, 0]), np.inf, 0.0), np.flatnonzero(~(np.isnan(flat[:, 0]) | simple.ravel()))
    size[rows] = newton.misses(arm, task, flat[rows], target[goal[rows]])
    beyond, first = np.zeros(len(flat), bool), np.arange(len(flat)) % q.shape[1] == 0
    free = np.flatnonzero(~(first | sure.reshape(-1, n).any(axis=1) | (size < tol.CLOSED)))
    if len(free):
        rows = free[size[free] < most]
        far = rows[size[rows] > tol.SOLUTION]
        beyond[far] = high_order_roots.beyond_folds(arm, task, flat[far], target[goal[far]])
        rows = rows[~beyond[rows]]
        # towards a root of third order each step goes a third of the way
        flat[rows], size[rows] = newton.correct(arm, task, flat[rows], target[goal[rows]], steps=40, patience=PATIENCE)
    q, size = flat.reshape(K, -1, n), size.reshape(K, -1)
    # `near` is a candidate as it is, where it solves the target; where it stands for a self-motion already it is none
    stands = ((q[:, 1:] == near[:, None]).all(axis=2) & sure[:, 1:].any(axis=2)).any(axis=1)
    q[stands | (size[:, 0] > tol.SOLUTION), 0], size[stands, 0] = np.nan, np.inf
    missed = (loose & (size[:, 1:] > tol.SOLUTION)).any(axis=1) | (seeds.loose & ~present).any(axis=1)
    far = beyond.reshape(K, -1)
    all_beyond = far.any(axis=1) & (far | (size > most) | np.isnan(q[..., 0]))[:, 1:].all(axis=1)
    rests: Bool = np.zeros(size.shape, bool)
    lost = newton.lost_directions(arm, task, q, (size <= tol.SOLUTION) & ~(sure.any(axis=2) | simple), target)
    if (lost.nullity[:, 1:] > 1).any():
        q, label, size, rests = meetings.ways_out(goals, q, label, size, lost)
        if q.shape[1] > sure.shape[1]:
            sure, simple = (widen_columns(array, q.shape[1]) for array in (sure, simple))
            lost = newton.lost_directions(arm, task, q, (size <= tol.SOLUTION) & ~(sure.any(axis=2) | simple), target)
    candidates = _Candidates(q, label, size, sure, simple)
    return _Groups(goals, candidates, lost, rests).settle(np.asarray(missed), np.asarray(all_beyond))
