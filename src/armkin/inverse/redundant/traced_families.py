"""Families of an arm whose other joints have no closed form: pieces of the curves that `traced_curves` joins."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from armkin.formula.array_tuples import replace_rows, rows_of
from armkin.formula.arrays import Array, Bool, Int, wrap_angle
from armkin.inverse.branches.whole_turns import nearest_row
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.numeric.newton import nudged
from armkin.inverse.redundant.curve_points import Points, Ways, onto_curves
from armkin.inverse.redundant.interval_pieces import Pieces, best_samples, holding_none, margin, motion, none, runs
from armkin.inverse.redundant.other_joints import Follower
from armkin.inverse.redundant.traced_curves import Chains, curves_of
from armkin.model.limits import SLACK
from armkin.model.units import radian_or_reach

AT_ONCE = 128  # targets whose points are worked on together
PARTS = 4  # parts of the way between two points, at whose ends limits and the joint's sense are asked
SECANTS = 10  # steps along a cubic to where a limit is crossed or the joint turns back
WAY = 0.1  # share of the way, to both sides, at which a cubic's slope tells how the joint turns back, as a parabola
TURNS = 5  # steps along the curve to where the joint turns back
LAST = 100  # last steps, at most, which take away what is left of a posture's residual
STEPS = 12  # steps of the golden section


def trace_families(follower: Follower) -> Iterator[Traced]:
    """The traced families of all targets, some at a time."""
    chains = curves_of(follower)
    point = np.append(0, np.cumsum(chains.counts))
    for k in range(0, len(follower.target), AT_ONCE):
        a, b = np.searchsorted(chains.row, [k, k + AT_ONCE])
        part = slice(a, b)
        points = rows_of(chains.points, slice(point[a], point[b]))
        curves = Chains(points, chains.row[part] - k, chains.counts[part], chains.closed[part])
        yield Traced.of(follower.of(np.arange(k, min(k + AT_ONCE, len(follower.target)))), curves)


class Traced(NamedTuple):
    """`families.Curves` of targets N by tracing: their parameter counts the points of a curve."""

    follower: Follower
    points: Points  # points of all curves, one after the other
    ways: Ways  # ways from each point to the next one
    row: Int  # (P,) whose target
    begin: Int  # (C,) first point of each curve
    counts: Int  # (C,) of its points
    after: Int  # (P,) the point after each, itself where an open curve ends
    curve: Int  # (N, B) which curve branch b of a target is
    pieces: Pieces
    short: Bool
    complete: Bool  # never: a curve between two planes may be missing
    steps: int = STEPS

    @classmethod
    def of(cls, follower: Follower, chains: Chains) -> Traced:
        """Curves of some targets."""
        points, row, count, _ = chains
        N, begin, after = len(follower.target), np.cumsum(count) - count, chains.after
        branch = np.arange(len(row)) - np.searchsorted(row, row)
        curve = np.zeros((N, int(branch.max(initial=0)) + 1), np.intp)
        curve[row, branch] = np.arange(len(row))
        cubics = Ways.between(follower, points, rows_of(points, after))
        pieces, flags = none(follower.arm.n), np.zeros((2, N), bool)
        curves = cls(follower, points, cubics, np.repeat(row, count), begin, count, after, curve, pieces, *flags)
        if not len(points.step):
            return curves
        extent = np.zeros(N)
        np.maximum.at(extent, row, 0.5 * np.add.reduceat(np.abs(cubics.chord), begin, axis=0).max(axis=1))
        pieces = curves._nodes().of_curves(curves, row, branch)
        return curves._replace(pieces=pieces, short=(extent > 0) & (extent < tol.REACH))

    def at(self, pieces: Pieces, parameter: Array) -> tuple[Array, Bool]:
        """Postures of pieces at a parameter, and whether they are legal: as `Turning.at`."""
        curve = self.curve[pieces.row, pieces.branch]
        floor = np.floor(parameter)
        point = self.begin[curve] + floor.astype(np.intp) % self.counts[curve]
        points = self._between(point, parameter - floor, tol.REACH)  # a cubic's miss squared is left
        q, legal = nearest_row(self.follower.arm, points.q, self.follower.near[pieces.row])
        return q, legal & (points.step < tol.REACH)

    def without_residual(self, pieces: Pieces, q: Array) -> Array:
        """Postures (P, n) of pieces, moved onto their targets from where `at` leaves them, by steps of least norm."""
        follower, q, active = self.follower, q.copy(), np.arange(len(q))
        for _ in range(LAST):
            if not len(active):
                break
            residual, J = newton.scaled_residual_and_jacobian(
                follower.arm, follower.redundant.task, q[active], follower.target[pieces.row[active]]
            )
            weight = nudged(np.linalg.solve, J @ J.transpose(0, 2, 1), residual[:, :, None])
            step = (J.transpose(0, 2, 1) @ weight)[:, :, 0]
            q[active] += step * radian_or_reach(follower.arm)
            active = active[np.abs(step).max(axis=1) >= tol.PAIR_STEP]
        return q

    def _between(self, point: Int, share: Array, tolerance: float = tol.PAIR_STEP) -> Points:
        """Points of the curves at shares (M,) of the way from points (M,) to those after them."""
        cubics = rows_of(self.ways, point)
        last = np.where(cubics.chord.any(axis=1, keepdims=True), cubics.chord, self.points.tangent[point])
        return onto_curves(self.follower, self.row[point], cubics.at(self.follower, share), last, tolerance)

    def _nodes(self) -> _Nodes:
        """Samples of all curves, and where something changes between them."""
        arm, j, P = self.follower.arm, self.follower.redundant.joint, len(self.row)
        point, parts = np.repeat(np.arange(P), PARTS), np.arange(PARTS) / PARTS
        part, samples = np.tile(parts, P), [self.ways.at(self.follower, u) for u in parts]
        # joint after joint in memory, as `margin` and `motion` read them
        q = np.stack(samples).transpose(2, 1, 0).reshape(arm.n, -1).T
        rises = (np.stack([self.ways.slope(u, j) for u in parts], axis=1) > 0).ravel()
        alive = self.after[point] != point
        following = np.arange(1, len(point) + 1)
        following[PARTS - 1 :: PARTS] = PARTS * self.after
        legal: Bool = np.asarray(margin(arm, q) >= -SLACK)
        next_legal, next_rises = legal[following], rises[following]
        crosses, turns = (np.flatnonzero(alive & changed) for changed in (legal != next_legal, rises != next_rises))
        cross_share, turn_share = np.full(len(point), np.inf), np.full(len(point), np.inf)
        cross_share[crosses], cross_q = self._crossing(point[crosses], part[crosses])
        turn_share[turns], turn_q = self._turning(point[turns], part[turns])
        cell = np.concatenate([np.arange(len(point)), crosses, turns])
        share = np.concatenate([part, cross_share[crosses], turn_share[turns]])
        postures = np.concatenate([q.T, cross_q.T, turn_q.T], axis=1)
        order = np.lexsort((share, cell))
        cell, share = cell[order], share[order]
        point = point[cell]
        return _Nodes(
            np.minimum(point + share, np.nextafter(point + 1.0, 0.0)),  # at the end still of its curve
            postures.take(order, axis=1).T,
            np.where(cross_share[cell] <= share, next_legal[cell], legal[cell]) & alive[cell],
            np.where(turn_share[cell] <= share, next_rises[cell], rises[cell]), alive[cell],
        )  # fmt: skip

    def _crossing(self, point: Int, low: Array) -> tuple[Array, Array]:
        """Shares of the way (M,) at which a limit is crossed, and the postures there: its joint is held on it."""
        arm, cubics = self.follower.arm, rows_of(self.ways, point)
        share = _find_root(lambda t: margin(arm, cubics.at(self.follower, t)), low, low + 1.0 / PARTS)
        guess = cubics.at(self.follower, share)
        free = (arm.upper - arm.lower == np.inf) | (~arm.prismatic & (arm.upper - arm.lower >= 2 * np.pi))
        low, high = np.where(free, 0.0, arm.lower), np.where(free, 0.0, arm.upper)
        offset = guess - 0.5 * (low + high)
        offset = np.where(arm.prismatic, offset, wrap_angle(offset))
        room = np.where(free, np.inf, 0.5 * (high - low) - np.abs(offset))
        joint, index = room.argmin(axis=1), np.arange(len(point))
        fixed = np.zeros_like(guess)
        fixed[index, joint] = 1.0
        guess[index, joint] += np.sign(offset[index, joint]) * room[index, joint]
        points = onto_curves(self.follower, self.row[point], guess, fixed)
        valid = points.settled & (np.abs(points.q - guess).max(axis=1, initial=0.0) < tol.REACH)
        touching = np.flatnonzero(~valid)  # the joint touches its limit alone
        points.q[touching] = self._between(point[touching], share[touching]).q
        return share, points.q

    def _turning(self, point: Int, low: Array) -> tuple[Array, Array]:
        """Shares of the way (M,) at which the joint turns back, and the postures there: by a step along the tangent."""
        j, arcs = self.follower.redundant.joint, rows_of(self.ways, point)
        share = _find_root(lambda t: arcs.slope(t, j), low, low + 1.0 / PARTS)
        end = self._between(point, share)
        size = np.maximum(np.sqrt((arcs.begin**2).sum(axis=1)), tol.TINY)
        bend = (arcs.slope(share + WAY, j) - arcs.slope(share - WAY, j)) / (2.0 * WAY * np.maximum(size**2, tol.TINY))
        for _ in range(TURNS):
            step = -end.tangent[:, j] / np.where(np.abs(bend) > tol.TINY, bend, np.inf)
            step = np.clip(step, -tol.REACH * size, tol.REACH * size)
            rows = np.flatnonzero(np.abs(step) > tol.PAIR_STEP)  # of a shorter one the bend would be rounding
            if not len(rows):
                break
            predicted = end.q + step[:, None] * end.tangent * radian_or_reach(self.follower.arm)
            moved = onto_curves(self.follower, self.row[point[rows]], predicted[rows], end.tangent[rows])
            bend[rows] = (moved.tangent - end.tangent[rows])[:, j] / step[rows]
            replace_rows(end, rows, moved)
        return share, end.q


def _find_root(value: Callable[[Array], Array], lo: Array, hi: Array) -> Array:
    """Where values change their sign between lo and hi (M,): regula falsi, the Illinois way."""
    at_lo, at_hi = value(lo), value(hi)
    share, side = 0.5 * (lo + hi), np.zeros(len(lo))
    for _ in range(SECANTS if len(lo) else 0):
        difference = np.where(at_hi == at_lo, 1.0, at_hi - at_lo)
        share = np.where(at_hi == at_lo, 0.5 * (lo + hi), (lo * at_hi - hi * at_lo) / difference)
        share = np.clip(share, lo, hi)
        middle = value(share)
        low = (middle >= 0) == (at_lo >= 0)
        at_hi = np.where(low, np.where(side > 0, 0.5 * at_hi, at_hi), middle)
        at_lo = np.where(low, middle, np.where(side < 0, 0.5 * at_lo, at_lo))
        lo, hi, side = np.where(low, share, lo), np.where(low, hi, share), np.where(low, 1.0, -1.0)
    return share


class _Nodes(NamedTuple):
    """Samples of curves, and where a limit is crossed or the joint turns back: K of them, as they follow."""

    at: Array  # (K,) parameter, counting the points of all curves
    q: Array  # (K, n)
    legal: Bool  # (K,) behind the node
    up: Bool  # (K,) whether the joint grows behind it
    alive: Bool  # (K,) whether the curve goes on behind it

    def of_curves(self, curves: Traced, row: Int, branch: Int) -> Pieces:
        """The pieces of curves (C,), which begin with the posture of their best node."""
        node, value = self._table(curves)
        near = curves.follower.near.T.take(curves.row[self.at.astype(np.intp)], axis=1).T
        K = node.shape[1]
        curve, first, length, legal = self._runs(node)
        q, fits = nearest_row(curves.follower.arm, self.q, near)
        cost = motion(curves.follower.arm, q, near)
        costs = np.concatenate([cost[node], np.where(fits, cost, np.inf)[node]])
        best_sample = best_samples(costs, curve + len(row) * legal, first, length + 1)
        a, b = _ends_of_pieces(self.q[node, curves.follower.redundant.joint], curve, first, length)

        def parameter(sample: Int) -> Array:
            return np.asarray(value[curve, sample % K] + curves.counts[curve] * (sample // K))

        best_at, last = first + best_sample, first + length
        pieces = Pieces(
            row=row[curve], branch=branch[curve], legal=legal, a=a, b=b, first=parameter(first), last=parameter(last),
            low=parameter(np.maximum(best_at - 1, first)), at=parameter(best_at),
            high=parameter(np.minimum(best_at + 1, last)), start=q[node[curve, best_at % K]],
        )  # fmt: skip
        exact, allowed = curves.at(pieces, pieces.at)
        is_inner = (best_sample > 0) & (best_sample < length) & (allowed | ~legal)
        return pieces._replace(start=np.where(is_inner[:, None], exact, pieces.start))

    def _table(self, curves: Traced) -> tuple[Int, Array]:
        """The nodes of curves C, a row each (C, K), and their parameters; the last one is repeated, at the parameter
        where the curve closes."""
        begin = np.searchsorted(self.at, curves.begin)
        count = np.diff(begin, append=len(self.at))
        k, last = np.arange(int(count.max())), begin + count - 1
        node = np.minimum(begin[:, None] + k, last[:, None])
        closing = (k >= count[:, None]) & self.alive[last][:, None]
        value = np.where(closing, curves.counts[:, None], self.at[node] - curves.begin[:, None])
        return np.where(closing, begin[:, None], node), value

    def _runs(self, node: Int) -> tuple[Int, Int, Int, Bool]:
        """Runs of nodes (C, K) along which the joint does not turn back, legal ones and those that hold no legal node:
        their curves, first nodes, lengths, and whether legal."""
        legal, rises = self.legal[node], self.up[node]
        turns = rises != np.roll(rises, 1, axis=1)
        of_legal, others = runs(legal, turns), runs(self.alive[node], turns)
        empty = holding_none(legal, *others)
        curve, first, length = (np.append(x, y[empty]) for x, y in zip(of_legal, others, strict=True))
        return curve, first, length, np.arange(len(curve)) < len(of_legal[0])


def _ends_of_pieces(value: Array, curve: Int, first: Int, length: Int) -> tuple[Array, Array]:
    """The least and the largest value of a joint along runs (R,) of curves' nodes, at which it has values (C, K)."""
    K = value.shape[1]
    change = np.cumsum(np.pad(wrap_angle(np.roll(value, -1, axis=1) - value), [(0, 0), (1, 0)]), axis=1)
    rounds, last = np.divmod(first + length, K)
    start = value[curve, first]
    end = start + rounds * change[curve, K] + change[curve, last] - change[curve, first]
    low = np.minimum(start, end)
    return low, np.where(length == K, low + 2 * np.pi, np.maximum(start, end))
