"""Families of an arm whose other joints have a closed form: its branches, followed along the redundant joint."""

from typing import NamedTuple, Self

import numpy as np

from armkin.formula.array_tuples import rows_of, stack_rows
from armkin.formula.arrays import Array, Bool, wrap_angle
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.redundant.boundaries import boundaries, boundary_angles
from armkin.inverse.redundant.branch_ends import crossed_at, hidden_stretches, number_of, places_of
from armkin.inverse.redundant.interval_pieces import Pieces, none
from armkin.inverse.redundant.other_joints import Follower, over_a_turn
from armkin.inverse.redundant.samples import Changes, SampleRuns, Summary, place_between, summary_of_samples, value_at
from armkin.inverse.tasks.task import distance

EVEN_SAMPLES = 180  # even samples of a turn of the redundant joint, besides all places where something may change
SAMPLES = 360  # samples of a turn where these places are not known
CLOSER_FACTOR = 4  # factor on the number of values where branches may be between two samples
FINER_FACTOR = 48  # factor on the number of values where no sample had an answer
STEPS = 16  # steps of the golden section


class Followed(NamedTuple):
    """`families.Curves` followed along the redundant joint, a turn by samples: it is their parameter."""

    follower: Follower
    pieces: Pieces
    short: Bool
    complete: Bool  # (N,) all places are known at which a curve may end
    steps: int = STEPS

    @classmethod
    def along(cls, follower: Follower) -> Self:
        """Curves of the targets in two ways: those of which all places of a change are known, and others."""
        N = len(follower.target)
        parts, is_short, complete = [none(follower.arm.n)], np.zeros(N, bool), np.zeros(N, bool)
        bounds = boundaries(follower.arm) if follower.redundant.joint == follower.arm.n - 1 else None
        if bounds is not None:
            angles, decided = boundary_angles(bounds, follower.target)
            if len(rows := np.flatnonzero(decided)):
                pieces, is_short[rows], complete[rows] = _between_places(follower.of(rows), angles[rows])
                parts.append(pieces._replace(row=rows[pieces.row]))
        if len(rows := np.flatnonzero(~complete)):
            pieces, is_short[rows] = _sampled_pieces(follower.of(rows), 1)
            parts.append(pieces._replace(row=rows[pieces.row]))
        return cls(follower, stack_rows(parts), is_short, complete)

    def values_to_try(self, pieces: Pieces, near: Array) -> list[Array]:
        """Values of the parameter (P,) that may hold the posture nearest to near (P, n): its own, and both ends.

        At an end where branches merge, the motion along one of them is least, however it goes on from there.
        """
        value = near[:, self.follower.redundant.joint]
        value = value + np.round((pieces.at - value) / (2 * np.pi)) * 2 * np.pi
        return [np.where((value >= pieces.a) & (value <= pieces.b), value, pieces.at), pieces.first, pieces.last]

    def at(self, pieces: Pieces, parameter: Array) -> tuple[Array, Bool]:
        """Postures of pieces at values of the joint, and whether they are legal: as `Turning.at`."""
        return self.follower.legal_branch(pieces.row, pieces.branch, parameter)


def _between_places(follower: Follower, angles: Array) -> tuple[Pieces, Bool, Bool]:
    """Pieces of targets whose curves change at angles (N, V) alone; which are short, and which targets' (N,)."""
    summary = summary_of_samples(follower, over_a_turn(EVEN_SAMPLES), angles)
    changes = summary.crossings.at, summary.ends.at
    legal, present = ends = [place_between(summary.t, change, angles) for change in changes]
    crossing = np.flatnonzero(np.isfinite(legal) & ~np.isnan(summary.crossings.rooms).any(axis=1))
    legal[crossing] = crossed_at(follower, rows_of(changes[0], crossing), legal[crossing])
    explained = np.ones(len(angles), bool)
    for change, end in zip(changes, ends, strict=True):
        explained[change.row[np.isinf(end)]] = False
    intervals, families = (rows_of(runs, explained[runs.row]) for runs in (summary.legal_runs, summary.present_runs))
    pieces = _of_runs(summary.t, intervals, True, changes[0], legal)
    illegal = _of_runs(summary.t, rows_of(families, ~families.within), False, changes[1], present)
    return stack_rows([pieces, illegal]), summary.is_short, explained


