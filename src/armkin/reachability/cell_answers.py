"""Results of a ring of cells: reached shares, numbers of branches, measures.

One solve answers many poses. A rotation of the target about the axis of joint 1 changes joint 1 only, and a rotation
about the tool's z axis changes the last joint only, if that joint's axis is the tool's z axis. Each branch of one solve
is therefore legal on an arc of azimuths and on an arc of rolls. An arc is a first index and a length; arcs of rolls are
also words with one bit for each roll, so that the union over all branches takes a few operations. The union changes
only at azimuths where the arc of some branch begins or ends, and it is computed only there. Other arms, and targets on
an edge, are solved pose by pose. If an arm has one joint more than its task, a branch is a legal interval of a family,
and measures are those of its listed posture.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool
from armkin.forward import jacobian
from armkin.inverse.answers.solutions import Solutions, Status
from armkin.inverse.solve import ik
from armkin.model.limits import SLACK
from armkin.model.units import TURN
from armkin.motors import joints_per_pulse
from armkin.reachability.dexterity import measure_function
from armkin.reachability.reach_cells import STRAIGHT, Grid

if TYPE_CHECKING:
    from armkin.model.arm import Arm

MEASURES = ("manipulability", "limit_margin", "step_error_mm")
Words = NDArray[np.uint64]


@dataclass(frozen=True, eq=False)
class CellQuestion:
    """A grid, and the arcs that answer it; measures: whether columns that need Jacobians are computed."""

    grid: Grid
    measures: bool = True

    @cached_property
    def by_arcs(self) -> bool:
        """Whether a rotation of the target about the axis of joint 1 changes joint 1 only."""
        arm = self.grid.arm
        is_free_revolute = not arm.prismatic[0] and bool((arm.ratio == 1.0).all()) and not arm.keep_out
        return is_free_revolute and arm.n <= 6 and arm.n == self.grid.task.constraints and not self.grid.down_is_apart

    @cached_property
    def roll_arcs(self) -> bool:
        """Whether the same holds for rolls and the last joint, whose axis is then the tool's z axis."""
        arm, tool_link = self.grid.arm, self.grid.arm.link[-1]
        on_axis = np.abs(tool_link[:2, 3]).max() <= STRAIGHT * arm.reach and np.abs(tool_link[:2, 2]).max() <= STRAIGHT
        return self.by_arcs and self.grid.task.orientation == "full" and not arm.prismatic[-1] and bool(on_axis)

    @cached_property
    def round_azimuths(self) -> bool:
        """Whether joint 1 has a copy within limits at every azimuth, so that one azimuth answers all.

        This is false with measures, because the distance to the limits depends on the azimuth.
        """
        return self.by_arcs and not self.measures and whole_turn(self.grid.arm, 0)

    @cached_property
    def round_rolls(self) -> bool:
        """Whether the last joint has a copy within limits at every roll."""
        return self.roll_arcs and whole_turn(self.grid.arm, -1)

    @property
    def solves_a_ring(self) -> int:
        """Number of solves for a ring."""
        grid = self.grid
        azimuths, rolls = 1 if self.by_arcs else grid.azimuths, 1 if self.roll_arcs else grid.rolls_count
        return azimuths * grid.directions_count * rolls

    @cached_property
    def roll_words(self) -> Words:
        """Bits of an arc of rolls by length and first index: (L + 1, L, W)."""
        return pack_bits(_all_arcs(self.grid.rolls_count if self.roll_arcs and not self.round_rolls else 1))

    @property
    def turns(self) -> int:
        """Number of azimuths with their own result: all M if azimuths are arcs, else 1."""
        return self.grid.azimuths if self.by_arcs and not self.round_azimuths else 1


