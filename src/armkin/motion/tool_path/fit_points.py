"""Dense points to one smooth curve: corners are rounded, what lies between them is a spline of few knots.

A corner is a point where the direction turns by more than 20 degrees, from chord to chord and seen from some way off,
so that a recorder's noise is none. Each curve between corners is fitted by least squares. Where it leaves its points by
more than is allowed, points get more weight (one that lies apart does not cost a knot), then an interval gets a knot in
its middle. Between points the curve is held, too: to the chord, and its sagitta more.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from armkin.formula.arrays import Array, Bool, Int
from armkin.motion.tool_path.b_spline import Layout
from armkin.motion.tool_path.chords import CORNER_ANGLE, Chords, turn_angles
from armkin.motion.tool_path.least_knots import Rows, least_knots

REVERSAL_ANGLE = np.deg2rad(160.0)  # turn [rad] from which on a corner is a stop
_CORNER_DISTANCES = (4.0, 16.0)  # distances [tolerances] from which a corner is still one, a recorder's noise none
_SAME_TURN = 0.1  # difference [rad] of turns that are the same
_INNER_PLACES = 6  # places of each cubic that are held to its chords in the end
_MAX_TRIES = 5  # tries after which a curve that leaves its chords is given up


@dataclass(frozen=True)
class FittedCurves:
    """Cubics one after another over a parameter that is nearly their length; where the given points are passed."""

    begin: Array  # (M + 1,) parameter at which each cubic begins, and the end
    powers: Array  # (M, 4, d) coefficients over the fraction of each
    parameters: Array  # (N,) parameter of every given point
    bends: Array  # (k,) parameters at which the curvature jumps

    def values(self, v: Array) -> tuple[Array, Array]:
        """Points and derivatives by the parameter: (K,) -> (K, d) twice."""
        i = np.clip(np.searchsorted(self.begin, v, side="right") - 1, 0, len(self.begin) - 2)
        h = np.diff(self.begin).take(i)
        f = (v - self.begin.take(i)) / h
        c0, c1, c2, c3 = self._columns.take(i, axis=2)
        return (c0 + f * (c1 + f * (c2 + f * c3))).T, ((c1 + f * (2 * c2 + 3 * f * c3)) / h).T

    @cached_property
    def _columns(self) -> Array:
        """The coefficients as (4, d, M): numpy works on long runs of numbers."""
        return np.ascontiguousarray(self.powers.transpose(1, 2, 0))


def corner_points(y: Array, tolerance: float, stop: Bool | None = None) -> Bool:
    """Which points (N, d) are corners: the direction turns by more than 20 degrees, from near and from afar.

    stop: (N,) points that nothing is seen beyond, and which are corners in any case, but for the ends.
    """
    corner = np.zeros(len(y), bool)
    near = turn_angles(y)
    sharp = np.flatnonzero(near > CORNER_ANGLE) + 1
    length = np.linalg.norm(np.diff(y, axis=0), axis=1)
    sure = np.minimum(length[sharp - 1], length[sharp]) >= _CORNER_DISTANCES[0] * tolerance
    alike = np.ones(len(sharp), bool)
    u = np.concatenate([[0.0], np.cumsum(length)])
    ends = np.array([0, len(y) - 1]) if stop is None else np.flatnonzero(stop)
    for distance in _CORNER_DISTANCES if len(sharp) else ():
        next_ = np.searchsorted(ends, sharp, side="right")
        before = np.maximum(u[sharp] - np.maximum(distance * tolerance, length[sharp - 1]), u[ends[next_ - 1]])
        after = np.minimum(u[sharp] + np.maximum(distance * tolerance, length[sharp]), u[ends[next_]])
        sides = [
            np.stack([np.interp(places, u, y[:, k]) for k in range(y.shape[1])], axis=1) for places in (before, after)
        ]
        far = turn_angles(np.stack([sides[0], y[sharp], sides[1]], axis=1).reshape(-1, y.shape[1]))[::3]
        alike = (alike & (np.abs(far - near[sharp - 1]) < _SAME_TURN))[far > CORNER_ANGLE]
        sharp, sure = sharp[far > CORNER_ANGLE], sure[far > CORNER_ANGLE]
    # beside chords too short to tell a direction one that is not as sharp from near as from afar is a tight bend and
    # noise, if a curve passes it
    corner[sharp[sure | alike]] = True
    corner[ends[1:-1]] = True
    return corner


def fit_curves(y: Array, tolerance: float, stop: Bool | None = None) -> FittedCurves:
    """Points (N, d) [mm], no two neighbours the same, as cubics within `tolerance` of each, in order.

    stop: (N,) where the way rests, the ends among them: there it stays a corner.
    """
    y = np.asfortranarray(y)  # numpy works on long runs of numbers
    chords = Chords(y, corner_points(y, tolerance, stop))
    stop = np.zeros(len(y), bool) if stop is None else stop
    used, parts = np.ones(len(y) - 1, bool), []
    for round_ in range(_MAX_TRIES + 1):
        begin, end, powers, missed = _fit_cubics(chords, used, tolerance)
        # where cubics waver between the points rounded chords take their place; in the last round all of a curve
        again = _chords_of_curves(chords, missed)
        final = ~again[np.searchsorted(chords.u, (begin + end) / 2) - 1] | (round_ == _MAX_TRIES)
        parts.append((begin[final], end[final], powers[final]))
        if not again.any() or round_ == _MAX_TRIES:
            break
        inside = np.concatenate([[False], again[1:] & again[:-1] & ~chords.corner[1:-1], [False]])
        used, chords = again, Chords(y, chords.corner | (missed if round_ + 1 < _MAX_TRIES else inside))
    begin, end, powers = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    order = np.argsort(begin, kind="stable")
    begin, end, powers = begin[order], end[order], powers[order]
    curve = chords.curve[np.searchsorted(chords.u, (begin + end) / 2) - 1]
    return _round_corners(chords, stop, begin, end, powers, curve, tolerance)


def _chords_of_curves(chords: Chords, chosen_points: Bool) -> Bool:
    """All chords (N - 1,) of the curves that some points (N,), none of them a corner, lie inside of."""
    chosen_curves = np.zeros(int(chords.curve[-1]) + 1, bool)
    chosen_curves[chords.curve[np.flatnonzero(chosen_points)]] = True
    return np.asarray(chosen_curves[chords.curve])


def _fit_cubics(chords: Chords, used: Bool, tolerance: float) -> tuple[Array, Array, Array, Bool]:
    """Cubics of all curves whose chords are used: begin, end (M,), powers (M, 4, d); which points they miss (N,)."""
    curve, u, y = chords.curve, chords.u, chords.y
    missed = np.zeros(len(y), bool)
    alone = (np.bincount(curve)[curve] == 1) & used  # a straight line
    flat = np.zeros((int(alone.sum()), 4, y.shape[1]))
    flat[:, 0], flat[:, 1] = y[:-1][alone], chords.step[alone]
    begin, end, powers = u[:-1][alone], u[1:][alone], flat
    bent = used & ~alone
    if bent.any():
        rows = Rows.from_chords(chords, bent, tolerance)
        layout, control, misses = least_knots(rows)
        bad = misses > 1.0
        missed[rows.point[bad & (rows.point >= 0)]] = True
        cubics = layout.powers(control)
        for beside in (rows.chord[bad & (rows.point < 0)], _astray_chords(chords, bent, layout, cubics, tolerance)):
            missed[beside] = missed[beside + 1] = True
        missed |= _astray_points(chords, bent, layout, cubics, tolerance)
        begin, end = np.append(begin, layout.begin), np.append(end, layout.end)
        powers = np.concatenate([powers, cubics])
    missed[[0, -1]] = False
    missed &= ~chords.corner
    return begin, end, powers, missed


def _astray_points(chords: Chords, used: Bool, layout: Layout, cubics: Array, tolerance: float) -> Bool:
    """Which of the given points inside of the used curves lie farther from the cubics than allowed: (N,)."""
    inside = np.concatenate([[False], used[1:] & used[:-1] & ~chords.corner[1:-1], [False]])
    number = np.flatnonzero(inside)
    y, places, least = chords.y[number], chords.u[number], np.full(len(number), np.inf)
    for _ in range(3):  # the nearest place is a little before or behind
        i = np.clip(np.searchsorted(layout.begin, places, side="right") - 1, 0, len(cubics) - 1)
        h = layout.end[i] - layout.begin[i]
        f = np.clip((places - layout.begin[i]) / h, 0.0, 1.0)[:, None]
        c0, c1, c2, c3 = (cubics[:, k][i] for k in range(4))
        offsets, slope = y - (c0 + f * (c1 + f * (c2 + f * c3))), (c1 + f * (2 * c2 + 3 * f * c3)) / h[:, None]
        least = np.minimum(least, (offsets**2).sum(axis=1))
        way = (offsets * slope).sum(axis=1) / np.maximum((slope**2).sum(axis=1), 1e-300)
        places = places + np.clip(way, -1.0, 1.0)
    inside[number[least <= tolerance**2]] = False
    return inside


def _astray_chords(chords: Chords, used: Bool, layout: Layout, cubics: Array, tolerance: float) -> Int:
    """Chords that a cubic leaves between the places that it was fitted to: their numbers."""
    f = (np.arange(_INNER_PLACES) + 0.5)[:, None] / _INNER_PLACES
    k = np.flatnonzero(used)
    u = np.append(layout.begin + f * (layout.end - layout.begin), chords.u[k] + f * chords.length[k])
    i = np.searchsorted(layout.begin, u, side="right") - 1
    h = ((u - layout.begin[i]) / (layout.end[i] - layout.begin[i]))[:, None]
    c0, c1, c2, c3 = (cubics[:, j][i] for j in range(4))
    p = c0 + h * (c1 + h * (c2 + h * c3))
    k = np.clip(np.searchsorted(chords.u, u, side="right") - 1, 0, len(chords.length) - 1)
    unit = chords.step[k] / chords.length[k][:, None]
    offsets = p - chords.y[k]
    along = np.clip((offsets * unit).sum(axis=1), 0.0, chords.length[k])
    away = np.linalg.norm(offsets - along[:, None] * unit, axis=1)
    return np.unique(k[away > tolerance + chords.sagitta[k]])


def _round_corners(
    chords: Chords, stop: Bool, begin: Array, end: Array, powers: Array, curve: Int, tolerance: float
) -> FittedCurves:
    """Curves with their corners, but for stops, rounded by cubics, within the tolerance and half of the sides."""
    corner = np.flatnonzero(chords.corner)
    passed, u = chords.u.copy(), chords.u
    if not len(corner):
        return FittedCurves(np.append(begin, end[-1]), powers, passed, np.zeros(0))
    curves = FittedCurves(np.append(begin, end[-1]), powers, passed, np.zeros(0))
    most = np.where(stop[corner], 0.0, 0.5 * np.minimum(chords.length[corner - 1], chords.length[corner]))
    tiny = 1e-9 * most
    before, after = (curves.values(u[corner] + way)[1] for way in (-tiny, tiny))
    bend = np.linalg.norm(before - after, axis=1)
    r = np.minimum(most, 4 * tolerance / np.maximum(bend, 1e-12))
    for _ in range(20):
        (a, da), (b, db) = curves.values(u[corner] - r), curves.values(u[corner] + r)
        size = 2 * r[:, None]
        middle = (a + b) / 2 + size * (da - db) / 8
        distances = np.linalg.norm(middle - chords.y[corner], axis=1)
        if (distances <= tolerance).all():
            break
        r = np.where(distances > tolerance, 0.9 * r * tolerance / np.maximum(distances, 1e-12), r)
    # a curve's number is the number of corners before it: it keeps what lies between low and high
    low, high = np.append(u[0], u[corner] + r), np.append(u[corner] - r, u[-1])
    x, y = np.maximum(begin, low[curve]), np.minimum(end, high[curve])
    keep = y - x > 1e-12
    x, y = x[keep], y[keep]
    begin, end, powers = begin[keep], end[keep], powers[keep]
    cut = _cubic_parts(powers, (x - begin) / (end - begin), (y - begin) / (end - begin))
    blends = np.stack([a, size * da, 3 * (b - a) - size * (2 * da + db), 2 * (a - b) + size * (da + db)], axis=1)
    round_ = ~stop[corner]
    corner, r = corner[round_], r[round_]
    starts = np.append(x, u[corner] - r)
    order = np.argsort(starts, kind="stable")
    bends = np.sort(np.concatenate([u[corner] - r, u[corner] + r]))
    return FittedCurves(np.append(starts[order], u[-1]), np.concatenate([cut, blends[round_]])[order], passed, bends)


def _cubic_parts(c: Array, a: Array, b: Array) -> Array:
    """Cubics (M, 4, d) over fractions a to b (M,) of themselves."""
    a, h = a[:, None], (b - a)[:, None]
    c0, c1, c2, c3 = (c[:, k] for k in range(4))
    return np.stack(
        [c0 + a * (c1 + a * (c2 + a * c3)), h * (c1 + a * (2 * c2 + 3 * a * c3)), h**2 * (c2 + 3 * a * c3), h**3 * c3],
        axis=1,
    )
