"""Least-squares splines with few knots through points and through places on the chords between them."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from armkin.formula.arrays import Array, Bool, Int
from armkin.motion.tool_path.b_spline import Layout, least_squares
from armkin.motion.tool_path.chords import SHORT_SHARE, Chords

_CHORD_SHARE = 0.85  # A curve may leave a chord by this share of the tolerance.
_EVEN_PARTS = 8  # Parts of a chord that is long beside its neighbour.
_MISFIT_SHARE = 0.98  # Share of the tolerance that a fit may use; the rest is for rounding.
_MAX_POINTS, _MAX_LENGTH = 32, 20.0  # Most points and greatest length [mm] of a first interval.
_MAX_ROUNDS = 80  # Most rounds of divisions.
_MIN_COUNT, _NOISE_SHARE = 5, 0.05  # Fewest points, and least share of the tolerance, of a misfit that is not noise.
_WEIGHING_ROUNDS = 4  # Rounds that raise weights before an interval is divided.
_MAX_WEIGHT = 1e6  # Greatest weight of a point.
_HOPELESS_MISFIT = 2.5  # A misfit of so many tolerances needs a division, as weights do not help.


@dataclass(frozen=True)
class FitRows:
    """The R rows of the fit: given points, and places on the chords between them."""

    u: Array  # (R,)
    y: Array  # (R, d)
    curve: Int  # (R,) from 0 without gaps
    tolerance: Array  # (R,) [mm]
    weight: Array  # (R,)
    chord_direction: Array  # (R, d) direction of the chord; 0 for a given point
    point: Int  # (R,) number of the given point; -1 for a place on a chord
    chord: Int  # (R,)
    chord_done: Array  # (R,) [mm] of its chord, from its begin to a place on it
    chord_left: Array  # (R,) from there to its end
    ends: Bool  # (R,) ends of curves

    @staticmethod
    def from_chords(chords: Chords, is_used: Bool, tolerance: float) -> FitRows:
        """Rows of the chords that are used: (N - 1,)."""
        numbers, share, row_weight = _places_on_chords(chords, is_used)
        u = chords.u[numbers] + share * chords.length[numbers]
        order = np.lexsort((u, chords.curve[numbers]))
        is_new = np.append(True, np.diff(u[order]) > 1e-9) | np.append(True, np.diff(chords.curve[numbers][order]) > 0)
        order = order[is_new]
        u, numbers = u[order], numbers[order]
        share, row_weight = share[order], row_weight[order]
        is_point = (share == 0) | (share == 1)
        _, curve = np.unique(chords.curve[numbers], return_inverse=True)
        starts = np.append(True, curve[1:] != curve[:-1])
        direction = np.where(is_point[:, None], 0.0, chords.step[numbers] / chords.length[numbers, None])
        return FitRows(
            u=u,
            y=np.asfortranarray(chords.y[numbers] + share[:, None] * chords.step[numbers]),
            curve=curve,
            tolerance=_MISFIT_SHARE * np.where(is_point, tolerance, _CHORD_SHARE * tolerance + chords.sagitta[numbers]),
            weight=row_weight,
            chord_direction=np.asfortranarray(direction),
            point=np.where(is_point, numbers + (share == 1), -1),
            chord=numbers,
            chord_done=share * chords.length[numbers],
            chord_left=(1 - share) * chords.length[numbers],
            ends=starts | np.append(starts[1:], True),
        )

    def part(self, curves: Int) -> FitRows:
        """All rows of some curves."""
        columns = {field.name: getattr(self, field.name).T.take(curves, axis=-1).T for field in fields(self)}
        columns["curve"] = np.unique(columns["curve"], return_inverse=True)[1]
        return FitRows(**columns)

    def miss(self, values: Array) -> Array:
        """The differences between curve points `values` (R, d) and the rows, across the curve or the chord: (R, d)."""
        miss = values - self.y
        direction = np.empty_like(values)
        direction[1:-1] = values[2:] - values[:-2]
        direction[0], direction[-1] = direction[1], direction[-2]
        direction /= np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-300)
        direction = np.where(self.point[:, None] >= 0, direction, self.chord_direction)
        direction[self.ends] = 0.0
        distance = (miss * direction).sum(axis=1)
        # The distance past a chord's end, or before its begin.
        overshoot = np.maximum(distance - self.chord_left, 0.0) + np.minimum(distance + self.chord_done, 0.0)
        distance -= np.where(self.point >= 0, 0.0, overshoot)
        return np.asarray(miss - distance[:, None] * direction)


def _places_on_chords(chords: Chords, is_used: Bool) -> tuple[Int, Array, Array]:
    """Chord number, fraction of the chord and weight of every row, in any order: (R,) each.

    The begin and the middle of each chord, the middle with weight 0, the ends of curves, and `_graded_places`.
    """
    used_chords = np.flatnonzero(is_used)
    last = np.flatnonzero(is_used & np.append(chords.curve[1:] != chords.curve[:-1], True))
    graded_chords, fractions = _graded_places(chords, is_used)
    numbers = np.concatenate([used_chords, used_chords, last, graded_chords])
    sizes = [len(used_chords), len(used_chords), len(last)]
    share = np.append(np.repeat([0.0, 0.5, 1.0], sizes), fractions)
    weight = np.append(np.repeat([1.0, 0.0, 1.0], sizes), np.ones(len(graded_chords)))
    return numbers, share, weight


def _graded_places(chords: Chords, is_used: Bool) -> tuple[Int, Array]:
    """Additional places on chords with a much shorter neighbour, denser towards it: chord numbers and fractions."""
    L = chords.length
    has_previous = np.append(False, (chords.curve[1:] == chords.curve[:-1])) & is_used
    has_next = np.append(has_previous[1:], False)
    left = np.where(has_previous, np.append(np.inf, L[:-1]), np.inf)
    right = np.where(has_next, np.append(L[1:], np.inf), np.inf)
    long_chords = np.flatnonzero(np.minimum(left, right) < SHORT_SHARE * L)
    fractions = np.arange(1, _EVEN_PARTS) / _EVEN_PARTS
    numbers, places = [np.repeat(long_chords, len(fractions))], [np.tile(fractions, len(long_chords))]
    for neighbour, side in ((left, 0), (right, 1)):
        distance = neighbour
        while (open_chords := np.flatnonzero((neighbour < SHORT_SHARE * L) & (distance < 0.45 * L))).size:
            numbers.append(open_chords)
            f = distance[open_chords] / L[open_chords]
            places.append(f if side == 0 else 1 - f)
            distance = np.where(distance < 0.45 * L, 2 * distance + neighbour, distance)
    return np.concatenate(numbers), np.concatenate(places)


def least_knots(rows: FitRows) -> tuple[Layout, Array, Array]:
    """Splines with few knots through rows: layout, control points, and misfits in tolerances (R,)."""
    first = np.flatnonzero(np.append(True, rows.curve[1:] != rows.curve[:-1]))
    row_in_curve = np.arange(len(rows.u)) - first[rows.curve]
    block = np.floor(np.minimum(row_in_curve / (2 * _MAX_POINTS), (rows.u - rows.u[first][rows.curve]) / _MAX_LENGTH))
    knot = rows.ends | np.append(False, np.diff(block) > 0)
    progress = _Progress(knot, weight=rows.weight.copy(), rounds=np.zeros(len(knot), int))
    active, index = rows, np.arange(len(knot))
    for _ in range(_MAX_ROUNDS - 1):
        present = progress.take(index)
        layout = Layout.from_points(active.u, active.curve, present.knot)
        control = least_squares(layout, active.y, present.weight, active.ends)
        miss = active.miss(layout.values(control))
        misses = np.linalg.norm(miss, axis=1) / active.tolerance
        missed_intervals = _astray_intervals(active, layout, miss, present.weight)
        missed_curves = np.zeros(active.curve[-1] + 1, bool)
        missed_curves[active.curve[misses > 1.0]] = missed_curves[layout.curve[missed_intervals]] = True
        if not missed_curves.any():
            break
        _refine_intervals(active, layout, misses, missed_intervals, present)
        for column, values in zip(progress, present, strict=True):
            column[index] = values
        if not missed_curves.all():  # curves without a misfit are done
            index = index[missed_curves[active.curve]]
            active = rows.part(index)
    layout = Layout.from_points(rows.u, rows.curve, progress.knot)
    control = least_squares(layout, rows.y, progress.weight, rows.ends)
    return layout, control, np.linalg.norm(rows.miss(layout.values(control)), axis=1) / rows.tolerance


class _Progress(NamedTuple):
    """Where knots stand and what rows weigh so far: (R,) each."""

    knot: Bool
    weight: Array
    rounds: Int  # since the last division, at the knot before an interval

    def take(self, index: Int) -> _Progress:
        """A copy of some of the rows."""
        return _Progress(self.knot[index], self.weight[index], self.rounds[index])


def _refine_intervals(rows: FitRows, layout: Layout, misses: Array, is_astray: Bool, progress: _Progress) -> None:
    """Divide intervals that miss their rows, or raise the weights of those rows: changes `progress` in place."""
    (knot, weight, rounds), too_far = progress, misses > 1.0
    misfit = np.zeros(len(layout.begin))
    np.maximum.at(misfit, layout.interval[too_far], misses[too_far])
    begins = np.searchsorted(layout.interval, np.arange(len(misfit) + 1))
    knots = np.flatnonzero(knot)
    knots_before = knots[np.searchsorted(knots, begins[:-1])]
    divide = is_astray | (misfit > _HOPELESS_MISFIT) | ((misfit > 1.0) & (rounds[knots_before] >= _WEIGHING_ROUNDS))
    rounds[knots_before[misfit > 1.0]] += 1
    middle = (begins[:-1] + begins[1:]) // 2
    is_divided = divide & (middle > begins[:-1]) & ~knot[middle]
    knot[middle[is_divided]] = True
    rounds[knots_before[is_divided]] = rounds[middle[is_divided]] = 0
    is_reset = is_divided[layout.interval]
    weight[is_reset] = rows.weight[is_reset]
    is_raised = too_far & ~is_reset
    weight[is_raised] = np.minimum(np.maximum(weight[is_raised], 0.05) * (1.4 * misses[is_raised]) ** 2, _MAX_WEIGHT)


def _astray_intervals(rows: FitRows, layout: Layout, miss: Array, weight: Array) -> Bool:
    """Which intervals miss their points systematically, with neighbours on the same side: (M,)."""
    points = np.flatnonzero(rows.point >= 0)
    a, b = points[:-1], points[1:]
    interval = layout.interval[a]
    in_one_interval = interval == layout.interval[b]
    a, b, interval = a[in_one_interval], b[in_one_interval], interval[in_one_interval]
    M = len(layout.begin)
    miss_a, miss_b = (miss.T.take(side, axis=1) for side in (a, b))
    products = np.bincount(interval, (miss_a * miss_b).sum(axis=0), M)
    size = np.bincount(interval, (miss_a**2).sum(axis=0), M)
    counts = np.bincount(interval, minlength=M)
    is_weighed = np.bincount(layout.interval, weight > rows.weight, M) > 0  # misfits there come from the raised weights
    noise = _NOISE_SHARE * rows.tolerance[0]
    return np.asarray(~is_weighed & (counts >= _MIN_COUNT) & (products > 0.5 * size) & (size > counts * noise**2))
