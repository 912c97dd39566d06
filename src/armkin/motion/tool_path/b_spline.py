"""Cubic B-splines by least squares: many separate curves at once, in time and memory linear in the points.

Points are rows in order, curve by curve. Some of them are knots, always including the first and the last of a curve. A
curve with K knots has K + 2 control points, since its end knots count four times. Its normal matrix has three diagonals
beside the main one, so all curves together make one banded system.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from armkin.formula.arrays import Array, Bool, Int

_BEND_WEIGHT = 1e-7  # weight of the bend of control polygons, which decides where points are too few
_END_WEIGHT = 1e6  # weight of the ends, which a curve passes
_DENSE_BLOCKS = 16  # up to so many blocks are solved as one dense system
_THIRDS = np.arange(4) / 3
_TO_POWERS = np.linalg.inv(np.vander(_THIRDS, increasing=True))  # values at thirds -> coefficients


@dataclass(frozen=True)
class Layout:
    """The intervals and control points of N points on splines with M intervals and C control points."""

    u: Array  # (N,) parameter of the points, increasing along a curve
    interval: Int  # (N,) interval that each point lies in
    begin: Array  # (M,) where intervals begin
    end: Array  # (M,)
    knots: Array  # (6, M) the six knots about each interval
    control: Int  # (M,) first of the four control points of each interval
    curve: Int  # (M,) curve of each interval
    count: int  # control points

    @staticmethod
    def from_points(u: Array, curve: Int, knot: Bool) -> Layout:
        """The layout of points u on curves (numbers from 0, in order), some of which are knots: (N,) each."""
        places, curves = u[knot], curve[knot]
        interval_knots = np.flatnonzero(curves[1:] == curves[:-1])  # knots at which an interval begins
        number = np.cumsum(knot) - 1
        begun_count = np.searchsorted(interval_knots, number)  # intervals that begin before the point's knot
        # the last knot is in the last interval
        interval = begun_count - (begun_count == np.searchsorted(interval_knots, number, side="right"))
        first = np.searchsorted(curves, curves[interval_knots])
        last = np.searchsorted(curves, curves[interval_knots], side="right") - 1
        neighbours = np.clip(interval_knots + np.arange(-2, 4)[:, None], first, last)
        control = np.arange(len(interval_knots)) + 3 * curves[interval_knots]
        count = len(interval_knots) + 3 * (int(curves[-1]) + 1)
        return Layout(
            u=u,
            interval=interval,
            begin=places[interval_knots],
            end=places[interval_knots + 1],
            knots=places[neighbours],
            control=control,
            curve=curves[interval_knots],
            count=count,
        )

    def values(self, control: Array) -> Array:
        """Points of the curves at the layout's parameters: control points (C, d) -> (N, d)."""
        first, columns = self.first, np.ascontiguousarray(control.T)
        return np.asarray(sum(N * columns.take(first + k, axis=1) for k, N in enumerate(self.basis))).T

    @cached_property
    def basis(self) -> Array:
        """The four basis functions at every point: (4, N)."""
        return _basis(self.knots.take(self.interval, axis=1), self.u)

    @cached_property
    def first(self) -> Int:
        """First of the four control points of every point: (N,)."""
        return self.control[self.interval]

    def powers(self, control: Array) -> Array:
        """Coefficients of the cubics over the fraction of each interval: (M, 4, d)."""
        size = self.end - self.begin
        bases = [_basis(self.knots, self.begin + f * size) for f in _THIRDS]
        values = np.stack([sum(N[k, :, None] * control[self.control + k] for k in range(4)) for N in bases], axis=1)
        return np.asarray(_TO_POWERS @ values)


def least_squares(layout: Layout, y: Array, weight: Array, ends: Bool) -> Array:
    """Control points (C, d) of the curves nearest to points y (N, d), weighted (N,); ends (N,): points to pass."""
    N, first = layout.basis, layout.first
    w = np.where(ends, _END_WEIGHT, weight)
    columns = np.ascontiguousarray(y.T)
    bands = np.zeros((4, layout.count))
    right = np.zeros((layout.count, y.shape[1]))
    for j in range(4):
        weighted, rows = w * N[j], first + j
        for k in range(j, 4):
            bands[k - j] += np.bincount(rows, weighted * N[k], layout.count)
        for coordinate, column in enumerate(columns):
            right[:, coordinate] += np.bincount(rows, weighted * column, layout.count)
    _add_ridge(layout, bands)
    return solve_banded(bands, right)


