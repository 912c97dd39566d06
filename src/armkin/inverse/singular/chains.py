"""Components longer than one polynomial holds: chains of these, each begun where the one before leaves its span.

A component on which the residual grows has two ends, where that passes `SOLUTION`. What lies between is on it.
"""

from typing import Any, NamedTuple

import numpy as np

from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.answers.batch import Goals
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.singular.local_structure import Structure, leave_spans, members, structure_ahead

FEW_LINKS = 4  # curves on each side of a posture whose component leaves a shortened span: others are decided elsewhere
LINKS = 24  # curves on each side of a posture, each as long as the last one lets expect


class Followed(NamedTuple):
    """What is known of the components of M postures after following them; of shape (M,) where no other is given."""

    members: Bool  # (M, K) which peers lie on the component
    known: Bool  # whether it was followed far enough to tell what it is
    manifold: Bool  # whether it is a self-motion manifold
    boundary: Bool  # whether it is a boundary; where it is neither, it is an isolated root
    joints: Bool  # (M, n) joints that move along a manifold
    ended: Bool  # whether both of its ends are known
    uncrossed: Bool  # whether both are, and no other curve crosses in between


class _Chains:
    """Two chains of curves from each of m postures: the first half of C = 2 m goes along v, the second against it."""

    def __init__(self, goals: Goals, at: Structure, begun: Int, place: tuple[Int, Int], peers: Array) -> None:
        """begun: (m,) which postures of M, as in `follow`."""
        (arm, self._task, target, _), posture = goals, np.tile(begun, 2)
        self._arm, row, column = arm, place[0][posture], place[1][posture]
        self._q, self._peers, self._target = peers[row, column], peers[row], target[row]
        # (m,) the same of those on one component; (C, K) which of them a peer is, -1 unless both are followed to ends
        self._group, number = np.arange(len(begun)), np.full(peers.shape[:2], -1)
        number[row, column] = np.where(at.known[posture], np.tile(self._group, 2), -1)
        self._number, self._v = np.where(at.known[posture, None], number[row], -1), at.v[begun]
        self._opposite = np.roll(np.arange(len(posture)), len(begun))  # (C,) the other end of what is followed
        self._span = (at.span_ratio * at.span)[posture]  # (C,) that of the next curve
        # (C, n) where the last curve leaves its span, nan if its component ends before, and the way there
        self._end, self._heading = leave_spans(arm, at, posture, self._q, np.concatenate([self._v, -self._v]))
        self.finished = np.isnan(self._end[:, 0])  # (C,) whether the component has ended, or closed
        self.active = ~self.finished  # (C,) whether another curve follows
        self.members = np.zeros(self._peers.shape[:2], bool)  # (C, K) which peers are on the way
        self._least_way, self._most_way = at.least_way[posture], at.most_way[posture]
        self.boundary, self.uncrossed = at.boundary[posture], at.uncrossed[posture]

    def add_curves(self) -> None:
        """One more curve for each chain that is active."""
        arm, chains, m = self._arm, np.flatnonzero(self.active), len(self._group)
        start, every, target = self._end[chains], np.arange(len(chains)), self._target[chains]
        curve = structure_ahead(arm, self._task, start, target, self._span[chains], self._heading[chains])
        self._span[chains] *= curve.span_ratio
        self.active[chains] = curve.second > tol.HIGH_ORDER
        holds = curve.followed & self.active[chains]
        # a curve closes where its two sides meet: a step may pass where the other was, or now is
        opposite = self._opposite[chains]
        opposite_start, holding = self._end[opposite], chains[holds]
        end, heading = leave_spans(arm, curve, every, start, curve.v)
        self._end[holding], self._heading[holding] = end[holds], heading[holds]
        tested = np.concatenate([self._peers[chains], opposite_start[:, None], self._end[opposite][:, None]], axis=1)
        way = newton.difference(arm, tested, start[:, None])
        passed = members(curve, every, way) & holds[:, None]
        self.members[chains] |= passed[:, :-2]
        shift = newton.difference(arm, start, self._q[chains])
        self._least_way[holding] = np.minimum(self._least_way[holding], (shift + curve.least_way)[holds])
        self._most_way[holding] = np.maximum(self._most_way[holding], (shift + curve.most_way)[holds])
        self.boundary[holding] |= curve.boundary[holds]
        self.uncrossed[holding] &= curve.uncrossed[holds]
        self.finished[holding] = np.isnan(end[holds, 0])
        closed = passed[:, -2:].any(axis=1)
        self.finished[chains[closed]] = self.finished[opposite[closed]] = True
        # a chain that comes to another posture has met the one that leads back from there
        for c, k in np.argwhere(passed[:, :-2] & (self._number[chains] >= 0)):
            posture = self._number[chains[c], k]
            pair = np.array([chains[c], posture + m * (way[c, k] @ self._v[posture] > 0.0)])
            self.finished[pair], ends = True, self._opposite[pair]
            self._opposite[ends] = ends[::-1]
            self._group[self._group == self._group[pair[1] % m]] = self._group[pair[0] % m]
        self.active &= ~self.finished

    def extent(self) -> Array:
        """How far the joints of each posture move in all (m, n)."""
        return np.asarray(by_sides(self._most_way).max(axis=0) - by_sides(self._least_way).min(axis=0))

    def of_components(self, ufunc: np.ufunc, values: Any) -> Any:
        """What values (m, ...) of the postures on one component amount to, for each of them."""
        total = values.copy()
        ufunc.at(total, self._group, values)
        return total[self._group]


