"""Families of an arm whose other joints have a closed form: its branches, followed along the redundant joint."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armkin.formula.array_tuples import rows_of, stacked
from armkin.formula.arrays import Array, Bool
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.redundant.boundaries import boundaries, places
from armkin.inverse.redundant.branch_ends import crossed_at, hidden_stretches, number_of, places_of
from armkin.inverse.redundant.interval_pieces import Pieces, none
from armkin.inverse.redundant.other_joints import Follower, over_a_turn
from armkin.inverse.redundant.samples import Changes, Runs, Seen, place_between, seen, value_at
from armkin.inverse.tasks.task import distance

EVEN = 180  # samples of a turn of the redundant joint besides all places where something may change;
SAMPLES = 360  # where these are not known,
CLOSER = 4  # times as many values where branches may be there between them,
FINER = 48  # and where none had an answer
STEPS = 16  # of the golden section


class Followed(NamedTuple):
    """`families.Curves` followed along the redundant joint, a turn by samples: it is their parameter."""

    find: Follower
    pieces: Pieces
    short: Bool
    complete: Bool  # (N,) all places are known at which a curve may end
    steps: int = STEPS

    @classmethod
    def along(cls, find: Follower) -> Followed:
        """Of some targets; in two ways: those of which all places are known where something changes, and others."""
        N = len(find.target)
        parts, short, complete = [none(find.arm.n)], np.zeros(N, bool), np.zeros(N, bool)
        of = boundaries(find.arm) if find.free.joint == find.arm.n - 1 else None
        if of is not None:
            at, known = places(of, find.target)
            if len(some := np.flatnonzero(known)):
                own, short[some], complete[some] = _between_places(find.of(some), at[some])
                parts.append(own._replace(row=some[own.row]))
        if len(some := np.flatnonzero(~complete)):
            own, short[some] = _sampled(find.of(some), 1)
            parts.append(own._replace(row=some[own.row]))
        return cls(find, stacked(parts), short, complete)

    def tried(self, pieces: Pieces, near: Array) -> list[Array]:
        """Values of the parameter (P,) that may hold the posture nearest to near (P, n), besides the best sample: where
        near has the joint, and beside that sample."""
        own = near[:, self.find.free.joint]
        own = own + np.round((pieces.at - own) / (2 * np.pi)) * 2 * np.pi
        return [np.where((own >= pieces.a) & (own <= pieces.b), own, pieces.at), pieces.low, pieces.high]

    def at(self, pieces: Pieces, parameter: Array) -> tuple[Array, Bool]:
        """As `Turning.at`."""
        return self.find.one(pieces.row, pieces.branch, parameter)


def _between_places(find: Follower, at: Array) -> tuple[Pieces, Bool, Bool]:
    """Pieces of those of some targets whose curves change at places (N, V) alone; which are short (N,), and which
    targets those are (N,)."""
    found = seen(find, over_a_turn(EVEN), at)
    changes = found.crossed.at, found.gone.at
    legal, there = ends = [place_between(found.t, one, at) for one in changes]
    crossing = np.flatnonzero(np.isfinite(legal) & ~np.isnan(found.crossed.rooms).any(axis=1))
    legal[crossing] = crossed_at(find, rows_of(changes[0], crossing), legal[crossing])
    explained = np.ones(len(at), bool)
    for one, end in zip(changes, ends, strict=True):
        explained[one.row[np.isinf(end)]] = False
    intervals, families = (rows_of(runs, explained[runs.row]) for runs in (found.legal, found.there))
    pieces = _of_runs(found.t, intervals, True, changes[0], legal)
    without = _of_runs(found.t, rows_of(families, ~families.within), False, changes[1], there)
    return stacked([pieces, without]), found.short, explained


def _sampled(find: Follower, finer: int) -> tuple[Pieces, Bool]:
    """Pieces of some targets, and which are short: one of which something may be hidden between samples, or without an
    answer, is asked again: all of a nearly stretched arm lie within a degree."""
    found = seen(find, over_a_turn(SAMPLES * finer))
    pieces, short = _pieces(find, found), found.short
    if finer == 1:
        near_enough = find.arm.prismatic.any() | (distance(find.arm, find.free.task, find.target) <= 1.0 + tol.SOLUTION)
        lost = found.lost & near_enough
        for more, which in ((CLOSER, found.hidden & ~lost), (FINER, lost)):
            again = np.flatnonzero(which)
            each = max(SAMPLES // more, 1)
            for some in (again[k : k + each] for k in range(0, len(again), each)):
                part, few = _sampled(find.of(some), more)
                kept, new = rows_of(pieces, ~np.isin(pieces.row, some)), part._replace(row=some[part.row])
                pieces = stacked([kept, new])
                short[some] = few
    return pieces, short


def _pieces(find: Follower, found: Seen) -> Pieces:
    """All pieces of the curves of some targets."""
    t, K = found.t, found.t.shape[1]
    places = places_of(find, found)
    hidden, stretch = hidden_stretches(find, t, found.turns)
    gaps = hidden.set_before
    more, short = rows_of(hidden, ~gaps), places.short
    parts = [_of_runs(t, found.legal, True, found.crossed.at, places.legal)]
    there = found.there
    of = there.row[:, None] == np.append(hidden.row, short.row)
    of &= there.branch[:, None] == np.append(hidden.branch, short.branch)
    of &= (np.append(hidden.k, short.sample(0, K)) - there.first[:, None]) % K < there.length[:, None]
    families = _of_runs(t, there, False, found.gone.at, places.there)
    parts.append(rows_of(families, ~(there.within | of.any(axis=1))))  # without those that hold one of these
    parts[0] = _without_gaps(find, parts[0], rows_of(hidden, gaps), stretch[:, gaps])
    row, branch = np.append(short.row, more.row), np.append(short.branch, more.branch)
    if len(row):
        a, b = np.concatenate([np.sort(places.ends, axis=0), stretch[:, ~gaps]], axis=1)
        middle = 0.5 * (a + b)
        q, legal = find.one(row, branch, middle)
        parts.append(rows_of(Pieces(row, branch, legal, a, b, a, b, a, middle, b, q), legal))
    return stacked(parts)


def _of_runs(t: Array, runs: Runs, legal: bool, changes: Changes, ends: Array) -> Pieces:
    """The pieces that hold runs of samples at t (N, K); ends: where changes are."""
    K, best = t.shape[1], runs.first + runs.best
    low, at, high = (value_at(t, runs.row, best + side) for side in (-1, 0, 1))
    a, b = np.full(len(at), -np.pi), np.full(len(at), np.pi)
    some = np.flatnonzero(runs.length < K)
    row, first, branch, middle = runs.row[some], runs.first[some], runs.branch[some], at[some]
    begin = ends[number_of(changes, row, (first - 1) % K, branch, K)]
    end = ends[number_of(changes, row, (first + runs.length[some] - 1) % K, branch, K)]
    a[some], b[some] = middle - (middle - begin) % (2 * np.pi), middle + (end - middle) % (2 * np.pi)
    low[some], high[some] = np.clip(low[some], a[some], b[some]), np.clip(high[some], a[some], b[some])
    return Pieces(runs.row, runs.branch, np.full(len(at), legal), a, b, a, b, low, at, high, runs.start)


def _without_gaps(find: Follower, pieces: Pieces, gaps: Changes, ends: Array) -> Pieces:
    """Pieces with gaps taken out that lie within them, from where to where (2, G)."""
    for row, branch, (begin, end) in zip(gaps.row, gaps.branch, ends.T, strict=True):
        turns = 2 * np.pi * np.round((0.5 * (pieces.a + pieces.b) - begin) / (2 * np.pi))
        inside = (pieces.row == row) & (pieces.branch == branch) & (pieces.a < begin + turns) & (end + turns < pieces.b)
        for p in np.flatnonzero(inside):
            one = rows_of(pieces, np.array([p]))
            before, behind = np.array([begin + turns[p]]), np.array([end + turns[p]])
            sides = [(one.a, before), (behind, one.b)]
            if pieces.b[p] - pieces.a[p] >= 2 * np.pi:  # a whole turn is one piece that begins behind the gap
                sides = [(behind, before + 2 * np.pi)]
            parts = [rows_of(pieces, np.arange(len(pieces.row)) != p)]
            for a, b in sides:
                holds = (a <= one.at) & (one.at <= b)
                at = np.where(holds, one.at, 0.5 * (a + b))
                low, high = (np.clip(one.low, a, b), np.clip(one.high, a, b)) if holds else (a, b)
                start, _ = find.one(one.row, one.branch, at)
                parts.append(one._replace(a=a, b=b, first=a, last=b, low=low, at=at, high=high, start=start))
            pieces = stacked(parts)
            break
    return pieces
