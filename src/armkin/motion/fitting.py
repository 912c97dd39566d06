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

from armkin.formula.arrays import Array, Bool
from armkin.motion.b_spline import Int, Layout, least_squares

CORNER = np.deg2rad(20.0)  # a larger turn is rounded
REVERSAL = np.deg2rad(160.0)  # a larger one is a stop
_SAME = 1e-6  # [mm] nearer points are one
_SCALE = 16.0  # tolerances: from so far off a corner is still one
_SHORT = 1 / 3  # of a chord: a shorter neighbour tells nothing of its curvature
_CHORD = 0.85  # share of the tolerance, beside chords
_BETWEEN = 6  # places of each cubic that are held to its chords in the end
_EVEN = 8  # parts of a chord that is long beside a neighbour
_SPARE = 0.98  # of what is allowed
_POINTS, _LONGEST = 32, 20.0  # of a first interval: points, or [mm]
_ROUNDS = 80
_TRIES = 5  # after which a curve that leaves its chords is given up
_TELLING, _CLOSE = 5, 0.05  # points that tell misfit from noise; of what is allowed: such a misfit is none
_PATIENCE = 4  # rounds of weighing before an interval is divided
_HEAVIEST = 1e6  # a point's weight
_HOPELESS = 2.5  # times what is allowed: dividing helps, weights do not


@dataclass(frozen=True)
class Fitted:
    """Cubics one after another over a parameter that is nearly their length; where the given points are passed."""

    begin: Array  # (M + 1,) parameter at which each cubic begins, and the end
    powers: Array  # (M, 4, d) coefficients over the fraction of each
    at: Array  # (N,) parameter of every given point
    bends: Array  # (k,) parameters at which the curvature jumps

    def values(self, v: Array) -> tuple[Array, Array]:
        """Points and derivatives by the parameter: (K,) -> (K, d) twice."""
        i = np.clip(np.searchsorted(self.begin, v, side="right") - 1, 0, len(self.begin) - 2)
        h = (self.begin[i + 1] - self.begin[i])[:, None]
        f = (v - self.begin[i])[:, None] / h
        c0, c1, c2, c3 = (self.powers[:, k][i] for k in range(4))
        return c0 + f * (c1 + f * (c2 + f * c3)), (c1 + f * (2 * c2 + 3 * f * c3)) / h


@dataclass(frozen=True)
class Chords:
    """Points (N, d), no two neighbours the same, and which of them are corners."""

    y: Array
    corner: Bool  # (N,) the ends are none

    @cached_property
    def step(self) -> Array:
        """From each point to the next: (N - 1, d)."""
        return np.asarray(np.diff(self.y, axis=0))

    @cached_property
    def length(self) -> Array:
        """Of every chord: (N - 1,)."""
        return np.asarray(np.linalg.norm(self.step, axis=1))

    @cached_property
    def u(self) -> Array:
        """Sum of the chords before every point: (N,)."""
        return np.concatenate([[0.0], np.cumsum(self.length)])

    @cached_property
    def curve(self) -> Int:
        """Number of the curve that each chord belongs to: (N - 1,)."""
        return np.asarray(np.cumsum(self.corner[:-1]))

    @cached_property
    def sagitta(self) -> Array:
        """How far the circle through a chord's ends and either neighbour leaves the chord: (N - 1,)."""
        L, out = self.length, np.zeros(len(self.length))
        across = np.linalg.norm(self.y[2:] - self.y[:-2], axis=1)
        turned = turns(self.y)
        with np.errstate(divide="ignore", invalid="ignore"):
            bend = 2 * np.sin(turned) / across  # 1 / radius
        for chord, neighbour in ((slice(1, None), slice(None, -1)), (slice(None, -1), slice(1, None))):
            half = np.minimum(0.5 * L[chord] * bend, 1.0)
            rise = np.where(bend > 1e-15, (1 - np.sqrt(1 - half**2)) / np.maximum(bend, 1e-300), 0.0)
            tells = (turned <= CORNER) & (L[neighbour] >= _SHORT * L[chord])
            out[chord] = np.maximum(out[chord], np.where(tells, rise, 0.0))
        return out


