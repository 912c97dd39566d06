"""Answers of an arm with a redundant joint at any of its values, in the columns of their branches.

Between samples more are taken where more may happen than they show: a joint comes to a limit and leaves it again, or
two branches appear and vanish, only where what is left to it is less than its bend from sample to sample allows. Where
branches merge, and beside a straight shoulder or wrist, joints turn without bound.
"""

import math
from functools import lru_cache
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool, Entry, Int, slices
from armkin.formula.trace import StraightLineCode
from armkin.inverse.answers.solutions import Ik
from armkin.inverse.branches.whole_turns import nearest_of_joint, nearest_row
from armkin.inverse.closed.candidates import recorded_formula, target_entries
from armkin.inverse.closed.subproblems import Pair
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.redundant.interval_pieces import motion_of_joint, within_limits
from armkin.inverse.solvers.choose_redundant_joint import Redundancy, move_entries, move_targets
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.model.arm import Arm

AT_A_TIME = 2_000  # targets that a formula solves at once: they stay in the cache
SAFE = 4.0  # safety factor on the bend that the samples show
LIMIT_DISTANCE = 0.3  # distance [rad] of a limit within which a branch can come to it before the next sample
FAST_STEP = 0.2  # movement [rad] from one sample to the next that is fast: beside a straight shoulder or wrist
LIMIT_SLACK = 0.2  # distance [rad] beyond its limits at which a branch may still be legal between two samples
END_SLACK = 0.3  # distance [rad] beyond its limits, as LIMIT_SLACK, near a branch's end
PARTS = 8  # parts of the way between two samples
MAX_WAYS = 16  # ways between two samples, at most, that are refined for a target
MAX_VALUES = MAX_WAYS * (PARTS - 1)  # values solved, at most, on the refined ways of a target


class Sampled(NamedTuple):
    """Answers of targets S at K values of the redundant joint, in the columns of their branches."""

    t: Array  # (S, K) these values
    values: list[Array]  # values of each joint: branch axes, perhaps of length 1, before all samples (S K,)
    axes: tuple[int, ...]  # lengths of the branch axes
    valid: Bool  # (S, K, B)
    legal: Bool
    room: Array  # (S, K, B) of `margin`
    cost: Array  # (S, K, B) motion from near
    missed: Array  # (S, K, B) squared, by candidates of a closed form; else nan

    def postures(self, row: Int, k: Int) -> Array:
        """All branches (M, B, n) at samples k (M,) of targets (M,), nan where there is none."""
        samples = row * self.valid.shape[1] + k
        shape = math.prod(self.axes), len(samples)
        columns = [np.broadcast_to(v[..., samples], (*self.axes, len(samples))).reshape(shape) for v in self.values]
        q = np.stack(columns).transpose(2, 1, 0)
        np.copyto(q, np.nan, where=~self.valid[row, k][:, :, None])
        return q


@lru_cache(maxsize=64)
def _recorded_form(arm: Arm, redundant: Redundancy) -> tuple[StraightLineCode, tuple[int, ...]]:
    """The closed form of the others with the redundant joint as an argument: of a target's entries and its pair."""
    rest_form = recorded_formula(redundant.rest, solver(redundant.rest, redundant.task.name)[0], redundant.geometry)
    inputs = 12 if redundant.task.orientation == "full" else len(redundant.task.labels)

    def formula(x: list[Entry]) -> list[Entry]:
        goal = move_entries(arm, redundant, x[:inputs], Pair(x[inputs], x[inputs + 1]))
        return rest_form.candidates(goal, [None] * rest_form.arm.n)

    return StraightLineCode(formula, inputs + 2), rest_form.axes


def over_a_turn(count: int) -> Array:
    """Values of a joint (count,) [rad], evenly over a turn, half a step from its ends."""
    return np.asarray(-np.pi + (np.arange(count) + 0.5) * (2 * np.pi / count))


