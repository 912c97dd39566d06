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

    def __init__(self, follower: Follower, owner: Int, q: Array) -> None:
        self.follower = follower
        self.planes, self.nodes, grid = answers_on_planes(follower, owner, q)
        self.partner = np.full(2 * len(self.nodes.row), -1)
        self.traced = np.zeros(len(self.partner), bool)  # a half that comes to nothing would do so again
        next_plane = (np.arange(grid.shape[1]) + 1) % self.planes.counts[:, None]
        following = np.take_along_axis(grid, next_plane[:, :, None], axis=1)
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
        follower, pair, failed = self.follower, np.arange(len(a)), np.zeros(len(a), bool)
        links: list[tuple[Int, Int, Int]] = []
        for k in range(HALVINGS + 1):
            if not len(a):
                break
            first, last = self.nodes.leaving(a), self.nodes.leaving(b)
            arcs = Ways.between(follower, first, last._replace(tangent=-last.tangent))
            size = np.sqrt((arcs.chord**2).sum(axis=1))
            failing = (arcs.chord * first.tangent).sum(axis=1) < 0
            failing |= ((arcs.chord * last.tangent).sum(axis=1) > 0) | (size > ARC_LENGTH)
            row = self.nodes.row[a >> 1]
            valid = ~failing & arcs.follow(follower, row)
            links.append((a[valid], b[valid], pair[valid]))
            failed[pair[failing]] = True
            todo = np.flatnonzero(~valid & ~failed[pair])
            if k == HALVINGS:
                failed[pair[todo]] = True
                break
            middle = rows_of(arcs, todo).at(follower, 0.5)
            points = onto_curves(follower, row[todo], middle, arcs.chord[todo] / size[todo, None], tol.SAME_SEED)
            drift = newton.wrapped_distance(follower.arm, points.q, middle)
            valid = (points.step < tol.SAME_SEED) & (drift < SIDE_SHARE * size[todo])
            failed[pair[todo[~valid]]] = True
            todo = todo[valid]
            middles = self._add(Nodes(row[todo], np.full(len(todo), -1), rows_of(points, valid)))
            a, b = np.concatenate([a[todo], 2 * middles]), np.concatenate([2 * middles + 1, b[todo]])
            pair = np.tile(pair[todo], 2)
        a, b, pair = (np.concatenate(column) for column in zip(*links, strict=True)) if links else (a, b, pair)
        a, b = a[~failed[pair]], b[~failed[pair]]
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
        first, slab_end = np.searchsorted(slab, slab, "left"), np.searchsorted(slab, slab, "right")
        place = first[:, None] + np.arange(max((slab_end - first).max(initial=0), 1))
        a, b = np.broadcast_to(every[:, None], place.shape), np.minimum(place, len(half) - 1)
        begin, end = self.nodes.leaving(half), self.nodes.leaving(half[b])
        chord = newton.difference(self.follower.arm, end.q, begin.q[:, None])
        advance = (chord * (begin.tangent[:, None] - end.tangent)).sum(axis=2)
        cost = 2.0 * np.sqrt((chord * chord).sum(axis=2)) - 0.5 * advance
        cost[(advance <= 0) | (place >= slab_end[:, None]) | (a == b)] = np.inf
        nearest = cost.argmin(axis=1)
        partner = np.where(np.isfinite(cost[every, nearest]), b[every, nearest], -1)
        mutual = np.flatnonzero((partner > every) & (partner[partner] == every))
        self._join(half[mutual], half[partner[mutual]])

    def trace(self) -> None:
        """Open halves, step by step to where they leave their slab."""
        ray = self.open()
        ray = ray[~self.traced[ray]]
        self.traced[ray] = True
        arcs, end, plane = self._steps(ray)
        arrived, every = np.flatnonzero(plane >= 0), np.arange(len(ray))
        row, slab = self.nodes.row[ray >> 1], self.slab(ray)
        number = self._on_plane(Nodes(row[arrived], plane[arrived], rows_of(end, arrived)))
        goal, place = np.full(len(ray), -1), np.full(len(self.partner), len(ray))
        goal[arrived], place[ray] = 2 * number + (plane[arrived] != slab[arrived]), every
        # an arc is traced from both of its ends: one of the two traces is kept
        selected = (goal >= 0) & (self.partner[goal] < 0) & (every < place[goal]) & (goal != ray)
        selected &= np.isin(every, np.unique(goal, return_index=True)[1])
        rays, owner = np.flatnonzero(selected), np.concatenate([rays for rays, _ in arcs])
        passing = np.flatnonzero(selected[owner])
        points, owner = rows_of(stack_rows([points for _, points in arcs]), passing), owner[passing]
        added = self._add(Nodes(row[owner], np.full(len(passing), -1), points))
        a = np.append(ray[rays], 2 * added)[np.argsort(np.append(rays, owner), kind="stable")]
        b = np.append(2 * added + 1, goal[rays])[np.argsort(np.append(owner, rays), kind="stable")]
        self._join(a, b)

    def _on_plane(self, arrived: Nodes) -> Int:
        """The nodes that others, on planes, are; those that are none yet become one."""
        places, number = self.planes.place(arrived.row, arrived.plane), np.full(len(arrived.row), -1)
        for _ in range(2):
            on_plane = np.flatnonzero(self.nodes.plane >= 0)
            place = self.planes.place(self.nodes.row[on_plane], self.nodes.plane[on_plane])
            shared = np.isin(place, places)
            i, k = np.nonzero(places[:, None] == place[shared])
            k = on_plane[shared][k]
            distance = newton.wrapped_distance(self.follower.arm, arrived.points.q[i], self.nodes.points.q[k])
            number[i[distance < tol.SAME_SEED]] = k[distance < tol.SAME_SEED]
            added = np.flatnonzero(number < 0)
            if not len(added):
                break
            added = added[first_of_equals(self.follower, places[added], arrived.points.q[added])]
            self._add(Nodes(arrived.row[added], arrived.plane[added], rows_of(arrived.points, added)))
        return number

    def _steps(self, ray: Int) -> tuple[list[tuple[Int, Points]], Points, Int]:
        """From halves (M,): points on the way, of which rays; those on the plane at the end, and which, -1: lost."""
        follower, j, values = self.follower, self.planes.guide.joint, self.planes.values
        unit = radian_or_reach(follower.arm)
        row, slab, current = self.nodes.row[ray >> 1], self.slab(ray), self.nodes.leaving(ray)
        next_plane = (slab + 1) % self.planes.counts[row]
        low, h = values[row, slab], np.full(len(ray), MAX_STEP)
        width = np.remainder(values[row, next_plane] - low, 2 * np.pi)
        end, plane = Points(*(x.copy() for x in current)), np.full(len(ray), -1)
        arcs, rays = [(ray[:0], rows_of(current, ray[:0]))], np.arange(len(ray))
        for _ in range(TRIES):
            begin, step = rows_of(current, rays), h[rays, None]
            predicted = begin.q + step * begin.tangent * unit
            on_arc = onto_curves(follower, row[rays], predicted, begin.tangent, tol.SAME_SEED)
            arc = Ways.between(follower, begin, on_arc)
            drift = np.sqrt(((arc.chord - step * begin.tangent) ** 2).sum(axis=1))
            valid = (on_arc.step < tol.SAME_SEED) & (drift < SIDE_SHARE * h[rays]) & arc.follow(follower, row[rays])
            h[rays] = np.where(valid, np.minimum(1.5 * h[rays], MAX_STEP), 0.5 * h[rays])
            middle = low[rays] + 0.5 * width[rays]
            depth, last_depth = (wrap_angle(points.q[:, j] - middle) for points in (on_arc, begin))
            leaves = valid & (np.abs(depth) >= 0.5 * width[rays]) & (np.abs(depth - last_depth) > tol.TINY)
            leaving, upward = rays[leaves], depth[leaves] > 0
            goal = np.where(upward, 0.5, -0.5) * width[leaving]
            share = np.clip((goal - last_depth[leaves]) / (depth[leaves] - last_depth[leaves]), 0.0, 1.0)
            guess = begin.q[leaves] + share[:, None] * arc.chord[leaves] * unit
            guess[:, j] = middle[leaves] + goal
            crossing = onto_curves(follower, row[leaving], guess, self.planes.held(len(leaving)))
            plane[leaving] = np.where(crossing.settled, np.where(upward, next_plane[leaving], slab[leaving]), -1)
            continues = valid & ~leaves
            arcs.append((rays[continues], rows_of(on_arc, continues)))
            for column, new, last, final in zip(current, on_arc, end, crossing, strict=True):
                column[rays[continues]] = new[continues]
                last[leaving] = final
            rays = rays[~leaves & (h[rays] > tol.SHORTEST_ARC)]
            if not len(rays):
                break
        return arcs, end, plane


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

    def curves(self, index: Int) -> Chains:
        """Some of the curves, in that order."""
        count = self.counts[index]
        first = np.cumsum(self.counts) - self.counts
        point = numbers_within(count) + np.repeat(first[index], count)
        return Chains(rows_of(self.points, point), self.row[index], count, self.closed[index])


