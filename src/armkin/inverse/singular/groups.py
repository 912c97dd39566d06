"""Targets on an edge: merging roots, singular postures, self-motions, boundaries.

The solvers say which targets are in doubt. One pass over them, with the Jacobian, is the mechanism behind the words
exact, boundary, singular and unreachable. Candidate postures are moved onto their targets, and grouped: those on one
component of the solution set are one branch. Regular postures with none close by need no more than an inverse; of weak
ones `local_structure` tells the component.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from armkin.formula.array_tuples import replace_rows, widen_columns
from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.answers.batch import OWN_LABEL, Examined, Goals, Seeds
from armkin.inverse.answers.solutions import Status
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.singular import curves, high_order_roots, meetings, self_motions
from armkin.inverse.singular.components import Candidates, Components

AT_ONCE = 128  # candidates from which on asking all together is cheaper than one after the other
FEW_CANDIDATES = 24  # candidates of a target that are compared all with all
PATIENCE = 6  # steps with hardly any gain after which a candidate is left where it is

# Takes targets (R, ...), preferred values (R, n) and whether branches seem lost (R,); returns more postures (R, M, n),
# their branches (M,), and of which targets (R,) a search from many starts may find others.
More = Callable[[Array, Array, Bool], tuple[Array, Int, Bool]]


def examine(
    goals: Goals, seeds: Seeds, more: More, unsettled: Bool | None = None, incomplete: Bool | None = None
) -> Examined:
    """Correct, group and classify candidate branches of doubted targets.

    goals: K targets; `near` is a branch itself where it solves its target. more: finds other candidates, for targets
    that seem to have no branch, for those of which the preferred value leaves the other joints no solution, and for
    self-motions that may meet others. unsettled: (K,) targets whose solver may have lost singular candidates: `more`
    is called for these, and for all that are singular. incomplete: (K,) targets that `more` takes for lost.
    """
    state = _settle_seeds(goals, seeds, tol.SEED_RESIDUAL)
    retry = state.again | state.surface | ~(state.valid.any(axis=1) | (state.beyond & (unsettled is None)))
    if unsettled is None:
        # a self-motion of joints more than one apart goes through postures in which others move, too
        first, last = state.moved.argmax(axis=1), goals.arm.n - 1 - state.moved[:, ::-1].argmax(axis=1)
        wants_more = retry | state.moved.any(axis=1) & (last - first > 2)
    else:
        wants_more = retry | unsettled | (state.status != Status.EXACT)
    if not len(rows := np.flatnonzero(wants_more)):
        return state._replace(again=retry)
    lost = retry if incomplete is None else retry | incomplete
    more_candidates, labels, wants_starts = more(goals.target[rows], goals.near[rows], lost[rows])
    if unsettled is None:  # another self-motion may meet a surface along a line, or at a point
        wants_starts |= state.surface[rows]
    if wants_starts.any():
        starts = newton.many_starts(goals.arm, goals.task, goals.target[rows], wants_starts)
        labels = np.append(labels, np.zeros(starts.shape[1], int))
        more_candidates = np.concatenate([more_candidates, starts], axis=1)
    has_candidates: Bool = np.asarray(~np.isnan(more_candidates[:, :, 0]).all(axis=1))
    useful = retry[rows] | has_candidates
    retry[rows] &= has_candidates  # nothing anywhere near: out of reach, and known to be
    rows, more_candidates = rows[useful], more_candidates[useful]
    if not len(rows):
        return state._replace(again=retry)
    label = np.concatenate([state.label[rows], np.broadcast_to(labels, more_candidates.shape[:2])], axis=1)
    all_seeds = Seeds.of(np.concatenate([state.q[rows], more_candidates], axis=1), label)
    return replace_rows(state, rows, _settle_seeds(goals.of(rows), all_seeds, tol.HOPELESS))._replace(again=retry)


@dataclass
class _Groups:
    """Which candidates are listed: one of each target at a time leads those that are on its component."""

    components: Components
    ungrouped: Bool  # (K, M) valid candidates that are in no group yet
    chosen: Bool  # (K, M) candidates that are listed
    chosen_joints: Bool  # (K, M, n) joints that move along the self-motions of those
    free_joints: Bool  # (K, n)
    has_manifold: Bool  # (K,)
    has_boundary: Bool  # (K,)

    def _group_plain(self) -> None:
        """Group what needs no comparison one by one: regular candidates with none close by, isolated roots and
        boundaries that are alone on their components or two, known self-motions where nothing else may be on them.
        """
        components = self.components
        on_simple = components.members[components.row] & components.candidates.simple[:, None]  # branches as they stand
        self.ungrouped &= ~on_simple.any(axis=2)
        valid, sigma, M = self.ungrouped, components.lost.sigma, self.ungrouped.shape[1]
        sure: Bool = np.asarray(components.candidates.sure.any(axis=2))
        unsure, is_other = valid & ~sure, ~np.eye(M, dtype=bool)
        close = np.zeros((len(valid), M, M), bool)
        k, i, j = np.nonzero(unsure[:, :, None] & unsure[:, None] & is_other)
        offset = newton.difference(components.goals.arm, components.candidates.q[k, i], components.candidates.q[k, j])
        close[k, i, j] = np.abs(offset).max(axis=1, initial=0.0) < tol.CLOSE_DISTANCE
        near_singular = unsure & components.near_singular
        decided = near_singular & (components.row > 0) & ~components.on_manifold
        may_move = near_singular & ~(decided & components.known & (sigma >= tol.SOLUTION))
        is_single = np.where(sure, ~may_move.any(axis=1, keepdims=True), ~near_singular & ~close.any(axis=2)) & valid
        is_open = (near_singular & (components.on_manifold | ~components.pushed)).any(axis=1)
        decided &= ~np.asarray(is_open | (sure.any(axis=1) & may_move.any(axis=1)))[:, None]
        rows = np.flatnonzero(decided.any(axis=1))
        if len(rows):
            pairable, known = decided[rows], components.known[rows]
            alike = components.members[components.row[rows]] & valid[rows, None] & is_other & pairable[:, :, None]
            pairable &= (alike == alike.swapaxes(1, 2)).all(axis=2) & ~(close[rows] & ~pairable[:, None]).any(axis=2)
            pairable &= ~(alike & (known[:, :, None] != known[:, None])).any(axis=2)
            pairable &= (alike.sum(axis=2) < 2) & ~alike[:, :, 0]
            pairable &= (~alike | pairable[:, None]).all(axis=2)
            # the most exact of each, the first of those that need no correction: the same in all arithmetics
            size = np.maximum(components.candidates.size[rows], np.where(known, tol.ROUNDING_RESIDUAL, 0.0))
            rank = np.argsort(np.argsort(size, axis=1, kind="stable"), axis=1)
            leads = pairable & ~(alike & (rank[:, None] < rank[:, :, None])).any(axis=2)
            self.chosen[rows] |= leads
            self.has_boundary[rows] |= (leads & components.is_boundary[rows]).any(axis=1)
            decided[rows] = pairable
        self.chosen |= is_single
        self.ungrouped &= ~(is_single | decided)
        self.chosen_joints |= is_single[:, :, None] & components.moving_joints & sure[:, :, None]
        self.has_manifold |= (is_single & sure).any(axis=1)
        self.free_joints |= self.chosen_joints.any(axis=1)

    def _group(self, k: Int, b: Int) -> None:
        """One group of each of targets k (m,): those that are one with their b-th candidate (m,)."""
        components = self.components
        components.push(k, b)
        if (uncompared := ~components.known[k, b] & (components.row[k, b] == 0)).any():
            components.compare(k[uncompared], b[uncompared])
        arm, near = components.goals.arm, components.goals.near
        q, label, size, *_ = components.candidates
        known = components.known[k, b]
        size = np.where(known[:, None], np.maximum(size[k], tol.ROUNDING_RESIDUAL), size[k])  # as in `_group_plain`
        offset = np.abs(newton.difference(arm, q[k], q[k, b][:, None]))  # (m, M, n)
        group: Bool = np.asarray(components.members[components.row[k, b]])
        unlisted = ~(group & components.candidates.simple[k]).any(axis=1)
        components.inherit_manifolds(k, b, group)
        moving, joints = components.on_manifold[k, b], components.moving_joints[k, b]
        group &= self.ungrouped[k]
        on_motion = self._on_motion(k, b, offset, group | ~self.ungrouped[k]) | (group & (known & moving)[:, None])
        on_motion[np.arange(len(k)), b] = True
        group |= on_motion  # what is one with it along a curve beside the self-motion is not on that
        self.ungrouped[k] &= ~group
        self.has_boundary[k] |= components.is_boundary[k, b]
        self.has_manifold[k] |= moving
        self.free_joints[k] |= joints & moving[:, None]
        # `near` itself comes first; else the posture of a self-motion that is closest to it, the most exact of others
        motion = np.abs(newton.difference(arm, q[k], near[k][:, None])).sum(axis=2)
        cost = np.where(moving[:, None], np.where(on_motion, motion, np.inf), np.where(group, size, np.inf))
        pick = cost.argmin(axis=1)
        leads_own = np.flatnonzero(label[k, b] == OWN_LABEL)
        pick[leads_own] = b[leads_own]
        self.chosen[k, pick] = unlisted
        self.chosen_joints[k, pick] = joints & moving[:, None]
        for array in (components.known, components.on_manifold, components.row, components.ended, components.uncrossed):
            array[k, pick] = array[k, b]
        if len(leads_own):  # named like the candidate of its group that is closest to it
            motion = np.where(group[leads_own] & (label[k[leads_own]] != OWN_LABEL), motion[leads_own], np.inf)
            twin_label = label[k[leads_own], motion.argmin(axis=1)]
            label[k[leads_own], b[leads_own]] = np.where(np.isinf(motion.min(axis=1)), OWN_LABEL, twin_label)

    def _on_motion(self, k: Int, b: Int, offset: Array, group: Bool) -> Bool:
        """Which candidates (m, M) lie on the self-motions of those that lead, besides those `group` with them (m, M).

        A candidate is on one if it differs in the joints that move alone. Where the residual grows along a self-motion
        its points are not equal, and the exact ones are listed.
        """
        components = self.components
        arm, task, target, _ = components.goals
        q, joints = components.candidates.q, components.moving_joints[k, b]
        held_offset = np.where(joints[:, None], 0.0, offset).max(axis=2)
        moving = components.on_manifold[k, b] & ~components.ended[k, b]  # all on other components is one with them
        # two postures of one self-motion may each be off by as much as a double root
        shared: Bool = moving[:, None] & (held_offset < 3 * tol.STILL_TURN) & (components.lost.sigma[k] < tol.SOLUTION)
        shared &= self.ungrouped[k]
        unsure = shared & ~group & (joints.sum(axis=1) > 2)[:, None]
        rows = np.flatnonzero(unsure.any(axis=1))
        if len(rows):
            leaders, goal = q[k[rows], b[rows]], target[k[rows]]
            shared[rows] &= curves.share_circuit(arm, task, leaders, joints[rows], q[k[rows]], unsure[rows], goal)
            # another curve crosses
            i, c = np.nonzero(unsure & shared & (components.resting[k] & joints[:, None]).any(axis=2))
            components.push(k[i], c)
            rests = components.resting[k[i], c] & ~components.moving_joints[k[i], c]
            shared[i, c] &= ~(components.on_manifold[k[i], c] & (joints[i] & rests).any(axis=1))
        return np.asarray(shared)

    def _drop_repeated(self, rows: Int) -> None:
        """Drop what the listed self-motions of targets rows have on them besides their own posture."""
        components = self.components
        goals, q, ended = components.goals.of(rows), components.candidates.q[rows], components.ended[rows]
        chosen, curve = self.chosen[rows], self.chosen_joints[rows]
        self_motions.drop_contained(goals, q, components.lost.sigma[rows], components.resting[rows], chosen, curve)
        # where two directions are lost several manifolds may have a posture
        linked = components.members[components.row[rows]] & (~ended & (components.lost.nullity[rows] < 2))[:, None]
        linked &= (components.known & components.on_manifold)[rows, :, None]
        self_motions.drop_twins(goals, q, chosen, curve, ended, linked, components.tube[rows])
        self.chosen[rows] = chosen

    def settle(self, missed: Bool, all_beyond: Bool) -> Examined:
        """Tell components, group candidates that are one, drop what self-motions contain. Of targets (K,), missed: a
        loose candidate came to nothing; all_beyond: all candidates that are near lie beyond a fold."""
        components = self.components
        is_few = components.valid.shape[1] <= FEW_CANDIDATES
        # candidates that lose several directions are followed once they lead; among many, those that lose one, too
        unfollowed = ~components.followed & (components.lost.nullity < 2)
        if unfollowed.any() and (is_few or unfollowed.sum() <= AT_ONCE):
            components.follow(*np.nonzero(unfollowed))
        if is_few:
            # eight candidates of one target one by one take five times as long
            unpushed = self.ungrouped & components.followed & ~components.pushed
            if 0 < unpushed.sum() <= AT_ONCE:
                components.push(*np.nonzero(unpushed))
            resting = self.ungrouped & components.near_singular & components.pushed
            resting &= ~components.known & ~components.on_manifold
            if resting.any():
                components.compare(*np.nonzero(resting))
            self._group_plain()
        while self.ungrouped.any():
            k = np.flatnonzero(self.ungrouped.any(axis=1))
            self._group(k, np.where(self.ungrouped[k], components.rank[k], np.inf).argmin(axis=1))
        moving = np.asarray(self.chosen_joints.any(axis=2))
        # a root of high order may also lie beside a self-motion
        high_order = self.chosen & (components.lost.sigma < tol.HIGH_ORDER) & ~moving
        has_root_beside = high_order.any(axis=1) & moving.any(axis=1)
        rows = np.flatnonzero((self.chosen_joints & ~components.candidates.sure).any(axis=(1, 2)) | has_root_beside)
        if len(rows):
            self._drop_repeated(rows)
        (arm, task, target, _), q, chosen = components.goals, components.candidates.q, self.chosen
        order = np.argsort(~chosen, axis=1, kind="stable")[:, : max(int(chosen.sum(axis=1).max(initial=0)), 1)]
        every = np.arange(len(q))[:, None]
        present = chosen[every, order]
        status = np.where(present.any(axis=1), Status.EXACT, Status.UNREACHABLE).astype(np.int8)
        status[self.has_boundary] = Status.BOUNDARY
        status[self.has_manifold] = Status.SINGULAR
        surface, (k, b) = np.zeros(len(q), bool), np.nonzero(chosen & (components.lost.nullity > 1) & moving)
        if len(k):
            lost = components.lost.V[k, b], components.lost.nullity[k, b]
            surface[k[self_motions.on_surface(arm, task, q[k, b], *lost, target[k])[0]]] = True
        listed = np.where(present[:, :, None], q[every, order], np.nan)
        label = np.where(present, components.candidates.label[every, order], OWN_LABEL)
        moved = np.asarray((self.chosen_joints & ~components.uncrossed[:, :, None]).any(axis=1))
        return Examined(listed, present, label, status, self.free_joints, missed, surface, moved, all_beyond)


def _correct(goals: Goals, q: Array, size: Array, goal: Int) -> tuple[Array, Array, Bool]:
    """Candidates q (M, n) moved onto the targets goal (M,), what they miss, and which of them lie beyond a fold; these
    stay. size: (M,) what they miss before."""
    arm, task, target = goals.arm, goals.task, goals.target[goal]
    out_of_reach, unsolved = np.zeros(len(q), bool), np.flatnonzero(size > tol.SOLUTION)
    out_of_reach[unsolved] = high_order_roots.beyond_folds(arm, task, q[unsolved], target[unsolved])
    rows = np.flatnonzero(~out_of_reach)
    # towards a root of third order each step goes a third of the way
    q[rows], size[rows] = newton.correct(arm, task, q[rows], target[rows], steps=40, patience=PATIENCE)
    return q, size, out_of_reach


def _settle_seeds(goals: Goals, seeds: Seeds, seed_limit: float) -> Examined:
    """Candidates moved onto their targets, those that miss by less than `seed_limit`, and grouped."""
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
    out_of_reach, is_near = np.zeros(len(flat), bool), np.arange(len(flat)) % q.shape[1] == 0
    inexact = np.flatnonzero(~(is_near | sure.reshape(-1, n).any(axis=1) | (size < tol.ROUNDING_RESIDUAL)))
    if len(rows := inexact[size[inexact] < seed_limit]):
        flat[rows], size[rows], out_of_reach[rows] = _correct(goals, flat[rows], size[rows], goal[rows])
    q, size, is_beyond = flat.reshape(K, -1, n), size.reshape(K, -1), out_of_reach.reshape(K, -1)
    # `near` is a candidate as it is, where it solves the target; where it stands for a self-motion already it is none
    stands = ((q[:, 1:] == near[:, None]).all(axis=2) & sure[:, 1:].any(axis=2)).any(axis=1)
    q[stands | (size[:, 0] > tol.SOLUTION), 0], size[stands, 0] = np.nan, np.inf
    missed = (loose & (size[:, 1:] > tol.SOLUTION)).any(axis=1) | (seeds.loose & ~present).any(axis=1)
    is_useless = is_beyond | (size > seed_limit) | np.isnan(q[..., 0])
    all_beyond = is_beyond.any(axis=1) & is_useless[:, 1:].all(axis=1)
    rests: Bool = np.zeros(size.shape, bool)
    lost = newton.lost_directions(arm, task, q, (size <= tol.SOLUTION) & ~(sure.any(axis=2) | simple), target)
    if (lost.nullity[:, 1:] > 1).any():
        q, label, size, rests = meetings.separate(goals, q, label, size, lost)
        if q.shape[1] > sure.shape[1]:
            sure, simple = (widen_columns(array, q.shape[1]) for array in (sure, simple))
            lost = newton.lost_directions(arm, task, q, (size <= tol.SOLUTION) & ~(sure.any(axis=2) | simple), target)
    candidates = Candidates(q, label, size, sure, simple)
    components = Components(goals, candidates, lost, rests)
    groups = _Groups(
        components=components,
        ungrouped=components.valid & ~simple,
        chosen=simple.copy(),
        chosen_joints=np.zeros(q.shape, bool),
        free_joints=np.zeros((K, n), bool),
        has_manifold=np.zeros(K, bool),
        has_boundary=np.zeros(K, bool),
    )
    return groups.settle(np.asarray(missed), np.asarray(all_beyond))
