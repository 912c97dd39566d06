"""Families of an arm whose other joints have no closed form: pieces of the curves that `traced_curves` follows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armkin.formula.arrays import Array, Bool, wrapped
from armkin.formula.rows import stacked
from armkin.inverse.branches.whole_turns import nearest_row
from armkin.inverse.numeric import newton
from armkin.inverse.numeric.tolerances import CONVERGING, REACH
from armkin.inverse.redundant.interval_pieces import Int, Pieces, best_samples, holding_none, margin, motion, none, runs
from armkin.inverse.redundant.other_joints import Follower
from armkin.inverse.redundant.traced_curves import Points, curves_of, onto
from armkin.model.limits import SLACK
from armkin.model.units import radian_or_reach

ON_LIMIT, ON_TURN = 12, 14  # steps to where a limit is crossed, and to where the joint turns back
STEPS = 16  # of the golden section


class Traced(NamedTuple):
    """`families.Curves` of targets N by tracing: their parameter counts the points of a curve."""

    find: Follower
    points: Points  # of all curves, one after the other
    after: Int  # (P,) the point after each, itself where an open curve ends
    begin: Int  # (C,) first point of each curve
    counts: Int  # (C,) of its points
    curve: Int  # (N, B) which curve branch b of a target is
    pieces: Pieces
    short: Bool
    complete: Bool  # never: a curve between two planes may be missing
    steps: int = STEPS

    @classmethod
    def along(cls, find: Follower) -> Traced:
        """The curves of all targets."""
        found = curves_of(find)
        N, n = find.near.shape
        count = np.array([len(one.points.miss) for one in found], np.intp)
        begin = np.cumsum(count) - count
        after = np.arange(1, int(count.sum()) + 1)
        for one, k, length in zip(found, begin.tolist(), count.tolist(), strict=True):
            after[k + length - 1] = k if one.closed else k + length - 1
        row = np.array([one.row for one in found], np.intp)
        branch = np.array([int((row[:k] == row[k]).sum()) for k in range(len(row))], np.intp)
        curve = np.zeros((N, int(branch.max(initial=0)) + 1), np.intp)
        curve[row, branch] = np.arange(len(row))
        points = stacked([one.points for one in found] or [Points(np.zeros((0, n)), np.zeros((0, n)), np.zeros(0))])
        curves = cls(find, points, after, begin, count, curve, none(n), *np.zeros((2, N), bool))
        if not len(row):
            return curves
        extent = np.zeros(N)
        way = np.add.reduceat(np.abs(curves.chord(np.arange(len(after)))), begin, axis=0).max(axis=1)
        np.maximum.at(extent, row, 0.5 * way)
        return curves._replace(pieces=curves._pieces(row, branch), short=(extent > 0) & (extent < REACH))

    def tried(self, pieces: Pieces, near: Array) -> list[Array]:
        """The samples beside the best one."""
        return [pieces.low, pieces.high]

    def at(self, pieces: Pieces, parameter: Array) -> tuple[Array, Bool]:
        """As `Turning.at`."""
        curve = self.curve[pieces.row, pieces.branch]
        whole = np.floor(parameter)
        point = self.begin[curve] + whole.astype(np.intp) % self.counts[curve]
        there = self.between(pieces.row, point, parameter - whole)
        q, legal = nearest_row(self.find.arm, there.q, self.find.near[pieces.row])
        return q, legal & (there.miss <= CONVERGING)

    def chord(self, point: Int) -> Array:
        """From points (M,) to those after them (M, n) [rad, reaches]."""
        return newton.difference(self.find.arm, self.points.q[self.after[point]], self.points.q[point])

    def between(self, row: Int, point: Int, share: Array) -> Points:
        """Points on the curves at shares (M,) of the way from points (M,) to those after them."""
        chord = self.chord(point)
        size = np.linalg.norm(chord, axis=1, keepdims=True)
        last = np.where(size > 0, chord / np.where(size > 0, size, 1.0), self.points.tangent[point])
        guess = self.points.q[point] + share[:, None] * chord * radian_or_reach(self.find.arm)
        return onto(self.find, row, guess, last)

    def _pieces(self, row: Int, branch: Int) -> Pieces:
        """All pieces of curves (C,)."""
        arm, j = self.find.arm, self.find.free.joint
        whose = np.repeat(row, self.counts)
        q, tangent, P = self.points.q, self.points.tangent, len(whose)
        index = np.arange(P)
        chord, next_tangent = self.chord(index), tangent[self.after]
        legal = margin(arm, q) >= -SLACK
        up = tangent[:, j] * (tangent * chord).sum(axis=1) > 0
        next_up = next_tangent[:, j] * (next_tangent * chord).sum(axis=1) > 0
        alive = self.after != index
        crosses, turns = (np.flatnonzero(alive & changed) for changed in (legal != legal[self.after], up != next_up))
        crossing, turning = np.full(P, np.inf), np.full(P, np.inf)
        crossing[crosses] = self._crossing(whose[crosses], crosses)
        turning[turns] = self._turning(whose[turns], turns, up[turns])
        # nodes: the points, and where something changes on the way to the next one
        point = np.concatenate([index, crosses, turns])
        share = np.concatenate([np.zeros(P), crossing[crosses], turning[turns]])
        order = np.lexsort((share, point))
        point, share = point[order], share[order]
        now_legal = np.where(crossing[point] <= share, legal[self.after][point], legal[point]) & alive[point]
        now_up = np.where(turning[point] <= share, next_up[point], up[point])
        posture, fits = self._postures(whose, point, share)
        cost = motion(arm, posture, self.find.near[whose[point]])
        costs = np.stack([cost, np.where(fits, cost, np.inf)])
        cuts = np.searchsorted(point, np.append(self.begin, P))
        parts = []
        for c, (k, end) in enumerate(zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True)):
            some = slice(k, end)
            nodes = _Nodes(
                point[some] - self.begin[c] + share[some], posture[some], costs[:, some], now_legal[some],
                now_up[some], alive[point[some]], int(self.counts[c]),
            )  # fmt: skip
            parts.append(nodes.pieces(int(row[c]), int(branch[c]), j))
        return stacked(parts)

    def _postures(self, whose: Int, point: Int, share: Array) -> tuple[Array, Bool]:
        """Nodes at their nearest legal copies, and whether they are legal."""
        q, some = self.points.q[point], np.flatnonzero(share)
        if len(some):
            q[some] = self.between(whose[point[some]], point[some], share[some]).q
        return nearest_row(self.find.arm, q, self.find.near[whose[point]])

    def _crossing(self, row: Int, point: Int) -> Array:
        """Shares of the way (M,) at which a limit is crossed: regula falsi, the Illinois way."""
        arm = self.find.arm
        lo, hi = np.zeros(len(point)), np.ones(len(point))
        at_lo, at_hi = margin(arm, self.points.q[point]), margin(arm, self.points.q[self.after[point]])
        share, side = 0.5 * (lo + hi), np.zeros(len(point))
        for _ in range(ON_LIMIT if len(point) else 0):
            apart = np.where(at_hi == at_lo, 1.0, at_hi - at_lo)
            share = np.where(at_hi == at_lo, 0.5 * (lo + hi), (lo * at_hi - hi * at_lo) / apart)
            value = margin(arm, self.between(row, point, share).q)
            low = (value >= 0) == (at_lo >= 0)
            at_hi = np.where(low, np.where(side > 0, 0.5 * at_hi, at_hi), value)
            at_lo = np.where(low, value, np.where(side < 0, 0.5 * at_lo, at_lo))
            lo, hi, side = np.where(low, share, lo), np.where(low, hi, share), np.where(low, 1.0, -1.0)
        return share

    def _turning(self, row: Int, point: Int, up: Bool) -> Array:
        """Shares of the way (M,) at which the joint turns back, which it does square: bisection to some 1e-5."""
        lo, hi = np.zeros(len(point)), np.ones(len(point))
        for _ in range(ON_TURN if len(point) else 0):
            middle = 0.5 * (lo + hi)
            same = (self.between(row, point, middle).tangent[:, self.find.free.joint] > 0) == up
            lo, hi = np.where(same, middle, lo), np.where(same, hi, middle)
        return lo


class _Nodes(NamedTuple):
    """The points of one curve, and where a limit is crossed or the joint turns back: K of them, as they follow."""

    at: Array  # (K,) parameter
    q: Array  # (K, n)
    cost: Array  # (2, K) motion from near; of legal ones
    legal: Bool  # (K,) behind the node
    up: Bool  # (K,) whether the joint grows behind it
    alive: Bool  # (K,) whether the curve goes on behind it
    whole: int  # the parameter after a whole turn

    def pieces(self, row: int, branch: int, joint: int) -> Pieces:
        """The pieces of the curve."""
        K = len(self.at)
        turns = (self.up != np.roll(self.up, 1))[None]
        good = (self.legal & self.alive)[None]
        _, first, length = runs(good, turns)
        empty_of, begin, count = runs(self.alive[None], turns)
        empty = holding_none(good, empty_of, begin, count)
        legal = np.repeat([True, False], [len(first), int(empty.sum())])
        first, length = np.concatenate([first, begin[empty]]), np.concatenate([length, count[empty]])
        best = best_samples(self.cost, legal.astype(np.intp), first, length + 1)
        t = self.q[:, joint]
        way = np.concatenate([[0.0], np.cumsum(np.tile(wrapped(np.roll(t, -1) - t), 2))])
        start = t[first]
        end = start + way[first + length] - way[first]

        def at(node: Int) -> Array:
            return np.asarray(self.at[node % K] + self.whole * (node // K))

        on = first + best
        return Pieces(
            np.full(len(first), row), np.full(len(first), branch), legal,
            np.minimum(start, end), np.where(length == K, np.minimum(start, end) + 2 * np.pi, np.maximum(start, end)),
            at(first), at(first + length),
            at(np.maximum(on - 1, first)), at(on), at(np.minimum(on + 1, first + length)),
            self.q[on % K],
        )  # fmt: skip
