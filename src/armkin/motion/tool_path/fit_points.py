"""Fits dense points by a smooth curve: splines of few knots between corners, and rounded corners.

A corner is a point where the direction turns by more than 20 degrees, both from chord to chord and over a distance, so
that a recorder's noise makes no corners. Each curve between two corners is fitted by least squares. Points that it
misses by more than the tolerance first get more weight, so that a single outlier costs no knot; then an interval gets a
knot in its middle. Between two points the curve stays within the tolerance and the sagitta of their chord.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from armkin.formula.arrays import Array, Bool, Int
from armkin.motion.tool_path.b_spline import Layout
from armkin.motion.tool_path.chords import CORNER_ANGLE, Chords, turn_angles
from armkin.motion.tool_path.least_knots import FitRows, least_knots

REVERSAL_ANGLE = np.deg2rad(160.0)  # a corner that turns more than this [rad] is a stop
_CORNER_DISTANCES = (4.0, 16.0)  # distances [tolerances] over which a corner is confirmed
_SAME_TURN = 0.1  # difference [rad] below which two turns are the same
_INNER_PLACES = 6  # places of each cubic that are held to its chords in the end
_MAX_TRIES = 5  # tries after which a curve that leaves its chords is given up


@dataclass(frozen=True)
class FittedCurves:
    """Consecutive cubics over a parameter that is nearly their length, and the parameters of the given points."""

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
        """The coefficients as (4, d, M), since numpy is fast along a long last axis."""
        return np.ascontiguousarray(self.powers.transpose(1, 2, 0))


def corner_points(y: Array, tolerance: float, stop: Bool | None = None) -> Bool:
    """Which points (N, d) are corners: the direction turns by more than 20 degrees, near and further out.

    stop: (N,) points that are corners in any case (except the ends), and limit how far out the direction is taken.
    """
    corner = np.zeros(len(y), bool)
    turns = turn_angles(y)
    sharp = np.flatnonzero(turns > CORNER_ANGLE) + 1
    length = np.linalg.norm(np.diff(y, axis=0), axis=1)
    has_long_chords = np.minimum(length[sharp - 1], length[sharp]) >= _CORNER_DISTANCES[0] * tolerance
    same_turn = np.ones(len(sharp), bool)
    u = np.concatenate([[0.0], np.cumsum(length)])
    ends = np.array([0, len(y) - 1]) if stop is None else np.flatnonzero(stop)
    for distance in _CORNER_DISTANCES if len(sharp) else ():
        following = np.searchsorted(ends, sharp, side="right")
        u_before = np.maximum(u[sharp] - np.maximum(distance * tolerance, length[sharp - 1]), u[ends[following - 1]])
        u_after = np.minimum(u[sharp] + np.maximum(distance * tolerance, length[sharp]), u[ends[following]])
        points_before, points_after = _points_along(y, u, u_before), _points_along(y, u, u_after)
        far_turns = turn_angles(np.stack([points_before, y[sharp], points_after], axis=1).reshape(-1, y.shape[1]))[::3]
        same_turn = (same_turn & (np.abs(far_turns - turns[sharp - 1]) < _SAME_TURN))[far_turns > CORNER_ANGLE]
        sharp, has_long_chords = sharp[far_turns > CORNER_ANGLE], has_long_chords[far_turns > CORNER_ANGLE]
    # with short chords, a turn that differs between near and far is a tight bend or noise, which a curve can pass
    corner[sharp[has_long_chords | same_turn]] = True
    corner[ends[1:-1]] = True
    return corner


def _points_along(y: Array, u: Array, places: Array) -> Array:
    """Points (k, d) at some places (k,) of the polygon through points y (N, d) at u (N,)."""
    return np.stack([np.interp(places, u, y[:, k]) for k in range(y.shape[1])], axis=1)


class _Cubics(NamedTuple):
    """Cubics over the parameter of the chords."""

    begin: Array  # (M,)
    end: Array  # (M,)
    powers: Array  # (M, 4, d) coefficients over the fraction of each

    def take(self, selection: Bool | Int) -> _Cubics:
        """The cubics that a mask (M,) or indices (K,) select."""
        return _Cubics(self.begin[selection], self.end[selection], self.powers[selection])

    def chord(self, chords: Chords) -> Int:
        """The number of the chord that the middle of each cubic lies on: (M,)."""
        return np.asarray(np.searchsorted(chords.u, (self.begin + self.end) / 2) - 1)


def fit_curves(y: Array, tolerance: float, stop: Bool | None = None) -> FittedCurves:
    """Cubics within `tolerance` of points (N, d) [mm], no two neighbours of which are the same.

    stop: (N,) the points where the path rests, including the ends, which stay sharp corners.
    """
    y = np.asfortranarray(y)  # column order, fast for numpy
    chords = Chords(y, corner_points(y, tolerance, stop))
    stop = np.zeros(len(y), bool) if stop is None else stop
    is_used, parts = np.ones(len(y) - 1, bool), []
    for attempt in range(_MAX_TRIES + 1):
        cubics, is_missed = _fit_cubics(chords, is_used, tolerance)
        # rounded chords replace cubics that miss points; in the last round they replace the whole curve
        is_retried = _chords_of_curves(chords, is_missed)
        final = ~is_retried[cubics.chord(chords)] | (attempt == _MAX_TRIES)
        parts.append(cubics.take(final))
        if not is_retried.any() or attempt == _MAX_TRIES:
            break
        inner_points = np.concatenate([[False], is_retried[1:] & is_retried[:-1] & ~chords.corner[1:-1], [False]])
        new_corners = is_missed if attempt + 1 < _MAX_TRIES else inner_points
        is_used, chords = is_retried, Chords(y, chords.corner | new_corners)
    every_cubic = _Cubics(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))
    in_order = every_cubic.take(np.argsort(every_cubic.begin, kind="stable"))
    return _round_corners(chords, stop, in_order, tolerance)


def _chords_of_curves(chords: Chords, chosen_points: Bool) -> Bool:
    """All chords (N - 1,) of the curves that contain the chosen points (N,), none of which is a corner."""
    chosen_curves = np.zeros(int(chords.curve[-1]) + 1, bool)
    chosen_curves[chords.curve[np.flatnonzero(chosen_points)]] = True
    return np.asarray(chosen_curves[chords.curve])


def _fit_cubics(chords: Chords, is_used: Bool, tolerance: float) -> tuple[_Cubics, Bool]:
    """Fit the curves with used chords: begin, end (M,), powers (M, 4, d) of cubics; which points they miss (N,)."""
    curve, u, y = chords.curve, chords.u, chords.y
    is_missed = np.zeros(len(y), bool)
    is_line = (np.bincount(curve)[curve] == 1) & is_used  # a straight line
    line_powers = np.zeros((int(is_line.sum()), 4, y.shape[1]))
    line_powers[:, 0], line_powers[:, 1] = y[:-1][is_line], chords.step[is_line]
    begin, end, powers = u[:-1][is_line], u[1:][is_line], line_powers
    is_curve = is_used & ~is_line
    if is_curve.any():
        rows = FitRows.from_chords(chords, is_curve, tolerance)
        layout, control, misses = least_knots(rows)
        too_far = misses > 1.0
        is_missed[rows.point[too_far & (rows.point >= 0)]] = True
        cubics = layout.powers(control)
        for numbers in (
            rows.chord[too_far & (rows.point < 0)],
            _astray_chords(chords, is_curve, layout, cubics, tolerance),
        ):
            is_missed[numbers] = is_missed[numbers + 1] = True
        is_missed |= _astray_points(chords, is_curve, layout, cubics, tolerance)
        begin, end = np.append(begin, layout.begin), np.append(end, layout.end)
        powers = np.concatenate([powers, cubics])
    is_missed[[0, -1]] = False
    is_missed &= ~chords.corner
    return _Cubics(begin, end, powers), is_missed


def _astray_points(chords: Chords, is_used: Bool, layout: Layout, cubics: Array, tolerance: float) -> Bool:
    """Which inner points of the used curves lie farther from the cubics than the tolerance: (N,)."""
    is_astray = np.concatenate([[False], is_used[1:] & is_used[:-1] & ~chords.corner[1:-1], [False]])
    number = np.flatnonzero(is_astray)
    y, parameters, min_square = chords.y[number], chords.u[number], np.full(len(number), np.inf)
    for _ in range(3):  # Newton steps to the nearest place
        i = np.clip(np.searchsorted(layout.begin, parameters, side="right") - 1, 0, len(cubics) - 1)
        h = layout.end[i] - layout.begin[i]
        f = np.clip((parameters - layout.begin[i]) / h, 0.0, 1.0)[:, None]
        c0, c1, c2, c3 = (cubics[:, k][i] for k in range(4))
        offsets, slope = y - (c0 + f * (c1 + f * (c2 + f * c3))), (c1 + f * (2 * c2 + 3 * f * c3)) / h[:, None]
        min_square = np.minimum(min_square, (offsets**2).sum(axis=1))
        step = (offsets * slope).sum(axis=1) / np.maximum((slope**2).sum(axis=1), 1e-300)
        parameters = parameters + np.clip(step, -1.0, 1.0)
    is_astray[number[min_square <= tolerance**2]] = False
    return is_astray


def _astray_chords(chords: Chords, is_used: Bool, layout: Layout, cubics: Array, tolerance: float) -> Int:
    """Numbers of the chords that a cubic leaves between the places to which it was fitted."""
    f = (np.arange(_INNER_PLACES) + 0.5)[:, None] / _INNER_PLACES
    k = np.flatnonzero(is_used)
    u = np.append(layout.begin + f * (layout.end - layout.begin), chords.u[k] + f * chords.length[k])
    i = np.searchsorted(layout.begin, u, side="right") - 1
    h = ((u - layout.begin[i]) / (layout.end[i] - layout.begin[i]))[:, None]
    c0, c1, c2, c3 = (cubics[:, j][i] for j in range(4))
    ends = c0 + h * (c1 + h * (c2 + h * c3))
    k = np.clip(np.searchsorted(chords.u, u, side="right") - 1, 0, len(chords.length) - 1)
    unit = chords.step[k] / chords.length[k][:, None]
    offsets = ends - chords.y[k]
    projections = np.clip((offsets * unit).sum(axis=1), 0.0, chords.length[k])
    distances = np.linalg.norm(offsets - projections[:, None] * unit, axis=1)
    return np.unique(k[distances > tolerance + chords.sagitta[k]])


def _round_corners(chords: Chords, stop: Bool, cubics: _Cubics, tolerance: float) -> FittedCurves:
    """Round all corners except stops by cubics, within the tolerance and half of the adjacent sides."""
    corner, u = np.flatnonzero(chords.corner), chords.u
    curves = FittedCurves(
        begin=np.append(cubics.begin, cubics.end[-1]),
        powers=cubics.powers,
        parameters=u.copy(),
        bends=np.zeros(0),
    )
    if not len(corner):
        return curves
    radius, blends = _blend_corners(curves, chords, corner, stop[corner], tolerance)
    # curve i lies between corners i - 1 and i and is trimmed to low .. high
    low, high = np.append(u[0], u[corner] + radius), np.append(u[corner] - radius, u[-1])
    curve = chords.curve[cubics.chord(chords)]
    parts = _trim_cubics(cubics, low[curve], high[curve])
    rounded = ~stop[corner]
    blend_begin, blend_end = (u[corner] - radius)[rounded], (u[corner] + radius)[rounded]
    starts = np.append(parts.begin, blend_begin)
    order = np.argsort(starts, kind="stable")
    return FittedCurves(
        begin=np.append(starts[order], u[-1]),
        powers=np.concatenate([parts.powers, blends[rounded]])[order],
        parameters=curves.parameters,
        bends=np.sort(np.concatenate([blend_begin, blend_end])),
    )


def _blend_corners(
    curves: FittedCurves, chords: Chords, corner: Int, stop: Bool, tolerance: float
) -> tuple[Array, Array]:
    """Half the length (k,) of the cubic that rounds each corner, 0 at stops, and the cubic's coefficients (k, 4, d)."""
    u = chords.u[corner]
    max_radius = np.where(stop, 0.0, 0.5 * np.minimum(chords.length[corner - 1], chords.length[corner]))
    offset = 1e-9 * max_radius
    slope_before, slope_after = (curves.values(u + shift)[1] for shift in (-offset, offset))
    bend = np.linalg.norm(slope_before - slope_after, axis=1)
    radius = np.minimum(max_radius, 4 * tolerance / np.maximum(bend, 1e-12))
    for _ in range(20):
        (a, slope_a), (b, slope_b) = curves.values(u - radius), curves.values(u + radius)
        size = 2 * radius[:, None]
        middle = (a + b) / 2 + size * (slope_a - slope_b) / 8
        distances = np.linalg.norm(middle - chords.y[corner], axis=1)
        if (distances <= tolerance).all():
            break
        radius = np.where(distances > tolerance, 0.9 * radius * tolerance / np.maximum(distances, 1e-12), radius)
    square = 3 * (b - a) - size * (2 * slope_a + slope_b)
    cube = 2 * (a - b) + size * (slope_a + slope_b)
    return radius, np.stack([a, size * slope_a, square, cube], axis=1)


def _trim_cubics(cubics: _Cubics, low: Array, high: Array) -> _Cubics:
    """The part of each cubic between low and high (M,); those of which nothing is left are dropped."""
    begin, end = np.maximum(cubics.begin, low), np.minimum(cubics.end, high)
    keep = end - begin > 1e-12
    whole, begin, end = cubics.take(keep), begin[keep], end[keep]
    length = whole.end - whole.begin
    powers = _cubic_parts(whole.powers, (begin - whole.begin) / length, (end - whole.begin) / length)
    return _Cubics(begin, end, powers)


def _cubic_parts(c: Array, a: Array, b: Array) -> Array:
    """The parts of cubics (M, 4, d) between their fractions a and b (M,), as cubics."""
    a, h = a[:, None], (b - a)[:, None]
    c0, c1, c2, c3 = (c[:, k] for k in range(4))
    return np.stack(
        [c0 + a * (c1 + a * (c2 + a * c3)), h * (c1 + a * (2 * c2 + 3 * a * c3)), h**2 * (c2 + 3 * a * c3), h**3 * c3],
        axis=1,
    )
