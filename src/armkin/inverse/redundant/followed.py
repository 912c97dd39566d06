"""Families of an arm whose other joints have a closed form: its branches, followed along the redundant joint."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armkin.formula.arrays import Array, Bool, wrapped
from armkin.inverse.numeric.tolerances import REACH, SOLUTION
from armkin.inverse.redundant.ends import Changes, hidden_stretches, places_of
from armkin.inverse.redundant.follower import Follower, Samples, over_a_turn
from armkin.inverse.redundant.pieces import Pieces, best_samples, holding_none, runs
from armkin.inverse.tasks.task import distance

SAMPLES = 360  # of a turn of the redundant joint,
CLOSER = 4  # times as many values where branches may be there between them,
FINER = 48  # and where none had an answer
STEPS = 16  # of the golden section


class Followed(NamedTuple):
    """`Curves` followed along the redundant joint, a turn by samples: it is their parameter."""

    find: Follower
    pieces: Pieces
    short: Bool
    steps: int = STEPS

    @classmethod
    def along(cls, find: Follower, finer: int = 1) -> Followed:
        """Of some targets; one of which something may be hidden between samples, or without an answer, is asked again:
        all of a nearly stretched arm lie within a degree."""
        t = over_a_turn(SAMPLES * finer)
        found = find.along(t)
        pieces, short = _pieces(find, t, found), _all_short(find, found)
        if finer == 1:
            near_enough = find.arm.prismatic.any() | (distance(find.arm, find.free.task, find.target) <= 1.0 + SOLUTION)
            lost = ~found.valid.any(axis=(1, 2)) & near_enough
            for more, which in ((CLOSER, found.hidden & ~lost), (FINER, lost)):
                again = np.flatnonzero(which)
                each = max(SAMPLES // more, 1)
                for some in (again[k : k + each] for k in range(0, len(again), each)):
                    part = cls.along(find._replace(target=find.target[some], near=find.near[some]), more)
                    kept, new = pieces.of(~np.isin(pieces.row, some)), part.pieces._replace(row=some[part.pieces.row])
                    pieces = Pieces(*(np.concatenate(pair) for pair in zip(kept, new, strict=True)))
                    short[some] = part.short
        return cls(find, pieces, short)

    @property
    def complete(self) -> Bool:
        """Never: what lies between two samples may be missing."""
        return np.zeros(len(self.find.target), bool)

    def tried(self, pieces: Pieces, near: Array) -> list[Array]:
        """Where near has the joint, and beside the best sample."""
        own = near[:, self.find.free.joint]
        own = own + np.round((pieces.at - own) / (2 * np.pi)) * 2 * np.pi
        return [np.where((own >= pieces.a) & (own <= pieces.b), own, pieces.at), pieces.low, pieces.high]

    def at(self, pieces: Pieces, parameter: Array) -> tuple[Array, Bool]:
        """As `Curves.at`."""
        there = self.find.one(pieces.row, pieces.branch, parameter)
        return there.q, there.legal


def _pieces(find: Follower, t: Array, found: Samples) -> Pieces:
    """All pieces of the curves of some targets, from samples along t."""
    K, B = found.valid.shape[1:]
    h = float(t[1] - t[0])
    cost = found.cost.transpose(0, 2, 1).reshape(-1, K)
    places = places_of(find, t, found)
    hidden, stretch = hidden_stretches(find, t, found)
    some = found.legal.copy()
    some[hidden.row, hidden.k, hidden.branch] = True
    some[places.short.row, places.short.sample(0, K), places.short.branch] = True
    parts = []
    within = some.transpose(0, 2, 1).reshape(-1, K)
    for legal, good, ends in ((True, found.legal, places.legal), (False, found.valid, places.there)):
        samples = good.transpose(0, 2, 1).reshape(-1, K)
        curve, first, length = runs(samples, np.zeros_like(samples))
        if not legal:
            without = holding_none(within, curve, first, length)
            curve, first, length = curve[without], first[without], length[without]
        row, branch = curve // B, curve % B
        best = best_samples(cost, curve, first, length)
        at = t[first] + best * h
        a, b = ends[row, first - 1, branch], ends[row, (first + length - 1) % K, branch]
        a, b = at - (at - a) % (2 * np.pi), at + (b - at) % (2 * np.pi)
        all_round = length == K
        a, b = np.where(all_round, -np.pi, a), np.where(all_round, np.pi, b)
        low, high = (np.where(all_round, beside, np.clip(beside, a, b)) for beside in (at - h, at + h))
        start = found.q[row, (first + best) % K, branch]
        parts.append(Pieces(row, branch, np.full(len(row), legal), a, b, a, b, low, at, high, start))
    gaps = hidden.set_before
    parts[0] = _cut(find, parts[0], hidden.some(gaps), stretch[:, gaps])
    more = hidden.some(~gaps)
    row, branch = np.append(places.short.row, more.row), np.append(places.short.branch, more.branch)
    if len(row):
        a, b = np.concatenate([np.sort(places.ends, axis=0), stretch[:, ~gaps]], axis=1)
        middle = 0.5 * (a + b)
        there = find.one(row, branch, middle)
        short = Pieces(row, branch, there.legal, a, b, a, b, a, middle, b, there.q)
        parts.append(short.of(there.legal))
    return Pieces(*(np.concatenate(pair) for pair in zip(*parts, strict=True)))


def _cut(find: Follower, pieces: Pieces, gaps: Changes, ends: Array) -> Pieces:
    """Pieces with gaps taken out that lie within them, from where to where (2, G)."""
    for row, branch, (begin, end) in zip(gaps.row, gaps.branch, ends.T, strict=True):
        turns = 2 * np.pi * np.round((0.5 * (pieces.a + pieces.b) - begin) / (2 * np.pi))
        inside = (pieces.row == row) & (pieces.branch == branch) & (pieces.a < begin + turns) & (end + turns < pieces.b)
        for p in np.flatnonzero(inside):
            one = pieces.of(np.array([p]))
            before, behind = np.array([begin + turns[p]]), np.array([end + turns[p]])
            sides = [(one.a, before), (behind, one.b)]
            if pieces.b[p] - pieces.a[p] >= 2 * np.pi:  # a whole turn is one piece that begins behind the gap
                sides = [(behind, before + 2 * np.pi)]
            parts = [pieces.of(np.arange(len(pieces.row)) != p)]
            for a, b in sides:
                holds = (a <= one.at) & (one.at <= b)
                at = np.where(holds, one.at, 0.5 * (a + b))
                low, high = (np.clip(one.low, a, b), np.clip(one.high, a, b)) if holds else (a, b)
                start = find.one(one.row, one.branch, at).q
                parts.append(one._replace(a=a, b=b, first=a, last=b, low=low, at=at, high=high, start=start))
            pieces = Pieces(*(np.concatenate(column) for column in zip(*parts, strict=True)))
            break
    return pieces


def _all_short(find: Follower, found: Samples) -> Bool:
    """Whether no joint moves by REACH along any family of a target (N,), from its samples."""
    together = found.valid
    for shift in range(1, 2 + int(REACH / (2 * np.pi / found.valid.shape[1]))):
        together = together & np.roll(found.valid, -shift, axis=1)
    short = np.asarray(found.valid.any(axis=(1, 2)) & ~together.any(axis=(1, 2)))
    for k in np.flatnonzero(short).tolist():
        q, valid = found.q[k], found.valid[k]
        step = np.abs(wrapped(np.roll(q, -1, axis=0) - q))
        way = np.where((valid & np.roll(valid, -1, axis=0))[..., None], np.nan_to_num(step), 0.0).sum(axis=0)
        short[k] = 2.0 * way.max(initial=0.0) < REACH
    return short