def cell_columns(question: CellQuestion, rings: Array) -> dict[str, Array]:
    """The columns of some rings (R, 2), M rows each, except x, y, z."""
    grid, M = question.grid, question.grid.azimuths
    count = question.solves_a_ring // (1 if question.by_arcs else M)
    if question.by_arcs:
        solve_rings = np.repeat(rings, count, axis=0)
        azimuth = np.zeros(len(solve_rings))
    else:
        solve_rings = np.repeat(rings, M * count, axis=0)
        azimuth = np.tile(np.repeat(np.arange(M) * (TURN / M), count), len(rings))
    orientation = np.arange(len(solve_rings)) % count
    rolls = 1 if question.roll_arcs else grid.rolls_count
    roll = np.asarray((orientation % rolls) * (TURN / grid.rolls_count), dtype=float)
    target = grid.targets(solve_rings, azimuth, orientation // rolls, roll)
    columns = _Answers(question, target, solve_rings, orientation // rolls).columns(count)
    cells = len(rings) * M
    return {name: values.reshape(cells) for name, values in columns.items()}


class _Edges(NamedTuple):
    """Solves (K,) on an edge, and their counts by name for each azimuth: (K, M)."""

    rows: NDArray[np.intp]
    counts: dict[str, Array]


class _Answers:
    """The answers of S solves, each for M azimuths and W words of rolls (both 1 without arcs)."""

    def __init__(self, question: CellQuestion, target: Array, azimuth: Array, direction: NDArray[np.intp]) -> None:
        self.question, self.grid, self.arm = question, question.grid, question.grid.arm
        self.azimuth, self.direction = azimuth, direction
        solutions = ik(self.arm, target)
        self.s, self.valid = solutions, solutions.valid
        self.count = self.grid.rolls_count if question.roll_arcs else 1
        is_legal = solutions.within_limits & solutions.clear if self.arm.keep_out else solutions.within_limits
        self.rolls: Words = np.full((*solutions.valid.shape, 1), np.uint64(1))
        self.first: NDArray[Any] = np.zeros(solutions.valid.shape, np.intp)  # (S, B) of azimuths
        self.length: NDArray[Any] = is_legal.astype(np.intp)
        if question.by_arcs:
            last = self.arm.n - 1 if question.roll_arcs else self.arm.n
            is_inside = solutions.valid & cells_inside(self.arm, solutions.q, range(1, last))
            self.first, length = legal_arc(self.arm, solutions.q[:, :, 0], 0, question.turns, 1)
            self.length = np.where(is_inside, length, 0)
            if question.roll_arcs:
                rolls = question.roll_words
                sense = 1 if self.arm.link[-1][2, 2] > 0 else -1
                first, length = legal_arc(self.arm, solutions.q[:, :, -1], -1, rolls.shape[1], sense)
                self.rolls = rolls[length, first]

    def columns(self, orientations: int) -> dict[str, Array]:
        """Columns (R * M,); orientations: number of solves of a ring (or a cell)."""
        M = self.grid.azimuths if self.question.by_arcs else 1
        counts, edges = self._counts(), self._edges(M)
        for values in counts.values():
            values[edges.rows] = 0.0
        sums = {name: self._sum_over_solves(values, orientations, M) for name, values in counts.items()}
        ring = edges.rows // orientations
        for name, values in edges.counts.items():
            np.add.at(sums[name], ring, values)
        reached_count, total = sums["reached"], orientations * self.count
        with np.errstate(divide="ignore", invalid="ignore"):
            mean = sums["legal"] / reached_count  # nan if no orientation is reached
        shares = {"share": reached_count, "share_any": sums["anywhere"], "branches": mean, "single": sums["single"]}
        columns = {name: values if name == "branches" else values / total for name, values in shares.items()}
        if self.question.measures:
            columns |= self._measures(orientations, M)
        return columns

    @cached_property
    def places(self) -> NDArray[np.intp]:
        """Sorted azimuths (S, P) where the arc of a branch begins or ends; legal branches change only there."""
        if self.question.turns == 1:
            return np.zeros((len(self.first), 1), np.intp)
        ends = (self.first + self.length) % self.question.turns
        return np.sort(np.concatenate([self.first, ends], axis=1), axis=1)

    def _counts(self) -> dict[str, Array]:
        """Counts at `places` (S, P): rolls that some branch reaches, rolls that exactly one branch reaches, and pairs
        of branch and roll; and (S, 1): rolls of solves that have any branch."""
        weight = float(self.count if self.question.round_rolls else 1)
        S, P = self.places.shape
        at_least_once: Words = np.zeros((S, P, self.rolls.shape[-1]), np.uint64)
        at_least_twice: Words = np.zeros_like(at_least_once)
        legal_count = np.zeros((S, P))
        roll_counts = _count_bits(self.rolls)
        for branch in range(self.first.shape[1]):
            steps_on_arc = self.places - self.first[:, branch, None]
            steps_on_arc += (steps_on_arc < 0) * self.question.turns
            on_arc = steps_on_arc < self.length[:, branch, None]
            legal_count += on_arc * roll_counts[:, branch, None]
            rolls_there = -on_arc.astype(np.int64).view(np.uint64)[:, :, None] & self.rolls[:, branch, None, :]
            at_least_twice |= at_least_once & rolls_there
            at_least_once |= rolls_there
        anywhere_count = np.any(self.valid, axis=1, keepdims=True) * float(self.count)
        counts = {
            "reached": weight * _count_bits(at_least_once),
            "single": weight * _count_bits(at_least_once & ~at_least_twice),
            "legal": weight * legal_count,
        }
        return counts | {"anywhere": anywhere_count}

    def _sum_over_solves(self, values: Array, orientations: int, M: int) -> Array:
        """Sums over the solves of a cell, (S, P) or (S, 1) -> (R, M); a value holds from its place to the next one."""
        R = len(values) // orientations
        if not values.shape[1]:  # no solve has a branch
            return np.zeros((R, M))
        if values.shape[1] == 1:
            sums = values.reshape(R, orientations).sum(axis=1, keepdims=True)
            return np.broadcast_to(sums, (R, M)).copy()
        step = values - np.roll(values, 1, axis=1)
        ring = np.arange(len(values)) // orientations * M
        steps = np.bincount((ring[:, None] + self.places).ravel(), step.ravel(), R * M).reshape(R, M)
        # the value of the last place also holds from azimuth 0 on
        steps[:, 0] += values[:, -1].reshape(R, orientations).sum(axis=1)
        return np.asarray(steps.cumsum(axis=1))

    def _edges(self, M: int) -> _Edges:
        """Targets on an edge (merging branches, free joints), whose poses are all solved."""
        rows = np.zeros(0, np.intp)
        if self.question.by_arcs:
            rows = np.flatnonzero((self.s.status == Status.BOUNDARY) | (self.s.status == Status.SINGULAR))
        counts = {name: np.zeros((len(rows), M)) for name in ("reached", "single", "legal", "anywhere")}
        for number, row in enumerate(rows.tolist()):
            solutions = self._all_solutions(row)
            legal_count = solutions.within_limits.sum(axis=1)
            for name, flags in zip(
                counts, (legal_count > 0, legal_count == 1, legal_count, solutions.valid.any(axis=1)), strict=True
            ):
                counts[name][number] = flags.reshape(M, self.count).sum(axis=1)
        return _Edges(rows, counts)

    def _all_solutions(self, row: int) -> Solutions:
        """Solutions of all poses that one solve stands for, azimuth by azimuth."""
        M, turns = self.grid.azimuths, self.count
        azimuth, turn = np.divmod(np.arange(M * turns), turns)
        rows = np.full(M * turns, row)
        roll = turn * (TURN / turns)
        if not self.question.roll_arcs and self.grid.rolls_count > 1:
            roll = np.full(
                M * turns, (row % self.question.solves_a_ring % self.grid.rolls_count) * (TURN / self.grid.rolls_count)
            )
        return ik(self.arm, self.grid.targets(self.azimuth[rows], azimuth * (TURN / M), self.direction[rows], roll))

    def _measures(self, orientations: int, M: int) -> dict[str, Array]:
        """Best manipulability and limit margin, and least step error, over the legal answers; nan without any."""
        steps_on_arc = (np.arange(self.question.turns) - self.first[:, :, None]) % self.question.turns
        rolls = np.asarray(np.any(self.rolls != 0, axis=2, keepdims=True))
        legal_rolls = (steps_on_arc < self.length[:, :, None]) & rolls  # (S, B, M or 1)
        is_legal: Bool = np.asarray(legal_rolls.any(axis=2))
        q = self.s.q[is_legal]
        measures = {
            "manipulability": _manipulability(self.arm, q)[:, None],
            "limit_margin": self._margins(q, legal_rolls.shape[2]),
            "step_error_mm": -_step_error(self.arm, q)[:, None],
        }
        for name, values in measures.items():
            legal_values = np.full(legal_rolls.shape, -np.inf)
            legal_values[is_legal] = np.where(np.isnan(values), -np.inf, values)
            best_values = np.where(legal_rolls, legal_values, -np.inf).max(axis=1, initial=-np.inf)
            best_values = best_values.reshape(-1, orientations, best_values.shape[1]).max(axis=1)
            best_values = np.where(
                np.isfinite(best_values), np.abs(best_values) if name == "step_error_mm" else best_values, np.nan
            )
            measures[name] = np.asarray(np.broadcast_to(best_values, (len(best_values), M)))
        return measures

    def _margins(self, q: Array, M: int) -> Array:
        """Least distance to a limit as a share of the range, for the best copies: (K, M); nan without limits."""
        margin = np.full((len(q), M), np.inf)
        for joint in range(self.arm.n):
            lower, upper = self.arm.lower[joint], self.arm.upper[joint]
            if not (math.isfinite(lower) and math.isfinite(upper)) or lower == upper:
                continue
            offset = q[:, joint, None] - 0.5 * (lower + upper)
            if joint == 0 and self.question.by_arcs:
                offset = offset + np.arange(M) * (TURN / M)
            if not self.arm.prismatic[joint]:
                step = TURN / self.count if joint == self.arm.n - 1 and self.question.roll_arcs else TURN
                offset = offset - step * np.rint(offset / step)
            margin = np.minimum(margin, 0.5 - np.abs(offset) / (upper - lower))
        return np.where(np.isfinite(margin), margin, np.nan)


def limit_margin(arm: Arm, q: Array) -> Array:
    """Least distance to a limit as a share of the range, for the best copies: (..., n) -> (...); inf without limits."""
    margin = np.full(q.shape[:-1], np.inf)
    for joint in range(arm.n):
        lower, upper = arm.lower[joint], arm.upper[joint]
        if math.isfinite(lower) and math.isfinite(upper) and lower < upper:
            offset = q[..., joint] - 0.5 * (lower + upper)
            if not arm.prismatic[joint]:
                offset = offset - TURN * np.rint(offset / TURN)
            margin = np.minimum(margin, 0.5 - np.abs(offset) / (upper - lower))
    return margin


def cells_inside(arm: Arm, q: Array, joints: range) -> Bool:
    """Whether each of these joints has a copy within limits: (..., n) -> (...)."""
    is_legal = np.ones(q.shape[:-1], bool)
    for joint in joints:
        is_legal &= some_copy_legal(arm, q[..., joint], joint)
    return is_legal


def some_copy_legal(arm: Arm, value: Array, joint: int) -> Bool:
    """Whether a joint value has a copy within limits."""
    low, high = arm.lower[joint] - SLACK, arm.upper[joint] + SLACK
    if not arm.prismatic[joint]:
        if not (math.isfinite(low) and math.isfinite(high)):
            return np.ones(value.shape, bool)
        middle = 0.5 * (low + high)
        value = value - TURN * np.rint((value - middle) / TURN)
    return np.asarray((value >= low) & (value <= high))


def legal_arc(arm: Arm, q: Array, joint: int, count: int, sense: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The turns i 2 pi / count for which q + sense times the turn is within limits: first index, and number."""
    low, high = float(arm.lower[joint]) - SLACK, float(arm.upper[joint]) + SLACK
    if whole_turn(arm, joint):
        return np.zeros(q.shape, np.intp), np.full(q.shape, count)
    if sense < 0:
        q, low, high = -q, -high, -low
    step, q = TURN / count, np.nan_to_num(q)
    first, last = np.ceil((low - q) / step), np.floor((high - q) / step)
    length = np.clip(last - first + 1, 0, count).astype(np.intp)
    return (first % count).astype(np.intp), length


def whole_turn(arm: Arm, joint: int) -> bool:
    """Whether the range of a joint is at least a whole turn, or has no limits."""
    low, high = float(arm.lower[joint]), float(arm.upper[joint])
    return not (math.isfinite(low) and math.isfinite(high)) or high - low + 2 * SLACK >= TURN


def _all_arcs(count: int) -> Bool:
    """All arcs of a circle of `count` places: (length, first, place)."""
    length, first, place = np.ogrid[: count + 1, :count, :count]
    return np.asarray((place - first) % count < length)


def pack_bits(bits: Bool) -> Words:
    """Flags (..., L) as words of 64 bits: (..., W)."""
    length = bits.shape[-1]
    padded = np.zeros((*bits.shape[:-1], -(-length // 64) * 64), bool)
    padded[..., :length] = bits
    bytes_of_bits = np.packbits(padded, axis=-1, bitorder="little")
    return bytes_of_bits.view("<u8").astype(np.uint64)


def _count_bits(words: Words) -> NDArray[np.int64]:
    """Number of bits set in the words of the last axis."""
    if hasattr(np, "bitwise_count"):
        return np.asarray(np.bitwise_count(words).sum(axis=-1, dtype=np.int64))
    bytes_ = np.ascontiguousarray(words).view(np.uint8)
    return np.asarray(_ONES[bytes_].sum(axis=-1, dtype=np.int64))


_ONES = np.array([bin(i).count("1") for i in range(256)], dtype=np.int64)


def _manipulability(arm: Arm, q: Array) -> Array:
    """See `armkin.reachability.dexterity`."""
    return measure_function(arm, "manipulability")(q) if len(q) else np.zeros(0)


def _step_error(arm: Arm, q: Array) -> Array:
    """Sum over the motors of half a pulse times its lever at the tip (N,) [mm]; nan for an arm without drives."""
    if not len(q) or not len(arm.motor_gain) or not arm.motor_gain.any(axis=0).all():
        return np.full(len(q), np.nan)
    levers = jacobian(arm, q)[:, :3] @ (0.5 * joints_per_pulse(arm))
    return np.asarray(np.linalg.norm(levers, axis=1).sum(axis=1))
