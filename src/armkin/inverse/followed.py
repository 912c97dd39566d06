"""Answers of an arm with a redundant joint at any of its values, followed along it by their branches."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool
from armkin.inverse.answers.solutions import Solutions
from armkin.inverse.branches.whole_turns import nearest_row
from armkin.inverse.closed.candidates import entries, recorded
from armkin.inverse.numeric.tolerances import ACCEPTED, REACH, SOLUTION
from armkin.inverse.pieces import Pieces, best_samples, motion, runs
from armkin.inverse.solvers.recognise import solver
from armkin.inverse.solvers.redundant import Redundancy, moved
from armkin.inverse.tasks.task import distance

if TYPE_CHECKING:
    from armkin.model.arm import Arm

Ik = Callable[..., Solutions]
AT_A_TIME = 2_000  # targets of a formula: they stay in the cache
SAMPLES = 720  # of a turn of the redundant joint
FINER = 24  # times as many values where none had an answer
HALVINGS = 24  # of half a degree: 3e-8 degrees
STEPS = 34  # of the golden section


class Postures(NamedTuple):
    """Answers at values of the redundant joint: q (..., B, n), whether they are there and within limits (..., B)."""

    q: Array
    valid: Bool
    legal: Bool


def over_a_turn(count: int) -> Array:
    """Values of a joint (count,) [rad], evenly over a turn, half a step from its ends."""
    return np.asarray(-np.pi + (np.arange(count) + 0.5) * (2 * np.pi / count))


class Follower(NamedTuple):
    """Answers of some targets (N, ...) at any value of the redundant joint; near: (N, n)."""

    ik: Ik
    arm: Arm
    free: Redundancy
    target: Array
    near: Array

    def at(self, rows: NDArray[np.intp], t: Array) -> Postures:
        """All branches of targets (M,) at values t (M,), each in the column of its index."""
        return self._legal(rows, self.found(rows, t))

    def found(self, rows: NDArray[np.intp], t: Array) -> Array:
        """Branches (M, B, n), nan where there is none."""
        goal = moved(self.arm, self.free, self.target[rows], t)
        if self.free.labelled and self.free.geometry.doubts is None:
            return self._by_formula(goal, t)
        s = self.ik(self.free.rest, goal, self.free.task.name, examine=False)
        M, B, r = len(t), s.q.shape[1], self.free.joint
        number = s.branch if self.free.labelled else np.where(s.valid, np.arange(B), -1)
        out = np.full((M, B + 1, self.arm.n), np.nan)
        place = np.arange(M)[:, None], np.where(number < 0, B, number)
        out[*place, :r], out[*place, r], out[*place, r + 1 :] = s.q[:, :, :r], t[:, None], s.q[:, :, r:]
        return out[:, : max(B, 1)]  # a column, where no target of them has an answer

    def _by_formula(self, goal: Array, t: Array) -> Array:
        """The same of a closed form, by its recorded formula alone; one joint after another in memory."""
        rest, r, M = self.free.rest, self.free.joint, len(t)
        formula = recorded(rest, solver(rest, self.free.task.name)[0], self.free.geometry)
        joints = [j for j in range(self.arm.n) if j != r]
        out = np.empty((self.arm.n, math.prod(formula.axes), M))
        out[r] = t
        room: list[NDArray[Any]] = []
        for start in range(0, M, AT_A_TIME):
            some = slice(start, min(start + AT_A_TIME, M))
            shape = (*formula.axes, some.stop - start)
            if not room or some.stop - start != AT_A_TIME:
                room = formula.code.workspace(some.stop - start)
            *values, miss, _, _ = formula.code.run(entries(formula.task, goal[some]), room)
            for j, value in zip(joints, values, strict=True):
                out[j, :, some] = np.broadcast_to(value, shape).reshape(-1, shape[-1])
            missing = np.broadcast_to(miss > ACCEPTED**2, shape).reshape(-1, shape[-1])
            out[:, :, some][:, missing] = np.nan
        return out.transpose(2, 1, 0)

    def _legal(self, rows: NDArray[np.intp], q: Array) -> Postures:
        """Postures (M, B, n) at their nearest legal copies."""
        valid = ~np.isnan(q[:, :, 0])
        q, legal = nearest_row(self.arm, np.where(valid[:, :, None], q, 0.0), self.near[rows][:, None])
        q[~valid] = np.nan
        return Postures(q, valid, legal & valid)

    def along(self, t: Array) -> Postures:
        """Of every target at all of t (K,): q (N, K, B, n)."""
        N, K = len(self.target), len(t)
        found = self.at(np.repeat(np.arange(N), K), np.tile(t, N))
        B = found.valid.shape[1]
        q, valid, legal = found.q.reshape(N, K, B, -1), found.valid.reshape(N, K, B), found.legal.reshape(N, K, B)
        return Postures(q, valid, legal)

    def one(self, rows: NDArray[np.intp], branch: NDArray[np.intp], t: Array) -> Postures:
        """One branch each (M,)."""
        one = self._legal(rows, self.found(rows, t)[np.arange(len(rows)), branch][:, None])
        return Postures(one.q[:, 0], one.valid[:, 0], one.legal[:, 0])


class Followed(NamedTuple):
    """`Curves` followed along the redundant joint, a turn by samples: it is their parameter."""

    find: Follower
    pieces: Pieces
    short: Bool
    steps: int = STEPS

    @classmethod
    def along(cls, find: Follower, finer: int = 1) -> Followed:
        """Of some targets; one without an answer is asked again: all of a nearly stretched arm lie within a degree."""
        K = SAMPLES * finer
        t = over_a_turn(K)
        found = find.along(t)
        pieces, short = _pieces(find, t, found), _all_short(find, found)
        if finer == 1:
            near_enough = find.arm.prismatic.any() | (distance(find.arm, find.free.task, find.target) <= 1.0 + SOLUTION)
            for k in np.flatnonzero(~found.valid.any(axis=(1, 2)) & near_enough):
                alone = cls.along(find._replace(target=find.target[[k]], near=find.near[[k]]), FINER)
                more = alone.pieces._replace(row=alone.pieces.row + k)
                pieces = Pieces(*(np.concatenate(pair) for pair in zip(pieces, more, strict=True)))
                short[k] = alone.short[0]
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


def _ends(find: Follower, t: Array, found: Postures, kinds: dict[bool, Bool]) -> dict[bool, Array]:
    """Of legal postures and of those that are there the values (N, K, B) where samples good end to be so before the
    sample k + 1, or begin to be so; nan where nothing changes."""
    h = t[1] - t[0]
    places = {legal: np.nonzero(good != np.roll(good, -1, axis=1)) for legal, good in kinds.items()}
    row, k, branch = (np.concatenate([place[i] for place in places.values()]) for i in range(3))
    inside = np.concatenate([kinds[legal][place] for legal, place in places.items()])
    of_legal = np.concatenate([np.full(len(place[0]), legal) for legal, place in places.items()])
    low = t[k]
    lo, hi = np.where(inside, low, low + h), np.where(inside, low + h, low)  # good at lo
    for _ in range(HALVINGS if len(row) else 0):
        middle = 0.5 * (lo + hi)
        there = find.one(row, branch, middle)
        keep = np.where(of_legal, there.legal, there.valid)
        lo, hi = np.where(keep, middle, lo), np.where(keep, hi, middle)
    out = {}
    for legal, place in places.items():
        out[legal] = np.full(found.valid.shape, np.nan)
        out[legal][place] = lo[of_legal == legal]
    return out


def _pieces(find: Follower, t: Array, found: Postures) -> Pieces:
    """All pieces of the curves of some targets, from samples along t."""
    K, B = found.valid.shape[1:]
    h = float(t[1] - t[0])
    cost = motion(find.arm, found.q, find.near[:, None, None]).transpose(0, 2, 1).reshape(-1, K)
    kinds = {True: found.legal, False: _families_without(found)}
    ends, parts = _ends(find, t, found, kinds), []
    for legal, good in kinds.items():
        samples = good.transpose(0, 2, 1).reshape(-1, K)
        curve, first, length = runs(samples, np.zeros_like(samples))
        row, branch = curve // B, curve % B
        best = best_samples(cost, curve, first, length)
        at = t[first] + best * h
        a, b = ends[legal][row, first - 1, branch], ends[legal][row, (first + length - 1) % K, branch]
        a, b = at - (at - a) % (2 * np.pi), at + (b - at) % (2 * np.pi)
        all_round = length == K
        a, b = np.where(all_round, -np.pi, a), np.where(all_round, np.pi, b)
        low, high = (np.where(all_round, beside, np.clip(beside, a, b)) for beside in (at - h, at + h))
        start = found.q[row, (first + best) % K, branch]
        parts.append(Pieces(row, branch, np.full(len(row), legal), a, b, a, b, low, at, high, start))
    return Pieces(*(np.concatenate(pair) for pair in zip(*parts, strict=True)))


def _families_without(found: Postures) -> Bool:
    """Samples (N, K, B) of families that have no legal posture: pieces between places where a branch is not real."""
    valid = found.valid
    first = valid & ~np.roll(valid, 1, axis=1)
    number = np.cumsum(first, axis=1)
    number = np.where(number == 0, number[:, -1:], number)  # what begins before the turn ends at its end
    N, K, B = valid.shape
    legal = np.zeros((N, K + 1, B), bool)
    row, branch = np.arange(N)[:, None, None], np.arange(B)
    np.logical_or.at(legal, (row, number, branch), found.legal)
    return np.asarray(valid & ~legal[row, number, branch])


def _all_short(find: Follower, found: Postures) -> Bool:
    """Whether no joint moves by REACH along any family of a target (N,), from its samples."""
    together = found.valid
    for shift in range(1, 2 + int(REACH / (2 * np.pi / found.valid.shape[1]))):
        together = together & np.roll(found.valid, -shift, axis=1)
    short = np.asarray(found.valid.any(axis=(1, 2)) & ~together.any(axis=(1, 2)))
    for k in np.flatnonzero(short).tolist():
        q, valid = found.q[k], found.valid[k]
        step = np.abs(np.remainder(np.roll(q, -1, axis=0) - q + np.pi, 2 * np.pi) - np.pi)
        way = np.where((valid & np.roll(valid, -1, axis=0))[..., None], np.nan_to_num(step), 0.0).sum(axis=0)
        short[k] = 2.0 * way.max(initial=0.0) < REACH
    return short