def _add_ridge(layout: Layout, bands: Array) -> None:
    """Add a small weight of the squared bend of every three consecutive control points."""
    t = layout.knots
    # Greville abscissae of an interval's four control points: means of three knots each
    abscissae = np.stack([t[k : k + 3].mean(axis=0) for k in range(4)], axis=1)
    starts = np.append(True, layout.curve[1:] != layout.curve[:-1])
    for k in (0, 1):
        selected = starts if k == 0 else np.ones(len(starts), bool)
        a, b = np.diff(abscissae[selected, k : k + 3], axis=1).T
        size = np.minimum(a, b)
        row = np.stack([size / a, -size / a - size / b, size / b], axis=1)
        rows = layout.control[selected] + k
        for i in range(3):
            for j in range(i, 3):
                bands[j - i] += _BEND_WEIGHT * np.bincount(rows + i, row[:, i] * row[:, j], layout.count)


def _basis(t: Array, u: Array) -> Array:
    """The four cubic basis functions at u (N,) within the middle of six knots t (6, N): (4, N).

    Source: Piegl and Tiller, The NURBS Book, 1997, algorithm A2.2.
    """
    left = [u - t[3 - k] for k in range(4)]  # left[k] = u - t_{j+1-k}
    right = [t[2 + k] - u for k in range(4)]
    N = [np.ones(len(u))]
    for p in range(1, 4):
        saved = np.zeros(len(u))
        for r in range(p):
            part = N[r] / (right[r + 1] + left[p - r])
            N[r] = saved + right[r + 1] * part
            saved = left[p - r] * part
        N.append(saved)
    return np.stack(N)


def solve_banded(bands: Array, right: Array) -> Array:
    """Solve A x = right for a symmetric positive A of few diagonals: bands (b + 1, n), right (n, d) -> (n, d).

    bands[k, i] = A[i, i + k]. As blocks of b rows, A is block tridiagonal.
    """
    b, n = len(bands) - 1, bands.shape[1]
    M = -(-n // b)
    full = np.zeros((b + 1, (M + 1) * b))
    full[:, :n] = np.where(np.arange(n) < n - np.arange(b + 1)[:, None], bands, 0.0)
    full[0, n:] = 1.0
    D, U = np.zeros((M, b, b)), np.zeros((M, b, b))
    rows = b * np.arange(M)
    for i in range(b):
        for k in range(b + 1):
            j = i + k
            if j < b:
                D[:, i, j] = D[:, j, i] = full[k, rows + i]
            else:
                U[:, i, j - b] = full[k, rows + i]
    rhs = np.zeros((M * b, right.shape[1]))
    rhs[:n] = right
    return _solve_block_tridiagonal(D, U[:-1], rhs.reshape(M, b, -1)).reshape(M * b, -1)[:n]


def _solve_block_tridiagonal(D: Array, U: Array, b: Array) -> Array:
    """Solve a symmetric block tridiagonal system by cyclic reduction, which eliminates every other block at once.

    D: (M, k, k); U: (M - 1, k, k) blocks beside the diagonal; b: (M, k, d) -> (M, k, d).
    """
    k, m = D.shape[1], len(D) // 2  # size of blocks, number of eliminated blocks
    if len(D) <= _DENSE_BLOCKS:
        matrix, i = np.zeros((len(D), k, len(D), k)), np.arange(len(D))
        matrix[i, :, i], matrix[i[:-1], :, i[1:]], matrix[i[1:], :, i[:-1]] = D, U, U.swapaxes(1, 2)
        return np.asarray(np.linalg.solve(matrix.reshape(len(D) * k, -1), b.reshape(len(D) * k, -1)).reshape(b.shape))
    left, right = U[0::2], np.zeros((m, k, k))
    upper = U[1::2]
    right[: len(upper)] = upper
    solutions = np.linalg.solve(D[1::2], np.concatenate([left.swapaxes(1, 2), right, b[1::2]], axis=2))
    a, c, d = solutions[..., :k], solutions[..., k : 2 * k], solutions[..., 2 * k :]
    D_kept, b_kept, count = D[0::2].copy(), b[0::2].copy(), len(upper)
    D_kept[:m] -= left @ a
    b_kept[:m] -= left @ d
    lower = upper.swapaxes(1, 2)
    D_kept[1 : 1 + count] -= lower @ c[:count]
    b_kept[1 : 1 + count] -= lower @ d[:count]
    even_blocks = _solve_block_tridiagonal(D_kept, -(left @ c)[:count], b_kept)
    solution = np.empty_like(b)
    solution[0::2] = even_blocks
    solution[1::2] = d - a @ even_blocks[:m]
    solution[1::2][:count] -= c[:count] @ even_blocks[1 : 1 + count]
    return solution
