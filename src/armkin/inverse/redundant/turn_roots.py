"""All real roots of real trigonometric polynomials over a turn, each in a cell of its own, or that some may be missing.

About the middle of a cell a polynomial is its Taylor series, whose rest Bernstein's inequality bounds. A cell holds no
root where the constant term outweighs all others, at most one where the linear term outweighs the slopes of all others;
any other is halved. What is above the degree in the samples is rounding, and tells how much of it there is: where what
is left is within it the polynomial is undecided, as two roots may be one or none.
"""

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool, Int
from armkin.inverse.numeric import tolerances as tol

TERMS = 12  # terms of a Taylor series
CELL_WIDTH = 0.35  # half a cell's width times the degree: what is left out is 1e-14 of the polynomial's size
HALVINGS = 28  # halvings of a cell, at most
TAIL = 4  # coefficients above the degree that the samples tell, too
SHIFT = 0.15  # distance [rad] of the samples from the real values
SAFE = 4.0  # safety factor on the rounding that the samples show
INPUT_SHARE = 0.1  # share of a double's rounding that a polynomial has, however many digits it is asked in
STEPS = 8  # steps of Newton's method in a cell in which a polynomial is monotone

Real = Any  # the kind of numbers: np.float64 or np.longdouble


class Roots(NamedTuple):
    """Roots (R,) in no order: which polynomial, where [rad]; of each polynomial whether all are known (F,)."""

    which: Int
    at: Array
    decided: Bool


def _half_turn(real: Real) -> Any:
    """Pi, in as many digits as numbers have."""
    return 4 * np.arctan(real(1))


@lru_cache(maxsize=8)
def _cells(degree: int, real: Real) -> tuple[Array, float, Array]:
    """Middles of cells (C,), half their width, and the Taylor coefficients there, for one half, of a polynomial by the
    real and the imaginary parts of its coefficients: (2 degree + 2, C TERMS)."""
    count = math.ceil(np.pi * degree / CELL_WIDTH)
    half_width = _half_turn(real) / count
    middle = (2 * np.arange(count) + 1 - count) * half_width
    k, order = np.arange(degree + 1), np.arange(TERMS)
    factor = (1j * k[:, None] * half_width) ** order / np.array([math.factorial(i) for i in order])
    factor[1:] *= 2.0  # the factor of -k is the conjugate
    wave = np.exp(1j * k[:, None] * middle)[:, :, None] * factor[:, None]  # (k, C, TERMS)
    series: Array = np.concatenate([wave.real, -wave.imag])
    return np.asarray(middle), half_width, series.reshape(2 * degree + 2, -1)


@lru_cache(maxsize=8)
def _coefficients(degree: int, real: Real) -> NDArray[Any]:
    """Matrix from values at samples to coefficients of exp(i k t), k from 0: (M, degree + TAIL + 1)."""
    t = sampled_at(degree, real)
    return np.asarray(np.exp(-1j * t[:, None] * np.arange(degree + TAIL + 1)) / len(t))


@lru_cache(maxsize=1)
def _halving_matrices() -> Array:
    """Taylor coefficients of a half about its own middle, of those of the whole: (2, TERMS, TERMS), left and right."""
    halves = np.zeros((2, TERMS, TERMS))
    for i in range(TERMS):
        for j in range(i + 1):
            halves[:, i, j] = math.comb(i, j) * np.array([-1.0, 1.0]) ** (i - j) / 2.0**i
    return halves


def sampled_at(degree: int, real: Real = np.float64) -> NDArray[Any]:
    """Where polynomials of a degree are asked (M,): aside of the real values, at which quotients may be 0 / 0."""
    samples = 2 * (degree + TAIL) + 1
    return np.asarray(np.arange(samples) * (2 * _half_turn(real) / samples) - 1j * real(SHIFT))


def roots(values: NDArray[Any], degree: int, most: float = np.inf) -> Roots:
    """The real roots of polynomials from their values (F, M) at `sampled_at`, in as many digits as these have.

    most: way [rad] by which rounding may move a root of one that is decided.
    """
    real: Any = values.real.dtype.type
    middle, half_width, series = _cells(degree, real)
    F, order = len(values), np.arange(TERMS)
    c = values @ _coefficients(degree, real)
    # the coefficients' errors shrink with their order, as the samples lie off the real line
    c, tail = c[:, : degree + 1], np.abs(c[:, degree + 1 :]) * np.exp(SHIFT * np.arange(degree + 1, degree + TAIL + 1))
    rounding = tol.ROUNDING * max(INPUT_SHARE, float(np.finfo(real).eps / np.finfo(float).eps))
    slack = SAFE * (2 * degree + 1) * tail.max(axis=1) + 10.0 * rounding * np.abs(c).sum(axis=1)
    a = (np.concatenate([c.real, c.imag], axis=1) @ series).reshape(-1, TERMS)
    index, angle = np.repeat(np.arange(F), len(middle)), np.tile(middle, F)
    found_which, found_at, decided = [], [], np.isfinite(slack)
    for _ in range(HALVINGS):
        sizes, blur = np.abs(a), slack[index]
        candidates = np.flatnonzero(sizes[:, 0] <= sizes[:, 1:].sum(axis=1) + blur)
        a, index, angle = a[candidates], index[candidates], angle[candidates]
        sizes, blur = sizes[candidates], blur[candidates]
        single = sizes[:, 1] > (sizes[:, 2:] * order[2:]).sum(axis=1) + TERMS * blur
        ends = a[:, ::2].sum(axis=1)[:, None] + a[:, 1::2].sum(axis=1)[:, None] * np.array([-1.0, 1.0])
        touches = (ends[:, 0] * ends[:, 1] <= 0.0) | (np.abs(ends).min(axis=1) <= blur)
        simple = np.flatnonzero(single & touches)
        found_which.append(index[simple])
        zero, slope = _zeros_of_series(a[simple])
        found_at.append(angle[simple] + half_width * zero)
        decided[index[simple[~(half_width * slack[index[simple]] <= most * np.abs(slope))]]] = False
        noise = ~single & (sizes[:, 1:].sum(axis=1) <= TERMS * blur)
        decided[index[noise]] = False
        found_which.append(index[noise])
        found_at.append(angle[noise])
        divided = np.flatnonzero(~single & ~noise)
        half_width *= 0.5
        a = (a[divided] @ _halving_matrices()).reshape(-1, TERMS)
        angle = (angle[divided] + half_width * np.array([[-1.0], [1.0]])).ravel()
        index = np.tile(index[divided], 2)
        if not len(index):
            break
    decided[index] = False
    return Roots(np.concatenate([*found_which, index]), np.concatenate([*found_at, angle]).astype(float), decided)


def _zeros_of_series(a: Array) -> tuple[Array, Array]:
    """Roots (R,) of series (R, TERMS) that are monotone from -1 to 1, and the slopes there."""
    x, slope = np.zeros_like(a[:, 0]), np.ones_like(a[:, 0])
    for _ in range(STEPS):
        value, slope = a[:, -1].copy(), np.zeros_like(x)
        for k in range(TERMS - 2, -1, -1):
            slope = slope * x + value
            value = value * x + a[:, k]
        x = np.clip(x - value / slope, -1.0, 1.0)
    return x, slope
