"""What a ring of cells is answered: shares, counts of branches, measures.

One solve stands for many poses. Turning a target about joint 1's axis adds to joint 1 alone, and turning it about the
tool's z axis adds to the last joint alone where that joint's axis is the tool's z: within real limits each branch of
one solve is legal on an arc of azimuths and on an arc of rolls. An arc is kept as its first index and its length; one
of rolls as a word of bits, too, a bit a roll, and the union of the branches' rolls is a few operations on words. It
changes only at azimuths where some branch's arc begins or ends, and is asked there alone. Where the axes do not allow
it, and for targets on an edge, poses are solved one by one, and the same words are filled in from them. Of an arm with
one joint more than its task a branch is a legal interval of a family, and measures are those of its listed posture.
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
    """A grid, and by which arcs it is answered; measures: whether the columns that need Jacobians are filled."""

    grid: Grid
    measures: bool = True

    @cached_property
    def by_arcs(self) -> bool:
        """Whether joint 1's turn is an arc."""
        arm = self.grid.arm
        plain = not arm.prismatic[0] and bool((arm.ratio == 1.0).all()) and not arm.keep_out
        return plain and arm.n <= 6 and arm.n == self.grid.task.constraints and not self.grid.down_is_apart

    @cached_property
    def roll_arcs(self) -> bool:
        """Whether the last joint's turn is an arc, too: the tool's z axis lies on that joint's axis."""
        arm, end = self.grid.arm, self.grid.arm.link[-1]
        on_axis = np.abs(end[:2, 3]).max() <= STRAIGHT * arm.reach and np.abs(end[:2, 2]).max() <= STRAIGHT
        return self.by_arcs and self.grid.task.orientation == "full" and not arm.prismatic[-1] and bool(on_axis)

    @cached_property
    def round_azimuths(self) -> bool:
        """Whether joint 1 has a copy within limits at every azimuth, so that one stands for all.

        Not with measures, as its distance to the limits differs.
        """
        return self.by_arcs and not self.measures and whole_turn(self.grid.arm, 0)

    @cached_property
    def round_rolls(self) -> bool:
        """Whether the last joint has one at every roll."""
        return self.roll_arcs and whole_turn(self.grid.arm, -1)

    @property
    def solves_a_ring(self) -> int:
        """Poses that a ring gives to the solver."""
        g = self.grid
        return (1 if self.by_arcs else g.azimuths) * g.directions_count * (1 if self.roll_arcs else g.rolls_count)

    @cached_property
    def roll_words(self) -> Words:
        """Bits of an arc of rolls by length and first index: (L + 1, L, W)."""
        return pack_bits(_all_arcs(self.grid.rolls_count if self.roll_arcs and not self.round_rolls else 1))

    @property
    def turns(self) -> int:
        """Azimuths that are told apart: M of them where joint 1's turn is an arc."""
        return self.grid.azimuths if self.by_arcs and not self.round_azimuths else 1


