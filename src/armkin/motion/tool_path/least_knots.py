"""Splines of few knots through points and places on the chords between them, by least squares, all curves at once."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from armkin.formula.arrays import Array, Bool, Int
from armkin.motion.tool_path.b_spline import Layout, least_squares
from armkin.motion.tool_path.chords import SHORT_SHARE, Chords

_CHORD_SHARE = 0.85  # A curve beside chords is allowed this share of the tolerance.
_EVEN_PARTS = 8  # A chord that is long beside a neighbour is divided into so many parts.
_MISFIT_SHARE = 0.98  # A fit is held to this share of the allowed misfit, so that rounding stays within it.
_MAX_POINTS, _MAX_LENGTH = 32, 20.0  # A first interval has at most so many points and so many mm.
_MAX_ROUNDS = 80  # The intervals are divided in at most so many rounds.
_MIN_COUNT, _NOISE_SHARE = 5, 0.05  # So many points tell misfit from noise; this share of what is allowed is none.
_WEIGHING_ROUNDS = 4  # Points are weighed in so many rounds before an interval is divided.
_MAX_WEIGHT = 1e6  # A point has at most this weight.
_HOPELESS_MISFIT = 2.5  # A misfit of so many times what is allowed needs a division: weights do not help.


@dataclass(frozen=True)
class Rows:
    """What the curves are held to: given points, and places on chords between them."""

    u: Array  # (R,)
    y: Array  # (R, d)
    curve: Int  # (R,) from 0 without gaps
    tolerance: Array  # (R,) [mm]
    weight: Array  # (R,)
    chord_direction: Array  # (R, d) direction of the chord of a place on one; 0 for a given point
    point: Int  # (R,) number of the given point, -1: a place on a chord
    chord: Int  # (R,)
    chord_done: Array  # (R,) [mm] of its chord, from its begin to a place on it
    chord_left: Array  # (R,) from there to its end
    ends: Bool  # (R,) ends of curves

    @staticmethod
    def from_chords(chords: Chords, used: Bool, tolerance: float) -> Rows:
        """Rows of the chords that are used: (N - 1,)."""
        chord, f, weight = [np.flatnonzero(used)] * 2, [0.0, 0.5], [1.0, 0.0]
        last = used & np.append(chords.curve[1:] != chords.curve[:-1], True)
        chord.append(np.flatnonzero(last))
        f.append(1.0)
        weight.append(1.0)
        numbers = np.concatenate(chord)
        share = np.repeat(f, [len(numbers_of) for numbers_of in chord])
        heavy = np.repeat(weight, [len(numbers_of) for numbers_of in chord])
        more, places = _graded_places(chords, used)
        numbers, share = np.append(numbers, more), np.append(share, places)
        heavy = np.append(heavy, np.ones(len(more)))
        u = chords.u[numbers] + share * chords.length[numbers]
        order = np.lexsort((u, chords.curve[numbers]))
        apart = np.append(True, np.diff(u[order]) > 1e-9) | np.append(True, np.diff(chords.curve[numbers][order]) > 0)
        order = order[apart]
        u, numbers = u[order], numbers[order]
        share, heavy = share[order], heavy[order]
        is_point = (share == 0) | (share == 1)
        _, curve = np.unique(chords.curve[numbers], return_inverse=True)
        edge = np.append(True, curve[1:] != curve[:-1])
        return Rows(
            u,
            np.asfortranarray(chords.y[numbers] + share[:, None] * chords.step[numbers]),  # long runs of numbers
            curve,
            _MISFIT_SHARE * np.where(is_point, tolerance, _CHORD_SHARE * tolerance + chords.sagitta[numbers]),
            heavy,
            np.asfortranarray(np.where(is_point[:, None], 0.0, chords.step[numbers] / chords.length[numbers, None])),
            np.where(is_point, numbers + (share == 1), -1),
            numbers,
            share * chords.length[numbers],
            (1 - share) * chords.length[numbers],
            edge | np.append(edge[1:], True),
        )

    def part(self, curves: Int) -> Rows:
        """All rows of some curves."""
        taken = {field.name: getattr(self, field.name).T.take(curves, axis=-1).T for field in fields(self)}
        taken["curve"] = np.unique(taken["curve"], return_inverse=True)[1]
        return Rows(**taken)

    def miss(self, values: Array) -> Array:
        """How curves that pass `values` (R, d) leave the rows: points across their own direction, chords: (R, d)."""
        miss = values - self.y
        along = np.empty_like(values)
        along[1:-1] = values[2:] - values[:-2]
        along[0], along[-1] = along[1], along[-2]
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
        along = np.where(self.point[:, None] >= 0, along, self.chord_direction)
        along[self.ends] = 0.0
        far = (miss * along).sum(axis=1)
        # The distance past a chord's end, or before its begin.
        past = np.maximum(far - self.chord_left, 0.0) + np.minimum(far + self.chord_done, 0.0)
        far -= np.where(self.point >= 0, 0.0, past)
        return np.asarray(miss - far[:, None] * along)


def _graded_places(chords: Chords, used: Bool) -> tuple[Int, Array]:
    """Places on chords that are long beside their neighbours, closer together towards these: chords, fractions."""
    L = chords.length
    same = np.append(False, (chords.curve[1:] == chords.curve[:-1])) & used
    same_next = np.append(same[1:], False)
    left = np.where(same, np.append(np.inf, L[:-1]), np.inf)
    right = np.where(same_next, np.append(L[1:], np.inf), np.inf)
    alone = np.flatnonzero(np.minimum(left, right) < SHORT_SHARE * L)
    even = np.arange(1, _EVEN_PARTS) / _EVEN_PARTS
    numbers, places = [np.repeat(alone, len(even))], [np.tile(even, len(alone))]
    for neighbour, side in ((left, 0), (right, 1)):
        distance = neighbour
        while (long := np.flatnonzero((neighbour < SHORT_SHARE * L) & (distance < 0.45 * L))).size:
            numbers.append(long)
            f = distance[long] / L[long]
            places.append(f if side == 0 else 1 - f)
            distance = np.where(distance < 0.45 * L, 2 * distance + neighbour, distance)
    return np.concatenate(numbers), np.concatenate(places)


def least_knots(rows: Rows) -> tuple[Layout, Array, Array]:
    """Splines of few knots through rows: layout, control points, and how far they leave the rows (R,)."""
    first = np.flatnonzero(np.append(True, rows.curve[1:] != rows.curve[:-1]))
    inside = np.arange(len(rows.u)) - first[rows.curve]
    block = np.floor(np.minimum(inside / (2 * _MAX_POINTS), (rows.u - rows.u[first][rows.curve]) / _MAX_LENGTH))
    knot = rows.ends | np.append(False, np.diff(block) > 0)
    weight, age = rows.weight.copy(), np.zeros(len(knot), int)  # age: rounds since an interval was divided, at its knot
    at_work, index = rows, np.arange(len(knot))
    for _ in range(_MAX_ROUNDS - 1):
        layout = Layout.from_points(at_work.u, at_work.curve, knot[index])
        control = least_squares(layout, at_work.y, weight[index], at_work.ends)
        miss = at_work.miss(layout.values(control))
        misses = np.linalg.norm(miss, axis=1) / at_work.tolerance
        bad, astray = misses > 1.0, _astray_intervals(at_work, layout, miss, weight[index])
        wrong = np.zeros(at_work.curve[-1] + 1, bool)
        wrong[at_work.curve[bad]] = wrong[layout.curve[astray]] = True
        if not wrong.any():
            break
        part = knot[index], weight[index], age[index]
        _refine_intervals(at_work, layout, misses, bad, astray, *part)
        knot[index], weight[index], age[index] = part
        if not wrong.all():  # what is well stays as it is
            index = index[wrong[at_work.curve]]
            at_work = rows.part(index)
    layout = Layout.from_points(rows.u, rows.curve, knot)
    control = least_squares(layout, rows.y, weight, rows.ends)
    return layout, control, np.linalg.norm(rows.miss(layout.values(control)), axis=1) / rows.tolerance


def _refine_intervals(
    rows: Rows, layout: Layout, misses: Array, bad: Bool, astray: Bool, knot: Bool, weight: Array, age: Int
) -> None:
    """Divide intervals that miss their rows, or give some of the rows more weight: in place."""
    worst = np.zeros(len(layout.begin))
    np.maximum.at(worst, layout.interval[bad], misses[bad])
    begins = np.searchsorted(layout.interval, np.arange(len(worst) + 1))
    knots = np.flatnonzero(knot)
    mine = knots[np.searchsorted(knots, begins[:-1])]
    divide = astray | (worst > _HOPELESS_MISFIT) | ((worst > 1.0) & (age[mine] >= _WEIGHING_ROUNDS))
    age[mine[worst > 1.0]] += 1
    middle = (begins[:-1] + begins[1:]) // 2
    can = divide & (middle > begins[:-1]) & ~knot[middle]
    knot[middle[can]] = True
    age[mine[can]] = age[middle[can]] = 0
    fresh = can[layout.interval]
    weight[fresh] = rows.weight[fresh]
    heavier = bad & ~fresh
    weight[heavier] = np.minimum(np.maximum(weight[heavier], 0.05) * (1.4 * misses[heavier]) ** 2, _MAX_WEIGHT)


def _astray_intervals(rows: Rows, layout: Layout, miss: Array, weight: Array) -> Bool:
    """Which intervals miss their points in a way that is no noise: neighbours lie on the same side (M,)."""
    points = np.flatnonzero(rows.point >= 0)
    a, b = points[:-1], points[1:]
    interval = layout.interval[a]
    inside = interval == layout.interval[b]
    a, b, interval = a[inside], b[inside], interval[inside]
    M = len(layout.begin)
    miss_a, miss_b = (miss.T.take(side, axis=1) for side in (a, b))
    like = np.bincount(interval, (miss_a * miss_b).sum(axis=0), M)
    size = np.bincount(interval, (miss_a**2).sum(axis=0), M)
    counts = np.bincount(interval, minlength=M)
    weighed = np.bincount(layout.interval, weight > rows.weight, M) > 0  # intervals that miss the others for a few
    noise = _NOISE_SHARE * rows.tolerance[0]
    return np.asarray(~weighed & (counts >= _MIN_COUNT) & (like > 0.5 * size) & (size > counts * noise**2))
