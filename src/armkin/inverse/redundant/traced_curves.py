"""Curves of answers of an arm whose other joints have no closed form: traced from the answers at planes of the joint.

The elimination answers PLANES values of the redundant joint. From each answer its curve is traced through the slab
beside its plane, by Newton's method in all joints with the tangent as the last equation (Allgower and Georg, Numerical
Continuation Methods, 1990, 2 and 6), to the answer where it leaves the slab; so the arcs join to whole curves, and a
curve that turns back is followed round its turn.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armkin.formula.arrays import Array, wrapped
from armkin.formula.rows import rows_of, stacked
from armkin.inverse.numeric import newton
from armkin.inverse.numeric.newton import nudged
from armkin.inverse.numeric.tolerances import CONVERGING, PAIR_SETTLED, SAME_SEED, SHORTEST_ARC
from armkin.inverse.redundant.interval_pieces import Int
from armkin.inverse.redundant.other_joints import Follower, over_a_turn
from armkin.model.units import radian_or_reach

PLANES = 60  # values of the redundant joint that the elimination answers
LONGEST = 0.1  # [rad, reaches] step along a curve
BENT = 0.96  # cosine between the tangents at both ends of a step at least
ASIDE = 0.3  # of a step, that Newton's method moves a point sideways at most
NEWTON = 4  # its steps
TRIES = 400  # steps of an arc
ROUNDS = 3


class Points(NamedTuple):
    """Postures (M, n), unit tangents (M, n) of their curves [rad, reaches], and what the postures miss (M,)."""

    q: Array
    tangent: Array
    miss: Array


def onto(find: Follower, row: Int, q: Array, last: Array, fixed: bool = False) -> Points:
    """Postures q (M, n) moved onto the curves of their targets, across last (M, n), or, fixed, with that held.

    The tangents point to where last does.
    """
    arm, task, unit = find.arm, find.free.task, radian_or_reach(find.arm)
    target = find.target[row]
    q, tangent, going = q.copy(), last.copy(), np.arange(len(q))
    for _ in range(NEWTON):
        some = slice(None) if len(going) == len(q) else going
        missing, J = newton.scaled(arm, task, q[some], target[some])
        rows = np.concatenate([J, last[some, None]], axis=1)
        right = np.zeros((*rows.shape[:2], 2))
        right[:, :-1, 0], right[:, -1, 1] = missing, 1.0
        # the direction of a tool's axis is three numbers for two constraints
        x = nudged(np.linalg.solve, rows, right) if rows.shape[1] == arm.n else np.linalg.pinv(rows) @ right
        step = x[:, :, 0]
        tangent[some] = x[:, :, 1] / np.linalg.norm(x[:, :, 1], axis=1, keepdims=True)
        size = np.abs(step).max(axis=1)
        q[some] += step * np.minimum(1.0, LONGEST / np.maximum(size, LONGEST))[:, None] * unit
        going = going[~(size < PAIR_SETTLED)]  # its square is below rounding
        if not len(going):
            break
    miss = newton.missing(arm, task, q, target)
    return Points(q, tangent, np.where(np.isnan(tangent).any(axis=1), np.inf, miss))


class _Seeds(NamedTuple):
    """Answers on planes: whose target (M,), which plane (M,), and the points, whose tangents raise the joint."""

    row: Int
    plane: Int
    points: Points


def _seeds(find: Follower, row: Int, plane: Int, q: Array) -> _Seeds:
    _, J = newton.scaled(find.arm, find.free.task, q, find.target[row])
    tangent = np.linalg.svd(J)[2][:, -1]
    tangent = tangent * np.where(tangent[:, find.free.joint] < 0, -1.0, 1.0)[:, None]
    return _Seeds(row, plane, Points(q, tangent, np.zeros(len(q))))


def _answers(find: Follower) -> _Seeds:
    """Of every target those on all planes."""
    N, t = len(find.target), over_a_turn(PLANES)
    q = find.found(np.repeat(np.arange(N), PLANES), np.tile(t, N))
    place, branch = np.nonzero(~np.isnan(q[:, :, 0]))
    row, plane, q = place // PLANES, place % PLANES, q[place, branch]
    missing = newton.missing(find.arm, find.free.task, q, find.target[row])
    good = missing < SAME_SEED
    row, plane, q = row[good], plane[good], q[good]
    last = np.zeros_like(q)
    last[:, find.free.joint] = 1.0
    points = onto(find, row, q, last, True)
    good = points.miss <= CONVERGING
    return _seeds(find, row[good], plane[good], points.q[good])


class _Arcs(NamedTuple):
    """Of rays M: the points P passed on the way, in their order; where they leave their slab."""

    ray: Int  # (P,)
    points: Points
    end: Array  # (M, n) posture on the plane, nan where a ray is lost
    plane: Int  # (M,) of these


def _trace(find: Follower, seeds: _Seeds, ray: Int, side: Int) -> _Arcs:
    """From seeds ray (M,) to their sides (M,), 1 where the joint grows, else -1."""
    j, unit, wide = find.free.joint, radian_or_reach(find.arm), 2 * np.pi / PLANES
    row, plane = seeds.row[ray], seeds.plane[ray]
    now = rows_of(seeds.points, ray)
    now = now._replace(tangent=now.tangent * side[:, None])
    low = over_a_turn(PLANES)[plane]
    h = np.full(len(ray), LONGEST)
    end, out = np.full((len(ray), find.arm.n), np.nan), np.zeros(len(ray), np.intp)
    passed: list[tuple[Int, Points]] = []
    going = np.arange(len(ray))
    for _ in range(TRIES):
        if not len(going):
            break
        here = rows_of(now, going)
        then = onto(find, row[going], here.q + h[going, None] * here.tangent * unit, here.tangent)
        moved = newton.difference(find.arm, then.q, here.q)
        aside = np.linalg.norm(moved - h[going, None] * here.tangent, axis=1)
        good = (then.miss <= CONVERGING) & ((then.tangent * here.tangent).sum(axis=1) > BENT)
        good &= aside < ASIDE * h[going]
        h[going] = np.where(good, np.minimum(1.5 * h[going], LONGEST), 0.5 * h[going])
        depth = wrapped(then.q[:, j] - low[going]) * side[going]
        left = good & ((depth <= 0.0) | (depth >= wide))
        if left.any():
            some, far = going[left], depth[left] >= wide
            before = wrapped(here.q[left, j] - low[some]) * side[some]
            share = (np.where(far, wide, 0.0) - before) / np.where(depth[left] == before, 1.0, depth[left] - before)
            guess = here.q[left] + np.clip(share, 0.0, 1.0)[:, None] * moved[left] * unit
            out[some] = np.where(far, (plane[some] + side[some]) % PLANES, plane[some])
            guess[:, j] = over_a_turn(PLANES)[out[some]]
            held = np.zeros_like(guess)
            held[:, j] = 1.0
            there = onto(find, row[some], guess, held, True)
            end[some] = np.where((there.miss <= CONVERGING)[:, None], there.q, np.nan)
        inside = good & ~left
        if inside.any():
            passed.append((going[inside], rows_of(then, inside)))
            for one, new in zip(now, then, strict=True):
                one[going[inside]] = new[inside]
        going = going[~left & (h[going] > SHORTEST_ARC)]
    rays = np.concatenate([np.zeros(0, np.intp), *(some for some, _ in passed)])
    order = np.argsort(rays, kind="stable")
    points = stacked([points for _, points in passed] or [rows_of(now, rays)])
    return _Arcs(rays[order], rows_of(points, order), end, out)


class Curve(NamedTuple):
    """A curve of one target: its points in their order, and whether the last one is joined to the first."""

    row: int
    points: Points
    closed: bool


def curves_of(find: Follower) -> list[Curve]:
    """All curves of all targets that a seed is on."""
    seeds = _answers(find)
    ways: dict[tuple[int, int], tuple[Int, tuple[int, int]]] = {}  # (seed, side): points on the way, where it ends
    tried: set[tuple[int, int]] = set()
    passed, count = [], 0
    for k in range(ROUNDS):
        rays = [
            (seed, side)
            for side in ((1,) if k == 0 else (1, -1))
            for seed in range(len(seeds.row))
            if (seed, side) not in ways and (seed, side) not in tried
        ]
        if not rays:
            break
        tried.update(rays)
        ray, side = (np.array(column) for column in zip(*rays, strict=True))
        arcs = _trace(find, seeds, ray, side)
        seeds, ends = _matched(find, seeds, seeds.row[ray], arcs)
        index = np.arange(count, count + len(arcs.ray))
        cut = np.searchsorted(arcs.ray, np.arange(len(ray) + 1)).tolist()
        stays = (arcs.plane == seeds.plane[ray]).tolist()
        for i, ((seed, s), to) in enumerate(zip(rays, ends.tolist(), strict=True)):
            back = (to, s if stays[i] else -s)
            if to >= 0 and (seed, s) not in ways and back not in ways:
                own = index[cut[i] : cut[i + 1]]
                ways[seed, s] = own, back
                ways[back] = own[::-1], (seed, s)
        passed.append(arcs.points)
        count += len(arcs.ray)
    return _chained(seeds, stacked([*passed, seeds.points]), ways)


def _matched(find: Follower, seeds: _Seeds, row: Int, arcs: _Arcs) -> tuple[_Seeds, Int]:
    """Which seed each arc ends at, -1: none; ends that are no seed yet become one."""
    ends = np.full(len(row), -1)
    key = seeds.row * PLANES + seeds.plane
    order = np.argsort(key, kind="stable")
    there = np.flatnonzero(~np.isnan(arcs.end[:, 0]))
    first, last = (
        np.searchsorted(key[order], row[there] * PLANES + arcs.plane[there], side) for side in ("left", "right")
    )
    place = first[:, None] + np.arange(max(int((last - first).max(initial=0)), 1))
    some = order[np.minimum(place, len(order) - 1)]
    apart = newton.wrapped_distance(find.arm, seeds.points.q[some], arcs.end[there, None])
    apart[place >= last[:, None]] = np.inf
    nearest = apart.argmin(axis=1)
    found = apart[np.arange(len(there)), nearest] < SAME_SEED
    ends[there[found]] = some[found, nearest[found]]
    new: list[int] = []
    for i in there[~found].tolist():
        if not any(
            row[k] == row[i]
            and arcs.plane[k] == arcs.plane[i]
            and newton.wrapped_distance(find.arm, arcs.end[k], arcs.end[i]) < SAME_SEED
            for k in new
        ):
            new.append(i)
            ends[i] = len(seeds.row) + len(new) - 1
    if new:
        more = _seeds(find, row[new], arcs.plane[new], arcs.end[new])
        seeds = stacked([seeds, more])
    return seeds, ends


def _chained(seeds: _Seeds, points: Points, ways: dict[tuple[int, int], tuple[Int, tuple[int, int]]]) -> list[Curve]:
    """Arcs joined to curves: open ones from their ends, then those that close; points: on the ways, then the seeds'."""
    M, own = len(seeds.row), np.arange(len(points.miss))[:, None]
    before = len(own) - M
    out, left = [], set(range(M))
    ends = [(seed, -side) for seed in range(M) for side in (1, -1) if (seed, side) not in ways]
    for begin, side in [*ends, *((seed, 1) for seed in range(M))]:
        if begin not in left:
            continue
        parts, seed, closed = [], begin, False
        while seed in left:
            left.remove(seed)
            parts.append(own[before + seed])
            if (seed, side) not in ways:
                break
            some, (seed, came) = ways[seed, side]
            parts.append(some)
            side, closed = -came, seed == begin
        out.append(Curve(int(seeds.row[begin]), rows_of(points, np.concatenate(parts)), closed))
    return out