def curves_of(follower: Follower) -> Chains:
    """All curves of all targets that an answer is on; of targets with answers that no curve passes, anew from these."""
    chains = _join_curves(follower, np.zeros(0, np.intp), follower.near[:0])
    row, q = answers_off_curves(follower, chains.points, np.repeat(chains.row, chains.counts), chains.after)
    if not len(row):
        return chains
    rows, place = np.unique(row, return_inverse=True)
    new_chains = _join_curves(follower.of(rows), place, q)
    unchanged = chains.curves(np.flatnonzero(~np.isin(chains.row, rows)))
    result = stack_rows([unchanged, new_chains._replace(row=rows[new_chains.row])])
    return result.curves(np.argsort(result.row, kind="stable"))


def _join_curves(follower: Follower, owner: Int, q: Array) -> Chains:
    """Curves of all targets that an answer on a plane, or one of q (M, n) of targets owner (M,), is on."""
    curves = _Curves(follower, owner, q)
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
    successor = np.append(np.where(partner < 0, end, partner ^ 1), end)  # the half that a curve goes on with
    rounds = range(max(M, 1).bit_length())
    jump, ring_min = successor.copy(), np.arange(M + 1)
    for _ in rounds:
        ring_min, jump = np.minimum(ring_min, ring_min[jump]), jump[jump]
    ring = jump[:-1] != end
    successor[:-1][ring & (successor[:-1] == ring_min[:-1])] = end  # a ring begins at its least half
    jump, length = successor.copy(), (successor < end).astype(np.intp)
    last = np.where(successor < end, successor, np.arange(M + 1))
    for _ in rounds:
        length, last, jump = length + length[jump], last[last], jump[jump]
    last = last[:-1]
    first = np.full(M + 1, -1)
    begins = np.ones(M + 1, bool)
    begins[successor] = False
    first[last[begins[:-1]]] = np.flatnonzero(begins[:-1])
    use = np.where(ring, ring_min[:-1] < ring_min[every ^ 1], last < (first[last] ^ 1))
    use &= (nodes.plane[every >> 1] >= 0) | (length[:-1] > 0) | (last != first[last])  # no middle of a way that failed
    halves = np.flatnonzero(use)
    row = nodes.row[halves >> 1]
    order = np.lexsort((-length[halves], last[halves], row))
    halves, row = halves[order], row[order]
    begin = np.flatnonzero(np.diff(last[halves], prepend=-1))
    return Chains(nodes.leaving(halves), row[begin], np.diff(begin, append=len(halves)), ring[halves[begin]])
