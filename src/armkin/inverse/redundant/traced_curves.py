"""Curves of answers of an arm whose other joints have no closed form: answers on planes of a joint, joined to curves.

Two answers are joined where the cubic through both, along their tangents, solves the target in its middle, as well as
where that holds of both halves after the middle is moved onto the curve. What such cubics do not join is traced through
the slab between two planes, step by step.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armkin.formula.array_tuples import rows_of, stack_rows
from armkin.formula.arrays import Array, Bool, Int, numbers_within, wrap_angle
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.redundant.curve_points import Points, Ways, onto_curves
from armkin.inverse.redundant.curve_starts import Nodes, answers_off_curves, answers_on_planes, first_of_equals
from armkin.inverse.redundant.other_joints import Follower
from armkin.model.units import radian_or_reach

HALVINGS = 6  # halvings of the way between two answers
ARC_LENGTH = 6.0  # distance [rad, reaches], at most, of answers that one cubic joins
MAX_STEP = 0.3  # longest step [rad, reaches] along a curve
SIDE_SHARE = 0.3  # distance, as a share of a step, that Newton's method moves a point sideways at most
TRIES = 100  # steps, at most, of one arc
ROUNDS = 20  # arcs, at most, of one curve, each to the next plane


class _Curves:
    """Nodes of curves, and which halves are joined."""

    def __init__(self, follower: Follower, whose: Int, q: Array) -> None:
        self.follower = follower
        self.planes, self.nodes, grid = answers_on_planes(follower, whose, q)
        self.partner = np.full(2 * len(self.nodes.row), -1)
        self.traced = np.zeros(len(self.partner), bool)  # a half that comes to nothing would do so again
        behind = (np.arange(grid.shape[1]) + 1) % self.planes.counts[:, None]
        following = np.take_along_axis(grid, behind[:, :, None], axis=1)
        adjacent = (grid >= 0) & (following >= 0)
        self._join(2 * grid[adjacent], 2 * following[adjacent] + 1)

    def _add(self, nodes: Nodes) -> Int:
        """More nodes: their numbers."""
        first = len(self.nodes.row)
        self.nodes = stack_rows([self.nodes, nodes])
        self.partner = np.append(self.partner, np.full(2 * len(nodes.row), -1))
        self.traced = np.append(self.traced, np.zeros(2 * len(nodes.row), bool))
        return np.arange(first, first + len(nodes.row))

    def _join(self, a: Int, b: Int) -> None:
        """Halves a and b (M,) joined by cubics, of which each must do."""
        follower, whose, failed = self.follower, np.arange(len(a)), np.zeros(len(a), bool)
        links: list[tuple[Int, Int, Int]] = []
        for k in range(HALVINGS + 1):
            if not len(a):
                break
            first, last = self.nodes.leaving(a), self.nodes.leaving(b)
            ways = Ways.between(follower, first, last._replace(tangent=-last.tangent))
            size = np.sqrt((ways.chord**2).sum(axis=1))
            apart = (ways.chord * first.tangent).sum(axis=1) < 0
            apart |= ((ways.chord * last.tangent).sum(axis=1) > 0) | (size > ARC_LENGTH)
            row = self.nodes.row[a >> 1]
            good = ~apart & ways.follow(follower, row)
            links.append((a[good], b[good], whose[good]))
            failed[whose[apart]] = True
            left = np.flatnonzero(~good & ~failed[whose])
            if k == HALVINGS:
                failed[whose[left]] = True
                break
            middle = rows_of(ways, left).at(follower, 0.5)
            points = onto_curves(follower, row[left], middle, ways.chord[left] / size[left, None], tol.SAME_SEED)
            aside = newton.wrapped_distance(follower.arm, points.q, middle)
            good = (points.step < tol.SAME_SEED) & (aside < SIDE_SHARE * size[left])
            failed[whose[left[~good]]] = True
            left = left[good]
            middles = self._add(Nodes(row[left], np.full(len(left), -1), rows_of(points, good)))
            a, b = np.concatenate([a[left], 2 * middles]), np.concatenate([2 * middles + 1, b[left]])
            whose = np.tile(whose[left], 2)
        a, b, whose = (np.concatenate(column) for column in zip(*links, strict=True)) if links else (a, b, whose)
        a, b = a[~failed[whose]], b[~failed[whose]]
        self.partner[a], self.partner[b] = b, a

    def slab(self, half: Int) -> Int:
        """In which slab between two planes halves are: the plane below it."""
        row = self.nodes.row[half >> 1]
        return np.asarray((self.nodes.plane[half >> 1] - (half & 1)) % self.planes.counts[row])

    def open(self) -> Int:
        """Halves that are joined to none, of nodes on planes."""
        return np.flatnonzero((self.partner < 0) & (np.repeat(self.nodes.plane, 2) >= 0))

    def join_pairs(self) -> None:
        """Open halves of a slab, each with the one that a short cubic leads to, and which leads to it."""
        half = self.open()
        slab = self.planes.place(self.nodes.row[half >> 1], self.slab(half))
        order, every = np.argsort(slab, kind="stable"), np.arange(len(half))
        half, slab = half[order], slab[order]
        first, behind = np.searchsorted(slab, slab, "left"), np.searchsorted(slab, slab, "right")
        place = first[:, None] + np.arange(max((behind - first).max(initial=0), 1))
        a, b = np.broadcast_to(every[:, None], place.shape), np.minimum(place, len(half) - 1)
        begin, end = self.nodes.leaving(half), self.nodes.leaving(half[b])
        chord = newton.difference(self.follower.arm, end.q, begin.q[:, None])
        along = (chord * (begin.tangent[:, None] - end.tangent)).sum(axis=2)
        cost = 2.0 * np.sqrt((chord * chord).sum(axis=2)) - 0.5 * along
        cost[(along <= 0) | (place >= behind[:, None]) | (a == b)] = np.inf
        best = cost.argmin(axis=1)
        to = np.where(np.isfinite(cost[every, best]), b[every, best], -1)
        mutual = np.flatnonzero((to > every) & (to[to] == every))
        self._join(half[mutual], half[to[mutual]])

    def trace(self) -> None:
        """Open halves, step by step to where they leave their slab."""
        ray = self.open()
        ray = ray[~self.traced[ray]]
        self.traced[ray] = True
        passed, end, plane = self._steps(ray)
        arrived, every = np.flatnonzero(plane >= 0), np.arange(len(ray))
        row, slab = self.nodes.row[ray >> 1], self.slab(ray)
        number = self._on_plane(Nodes(row[arrived], plane[arrived], rows_of(end, arrived)))
        to, place = np.full(len(ray), -1), np.full(len(self.partner), len(ray))
        to[arrived], place[ray] = 2 * number + (plane[arrived] != slab[arrived]), every
        # an arc is traced from both of its ends: one of the two traces is kept
        chosen = (to >= 0) & (self.partner[to] < 0) & (every < place[to]) & (to != ray)
        chosen &= np.isin(every, np.unique(to, return_index=True)[1])
        rays, whose = np.flatnonzero(chosen), np.concatenate([rays for rays, _ in passed])
        passing = np.flatnonzero(chosen[whose])
        points, whose = rows_of(stack_rows([points for _, points in passed]), passing), whose[passing]
        added = self._add(Nodes(row[whose], np.full(len(passing), -1), points))
        a = np.append(ray[rays], 2 * added)[np.argsort(np.append(rays, whose), kind="stable")]
        b = np.append(2 * added + 1, to[rays])[np.argsort(np.append(whose, rays), kind="stable")]
        self._join(a, b)

    def _on_plane(self, arrived: Nodes) -> Int:
        """The nodes that others, on planes, are; those that are none yet become one."""
        places, number = self.planes.place(arrived.row, arrived.plane), np.full(len(arrived.row), -1)
        for _ in range(2):
            near = np.flatnonzero(self.nodes.plane >= 0)
            place = self.planes.place(self.nodes.row[near], self.nodes.plane[near])
            shared = np.isin(place, places)
            i, k = np.nonzero(places[:, None] == place[shared])
            k = near[shared][k]
            apart = newton.wrapped_distance(self.follower.arm, arrived.points.q[i], self.nodes.points.q[k])
            number[i[apart < tol.SAME_SEED]] = k[apart < tol.SAME_SEED]
            added = np.flatnonzero(number < 0)
            if not len(added):
                break
            added = added[first_of_equals(self.follower, places[added], arrived.points.q[added])]
            self._add(Nodes(arrived.row[added], arrived.plane[added], rows_of(arrived.points, added)))
        return number

    def _steps(self, ray: Int) -> tuple[list[tuple[Int, Points]], Points, Int]:
        """From halves (M,): the points passed on the way, of which rays; those on the plane at the end, and which, -1:
        lost."""
        follower, j, values = self.follower, self.planes.guide.joint, self.planes.values
        unit = radian_or_reach(follower.arm)
        row, slab, current = self.nodes.row[ray >> 1], self.slab(ray), self.nodes.leaving(ray)
        behind = (slab + 1) % self.planes.counts[row]
        low, h = values[row, slab], np.full(len(ray), MAX_STEP)
        wide = np.remainder(values[row, behind] - low, 2 * np.pi)
        end, plane = Points(*(x.copy() for x in current)), np.full(len(ray), -1)
        passed, going = [(ray[:0], rows_of(current, ray[:0]))], np.arange(len(ray))
        for _ in range(TRIES):
            begin, step = rows_of(current, going), h[going, None]
            ahead = begin.q + step * begin.tangent * unit
            then = onto_curves(follower, row[going], ahead, begin.tangent, tol.SAME_SEED)
            way = Ways.between(follower, begin, then)
            aside = np.sqrt(((way.chord - step * begin.tangent) ** 2).sum(axis=1))
            good = (then.step < tol.SAME_SEED) & (aside < SIDE_SHARE * h[going]) & way.follow(follower, row[going])
            h[going] = np.where(good, np.minimum(1.5 * h[going], MAX_STEP), 0.5 * h[going])
            middle = low[going] + 0.5 * wide[going]
            depth, before = (wrap_angle(points.q[:, j] - middle) for points in (then, begin))
            left = good & (np.abs(depth) >= 0.5 * wide[going]) & (np.abs(depth - before) > tol.TINY)
            leaving, far = going[left], depth[left] > 0
            goal = np.where(far, 0.5, -0.5) * wide[leaving]
            share = np.clip((goal - before[left]) / (depth[left] - before[left]), 0.0, 1.0)
            guess = begin.q[left] + share[:, None] * way.chord[left] * unit
            guess[:, j] = middle[left] + goal
            landed = onto_curves(follower, row[leaving], guess, self.planes.held(len(leaving)))
            plane[leaving] = np.where(landed.settled, np.where(far, behind[leaving], slab[leaving]), -1)
            inside = good & ~left
            passed.append((going[inside], rows_of(then, inside)))
            for column, moved, last, final in zip(current, then, end, landed, strict=True):
                column[going[inside]] = moved[inside]
                last[leaving] = final
            going = going[~left & (h[going] > tol.SHORTEST_ARC)]
            if not len(going):
                break
        return passed, end, plane


class Chains(NamedTuple):
    """Curves C, target after target: their points P in their order, along their tangents."""

    points: Points
    row: Int  # (C,) whose target
    counts: Int  # (C,) of points
    closed: Bool  # (C,) the last one is joined to the first

    @property
    def after(self) -> Int:
        """The point after each (P,), itself where an open curve ends."""
        begin = np.cumsum(self.counts) - self.counts
        after = np.arange(1, int(self.counts.sum()) + 1)
        after[begin + self.counts - 1] = np.where(self.closed, begin, begin + self.counts - 1)
        return after

    def curves(self, chosen: Int) -> Chains:
        """Some of the curves, in that order."""
        count = self.counts[chosen]
        first = np.cumsum(self.counts) - self.counts
        point = numbers_within(count) + np.repeat(first[chosen], count)
        return Chains(rows_of(self.points, point), self.row[chosen], count, self.closed[chosen])


def curves_of(follower: Follower) -> Chains:
    """All curves of all targets that an answer is on; of targets with answers that no curve passes, anew from these."""
    chains = _join_curves(follower, np.zeros(0, np.intp), follower.near[:0])
    row, q = answers_off_curves(follower, chains.points, np.repeat(chains.row, chains.counts), chains.after)
    if not len(row):
        return chains
    again, place = np.unique(row, return_inverse=True)
    more = _join_curves(follower.of(again), place, q)
    unchanged = chains.curves(np.flatnonzero(~np.isin(chains.row, again)))
    joined = stack_rows([unchanged, more._replace(row=again[more.row])])
    return joined.curves(np.argsort(joined.row, kind="stable"))


def _join_curves(follower: Follower, whose: Int, q: Array) -> Chains:
    """Curves of all targets that an answer on a plane, or one of q (M, n) of targets whose (M,), is on."""
    curves = _Curves(follower, whose, q)
    for _ in range(ROUNDS):
        if curves.traced[curves.open()].all():
            break
        curves.join_pairs()
        curves.trace()
    return _chain_halves(curves)


def _chain_halves(curves: _Curves) -> Chains:
    """Halves that are joined as curves, each in one of its two senses."""
    partner, nodes = curves.partner, curves.nodes
    M = len(partner)
    every, end = np.arange(M), M
    behind = np.append(np.where(partner < 0, end, partner ^ 1), end)  # the half that a curve goes on with
    rounds = range(max(M, 1).bit_length())
    jump, least = behind.copy(), np.arange(M + 1)
    for _ in rounds:
        least, jump = np.minimum(least, least[jump]), jump[jump]
    ring = jump[:-1] != end
    behind[:-1][ring & (behind[:-1] == least[:-1])] = end  # a ring begins at its least half
    jump, left = behind.copy(), (behind < end).astype(np.intp)
    last = np.where(behind < end, behind, np.arange(M + 1))
    for _ in rounds:
        left, last, jump = left + left[jump], last[last], jump[jump]
    last = last[:-1]
    first = np.full(M + 1, -1)
    begins = np.ones(M + 1, bool)
    begins[behind] = False
    first[last[begins[:-1]]] = np.flatnonzero(begins[:-1])
    use = np.where(ring, least[:-1] < least[every ^ 1], last < (first[last] ^ 1))
    use &= (nodes.plane[every >> 1] >= 0) | (left[:-1] > 0) | (last != first[last])  # not a middle of a way that failed
    halves = np.flatnonzero(use)
    row = nodes.row[halves >> 1]
    order = np.lexsort((-left[halves], last[halves], row))
    halves, row = halves[order], row[order]
    begin = np.flatnonzero(np.diff(last[halves], prepend=-1))
    return Chains(nodes.leaving(halves), row[begin], np.diff(begin, append=len(halves)), ring[halves[begin]])
