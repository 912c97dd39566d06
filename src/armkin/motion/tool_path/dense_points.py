"""Dense points of a path become smooth curves within the tolerance, in time linear in their number."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from armkin.formula.arrays import Array, Bool, Int
from armkin.model.target_numbers import targets_in
from armkin.motion.tool_path import path_numbers
from armkin.motion.tool_path.chords import distinct_points, turn_angles
from armkin.motion.tool_path.fit_points import REVERSAL_ANGLE, FittedCurves, fit_curves
from armkin.motion.tool_path.path_pieces import (
    Dense,
    Piece,
    Spot,
    rotation_vectors,
    turn_between,
    unit_speed_piece,
    weights,
)
from armkin.motion.tool_path.piece_shapes import line

if TYPE_CHECKING:
    from armkin.inverse.tasks.task import Task

FIT_SHARE = 0.94  # share of the tolerance between points and curve
PLAN_SHARES = (0.1, 0.05, 0.02)  # shares between curve and motion, tried in order
_BLOCK_POINTS = 8192  # points that are fitted at once, approximately
_FARTHEST_TURN = 5.0  # largest turn [rad] that rotation vectors represent safely
_NAN = float("nan")


class Polyline:
    """Consecutive targets in the file's numbers behind a first one, each with the speeds of the line to it."""

    def __init__(self, task: Task, first: Spot) -> None:
        self.task, self.first = task, first
        self.rows: list[Sequence[float]] = []
        self.speeds: list[tuple[float, float]] = []  # fraction of the joints' max_speed, tool speed; nan: the path's
        self._last: tuple[int, Spot] = (0, first)

    def add(self, values: Sequence[Sequence[float]], speed: float | None, tool_speed: float | None) -> None:
        """Add targets, with the speeds of the lines to them. Raises UsageError for one that does not fit the task."""
        for number, value in enumerate(values, len(self.rows) + 1):
            if len(value) != self.task.position:
                self._last = number, path_numbers.target_spot(self.task, self.first, value)
        self.rows += values
        pace = _NAN if speed is None else speed, _NAN if tool_speed is None else tool_speed
        self.speeds += [pace] * len(values)

    @property
    def last(self) -> Spot:
        """The last target."""
        number, spot = self._last
        if number < len(self.rows):  # later rows give the position alone
            self._last = len(self.rows), replace(spot, position=np.array(self.rows[-1], dtype=float))
        return self._last[1]

    def pieces(self, tolerance: float) -> list[Piece]:
        """Smooth curves through all targets, divided where the path turns back."""
        spots = _Spots.from_rows(self.task, self.first, self.rows)
        speeds = np.array(self.speeds)
        y = spots.relative_values(0, len(spots.positions) - 1)
        if y is None:  # the tool turns too far for one curve: straight lines
            return self._lines(spots, speeds)
        y = y * weights(self.task)
        distinct = distinct_points(y)
        if len(distinct) == 1:  # no length at all, which the route reports
            return self._lines(spots, speeds)
        angles = turn_angles(y[distinct]) if len(distinct) > 2 else np.zeros(0)
        reversals = 1 + np.flatnonzero(angles > REVERSAL_ANGLE)
        ends = np.concatenate([[0], reversals, [len(distinct) - 1]])
        turns = bool(y[:, len(spots.positions[0]) + spots.sums.shape[1] :].any())
        pieces: list[Piece] = []
        for block in _point_blocks(ends, 1 if turns else _BLOCK_POINTS):
            numbers, first = distinct[block[0] : block[-1] + 1], int(distinct[block[0]])
            values = spots.relative_values(first, int(numbers[-1])) if turns else y[first : numbers[-1] + 1]
            assert values is not None
            values = (values * weights(self.task) if turns else values)[numbers - first]
            through = _Block(numbers, ends=block - block[0], y=values, speeds=speeds[numbers[1:] - 1])
            pieces += _fit_block(self.task, spots, through, tolerance)
        return pieces

    def _lines(self, spots: _Spots, speeds: Array) -> list[Piece]:
        pieces = []
        for number, (speed, tool_speed) in enumerate(speeds.tolist()):
            piece = line(self.task, spots.spot(number), spots.spot(number + 1))
            pieces.append(replace(piece, speed=_none_if_nan(speed), tool_speed=_none_if_nan(tool_speed)))
        return pieces


