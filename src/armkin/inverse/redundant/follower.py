"""Answers of an arm with a redundant joint at any of its values, in the columns of their branches."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool, Entry
from armkin.formula.trace import StraightLineCode
from armkin.inverse.answers.solutions import Solutions
from armkin.inverse.branches.whole_turns import nearest_row
from armkin.inverse.closed.candidates import entries, recorded
from armkin.inverse.closed.subproblems import Pair
from armkin.inverse.numeric.tolerances import ACCEPTED
from armkin.inverse.redundant.pieces import margin, motion, turning
from armkin.inverse.solvers.recognise import solver
from armkin.inverse.solvers.redundant import Redundancy, moved, moved_entries

if TYPE_CHECKING:
    from armkin.model.arm import Arm

Ik = Callable[..., Solutions]
AT_A_TIME = 2_000  # targets of a formula: they stay in the cache


class Postures(NamedTuple):
    """Answers at values of the redundant joint: q (..., B, n), whether they are there and within limits (..., B)."""

    q: Array
    valid: Bool
    legal: Bool


class Samples(NamedTuple):
    """Answers of targets N at K values of the redundant joint, in the columns of their branches."""

    q: Array  # (N, K, B, n)
    valid: Bool  # (N, K, B)
    legal: Bool
    room: Array  # (N, K, B) of `margin`
    cost: Array  # (N, K, B) motion from near
    turns: Bool  # (N, K, B) the limits seem to be crossed, and crossed again, before the next value
    hidden: Bool  # (N,) branches seem to be there between two values at which they are not


@lru_cache(maxsize=64)
def _recorded(arm: Arm, free: Redundancy) -> tuple[StraightLineCode, tuple[int, ...]]:
    """The closed form of the others with the redundant joint as an argument: of a target's entries and its pair."""
    rest = recorded(free.rest, solver(free.rest, free.task.name)[0], free.geometry)
    inputs = 12 if free.task.orientation == "full" else len(free.task.labels)

    def formula(x: list[Entry]) -> list[Entry]:
        goal = moved_entries(arm, free, x[:inputs], Pair(x[inputs], x[inputs + 1]))
        return rest.candidates(goal, [None] * rest.arm.n)

    return StraightLineCode(formula, inputs + 2), rest.axes


def over_a_turn(count: int) -> Array:
    """Values of a joint (count,) [rad], evenly over a turn, half a step from its ends."""
    return np.asarray(-np.pi + (np.arange(count) + 0.5) * (2 * np.pi / count))


def _joined(parts: Sequence[NDArray[Any]]) -> NDArray[Any]:
    """Parts (S, K, ...) one after the other, the samples of a branch side by side in memory, as in the parts."""
    if len(parts) == 1 or parts[0].ndim == 1:
        return np.concatenate(parts) if len(parts) > 1 else parts[0]
    out = np.concatenate([np.moveaxis(part, (0, 1), (-2, -1)) for part in parts], axis=-2)
    return np.moveaxis(out, (-2, -1), (0, 1))


