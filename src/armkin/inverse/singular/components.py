"""What components of the solution set candidates of targets on an edge lie on.

Of regular postures with none close by nothing need be asked. `local_structure` tells the component of those that lose
one direction, as far as one polynomial holds, and `chains` beyond; a push tells whether others move.
"""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from armkin.formula.array_tuples import rows_of
from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.answers.batch import Goals
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.singular import chains, high_order_roots, self_motions
from armkin.inverse.singular.local_structure import local_structure


class Candidates(NamedTuple):
    """Candidates of K targets, `near` the first of each."""

    q: Array  # (K, M, n)
    label: Int  # (K, M)
    size: Array  # (K, M) residual
    sure: Bool  # (K, M, n) joints that move along a known self-motion, for one posture of each
    simple: Bool  # (K, M) branches that need no examination


class Components:
    """What components of the solution set the candidates of K targets lie on, as far as that was asked."""

    def __init__(self, goals: Goals, candidates: Candidates, lost: newton.LostDirections, rests: Bool) -> None:
        """rests: (K, M) those that no push takes along a self-motion."""
        self.goals, self.candidates = goals, candidates
        self.lost, self.rests = lost, rests
        (K, M, _), simple = candidates.q.shape, candidates.simple
        on_motion: Bool = np.asarray(candidates.sure.any(axis=2))
        # of each candidate, (K, M) or (K, M, n):
        self.valid: Bool = np.asarray(candidates.size <= tol.SOLUTION)
        # where one direction alone is lost a joint that rests there and on a part of the self-motion rests on all of it
        self.resting: Bool = (lost.nullity == 1)[:, :, None] & (np.abs(lost.V[:, :, -1]) < tol.SOLUTION)
        # `near` leads its group, else the most exact candidate: one between two branches must not join them
        self.rank = np.maximum(candidates.size, tol.EQUAL_RESIDUALS)
        self.rank[:, 0] = 0.0
        self.near_singular: Bool = (lost.place >= 0) & (lost.sigma < tol.FOLD_VALUE) & ~on_motion
        lost.sigma[on_motion] = 0.0
        self.followed: Bool = ~(self.valid & ~simple & self.near_singular)  # whether `follow` is done or needless
        self.pushed = self.followed.copy()  # whether `push` is done or needless
        self.known = on_motion.copy()  # whether its component is known
        self.on_manifold = on_motion.copy()  # whether that is a self-motion manifold
        self.moving_joints = candidates.sure.copy()  # those that move along the manifold
        self.ended = np.zeros((K, M), bool)  # whether both ends of the component are known
        self.uncrossed = on_motion.copy()  # whether they are, and no other curve crosses in between
        self.is_boundary = np.zeros((K, M), bool)  # whether two roots merge there
        self.row = np.zeros((K, M), np.int64)  # its row of `members`, 0 as long as that is not known
        self.members = np.zeros((1, M), bool)  # (rows, M) which candidates of a target are one

    @cached_property
    def tube(self) -> Array:
        """How far a posture of residual `SOLUTION` may be off the curve through candidates (K, M) [rad, reaches]:
        `SOLUTION` over the second smallest singular value, where that is small."""
        place, S, n = self.lost.place, self.lost.weak.S, self.goals.arm.n
        widths, has_values = np.zeros(place.shape), place >= 0
        if S.shape[1] >= n > 1:
            widths[has_values] = tol.SOLUTION / np.maximum(S[place[has_values], n - 2], tol.WEAK)
        return widths

    def follow(self, k: Int, b: Int) -> None:
        """Follow the components of those of these candidates that lose one direction, if that is not done."""
        (arm, task, target, _), q = self.goals, self.candidates.q
        unfollowed = ~self.followed[k, b]
        if not unfollowed.any():
            return
        k, b = k[unfollowed], b[unfollowed]
        self.followed[k, b] = True
        loses_one = self.lost.nullity[k, b] < 2
        if loses_one.any():
            i, c = k[loses_one], b[loses_one]
            local = local_structure(arm, task, q[i, c], target[i], rows_of(self.lost.weak, self.lost.place[i, c]))
            curve = chains.follow(self.goals, local, (i, c), q)
            self.known[i, c], self.on_manifold[i, c] = curve.known, curve.manifold
            self.moving_joints[i, c], self.is_boundary[i, c] = curve.joints, curve.boundary
            self.ended[i, c], self.uncrossed[i, c] = curve.ended, curve.uncrossed
            self.row[i, c] = np.where(curve.known, len(self.members) + np.arange(len(i)), 0)
            self.members = np.concatenate([self.members, curve.members])
        self.pushed[k, b] = self.known[k, b] | self.rests[k, b] | ~(self.lost.sigma[k, b] < tol.MOVING_VALUE)
        self.rank[k, b] += np.where(self.pushed[k, b] | (b == 0), 0.0, 1.0)  # it may be on a component that is known

    def push(self, k: Int, b: Int) -> None:
        """Push those of these candidates whose components `follow` does not tell: do they move?"""
        self.follow(k, b)
        unpushed = ~self.pushed[k, b]
        if unpushed.any():
            k, b = k[unpushed], b[unpushed]
            self.pushed[k, b] = True
            (arm, task, target, _), lost = self.goals, np.maximum(self.lost.nullity[k, b], 1)
            motion = self_motions.self_motion(arm, task, self.candidates.q[k, b], self.lost.V[k, b], lost, target[k])
            self.on_manifold[k, b], self.moving_joints[k, b] = motion

    def compare(self, k: Int, b: Int) -> None:
        """Find the candidates that are one with these, whose components are not known."""
        (q, _, size, *_), (arm, task, target, _), sigma = self.candidates, self.goals, self.lost.sigma
        self.row[k, b] = len(self.members) + np.arange(len(k))
        alike, distance = high_order_roots.equal_candidates(arm, task, q, k, b, sigma, size, target)
        has_twin = (alike & self.valid[k] & (distance > tol.ROUNDING_DISTANCE)).any(axis=1)
        self.is_boundary[k, b] = has_twin | (sigma[k, b] < tol.DOUBLE_VALUE)
        self.members = np.concatenate([self.members, alike])

    def inherit_manifolds(self, k: Int, b: Int, alike: Bool) -> None:
        """Components (m, M) become the manifold that begins at another of their candidates and has their own on it.

        Where a second direction is all but lost the curve through a candidate beside a manifold may leave it.
        """
        is_vague = (self.tube[k, b] > tol.STILL_TURN) & self.known[k, b] & ~self.on_manifold[k, b]
        if not is_vague.any():
            return
        alike_vague = alike & is_vague[:, None]
        i, c = np.nonzero(alike_vague & (self.tube[k] > tol.STILL_TURN))
        self.follow(k[i], c)
        i, c = np.nonzero(alike_vague & self.known[k] & self.on_manifold[k])
        has_own = self.members[self.row[k[i], c], b[i]]
        i, first = np.unique(i[has_own], return_index=True)
        k, b, c = k[i], b[i], c[has_own][first]
        alike[i] |= self.members[self.row[k, c]]
        for array in (self.on_manifold, self.moving_joints, self.ended, self.uncrossed):
            array[k, b] = array[k, c]
