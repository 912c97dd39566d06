"""Curves of answers of an arm whose other joints have no closed form: answers on planes of a joint, joined to curves.

Two answers are joined where the cubic through both, along their tangents, solves the target in its middle, as well as
where that holds of both halves after the middle is moved onto the curve. What such cubics do not join is traced through
the slab between two planes, step by step.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armkin.formula.array_tuples import replace_rows, rows_of, stack_rows
from armkin.formula.arrays import Array, Bool, Int, numbers_within, slices, wrap_angle
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.redundant.curve_points import Points, Ways, onto_curves
from armkin.inverse.redundant.curve_starts import Nodes, answers_off_curves, answers_on_planes, first_of_equals
from armkin.inverse.redundant.other_joints import Follower
from armkin.model.units import radian_or_reach

AT_ONCE = 8000  # pairs of answers that are joined at once: they stay in the cache
HALVINGS = 6  # halvings of the way between two answers
ARC_LENGTH = 6.0  # distance [rad, reaches], at most, of answers that one cubic joins
MAX_STEP = 0.3  # longest step [rad, reaches] along a curve
TRACES = 3  # traces, at most, of a half whose way contradicts another one
STEP_SHARE = 0.25  # longest step of the next one of these, in that of the last
SIDE_SHARE = 0.3  # distance, as a share of a step, that Newton's method moves a point sideways at most
TRIES = 400  # steps, at most, of rays that follow on one another
ROUNDS = 20  # traces of all halves, at most


class _Rays(NamedTuple):
    """Halves on their way through a slab, the part of their curves between two planes: R of those that are traced."""

    number: Int  # (R,) which of the halves that are traced
    row: Int  # (R,) whose target
    slab: Int  # (R,) the plane below it
    middle: Array  # (R,) the joint of the planes in the middle of the slab [rad]
    half_width: Array  # (R,) [rad]
    step: Array  # (R,) length of the next step [rad, reaches]
    longest: Array  # (R,) of any
    points: Points  # where they are


class _Curves:
    """Nodes of curves, and which halves are joined: half 2 m leaves node m along its tangent, 2 m + 1 against it."""

    def __init__(self, follower: Follower, owner: Int, q: Array) -> None:
        self.follower = follower
        self.planes, self.nodes, self.grid = answers_on_planes(follower, owner, q)
        self.count = len(self.nodes.row)  # behind these there may be room for more
        self.partner = np.full(2 * self.count, -1)  # the half that each is joined to, -1: none yet
        self.traces = np.zeros(len(self.partner), np.intp)  # of each half; `TRACES` where another one would be the same
        self.ends = np.arange(self.count)  # nodes on planes of which a half may be open
        self.later = np.zeros(0, np.intp)  # nodes on planes, but not on the grid
        next_plane = (np.arange(self.grid.shape[1]) + 1) % self.planes.counts[:, None]
        following = np.take_along_axis(self.grid, next_plane[:, :, None], axis=1)
        adjacent = (self.grid >= 0) & (following >= 0)
        adjacent[:, :, -1] = False  # answers of no branch
        a, b = 2 * self.grid[adjacent], 2 * following[adjacent] + 1
        for part in slices(len(a), AT_ONCE):
            self._join(a[part], b[part])

    def _add(self, nodes: Nodes) -> Int:
        """More nodes: their numbers."""
        number = np.arange(self.count, self.count + len(nodes.row))
        self.count += len(nodes.row)
        if self.count > len(self.nodes.row):
            self.nodes = stack_rows([self.nodes, self.nodes, nodes])
            added = 2 * len(self.nodes.row) - len(self.partner)
            self.partner = np.append(self.partner, np.full(added, -1))
            self.traces = np.append(self.traces, np.zeros(added, np.intp))
        replace_rows(self.nodes, number, nodes)
        return number

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
        return np.asarray((self.nodes.plane[half >> 1] - (half & 1)) % self.planes.counts[self.nodes.row[half >> 1]])

    def open(self) -> Int:
        """Halves that are joined to none, of nodes on planes."""
        half = 2 * np.repeat(self.ends, 2) + np.tile([0, 1], len(self.ends))
        half = half[self.partner[half] < 0]
        self.ends = np.unique(half >> 1)
        return np.asarray(half)

    def join_pairs(self) -> None:
        """Open halves of a slab, each with the one that a short cubic leads to, and which leads to it."""
        half = self.open()
        slab = self.planes.place(self.nodes.row[half >> 1], self.slab(half))
        order, every = np.argsort(slab, kind="stable"), np.arange(len(half))
        half, slab = half[order], slab[order]
        first, count = np.searchsorted(slab, slab, "left"), np.unique(slab, return_counts=True)[1]
        count = np.repeat(count, count)  # of the halves in its slab
        a, b = np.repeat(every, count), np.repeat(first, count) + numbers_within(count)
        begin, end = self.nodes.leaving(half[a]), self.nodes.leaving(half[b])
        chord = newton.difference(self.follower.arm, end.q, begin.q)
        advance = (chord * (begin.tangent - end.tangent)).sum(axis=1)
        cost = np.where(advance > 0, 2.0 * np.sqrt((chord * chord).sum(axis=1)) - 0.5 * advance, np.inf)
        least = np.minimum.reduceat(cost, np.cumsum(count) - count) if len(half) else cost
        nearest = np.flatnonzero((cost == np.repeat(least, count)) & (advance > 0))[::-1]
        partner = np.full(len(half), -1)
        partner[a[nearest]] = b[nearest]  # the first one of several
        mutual = np.flatnonzero((partner > every) & (partner[partner] == every))
        self._join(half[mutual], half[partner[mutual]])

    def trace(self) -> None:
        """Open halves, step by step to the nodes that they come to."""
        half = self.open()
        half, goal, passed = self._follow_rays(half[self.traces[half] < TRACES])
        self.traces[half] = np.where((goal < 0) | (self.partner[goal] >= 0), TRACES, self.traces[half] + 1)
        every = np.arange(len(half))
        place = np.where(np.isin(goal, half), np.searchsorted(half, goal), len(half))
        # an arc is traced from both of its ends: one of the two traces is kept, unless another one contradicts it
        back, (_, index, count) = np.append(goal, -1)[place], np.unique(goal, return_inverse=True, return_counts=True)
        selected = (goal >= 0) & (self.partner[goal] < 0) & (every < place) & (goal != half)
        selected &= (count[index] == 1) & ((back < 0) | (back == half))
        rays, passed = np.flatnonzero(selected), rows_of(passed, selected[passed.number])
        added = self._add(Nodes(passed.row, np.full(len(passed.row), -1), passed.points))
        a = np.append(half[rays], 2 * added)[np.argsort(np.append(rays, passed.number), kind="stable")]
        b = np.append(2 * added + 1, goal[rays])[np.argsort(np.append(passed.number, rays), kind="stable")]
        self._join(a, b)

    def _on_plane(self, arrived: Nodes) -> Int:
        """The nodes that others, on planes, are; those that are none yet become one."""
        places, number = self.planes.place(arrived.row, arrived.plane), np.full(len(arrived.row), -1)
        on_grid = self.grid[arrived.row, arrived.plane]
        for _ in range(2):
            place = self.planes.place(self.nodes.row[self.later], self.nodes.plane[self.later])
            beside = np.concatenate([on_grid, np.where(place == places[:, None], self.later, -1)], axis=1)
            i, column = np.nonzero(beside >= 0)
            k = beside[i, column]
            distance = newton.wrapped_distance(self.follower.arm, arrived.points.q[i], self.nodes.points.q[k])
            number[i[distance < tol.SAME_SEED]] = k[distance < tol.SAME_SEED]
            added = np.flatnonzero(number < 0)
            if not len(added):
                break
            added = added[first_of_equals(self.follower, places[added], arrived.points.q[added])]
            added = self._add(Nodes(arrived.row[added], arrived.plane[added], rows_of(arrived.points, added)))
            self.later, self.ends = np.append(self.later, added), np.append(self.ends, added)
        return number

    def _rays(self, half: Int) -> _Rays:
        """The rays of halves (M,), where they begin."""
        row, slab, points = self.nodes.row[half >> 1], self.slab(half), self.nodes.leaving(half)
        longest = np.asarray(MAX_STEP * STEP_SHARE ** self.traces[half], float)
        points = onto_curves(self.follower, row, points.q, points.tangent)  # as near as short steps need
        return _Rays(np.arange(len(half)), row, slab, *self._sizes(row, slab), longest, longest, points)

    def _sizes(self, row: Int, slab: Int) -> tuple[Array, Array]:
        """The middles of slabs (M,) of targets row (M,) and half their widths [rad]."""
        low, high = (self.planes.values[row, plane % self.planes.counts[row]] for plane in (slab, slab + 1))
        half_width = 0.5 * np.remainder(high - low, 2 * np.pi)
        return low + half_width, half_width

    def _follow_rays(self, half: Int) -> tuple[Int, Int, _Rays]:
        """Halves (M,), step by step to where they leave their slabs, and from there, where no node was, on.

        Returns:
            The halves that were followed (R,), in their order, those that they come to (R,), -1 where a ray is lost,
            and the rays at all points that they pass on the way.
        """
        rays, goal, passed = self._rays(half), np.full(len(half), -1), []
        for _ in range(TRIES):
            points, valid = self._advance(rays)
            leaves, count = valid & self._leave_slab(rays, points), self.count
            if leaves.any():
                crossing = self._cross_plane(rows_of(rays, leaves), rows_of(points, leaves))
                origin = self.nodes.points.q[half[rays.number[leaves]] >> 1]
                way = newton.wrapped_distance(self.follower.arm, crossing.points.q, origin)
                found = crossing.points.settled & (way >= tol.SAME_SEED)  # else the step is too long,
                touches = ~found & (rays.step[leaves] < tol.TOUCHING_STEP)  # or the curve turns back beside the plane
                self._pass_plane(rays, np.flatnonzero(leaves)[touches], crossing.plane[touches])
                valid[leaves], leaves[leaves] = found | touches, found
                arrived = 2 * self._on_plane(rows_of(crossing, found))
                goal[rays.number[leaves]] = arrived + (crossing.plane[found] != rays.slab[leaves])
            continues = valid & ~leaves
            replace_rows(rays.points, continues, rows_of(points, continues))
            passed.append(rows_of(rays, continues))
            rays = rays._replace(step=np.where(valid, np.minimum(1.5 * rays.step, rays.longest), 0.5 * rays.step))
            rays = rows_of(rays, ~leaves & (rays.step > tol.SHORTEST_ARC))
            if self.count > count and len(onward := np.setdiff1d(np.arange(2 * count, 2 * self.count), goal)):
                number = np.arange(len(half), len(half) + len(onward))
                half, goal = np.append(half, onward), np.append(goal, np.full(len(onward), -1))
                rays = stack_rows([rays, self._rays(onward)._replace(number=number)])
            if not len(rays.number):
                break
        return half, goal, stack_rows(passed)

    def _advance(self, rays: _Rays) -> tuple[Points, Bool]:
        """The points to which a step along the tangents leads rays (R,), and whether along their curves."""
        follower, begin, step = self.follower, rays.points, rays.step[:, None]
        predicted = begin.q + step * begin.tangent * radian_or_reach(follower.arm)
        points = onto_curves(follower, rays.row, predicted, begin.tangent)
        arcs = Ways.between(follower, begin, points)
        drift = np.sqrt(((arcs.chord - step * begin.tangent) ** 2).sum(axis=1))
        is_close = points.settled & (drift < SIDE_SHARE * rays.step)
        return points, is_close & arcs.follow(follower, rays.row)

    def _pass_plane(self, rays: _Rays, index: Int, plane: Int) -> None:
        """Rays of some index (M,) come through planes (M,) into the slabs beyond."""
        row, slab = rays.row[index], rays.slab[index]
        rays.slab[index] = beyond = (slab + np.where(plane == slab, -1, 1)) % self.planes.counts[row]
        rays.middle[index], rays.half_width[index] = self._sizes(row, beyond)

    def _leave_slab(self, rays: _Rays, points: Points) -> Bool:
        """Which rays (R,) leave their slabs by a step to points."""
        joint = self.planes.guide.joint
        depth, begin_depth = (wrap_angle(end.q[:, joint] - rays.middle) for end in (points, rays.points))
        return np.asarray((np.abs(depth) >= rays.half_width) & (np.abs(depth - begin_depth) > tol.TINY))

    def _cross_plane(self, rays: _Rays, points: Points) -> Nodes:
        """Where rays (R,) that leave their slabs by a step to points cross a plane, if that posture is settled."""
        begin, arm, joint = rays.points, self.follower.arm, self.planes.guide.joint
        depth, begin_depth = (wrap_angle(end.q[:, joint] - rays.middle) for end in (points, begin))
        goal = np.where(depth > 0, rays.half_width, -rays.half_width)
        share = np.clip((goal - begin_depth) / (depth - begin_depth), 0.0, 1.0)
        guess = begin.q + share[:, None] * newton.difference(arm, points.q, begin.q) * radian_or_reach(arm)
        guess[:, joint] = rays.middle + goal
        crossing = onto_curves(self.follower, rays.row, guess, self.planes.held(len(guess)))
        return Nodes(rays.row, (rays.slab + (depth > 0)) % self.planes.counts[rays.row], crossing)


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
        curves.join_pairs()
        if (curves.traces[curves.open()] >= TRACES).all():
            break
        curves.trace()
    return _chain_halves(curves)


def _chain_halves(curves: _Curves) -> Chains:
    """Halves that are joined as curves, each in one of its two senses."""
    M, nodes = 2 * curves.count, rows_of(curves.nodes, slice(curves.count))
    partner = curves.partner[:M]
    every, end = np.arange(M), M
    successor = np.append(np.where(partner < 0, end, partner ^ 1), end)  # the half that a curve goes on with
    rounds = range((2 * int(np.bincount(nodes.row, minlength=1).max())).bit_length())
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
