"""Two solutions that share the hidden joint: their root is double, and its two vectors are any mixtures of theirs.

A solution's vector is a product (cos 3f, sin 3f, cos f, sin f)(1, cos k, sin k), see `pencil`. Whatever quadratic
vanishes on products (those of the twisted cubic, Harris 1992, "Algebraic Geometry", example 1.10, and the circle)
vanishes on both solutions, which makes it a multiple of one quadratic in the two weights of a mixture.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Bool
from armkin.inverse.numeric.tolerances import ALIKE_QUADRATICS, EQUAL_ROOTS

# (cos 3f, sin 3f, cos f, sin f) to (c^3, c^2 s, c s^2, s^3) of c = cos f, s = sin f
_CUBIC: Array = 0.25 * np.array([[1, 0, 3, 0], [0, 1, 0, 1], [-1, 0, 1, 0], [0, -1, 0, 3]], dtype=float)
_TWISTED = ((0, 2, 1, 1), (1, 3, 2, 2), (0, 3, 1, 2))  # quadratics of these: y0 y2 = y1^2 and so on

Int = NDArray[np.int64]


def pairs(pose: Int, x: Array) -> tuple[Int, Int]:
    """Rows of candidates whose roots x are equal, and equal to no third one of their pose."""
    angle = 2 * np.arctan(x)
    order = np.lexsort((angle, pose))
    close = np.zeros(len(pose) + 1, dtype=np.bool_)
    close[1:-1] = (np.diff(pose[order]) == 0) & (np.diff(angle[order]) < EQUAL_ROOTS)
    alone = close[1:-1] & ~close[:-2] & ~close[2:]
    first = np.flatnonzero(alone)
    return order[first], order[first + 1]


def products(a: Array, b: Array) -> tuple[Array, Bool]:
    """Weights (M, 2, 2) of two products, a row each, in the span of vectors a and b (M, 4, 3); whether they are (M,).

    a and b are orthonormal in the pencil's own vectors, of which these are linear maps.
    """
    plain = np.stack([a, b], axis=1)  # (M, 2, 4, 3)
    cubic = np.einsum("ij,mwjk->mwik", _CUBIC, plain)
    # bilinear forms (M, 2, 2) of the weights that vanish on products: of each column, then of each row
    forms = [_form(cubic[:, :, i], cubic[:, :, j]) - _form(cubic[:, :, k], cubic[:, :, m]) for i, j, k, m in _TWISTED]
    one, cosine, sine = np.moveaxis(plain, 3, 0)
    forms.append(_form(one, one) - _form(cosine, cosine) - _form(sine, sine))
    rows = np.concatenate(forms, axis=1)  # (M, 13, 3)
    _, size, V = np.linalg.svd(rows)
    q = V[:, 0]
    disc = q[:, 1] ** 2 - 4.0 * q[:, 0] * q[:, 2]
    good = (size[:, 1] < ALIKE_QUADRATICS * size[:, 0]) & (disc > ALIKE_QUADRATICS)
    # q0 s^2 + q1 s t + q2 t^2 = 0 without cancellation
    large = -0.5 * (q[:, 1] + np.copysign(np.sqrt(np.maximum(disc, 0.0)), q[:, 1]))
    weights = np.stack([np.stack([large, q[:, 0]], axis=1), np.stack([q[:, 2], large], axis=1)], axis=1)
    return weights, good


def _form(u: Array, v: Array) -> Array:
    """Coefficients (M, k, 3) of s^2, s t and t^2 in (s u0 + t u1)(s v0 + t v1), for each of k entries (M, 2, k)."""
    return np.stack([u[:, 0] * v[:, 0], u[:, 0] * v[:, 1] + u[:, 1] * v[:, 0], u[:, 1] * v[:, 1]], axis=2)