def turns(y: Array) -> Array:
    """How far the direction turns at every point but the ends: (N, d) -> (N - 2,) [rad]."""
    step = np.diff(y, axis=0)
    unit = step / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-300)
    a, b = unit[:-1], unit[1:]
    return np.asarray(2 * np.arctan2(np.linalg.norm(a - b, axis=1), np.linalg.norm(a + b, axis=1)))


def distinct(y: Array) -> Int:
    """Numbers of the points (N, d) that are not the same as the one before; the last one stays."""
    apart = np.linalg.norm(np.diff(y, axis=0), axis=1) > _SAME
    return np.flatnonzero(np.append(True, apart))


def corners(y: Array, tolerance: float) -> Bool:
    """Which points (N, d) are corners: the direction turns by more than 20 degrees, from near and from afar."""
    found = np.zeros(len(y), bool)
    sharp = np.flatnonzero(turns(y) > CORNER) + 1
    length = np.linalg.norm(np.diff(y, axis=0), axis=1)
    u = np.concatenate([[0.0], np.cumsum(length)])
    off = np.maximum(_SCALE * tolerance, 0.0)
    sides = [np.maximum(off, length[sharp - 1]), np.maximum(off, length[sharp])]
    before, after = (
        np.stack([np.interp(u[sharp] + way, u, y[:, k]) for k in range(y.shape[1])], axis=1)
        for way in (-sides[0], sides[1])
    )
    if len(sharp):
        far = turns(np.stack([before, y[sharp], after], axis=1).reshape(-1, y.shape[1]))[::3]
        found[sharp[far > CORNER]] = True
    return found


def fitted(y: Array, tolerance: float) -> Fitted:
    """Points (N, d) [mm], no two neighbours the same, as cubics within `tolerance` of each, in order."""
    chords = Chords(y, corners(y, tolerance))
    used, parts = np.ones(len(y) - 1, bool), []
    for round_ in range(_TRIES + 1):
        begin, end, powers, missed = _curves(chords, used, tolerance)
        # cubics that waver: the chords themselves, rounded; in the end all of such a curve's
        again = _of_curves(chords, missed)
        kept = ~again[np.searchsorted(chords.u, (begin + end) / 2) - 1] | (round_ == _TRIES)
        parts.append((begin[kept], end[kept], powers[kept]))
        if not again.any() or round_ == _TRIES:
            break
        inside = np.concatenate([[False], again[1:] & again[:-1] & ~chords.corner[1:-1], [False]])
        used, chords = again, Chords(y, chords.corner | (missed if round_ + 1 < _TRIES else inside))
    begin, end, powers = (np.concatenate(some) for some in zip(*parts, strict=True))
    order = np.argsort(begin, kind="stable")
    begin, end, powers = begin[order], end[order], powers[order]
    curve = chords.curve[np.searchsorted(chords.u, (begin + end) / 2) - 1]
    return _rounded(chords, begin, end, powers, curve, tolerance)


def _of_curves(chords: Chords, some: Bool) -> Bool:
    """All chords (N - 1,) of the curves that some points (N,), none of them a corner, lie inside of."""
    found = np.zeros(int(chords.curve[-1]) + 1, bool)
    found[chords.curve[np.flatnonzero(some)]] = True
    return np.asarray(found[chords.curve])