def cell_columns(question: CellQuestion, rings: Array) -> dict[str, Array]:
    """The columns of some rings (R, 2), M rows each, besides x, y, z."""
    grid, M = question.grid, question.grid.azimuths
    count = question.solves_a_ring // (1 if question.by_arcs else M)
    if question.by_arcs:
        ring = np.repeat(rings, count, axis=0)
        azimuth = np.zeros(len(ring))
    else:
        ring = np.repeat(rings, M * count, axis=0)
        azimuth = np.tile(np.repeat(np.arange(M) * (TURN / M), count), len(rings))
    orientation = np.arange(len(ring)) % count
    L = 1 if question.roll_arcs else grid.rolls_count
    roll = np.asarray((orientation % L) * (TURN / grid.rolls_count), dtype=float)
    target = grid.targets(ring, azimuth, orientation // L, roll)
    columns = _Answers(question, target, ring, orientation // L).columns(count)
    cells = len(rings) * M
    return {name: values.reshape(cells) for name, values in columns.items()}


class _Edges(NamedTuple):
    """Solves (K,) on an edge and what is counted of them, azimuth by azimuth, by name: (K, M)."""

    rows: NDArray[np.intp]
    counts: dict[str, Array]


class _Answers:
    """The answers of S solves, each for M azimuths and W words of rolls (both 1 where they are no arcs)."""

    def __init__(self, question: CellQuestion, target: Array, azimuth: Array, direction: NDArray[np.intp]) -> None:
        self.question, self.grid, self.arm = question, question.grid, question.grid.arm
        self.azimuth, self.direction = azimuth, direction
        s = ik(self.arm, target)
        self.s, self.valid = s, s.valid
        self.count = self.grid.rolls_count if question.roll_arcs else 1
        legal = s.within_limits & s.clear if self.arm.keep_out else s.within_limits
        self.rolls: Words = np.full((*s.valid.shape, 1), np.uint64(1))
        self.first: NDArray[Any] = np.zeros(s.valid.shape, np.intp)  # (S, B) of azimuths
        self.length: NDArray[Any] = legal.astype(np.intp)
        if question.by_arcs:
            last = self.arm.n - 1 if question.roll_arcs else self.arm.n
            inner = s.valid & cells_inside(self.arm, s.q, range(1, last))
            self.first, length = legal_arc(self.arm, s.q[:, :, 0], 0, question.turns, 1)
            self.length = np.where(inner, length, 0)
            if question.roll_arcs:
                rolls = question.roll_words
                sense = 1 if self.arm.link[-1][2, 2] > 0 else -1
                first, length = legal_arc(self.arm, s.q[:, :, -1], -1, rolls.shape[1], sense)
                self.rolls = rolls[length, first]

    def columns(self, orientations: int) -> dict[str, Array]:
        """Columns (R * M,), so many solves a ring (or a cell)."""
        M = self.grid.azimuths if self.question.by_arcs else 1
        counts, edges = self._counts(), self._edges(M)
        for values in counts.values():
            values[edges.rows] = 0.0
        sums = {name: self._sum_over_solves(values, orientations, M) for name, values in counts.items()}
        ring = edges.rows // orientations
        for name, values in edges.counts.items():
            np.add.at(sums[name], ring, values)
        reached, total = sums["reached"], orientations * self.count
        with np.errstate(divide="ignore", invalid="ignore"):
            mean = sums["legal"] / reached  # nan where none is reached: a mean of nothing
        shares = {"share": reached, "share_any": sums["anywhere"], "branches": mean, "single": sums["single"]}
        columns = {name: values if name == "branches" else values / total for name, values in shares.items()}
        if self.question.measures:
            columns |= self._measures(orientations, M)
        return columns

    @cached_property
    def places(self) -> NDArray[np.intp]:
        """Azimuths (S, P), in order, at which a branch's arc begins or ends: what is legal changes nowhere else."""
        if self.question.turns == 1:
            return np.zeros((len(self.first), 1), np.intp)
        ends = (self.first + self.length) % self.question.turns
        return np.sort(np.concatenate([self.first, ends], axis=1), axis=1)

    def _counts(self) -> dict[str, Array]:
        """(S, P): rolls that at least one branch reaches and that exactly one does, and (branch, roll) there are, at
        `places`; (S, 1): rolls of solves that have a branch at all."""
        weight = float(self.count if self.question.round_rolls else 1)
        S, P = self.places.shape
        once: Words = np.zeros((S, P, self.rolls.shape[-1]), np.uint64)
        twice: Words = np.zeros_like(once)
        legal = np.zeros((S, P))
        roll_counts = _count_bits(self.rolls)
        for b in range(self.first.shape[1]):
            after = self.places - self.first[:, b, None]
            after += (after < 0) * self.question.turns
            on_arc = after < self.length[:, b, None]
            legal += on_arc * roll_counts[:, b, None]
            rolls_there = -on_arc.astype(np.int64).view(np.uint64)[:, :, None] & self.rolls[:, b, None, :]
            twice |= once & rolls_there
            once |= rolls_there
        anywhere = np.any(self.valid, axis=1, keepdims=True) * float(self.count)
        counts = {
            "reached": weight * _count_bits(once),
            "single": weight * _count_bits(once & ~twice),
            "legal": weight * legal,
        }
        return counts | {"anywhere": anywhere}

    def _sum_over_solves(self, values: Array, orientations: int, M: int) -> Array:
        """Sums over the solves of a cell: (S, P), each from its place to the next one, or (S, 1) -> (R, M)."""
        R = len(values) // orientations
        if not values.shape[1]:  # no solve has a branch at all
            return np.zeros((R, M))
        if values.shape[1] == 1:
            sums = values.reshape(R, orientations).sum(axis=1, keepdims=True)
            return np.broadcast_to(sums, (R, M)).copy()
        step = values - np.roll(values, 1, axis=1)
        ring = np.arange(len(values)) // orientations * M
        steps = np.bincount((ring[:, None] + self.places).ravel(), step.ravel(), R * M).reshape(R, M)
        steps[:, 0] += values[:, -1].reshape(R, orientations).sum(axis=1)  # the last place's goes on through 0
        return np.asarray(steps.cumsum(axis=1))

    def _edges(self, M: int) -> _Edges:
        """Targets on an edge by arcs: merging branches, free joints. All their poses are asked."""
        rows = np.zeros(0, np.intp)
        if self.question.by_arcs:
            rows = np.flatnonzero((self.s.status == Status.BOUNDARY) | (self.s.status == Status.SINGULAR))
        counts = {name: np.zeros((len(rows), M)) for name in ("reached", "single", "legal", "anywhere")}
        for k, row in enumerate(rows.tolist()):
            s = self._all_solutions(row)
            legal = s.within_limits.sum(axis=1)
            for name, flags in zip(counts, (legal > 0, legal == 1, legal, s.valid.any(axis=1)), strict=True):
                counts[name][k] = flags.reshape(M, self.count).sum(axis=1)
        return _Edges(rows, counts)

    def _all_solutions(self, row: int) -> Solutions:
        """All poses of one solve, azimuth by azimuth."""
        M, L = self.grid.azimuths, self.count
        azimuth, turn = np.divmod(np.arange(M * L), L)
        rows = np.full(M * L, row)
        roll = turn * (TURN / L)
        if not self.question.roll_arcs and self.grid.rolls_count > 1:
            roll = np.full(
                M * L, (row % self.question.solves_a_ring % self.grid.rolls_count) * (TURN / self.grid.rolls_count)
            )
        return ik(self.arm, self.grid.targets(self.azimuth[rows], azimuth * (TURN / M), self.direction[rows], roll))

    def _measures(self, orientations: int, M: int) -> dict[str, Array]:
        """Best manipulability and limit margin, least step error over legal answers; nan where there is none."""
        after = (np.arange(self.question.turns) - self.first[:, :, None]) % self.question.turns
        rolls = np.asarray(np.any(self.rolls != 0, axis=2, keepdims=True))
        legal = (after < self.length[:, :, None]) & rolls  # (S, B, M or 1)
        any_turn: Bool = np.asarray(legal.any(axis=2))
        q = self.s.q[any_turn]
        measures = {
            "manipulability": _manipulability(self.arm, q)[:, None],
            "limit_margin": self._margins(q, legal.shape[2]),
            "step_error_mm": -_step_error(self.arm, q)[:, None],
        }
        for name, values in measures.items():
            legal_values = np.full(legal.shape, -np.inf)
            legal_values[any_turn] = np.where(np.isnan(values), -np.inf, values)
            best = np.where(legal, legal_values, -np.inf).max(axis=1, initial=-np.inf)
            best = best.reshape(-1, orientations, best.shape[1]).max(axis=1)
            best = np.where(np.isfinite(best), np.abs(best) if name == "step_error_mm" else best, np.nan)
            measures[name] = np.asarray(np.broadcast_to(best, (len(best), M)))
        return measures

    def _margins(self, q: Array, M: int) -> Array:
        """Least distance to a limit as a share of the range, of the best copies: (K, M); nan without limits."""
        margin = np.full((len(q), M), np.inf)
        for j in range(self.arm.n):
            low, high = self.arm.lower[j], self.arm.upper[j]
            if not (math.isfinite(low) and math.isfinite(high)) or low == high:
                continue
            away = q[:, j, None] - 0.5 * (low + high)
            if j == 0 and self.question.by_arcs:
                away = away + np.arange(M) * (TURN / M)
            if not self.arm.prismatic[j]:
                step = TURN / self.count if j == self.arm.n - 1 and self.question.roll_arcs else TURN
                away = away - step * np.rint(away / step)
            margin = np.minimum(margin, 0.5 - np.abs(away) / (high - low))
        return np.where(np.isfinite(margin), margin, np.nan)


def limit_margin(arm: Arm, q: Array) -> Array:
    """Least distance to a limit as a share of the joint's range, of the best copies: (..., n) -> (...); inf: none."""
    margin = np.full(q.shape[:-1], np.inf)
    for j in range(arm.n):
        low, high = arm.lower[j], arm.upper[j]
        if math.isfinite(low) and math.isfinite(high) and low < high:
            away = q[..., j] - 0.5 * (low + high)
            if not arm.prismatic[j]:
                away = away - TURN * np.rint(away / TURN)
            margin = np.minimum(margin, 0.5 - np.abs(away) / (high - low))
    return margin


def cells_inside(arm: Arm, q: Array, joints: range) -> Bool:
    """Whether some copies of these joints are within limits: (..., n) -> (...)."""
    inside = np.ones(q.shape[:-1], bool)
    for j in joints:
        inside &= some_copy_legal(arm, q[..., j], j)
    return inside


def some_copy_legal(arm: Arm, value: Array, joint: int) -> Bool:
    """Whether some copy of a joint's values is within limits."""
    low, high = arm.lower[joint] - SLACK, arm.upper[joint] + SLACK
    if not arm.prismatic[joint]:
        if not (math.isfinite(low) and math.isfinite(high)):
            return np.ones(value.shape, bool)
        middle = 0.5 * (low + high)
        value = value - TURN * np.rint((value - middle) / TURN)
    return np.asarray((value >= low) & (value <= high))


def legal_arc(arm: Arm, q: Array, joint: int, count: int, sense: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The turns i 2 pi / count at which a joint, q + sense times the turn, is within limits: the first, how many."""
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
    """Whether a joint has a whole turn or more, or no limits."""
    low, high = float(arm.lower[joint]), float(arm.upper[joint])
    return not (math.isfinite(low) and math.isfinite(high)) or high - low + 2 * SLACK >= TURN


def _all_arcs(count: int) -> Bool:
    """All arcs of a circle of so many places: (length, first, place)."""
    length, first, place = np.ogrid[: count + 1, :count, :count]
    return np.asarray((place - first) % count < length)


def pack_bits(bits: Bool) -> Words:
    """Flags (..., L) as words of 64: (..., W)."""
    L = bits.shape[-1]
    padded = np.zeros((*bits.shape[:-1], -(-L // 64) * 64), bool)
    padded[..., :L] = bits
    packed = np.packbits(padded, axis=-1, bitorder="little")
    return packed.view("<u8").astype(np.uint64)


def _count_bits(words: Words) -> NDArray[np.int64]:
    """How many bits are set in the words of the last axis."""
    if hasattr(np, "bitwise_count"):
        return np.asarray(np.bitwise_count(words).sum(axis=-1, dtype=np.int64))
    flat = np.ascontiguousarray(words).view(np.uint8)
    return np.asarray(_ONES[flat].sum(axis=-1, dtype=np.int64))


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