@dataclass(frozen=True)
class _Spots:
    """Spots as arrays."""

    task: Task
    positions: Array  # (N, 2 or 3)
    sums: Array  # (N, k)
    orientations: Array | None  # (N, 3, 3), (N, 3) or nothing

    @staticmethod
    def from_rows(task: Task, first: Spot, rows: list[Sequence[float]]) -> _Spots:
        """The first spot and rows of numbers from the file; a row of a position keeps the orientation before it."""
        labels, N = task.labels, len(rows) + 1
        full_rows = np.flatnonzero([False, *(len(row) > task.position for row in rows)])
        positions = np.array(
            [first.position, *((row[: task.position] for row in rows) if len(full_rows) else rows)], dtype=float
        )
        last_full = np.searchsorted(full_rows, np.arange(N), side="right")  # 0: the first spot
        targets = targets_in(labels, [list(rows[k - 1]) for k in full_rows]) if len(full_rows) else None
        k = len(task.sums)
        sums = (
            np.zeros((len(full_rows), k)) if targets is None or not k else targets[:, task.position : task.position + k]
        )
        orientations = None
        if first.orientation is not None:
            parts = [first.orientation[None]]
            if targets is not None and task.orientation == "full":
                parts.append(targets[:, :3, :3])
            elif targets is not None:
                axis = targets[:, task.position + k : task.position + k + 3]
                parts.append(axis / np.linalg.norm(axis, axis=1, keepdims=True))
            orientations = np.concatenate(parts)[last_full]
        return _Spots(task, positions, np.concatenate([first.sums[None], sums])[last_full], orientations)

    def spot(self, k: int) -> Spot:
        """The position, angle sums and orientation of point k as a `Spot`."""
        return Spot(self.positions[k], self.sums[k], None if self.orientations is None else self.orientations[k])

    def relative_values(self, a: int, b: int) -> Array | None:
        """Spots a to b as values y of a piece that starts at a, (b - a + 1, d); None: the tool turns too far."""
        rotations = np.zeros((b - a + 1, 3))
        if self.orientations is not None and (self.orientations[a : b + 1] != self.orientations[a]).any():
            if self.task.orientation == "full":
                rotations = rotation_vectors(self.orientations[a : b + 1] @ self.orientations[a].T)
                for k in np.flatnonzero(np.linalg.norm(rotations, axis=1) > 0.5 * np.pi).tolist():
                    size = np.linalg.norm(rotations[k])
                    opposite = rotations[k] * (1 - 2 * np.pi / size)  # the same rotation the other way round
                    if k and np.linalg.norm(opposite - rotations[k - 1]) < np.linalg.norm(
                        rotations[k] - rotations[k - 1]
                    ):
                        rotations[k] = opposite
            else:
                rotations = np.array([turn_between(self.task, self.spot(a), self.spot(k)) for k in range(a, b + 1)])
            if np.linalg.norm(rotations, axis=1).max() > _FARTHEST_TURN:
                return None
        return np.concatenate([self.positions[a : b + 1], self.sums[a : b + 1], rotations], axis=1)