def by_sides(array: Array | Bool) -> Any:
    """What chains (C, ...) have by their sides: (2, m, ...)."""
    return array.reshape(2, -1, *array.shape[1:])


def follow(goals: Goals, at: Structure, place: tuple[Int, Int], peers: Array) -> Followed:
    """The components of M of the targets' peers (N, K, n), at place, with structures `at`; which peers lie on them.

    Components on which the residual grows, and those that leave a shortened span, are followed both ways until they
    end or close; the latter at most as far as tells that they are manifolds.
    """
    way = newton.difference(goals.arm, peers[place[0]], peers[place][:, None])
    on_component, residual = members(at, np.arange(len(way)), way), np.linalg.norm(np.abs(at.g).sum(axis=0), axis=1)
    ended = np.asarray(at.known & (np.maximum(-at.low, at.high) < at.span))
    known, manifold, boundary = at.known.copy(), at.manifold.copy(), at.boundary.copy()
    joints, uncrossed = at.joints.copy(), at.uncrossed.copy()
    goes_on = np.where(at.known, at.manifold & ~ended & (residual > tol.ERROR), at.followed)
    begun = np.flatnonzero(goes_on & (at.second > tol.HIGH_ORDER))
    if len(begun):
        chains = _Chains(goals, at, begun, place, peers)
        for count in range(1, LINKS + 1):
            if not chains.active.any():
                break
            chains.add_curves()
            enough = (count == FEW_LINKS) | (chains.extent().max(axis=1) >= tol.REACH)
            chains.active &= ~np.tile(enough & ~at.known[begun], 2)
        extent = chains.of_components(np.maximum, chains.extent())
        ended[begun] = chains.of_components(np.logical_and, by_sides(chains.finished).all(axis=0))
        on_component[begun] |= by_sides(chains.members).any(axis=0)
        on_component[begun] = chains.of_components(np.logical_or, on_component[begun])
        manifold[begun] = extent.max(axis=1) >= tol.REACH
        known[begun] = manifold[begun] | ended[begun]
        boundary[begun] = by_sides(chains.boundary).any(axis=0) & ~manifold[begun]
        uncrossed[begun] = chains.of_components(np.logical_and, by_sides(chains.uncrossed).all(axis=0))
        joints[begun] = manifold[begun, None] & (extent > tol.MOVED * extent.max(axis=1)[:, None])
    return Followed(on_component, known, manifold, boundary, joints, ended, ended & uncrossed)
