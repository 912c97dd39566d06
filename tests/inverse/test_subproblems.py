"""The subproblems alone, against brute force."""

from __future__ import annotations

from typing import cast

import numpy as np
import pytest

from armkin.formula.arrays import Array
from armkin.inverse.closed.subproblems import Pair, quadratic, trig_quadratic


def form_values(e: Array, q: Array) -> Array:
    """The form at angles q (M, N) for coefficients e (6, N)."""
    c, s = np.cos(q), np.sin(q)
    return np.asarray(e[0] + e[1] * c + e[2] * s + e[3] * c * c + e[4] * c * s + e[5] * s * s)


def random_forms(kind: str, rng: np.random.Generator, count: int) -> Array:
    """Coefficients (6, count): random, of small integers with many zeros, or with prescribed roots."""
    if kind == "integers":
        return rng.integers(-2, 3, (6, count)).astype(float)
    if kind == "sizes":
        return rng.normal(size=(6, count)) * 10.0 ** rng.uniform(-6, 0, (6, count))
    if kind == "lines":  # a product of two lines, integer ones among them: parallel, equal, meeting on the circle
        a, b = rng.integers(-2, 3, (2, 3, count)) + rng.normal(size=(2, 3, count)) * rng.integers(0, 2, (2, 3, count))
        return np.array(
            [
                a[2] * b[2],
                a[0] * b[2] + a[2] * b[0],
                a[1] * b[2] + a[2] * b[1],
                a[0] * b[0],
                a[0] * b[1] + a[1] * b[0],
                a[1] * b[1],
            ]
        )
    return rng.normal(size=(6, count))


@pytest.mark.parametrize("kind", ["random", "integers", "sizes", "lines"])
def test_a_circle_and_a_conic(kind: str) -> None:
    """Every change of sign on a fine grid has its root, every simple root is one, and none is invented."""
    e = random_forms(kind, np.random.default_rng(1), 4000)
    grid = np.linspace(-np.pi, np.pi, 1001)[:, None]
    vanishing = np.abs(form_values(e, grid)).max(axis=0) < 1e-9
    nothing = trig_quadratic(list(e[:, vanishing]), 1.0)[1]
    assert nothing.edge.any(axis=(0, 1, 2)).all()
    assert np.all(nothing.free)
    e = e[:, ~vanishing]
    scale = np.abs(e).sum(axis=0)
    pair, word = trig_quadratic(list(e), 1.0)
    c, s = cast("list[Array]", pair)
    q = np.arctan2(s, c).reshape(4, -1)
    doubt = np.asarray(word.edge.reshape(-1, e.shape[1]).any(axis=0))
    on_circle = np.abs(c**2 + s**2 - 1).reshape(4, -1) < 1e-12
    assert not np.any(word.free)
    root = on_circle & (np.abs(form_values(e, q)) < 1e-12 * scale)
    assert not (on_circle & ~root & ~doubt).any()
    residuals = form_values(e, grid)
    k, n = np.nonzero(residuals[:-1] * residuals[1:] < 0)
    # bisection: slow and sure
    low, high = grid[k, 0], grid[k + 1, 0]
    below = residuals[k, n]
    for _ in range(60):
        middle = (low + high) / 2
        left = form_values(e[:, n], middle) * below <= 0
        low, high = np.where(left, low, middle), np.where(left, middle, high)
    away = np.abs(np.exp(1j * q[:, n]) - np.exp(1j * low))
    assert np.where(root[:, n], away, np.inf).min(axis=0)[~doubt[n]].max() < 1e-9
    assert away.min(axis=0).max() < 5e-3  # a root of fourth order is known to the fourth root of rounding
    assert doubt.mean() < {"random": 0.01, "sizes": 0.02}.get(kind, 0.7)


def test_two_double_roots() -> None:
    """A squared line that crosses the circle: both roots of second order, told as such, not one of fourth order."""
    rng = np.random.default_rng(5)
    x, y = rng.normal(size=(2, 4000)) * (rng.random((2, 4000)) < 0.7)
    z = rng.uniform(-0.9, 0.9, 4000) * np.hypot(x, y) * (rng.random(4000) < 0.7)
    x, y, z = (v[np.hypot(x, y) > 0.1] for v in (x, y, z))
    e = np.array([z * z, 2 * x * z, 2 * y * z, x * x, 2 * x * y, y * y])
    e *= 1 + 3e-16 * rng.integers(-1, 2, e.shape)
    pair, word = trig_quadratic(list(e), 1.0)
    middle, half = np.arctan2(y, x), np.arccos(-z / np.hypot(x, y))
    c, s = cast("list[Array]", pair)
    q = np.arctan2(s, c).reshape(4, -1)
    for root in (middle + half, middle - half):
        assert np.abs(np.exp(1j * q) - np.exp(1j * root)).min(axis=0).max() < 1e-5
    assert np.asarray(word.edge.any(axis=(0, 1, 2))).all()


def test_a_conic_that_vanishes_on_the_circle_leaves_the_angle_free() -> None:
    """cos^2 + sin^2 - 1, in rounded multiples, beside one that is off by a little."""
    k = np.array([0.5, 1.0, 0.1, 7.3e-3, 0.7, 0.7])
    none = np.zeros(6)
    errors = np.array([0.0, 1e-16, 0.0, 0.0, 1e-9, 1e-3])
    pair, word = trig_quadratic([-k, none, errors, k + errors, none, k], 1.0, Pair(0.6, 0.8))
    c, s = cast("list[Array]", pair)
    assert np.asarray(word.free).tolist() == [True] * 4 + [False] * 2
    assert np.asarray(word.edge.any(axis=(0, 1, 2)))[:5].all()
    assert (c[..., :4] == 0.6).all()
    assert (s[..., :4] == 0.8).all()


def test_quadratic() -> None:
    """Both roots, those of a vanishing leading coefficient far away, over many sizes."""
    rng = np.random.default_rng(2)
    size = 10.0 ** rng.uniform(-2, 2, (2, 2000))
    d = rng.normal(size=(2, 2000)) * size
    a = np.where(rng.random(2000) < 0.2, 0.0, 1.0)
    b, c = np.where(a == 0.0, 1.0, -d[0] - d[1]), np.where(a == 0.0, -d[0], d[0] * d[1])
    roots = cast("Array", quadratic(a, b, c, 0, 1.0, 1e-300, None)[0]).reshape(2, -1)
    for root in (d[0], np.where(a == 0.0, d[0], d[1])):
        assert (np.abs(roots - root).min(axis=0) / (1 + np.abs(root) + np.abs(d).max(axis=0))).max() < 1e-9