class Follower(NamedTuple):
    """Answers of some targets (N, ...) at any value of the redundant joint; near: (N, n)."""

    ik: Ik
    arm: Arm
    redundant: Redundancy
    target: Array
    near: Array

    def of(self, rows: Int | slice) -> Self:
        """For some of the targets."""
        return self._replace(target=self.target[rows], near=self.near[rows])

    def branches_at(self, rows: Int, t: Array) -> Array:
        """Branches (M, B, n), nan for none, of targets (M,) at values t (M,), of closed forms in their columns."""
        if not self.redundant.by_formula:
            goal = move_targets(self.arm, self.redundant, self.target[rows], t)
            s = self.ik(self.redundant.rest, goal, self.redundant.task.name, examine=False)
            return np.insert(s.q, self.redundant.joint, np.where(s.valid, t[:, None], np.nan), axis=2)
        q, misses = self.candidates(rows, t)
        np.copyto(q, np.nan, where=~(misses <= tol.ACCEPTED)[..., None])
        return q

    def candidates(self, rows: Int, t: Array) -> tuple[Array, Array]:
        """All branches (M, B, n) of a closed form, real or not, and what they miss (M, B)."""
        axes = _recorded_form(self.arm, self.redundant)[1]
        columns = np.empty((self.arm.n, math.prod(axes), len(t)))  # one joint after another in memory
        misses = np.empty(columns.shape[1:])
        room: list[NDArray[Any]] = []
        for part in slices(len(t), AT_A_TIME):
            shape = (*axes, part.stop - part.start)
            *values, miss, room = self._candidates(rows[part], t[part], room)
            for j, q in enumerate(values):
                columns[j, :, part] = np.broadcast_to(q, shape).reshape(-1, shape[-1])
            misses[:, part] = np.broadcast_to(miss, shape).reshape(-1, shape[-1])
        return columns.transpose(2, 1, 0), np.sqrt(misses.T)

    def _candidates(self, rows: Int, t: Array, room: list[NDArray[Any]]) -> list[Any]:
        """The values of all joints and what they miss, squared, on their own branch axes before targets (M,); the
        workspace that they stand in, room if that is one for as many."""
        code, _ = _recorded_form(self.arm, self.redundant)
        if not room or room[0].shape[-1] != len(t):
            room = code.workspace(len(t))
        goal = [np.asarray(x)[rows] for x in target_entries(self.redundant.task, self.target)]
        *values, miss, _, _ = code.run([*goal, np.cos(t), np.sin(t)], room)
        values.insert(self.redundant.joint, t)
        return [*values, miss, room]

    def samples_at(self, pick: Int, t: Array, extra: Array | None = None) -> Sampled:
        """Some of the targets (S,), of a closed form, at all of t (K,) and at extra values (S, M), inf where there are
        fewer; by default between those at which more may happen."""
        rows, values = np.repeat(pick, len(t)), np.tile(t, len(pick))
        axes = _recorded_form(self.arm, self.redundant)[1]
        *columns, misses, _ = self._candidates(rows, values, [])
        if extra is None:
            extra = _values_between(self.arm, columns, misses, axes, t)
        real = np.isfinite(extra)
        *added, added_miss, _ = self._candidates(np.broadcast_to(pick[:, None], extra.shape)[real], extra[real], [])
        every = np.concatenate([np.tile(t, (len(pick), 1)), np.where(real, extra, t[-1])], axis=1)
        order = np.argsort(every, axis=1, kind="stable")

        def merged(first: Array, second: Array) -> Array:
            """With the values between; where there is none the last sample is there once more."""
            axes, (S, K) = first.shape[:-1], every.shape
            samples = np.empty((*axes, S, K))
            samples[..., : len(t)] = first.reshape(*axes, S, len(t))
            samples[..., len(t) :] = samples[..., len(t) - 1, None]
            samples[..., len(t) :][..., real] = second
            return np.take_along_axis(samples, order.reshape(*[1] * len(axes), S, K), axis=-1).reshape(*axes, -1)

        columns = [merged(*pair) for pair in zip(columns, added, strict=True)]
        return self._within(pick, np.take_along_axis(every, order, axis=1), columns, merged(misses, added_miss), axes)

    def _within(self, pick: Int, t: Array, columns: list[Array], misses: Array, axes: tuple[int, ...]) -> Sampled:
        """Values of all joints on their own branch axes before samples of some of the targets, at legal copies."""
        present = misses <= tol.ACCEPTED**2
        near = self.near[np.repeat(pick, t.shape[1])].T
        shape = (*axes, t.size)
        legal, cost, room = present, np.zeros(()), np.full(shape, 2 * np.pi)
        for j in sorted(range(len(columns)), key=lambda j: columns[j].size):  # joints on few branch axes come first
            columns[j], fits = nearest_of_joint(self.arm, j, columns[j], near[j])
            legal, cost = legal & fits, cost + motion_of_joint(self.arm, j, columns[j], near[j])
            within_limits(self.arm, j, columns[j], room)
        room = np.where(present, room, np.nan)
        every = (present, legal, room, np.where(present, cost, np.inf), misses)
        dense = (np.broadcast_to(x, shape).reshape(-1, *t.shape).transpose(1, 2, 0) for x in every)
        return Sampled(t, columns, axes, *dense)

    def own(self, rows: Int, branch: Int, t: Array) -> Array:
        """One branch each (M, n), as `branches_at`."""
        *columns, miss, _ = self._candidates(rows, t, [])
        place = np.unravel_index(branch, _recorded_form(self.arm, self.redundant)[1])

        def picked(values: Array) -> Array:
            axes = values.shape[:-1]
            index = (k if size > 1 else 0 for k, size in zip(place[len(place) - len(axes) :], axes, strict=True))
            return np.asarray(values[*index, np.arange(len(t))])

        q = np.stack([picked(values) for values in columns]).T
        q[~(picked(miss) <= tol.ACCEPTED**2)] = np.nan
        return q

    def legal_branch(self, rows: Int, branch: Int, t: Array) -> tuple[Array, Bool]:
        """One branch each (M, n), at its nearest legal copy, nan where there is none; which are within limits (M,)."""
        postures = self.own(rows, branch, t)
        present = ~np.isnan(postures[:, 0])
        q, legal = nearest_row(self.arm, np.where(present[:, None], postures, 0.0), self.near[rows])
        return np.where(present[:, None], q, np.nan), legal & present