def _curves(chords: Chords, used: Bool, tolerance: float) -> tuple[Array, Array, Array, Bool]:
    """Cubics of all curves whose chords are used: begin, end (M,), powers (M, 4, d); which points they miss (N,)."""
    curve, u, y = chords.curve, chords.u, chords.y
    missed = np.zeros(len(y), bool)
    alone = (np.bincount(curve)[curve] == 1) & used  # a straight line
    flat = np.zeros((int(alone.sum()), 4, y.shape[1]))
    flat[:, 0], flat[:, 1] = y[:-1][alone], chords.step[alone]
    begin, end, powers = u[:-1][alone], u[1:][alone], flat
    bent = used & ~alone
    if bent.any():
        rows = _Rows.of(chords, bent, tolerance)
        layout, control, off = _least_knots(rows)
        bad = off > 1.0
        missed[rows.point[bad & (rows.point >= 0)]] = True
        cubics = layout.powers(control)
        for beside in (rows.chord[bad & (rows.point < 0)], _astray_chords(chords, layout, cubics, tolerance)):
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
    y, at, least = chords.y[number], chords.u[number], np.full(len(number), np.inf)
    for _ in range(3):  # the nearest place is a little before or behind
        i = np.clip(np.searchsorted(layout.begin, at, side="right") - 1, 0, len(cubics) - 1)
        h = layout.end[i] - layout.begin[i]
        f = np.clip((at - layout.begin[i]) / h, 0.0, 1.0)[:, None]
        c0, c1, c2, c3 = (cubics[:, k][i] for k in range(4))
        off, slope = y - (c0 + f * (c1 + f * (c2 + f * c3))), (c1 + f * (2 * c2 + 3 * f * c3)) / h[:, None]
        least = np.minimum(least, (off**2).sum(axis=1))
        way = (off * slope).sum(axis=1) / np.maximum((slope**2).sum(axis=1), 1e-300)
        at = at + np.clip(way, -1.0, 1.0)
    inside[number[least <= tolerance**2]] = False
    return inside


def _astray_chords(chords: Chords, layout: Layout, cubics: Array, tolerance: float) -> Int:
    """Chords that a cubic leaves between the places that it was fitted to: their numbers."""
    f = (np.arange(_BETWEEN) + 0.5)[:, None, None] / _BETWEEN
    p = cubics[:, 0] + f * (cubics[:, 1] + f * (cubics[:, 2] + f * cubics[:, 3]))
    at = layout.begin + f[..., 0] * (layout.end - layout.begin)
    k = np.clip(np.searchsorted(chords.u, at, side="right") - 1, 0, len(chords.length) - 1)
    unit = chords.step[k] / chords.length[k][..., None]
    off = p - chords.y[k]
    along = np.clip((off * unit).sum(axis=2), 0.0, chords.length[k])
    away = np.linalg.norm(off - along[..., None] * unit, axis=2)
    return np.unique(k[away > tolerance + chords.sagitta[k]])


@dataclass(frozen=True)
class _Rows:
    """What the curves are held to: given points, and places on chords between them."""

    u: Array  # (R,)
    y: Array  # (R, d)
    curve: Int  # (R,) from 0 without gaps
    curves: Int  # their numbers
    allowed: Array  # (R,) [mm]
    weight: Array  # (R,)
    along: Array  # (R, d) direction of the chord of a place on one; 0 for a given point
    point: Int  # (R,) number of the given point, -1: a place on a chord
    chord: Int  # (R,)
    before: Array  # (R,) [mm] of its chord, from its begin to a place on it
    beyond: Array  # (R,) from there to its end
    ends: Bool  # (R,) ends of curves

    @staticmethod
    def of(chords: Chords, used: Bool, tolerance: float) -> _Rows:
        """Rows of the chords that are used: (N - 1,)."""
        chord, f, weight = [np.flatnonzero(used)] * 2, [0.0, 0.5], [1.0, 0.0]
        last = used & np.append(chords.curve[1:] != chords.curve[:-1], True)
        chord.append(np.flatnonzero(last))
        f.append(1.0)
        weight.append(1.0)
        numbers = np.concatenate(chord)
        share = np.repeat(f, [len(each) for each in chord])
        heavy = np.repeat(weight, [len(each) for each in chord])
        more, places = _graded(chords, used)
        numbers, share = np.append(numbers, more), np.append(share, places)
        heavy = np.append(heavy, np.ones(len(more)))
        u = chords.u[numbers] + share * chords.length[numbers]
        order = np.lexsort((u, chords.curve[numbers]))
        apart = np.append(True, np.diff(u[order]) > 1e-9) | np.append(True, np.diff(chords.curve[numbers][order]) > 0)
        order = order[apart]
        u, numbers, share, heavy = u[order], numbers[order], share[order], heavy[order]
        given = (share == 0) | (share == 1)
        names, curve = np.unique(chords.curve[numbers], return_inverse=True)
        edge = np.append(True, curve[1:] != curve[:-1])
        return _Rows(
            u,
            chords.y[numbers] + share[:, None] * chords.step[numbers],
            curve,
            names,
            _SPARE * np.where(given, tolerance, _CHORD * tolerance + chords.sagitta[numbers]),
            heavy,
            np.where(given[:, None], 0.0, chords.step[numbers] / chords.length[numbers, None]),
            np.where(given, numbers + (share == 1), -1),
            numbers,
            share * chords.length[numbers],
            (1 - share) * chords.length[numbers],
            edge | np.append(edge[1:], True),
        )

    def miss(self, values: Array) -> Array:
        """How curves that pass `values` (R, d) leave the rows: points across their own direction, chords: (R, d)."""
        miss = values - self.y
        along = np.empty_like(values)
        along[1:-1] = values[2:] - values[:-2]
        along[0], along[-1] = along[1], along[-2]
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
        along = np.where(self.point[:, None] >= 0, along, self.along)
        along[self.ends] = 0.0
        far = (miss * along).sum(axis=1)
        past = np.maximum(far - self.beyond, 0.0) + np.minimum(far + self.before, 0.0)  # a chord's end, or its begin
        far -= np.where(self.point >= 0, 0.0, past)
        return np.asarray(miss - far[:, None] * along)