def _point_blocks(ends: Int, points: int) -> list[Int]:
    """Ends of curves (k,) in groups of about `points` points; each group begins with the last end of the one before."""
    first = np.flatnonzero(np.diff((ends[:-1] - ends[0]) // points, prepend=-1))
    return [ends[a : b + 1] for a, b in pairwise([*first.tolist(), len(ends) - 1])]


class _Block(NamedTuple):
    """Some of the spots, through which smooth curves lead from each end to the next."""

    numbers: Int  # (N,) of the spots
    ends: Int  # (k,) indices into these
    y: Array  # (N, d) [mm] values of the spots
    speeds: Array  # (N - 1, 2) [mm/s] on the lines between them, nan: none given


def _fit_block(task: Task, spots: _Spots, block: _Block, tolerance: float) -> list[Piece]:
    """Smooth curves through a block's spots within the tolerance [mm], one from each of the ends to the next."""
    numbers, ends, y, speeds = block
    if len(numbers) == 2:
        return [_line_between(task, spots, numbers, speeds)]
    curve, curve_at = _fit_moving(task, y, np.isin(np.arange(len(y)), ends), tolerance)
    piece, length = unit_speed_piece(task, spots.spot(numbers[0]), curve_at, curve.begin)
    lengths, bends, spans = length(curve.parameters), length(curve.bends), length(curve.begin)
    changes = _speed_changes(speeds)
    pieces = []
    for a, b in pairwise(ends.tolist()):
        if b == a + 1:
            pieces.append(_line_between(task, spots, numbers[a : b + 1], speeds[a:b]))
            continue
        begins = a + np.flatnonzero(np.append(True, changes[a + 1 : b]))
        low, high = lengths[a], lengths[b]
        block_ends = [low - 1e-12, high + 1e-12]
        first_bend, last_bend = np.searchsorted(bends, block_ends).tolist()
        first_span, last_span = np.searchsorted(spans, block_ends).tolist()
        dense = Dense(
            given_lengths=lengths[a : b + 1] - low,
            points=spots.positions[numbers[a : b + 1]],
            bends=bends[first_bend:last_bend] - low,
            spans=spans[first_span:last_span] - low,
            begins=lengths[begins] - low,
            speed=speeds[begins, 0],
            tool_speed=speeds[begins, 1],
        )
        first = replace(piece.first, position=spots.positions[numbers[a]], sums=spots.sums[numbers[a]])
        pieces.append(Piece(task, first, partial(_curve_from, piece.curve, low), high - low, dense=dense))
    return pieces


def _fit_moving(
    task: Task, y: Array, stop: Bool, tolerance: float
) -> tuple[FittedCurves, Callable[[Array], tuple[Array, Array]]]:
    """The curve through the components of y (N, d) [mm] that are not constant; and points and slopes of all of them.

    stop: (N,) where the path rests.
    """
    is_varying = (y != y[0]).any(axis=0)
    scale, constant = weights(task)[is_varying], np.where(is_varying, 0.0, y[0] / weights(task))
    curve: FittedCurves = fit_curves(y[:, is_varying], FIT_SHARE * tolerance, stop)

    def curve_at(v: Array) -> tuple[Array, Array]:
        values, slopes = np.repeat(constant[:, None], len(v), axis=1), np.zeros((len(constant), len(v)))
        values[is_varying], slopes[is_varying] = (component.T / scale[:, None] for component in curve.values(v))
        return values.T, slopes.T

    return curve, curve_at


def _speed_changes(speeds: Array) -> Bool:
    """Whether the speeds of each line (N,) differ from those of the line before; speeds: (N, 2), nan: none given."""
    is_same = (speeds[1:] == speeds[:-1]) | (np.isnan(speeds[1:]) & np.isnan(speeds[:-1]))
    return np.append(True, ~is_same.all(axis=1))


def _curve_from(curve: Callable[[Array], Array], begin: float, s: Array) -> Array:
    return curve(s + begin)


def _line_between(task: Task, spots: _Spots, numbers: Int, speeds: Array) -> Piece:
    """The line between two spots."""
    speed, tool_speed = speeds[0].tolist()
    piece = line(task, spots.spot(numbers[0]), spots.spot(numbers[1]))
    return replace(piece, speed=_none_if_nan(speed), tool_speed=_none_if_nan(tool_speed))


def _none_if_nan(value: float) -> float | None:
    return None if np.isnan(value) else value