def _sampled_pieces(follower: Follower, finer: int) -> tuple[Pieces, Bool]:
    """Pieces of some targets, and which are short: one of which something may be hidden between samples, or without an
    answer, is asked again: all of a nearly stretched arm lie within a degree."""
    summary = summary_of_samples(follower, over_a_turn(SAMPLES * finer))
    pieces, is_short = _all_pieces(follower, summary), summary.is_short
    if finer == 1:
        within_reach = distance(follower.arm, follower.redundant.task, follower.target) <= 1.0 + tol.SOLUTION
        unanswered = summary.is_lost & (follower.arm.prismatic.any() | within_reach)
        for factor, repeated in ((CLOSER_FACTOR, summary.has_hidden & ~unanswered), (FINER_FACTOR, unanswered)):
            targets = np.flatnonzero(repeated)
            at_once = max(SAMPLES // factor, 1)
            for rows in (targets[k : k + at_once] for k in range(0, len(targets), at_once)):
                part, part_short = _sampled_pieces(follower.of(rows), factor)
                unchanged, new_pieces = rows_of(pieces, ~np.isin(pieces.row, rows)), part._replace(row=rows[part.row])
                pieces = stack_rows([unchanged, new_pieces])
                is_short[rows] = part_short
    return pieces, is_short


def _all_pieces(follower: Follower, summary: Summary) -> Pieces:
    """All pieces of the curves of some targets."""
    t, K = summary.t, summary.t.shape[1]
    places = places_of(follower, summary)
    hidden, stretch = hidden_stretches(follower, t, summary.possible_crossings)
    gaps = hidden.set_before
    stretches, ends = rows_of(hidden, ~gaps), places.short
    parts = [_of_runs(t, summary.legal_runs, True, summary.crossings.at, places.legal)]
    present = summary.present_runs
    holds = present.row[:, None] == np.append(hidden.row, ends.row)
    holds &= present.branch[:, None] == np.append(hidden.branch, ends.branch)
    holds &= (np.append(hidden.k, ends.sample(0, K)) - present.first[:, None]) % K < present.length[:, None]
    families = _of_runs(t, present, False, summary.ends.at, places.there)
    parts.append(rows_of(families, ~(present.within | holds.any(axis=1))))  # families that hold one are left out
    parts[0] = _without_gaps(follower, parts[0], rows_of(hidden, gaps), stretch[:, gaps])
    row, branch = np.append(ends.row, stretches.row), np.append(ends.branch, stretches.branch)
    if len(row):
        a, b = np.concatenate([np.sort(places.ends, axis=0), stretch[:, ~gaps]], axis=1)
        middle = 0.5 * (a + b)
        q, legal = follower.legal_branch(row, branch, middle)
        parts.append(rows_of(Pieces(row, branch, legal, a, b, a, b, a, middle, b, q), legal))
    return stack_rows(parts)


def _of_runs(t: Array, runs: SampleRuns, legal: bool, changes: Changes, ends: Array) -> Pieces:
    """The pieces that hold runs of samples at t (N, K); ends: where changes are."""
    K, sample = t.shape[1], runs.first + runs.best
    low, centre, high = (value_at(t, runs.row, sample + side) for side in (-1, 0, 1))
    a, b = np.full(len(centre), -np.pi), np.full(len(centre), np.pi)
    cut = np.flatnonzero(runs.length < K)
    row, branch = runs.row[cut], runs.branch[cut]
    begin, end = runs.first[cut], runs.first[cut] + runs.length[cut] - 1
    # an end lies beside the run's last sample, and rounding may put it before that
    for side, bound, k in ((a, begin, begin - 1), (b, end, end)):
        value = value_at(t, row, bound)
        side[cut] = value + wrap_angle(ends[number_of(changes, row, k % K, branch, K)] - value)
    a, b = np.minimum(a, centre), np.maximum(b, centre)
    low[cut], high[cut] = np.clip(low[cut], a[cut], b[cut]), np.clip(high[cut], a[cut], b[cut])
    return Pieces(runs.row, runs.branch, np.full(len(centre), legal), a, b, a, b, low, centre, high, runs.start)


def _without_gaps(follower: Follower, pieces: Pieces, gaps: Changes, ends: Array) -> Pieces:
    """Pieces with gaps taken out that lie within them, from where to where (2, G)."""
    for row, branch, (begin, end) in zip(gaps.row, gaps.branch, ends.T, strict=True):
        turns = 2 * np.pi * np.round((0.5 * (pieces.a + pieces.b) - begin) / (2 * np.pi))
        spans = (pieces.row == row) & (pieces.branch == branch) & (pieces.a < begin + turns) & (end + turns < pieces.b)
        for p in np.flatnonzero(spans):
            piece = rows_of(pieces, np.array([p]))
            gap_begin, gap_end = np.array([begin + turns[p]]), np.array([end + turns[p]])
            sides = [(piece.a, gap_begin), (gap_end, piece.b)]
            if pieces.b[p] - pieces.a[p] >= 2 * np.pi:  # a whole turn is one piece that begins behind the gap
                sides = [(gap_end, gap_begin + 2 * np.pi)]
            parts = [rows_of(pieces, np.arange(len(pieces.row)) != p)]
            for a, b in sides:
                holds = (a <= piece.at) & (piece.at <= b)
                centre = np.where(holds, piece.at, 0.5 * (a + b))
                low, high = (np.clip(piece.low, a, b), np.clip(piece.high, a, b)) if holds else (a, b)
                start, _ = follower.legal_branch(piece.row, piece.branch, centre)
                parts.append(piece._replace(a=a, b=b, first=a, last=b, low=low, at=centre, high=high, start=start))
            pieces = stack_rows(parts)
            break
    return pieces