def _graded(chords: Chords, used: Bool) -> tuple[Int, Array]:
    """Places on chords that are long beside their neighbours, closer together towards these: chords, fractions."""
    L = chords.length
    same = np.append(False, (chords.curve[1:] == chords.curve[:-1])) & used
    other = np.append(same[1:], False)
    left = np.where(same, np.append(np.inf, L[:-1]), np.inf)
    right = np.where(other, np.append(L[1:], np.inf), np.inf)
    alone = np.flatnonzero(np.minimum(left, right) < _SHORT * L)
    even = np.arange(1, _EVEN) / _EVEN
    numbers, places = [np.repeat(alone, len(even))], [np.tile(even, len(alone))]
    for neighbour, side in ((left, 0), (right, 1)):
        at = neighbour
        while (long := np.flatnonzero((neighbour < _SHORT * L) & (at < 0.45 * L))).size:
            numbers.append(long)
            f = at[long] / L[long]
            places.append(f if side == 0 else 1 - f)
            at = np.where(at < 0.45 * L, 2 * at + neighbour, at)
    return np.concatenate(numbers), np.concatenate(places)


def _least_knots(rows: _Rows) -> tuple[Layout, Array, Array]:
    """Splines of few knots through rows: layout, control points, and how far they leave the rows (R,)."""
    first = np.flatnonzero(np.append(True, rows.curve[1:] != rows.curve[:-1]))
    inside = np.arange(len(rows.u)) - first[rows.curve]
    many = np.floor(np.minimum(inside / (2 * _POINTS), (rows.u - rows.u[first][rows.curve]) / _LONGEST))
    knot = rows.ends | np.append(False, np.diff(many) > 0)
    weight, age = rows.weight.copy(), np.zeros(len(knot), int)  # age: rounds since an interval was divided, at its knot
    for round_ in range(_ROUNDS):
        layout = Layout.of(rows.u, rows.curve, knot)
        control = least_squares(layout, rows.y, weight, rows.ends)
        miss = rows.miss(layout.values(control))
        off = np.linalg.norm(miss, axis=1) / rows.allowed
        bad, astray = off > 1.0, _astray(rows, layout, miss, weight)
        if not (bad.any() or astray.any()) or round_ == _ROUNDS - 1:
            break
        worst = np.zeros(len(layout.begin))
        np.maximum.at(worst, layout.interval[bad], off[bad])
        begins = np.searchsorted(layout.interval, np.arange(len(worst) + 1))
        at = np.flatnonzero(knot)
        mine = at[np.searchsorted(at, begins[:-1])]
        divide = astray | (worst > _HOPELESS) | ((worst > 1.0) & (age[mine] >= _PATIENCE))
        age[mine[worst > 1.0]] += 1
        middle = (begins[:-1] + begins[1:]) // 2
        can = divide & (middle > begins[:-1]) & ~knot[middle]
        knot[middle[can]] = True
        age[mine[can]] = age[middle[can]] = 0
        fresh = can[layout.interval]
        weight[fresh] = rows.weight[fresh]
        heavier = bad & ~fresh
        weight[heavier] = np.minimum(np.maximum(weight[heavier], 0.05) * (1.4 * off[heavier]) ** 2, _HEAVIEST)
    return layout, control, off