def _values_between(arm: Arm, columns: list[Array], misses: Array, axes: tuple[int, ...], t: Array) -> Array:
    """Values of the joint between t (K,) that shall be asked, too (S, MAX_VALUES); inf where there are fewer.

    columns: of each joint its values on its own branch axes before targets' samples (S K,); misses: squared.
    """
    K = len(t)
    shape = (*axes, columns[0].shape[-1] // K, K)

    def by_target(x: Array) -> Array:
        return x.reshape(*x.shape[:-1], *shape[-2:])

    present = by_target(misses) <= tol.ACCEPTED**2
    room, may, crossed = np.full(shape, 2 * np.pi), np.zeros(shape, bool), np.zeros(shape, np.int8)
    for j, column in enumerate(columns):
        margins = np.full(column.shape, 2 * np.pi)
        within_limits(arm, j, column, margins)
        margins = by_target(margins)
        np.minimum(room, margins, out=room)
        may |= _may_touch(margins)
        crossed += (margins < 0) != _next_sample(margins < 0)
    room = np.where(present, room, -np.inf)
    room = np.maximum(room, _next_sample(room))
    absent = ~present & ~_next_sample(present)
    ends = present != _next_sample(present)
    hidden = absent & _may_touch(np.sqrt(by_target(misses)))
    limits = ~absent & ~ends & (may | (crossed > 1)) & (room > -LIMIT_SLACK)
    counts = (limits | (ends & (room > -END_SLACK)) | hidden).sum(axis=tuple(range(len(axes))))
    ways = np.argsort(-counts, axis=1, kind="stable")[:, :MAX_WAYS]
    begin = np.where(np.take_along_axis(counts, ways, axis=1) > 0, t[ways], np.inf)
    width = np.diff(t, append=t[0] + 2 * np.pi)[ways]
    values = begin[:, :, None] + width[:, :, None] * (np.arange(1, PARTS) / PARTS)
    return np.asarray(values.reshape(-1, MAX_VALUES))


def _next_sample(x: NDArray[Any]) -> NDArray[Any]:
    """The values x (..., K) of the next sample round the turn."""
    return np.roll(x, -1, axis=-1)


def _may_touch(margins: Array) -> Bool:
    """Whether margins (..., K) may come to nothing and back between a sample and the next."""
    touches, values, K = np.abs(_next_sample(margins) - margins) > FAST_STEP, margins.ravel(), margins.shape[-1]
    index = np.flatnonzero(np.abs(values) < LIMIT_DISTANCE)
    k = index % K
    v0, v1, v2, v3 = (values[index - k + (k + offset) % K] for offset in (-1, 0, 1, 2))
    step = v2 - v1
    bend = SAFE * np.maximum(np.abs(step - (v1 - v0)), np.abs((v3 - v2) - step))
    smallest = np.minimum(np.abs(v1), np.abs(v2))
    touches.ravel()[index] |= (smallest < bend / 8) & (np.abs(step) < bend / 2)
    return touches