class Follower(NamedTuple):
    """Answers of some targets (N, ...) at any value of the redundant joint; near: (N, n)."""

    ik: Ik
    arm: Arm
    free: Redundancy
    target: Array
    near: Array

    def found(self, rows: NDArray[np.intp], t: Array) -> Array:
        """Branches (M, B, n) of targets (M,) at values t (M,), each in the column of its index, nan where there is
        none."""
        if self.by_formula:
            q, missed = self._by_formula(rows, t)
            np.copyto(q, np.nan, where=~(missed <= ACCEPTED**2)[..., None])
            return q
        goal = moved(self.arm, self.free, self.target[rows], t)
        s = self.ik(self.free.rest, goal, self.free.task.name, examine=False)
        M, B, r = len(t), s.q.shape[1], self.free.joint
        number = s.branch if self.free.labelled else np.where(s.valid, np.arange(B), -1)
        out = np.full((M, B + 1, self.arm.n), np.nan)
        place = np.arange(M)[:, None], np.where(number < 0, B, number)
        out[*place, :r], out[*place, r], out[*place, r + 1 :] = s.q[:, :, :r], t[:, None], s.q[:, :, r:]
        return out[:, : max(B, 1)]  # a column, where no target of them has an answer

    @property
    def by_formula(self) -> bool:
        """Whether the others have a closed form that needs no more than its recorded formula."""
        return self.free.labelled and self.free.geometry.doubts is None

    def _by_formula(self, rows: NDArray[np.intp], t: Array) -> tuple[Array, Array]:
        """The candidates of a closed form (M, B, n), real or not, one joint after another in memory; what they miss,
        squared (M, B)."""
        code, axes = _recorded(self.arm, self.free)
        M = len(t)
        joints = [j for j in range(self.arm.n) if j != self.free.joint]
        goal = [np.asarray(x) for x in entries(self.free.task, self.target)]
        out = np.empty((self.arm.n, math.prod(axes), M))
        out[self.free.joint] = t
        missed = np.empty(out.shape[1:])
        room: list[NDArray[Any]] = []
        for start in range(0, M, AT_A_TIME):
            some = slice(start, min(start + AT_A_TIME, M))
            shape = (*axes, some.stop - start)
            if not room or some.stop - start != AT_A_TIME:
                room = code.workspace(some.stop - start)
            row, value = rows[some], t[some]
            *values, miss, _, _ = code.run([*(x[row] for x in goal), np.cos(value), np.sin(value)], room)
            for j, q in zip(joints, values, strict=True):
                out[j, :, some] = np.broadcast_to(q, shape).reshape(-1, shape[-1])
            missed[:, some] = np.broadcast_to(miss, shape).reshape(-1, shape[-1])
        return out.transpose(2, 1, 0), missed.T

    def _legal(self, rows: NDArray[np.intp], q: Array) -> Postures:
        """Postures (M, B, n) at their nearest legal copies."""
        valid = ~np.isnan(q[:, :, 0])
        q, legal = nearest_row(self.arm, np.where(valid[:, :, None], q, 0.0), self.near[rows][:, None])
        np.copyto(q, np.nan, where=~valid[:, :, None])
        return Postures(q, valid, legal & valid)

    def along(self, t: Array) -> Samples:
        """Every target at all of t (K,)."""
        N, K = len(self.target), len(t)
        each = max(AT_A_TIME // K, 1) if self.by_formula else N  # targets whose samples stay in the cache
        parts = [self._sampled(np.arange(k, min(k + each, N)), t) for k in range(0, N, each)]
        return Samples(*(_joined(column) for column in zip(*parts, strict=True)))

    def _sampled(self, some: NDArray[np.intp], t: Array) -> Samples:
        """As `along`, some of the targets (S,)."""
        rows, values = np.repeat(some, len(t)), np.tile(t, len(some))
        if self.by_formula:
            q, missed = self._by_formula(rows, values)
            np.copyto(q, np.nan, where=~(missed <= ACCEPTED**2)[..., None])
        else:
            q = self.found(rows, values)
            missed = np.full(q.shape[:2], np.nan)
        q, valid, legal = self._legal(rows, q)
        every = q, valid, legal, margin(self.arm, q), motion(self.arm, q, self.near[rows][:, None]), missed
        q, valid, legal, room, cost, missed = (x.reshape(len(some), len(t), *x.shape[1:]) for x in every)
        off = np.where(valid, np.nan, -np.sqrt(missed))
        return Samples(q, valid, legal, room, cost, turning(room), turning(off).any(axis=(1, 2)))

    def one(self, rows: NDArray[np.intp], branch: NDArray[np.intp], t: Array) -> Postures:
        """One branch each (M,)."""
        one = self._legal(rows, self.found(rows, t)[np.arange(len(rows)), branch][:, None])
        return Postures(one.q[:, 0], one.valid[:, 0], one.legal[:, 0])