def _astray(rows: _Rows, layout: Layout, miss: Array, weight: Array) -> Bool:
    """Which intervals miss their points in a way that is no noise: neighbours lie on the same side (M,)."""
    given = np.flatnonzero(rows.point >= 0)
    a, b = given[:-1], given[1:]
    where = layout.interval[a]
    inside = where == layout.interval[b]
    a, b, where = a[inside], b[inside], where[inside]
    M = len(layout.begin)
    like = np.bincount(where, (miss[a] * miss[b]).sum(axis=1), M)
    size = np.bincount(where, (miss[a] ** 2).sum(axis=1), M)
    many = np.bincount(where, minlength=M)
    weighed = np.bincount(layout.interval, weight > rows.weight, M) > 0  # these miss the others for a few
    return np.asarray(
        ~weighed & (many >= _TELLING) & (like > 0.5 * size) & (size > many * (_CLOSE * rows.allowed[0]) ** 2)
    )


def _rounded(chords: Chords, begin: Array, end: Array, powers: Array, curve: Int, tolerance: float) -> Fitted:
    """Curves with their corners rounded by cubics, within the tolerance and half of the sides."""
    corner = np.flatnonzero(chords.corner)
    at, u = chords.u.copy(), chords.u
    if not len(corner):
        return Fitted(np.append(begin, end[-1]), powers, at, np.zeros(0))
    whole = Fitted(np.append(begin, end[-1]), powers, at, np.zeros(0))
    most = 0.5 * np.minimum(chords.length[corner - 1], chords.length[corner])
    tiny = 1e-9 * most
    before, after = (whole.values(u[corner] + way)[1] for way in (-tiny, tiny))
    bend = np.linalg.norm(before - after, axis=1)
    r = np.minimum(most, 4 * tolerance / np.maximum(bend, 1e-12))
    for _ in range(20):
        (a, da), (b, db) = whole.values(u[corner] - r), whole.values(u[corner] + r)
        size = 2 * r[:, None]
        middle = (a + b) / 2 + size * (da - db) / 8
        off = np.linalg.norm(middle - chords.y[corner], axis=1)
        if (off <= tolerance).all():
            break
        r = np.where(off > tolerance, 0.9 * r * tolerance / np.maximum(off, 1e-12), r)
    low, high = (np.concatenate([[x], u[corner] + way, [y]]) for x, way, y in ((u[0], r, np.nan), (np.nan, -r, u[-1])))
    # a curve's number is the number of corners before it: it keeps what lies between low and high
    low, high = np.append(u[0], u[corner] + r), np.append(u[corner] - r, u[-1])
    x, y = np.maximum(begin, low[curve]), np.minimum(end, high[curve])
    keep = y - x > 1e-12
    x, y, begin, end, powers = x[keep], y[keep], begin[keep], end[keep], powers[keep]
    cut = _part(powers, (x - begin) / (end - begin), (y - begin) / (end - begin))
    blends = np.stack([a, size * da, 3 * (b - a) - size * (2 * da + db), 2 * (a - b) + size * (da + db)], axis=1)
    order = np.argsort(np.append(x, u[corner] - r), kind="stable")
    starts = np.append(x, u[corner] - r)[order]
    bends = np.concatenate([u[corner] - r, u[corner] + r])
    return Fitted(np.append(starts, u[-1]), np.concatenate([cut, blends])[order], at, np.sort(bends))


def _part(c: Array, a: Array, b: Array) -> Array:
    """Cubics (M, 4, d) over fractions a to b (M,) of themselves."""
    a, h = a[:, None], (b - a)[:, None]
    c0, c1, c2, c3 = (c[:, k] for k in range(4))
    return np.stack(
        [c0 + a * (c1 + a * (c2 + a * c3)), h * (c1 + a * (2 * c2 + 3 * a * c3)), h**2 * (c2 + 3 * a * c3), h**3 * c3],
        axis=1,
    )
