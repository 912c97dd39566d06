"""Quadratic expressions of two numbers b1 and b2, a joint's cosine and sine or d and d^2, by their six coefficients.

In this order: of 1, b1, b2, b1^2, b1 b2, b2^2; of an affine expression the first three.
"""

import numpy as np

from armkin.formula import arrays
from armkin.formula.arrays import Array, Entry
from armkin.inverse.closed.subproblems import Doubt, Pair, trig_quadratic


def of_form(form: Array) -> Array:
    """The coefficients of ``b^T form b``, form symmetric (3, 3), b = (1, b1, b2)."""
    return np.array([form[0, 0], 2 * form[0, 1], 2 * form[0, 2], form[1, 1], 2 * form[1, 2], form[2, 2]])


def product(u: list[Entry], v: list[Entry]) -> list[Entry]:
    """Product of two affine expressions, of which only the first three coefficients are read."""

    def mixed(i: int, j: int) -> Entry:
        return arrays.add(arrays.mul(u[i], v[j]), arrays.mul(u[j], v[i]))

    return [
        arrays.mul(u[0], v[0]),
        mixed(0, 1),
        mixed(0, 2),
        arrays.mul(u[1], v[1]),
        mixed(1, 2),
        arrays.mul(u[2], v[2]),
    ]


def total(*terms: list[Entry]) -> list[Entry]:
    """The sum of expressions."""
    sums = terms[0]
    for term in terms[1:]:
        sums = [arrays.add(a, b) for a, b in zip(sums, term, strict=True)]
    return sums


def turn(six: list[Entry], size: Entry, prefer: Pair | None) -> tuple[Pair, Doubt]:
    """A joint from a quadratic equation of its cosine and sine, of the size of `size` squared: four roots.

    Pairs of complex roots stay off the unit circle, with length up to 2, as they could equal a real root if normalised.
    """
    pair, doubt = trig_quadratic(six, size * size, prefer)
    shorter = 1.0 / arrays.maximum(1.0, 0.5 * arrays.sqrt(pair.c * pair.c + pair.s * pair.s))
    return Pair(pair.c * shorter, pair.s * shorter), doubt
