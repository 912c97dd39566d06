"""Distances of segments to shapes and to each other, against minima that are searched for."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from armkin.formula.arrays import Array
from armkin.keep_out.shapes.box import Box
from armkin.keep_out.shapes.capsule import Capsule
from armkin.keep_out.shapes.floor import Floor
from armkin.keep_out.shapes.segment_distances import segment_distance
from armkin.model.rotation import transform

MANY = 4000
_GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


def _least_value(f: Callable[[Array], Array], count: int) -> Array:
    """Least value over [0, 1] of convex functions f (count,) -> (count,), by golden sections."""
    low, high = np.zeros(count), np.ones(count)
    best = np.minimum(f(low), f(high))
    for _ in range(90):
        a, b = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
        left = f(a) <= f(b)
        low, high = np.where(left, low, a), np.where(left, b, high)
        best = np.minimum(best, np.minimum(f(a), f(b)))
    return best


def _random_segments(rng: np.random.Generator, count: int, size: float) -> tuple[Array, Array]:
    """Ends (3, count): a quarter along axes, a quarter points, the rest anyhow."""
    a, b = rng.uniform(-size, size, (2, 3, count))
    axis = rng.integers(0, 3, count)
    along = np.eye(3)[:, axis] * rng.uniform(-size, size, count)
    kind = np.arange(count) % 4
    b = np.where(kind == 0, a + along, np.where(kind == 1, a, b))
    return a, b


def _point_to_segment(p: Array, c: Array, d: Array) -> Array:
    v = d - c
    length = np.einsum("km,km->m", v, v)
    t = np.clip(np.einsum("km,km->m", p - c, v) / np.where(length > 0, length, 1.0), 0.0, 1.0)
    return np.asarray(np.linalg.norm(p - c - t * v, axis=0))


def test_segments_are_as_far_apart_as_the_search_finds() -> None:
    rng = np.random.default_rng(1)
    (a, b), (c, d) = (_random_segments(rng, MANY, 300.0) for _ in range(2))
    third = np.arange(MANY) % 3 == 0  # parallel, and nearly so
    d = np.where(third, c + (b - a) * rng.uniform(-2, 2, MANY) + rng.choice([0.0, 1e-9, 1e-5], MANY), d)
    distances = segment_distance(a, b, c, d)
    assert np.abs(distances - _least_value(lambda s: _point_to_segment(a + s * (b - a), c, d), MANY)).max() < 1e-9


def test_crossing_segments_touch() -> None:
    a, b, c, d = np.array([[-1.0, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0]]).T.reshape(3, 4).T.reshape(4, 3, 1)
    assert segment_distance(a, b, c, d).item() == 0.0


def _signed_distance(box: Box, p: Array) -> Array:
    """Signed distance of points (3, M) to a box, point by point."""
    local = np.abs(box.axes.T @ (p - box.centre[:, None])) - box.half[:, None]
    beyond = np.linalg.norm(np.maximum(local, 0.0), axis=0)
    return np.asarray(np.where(beyond > 0, beyond, local.max(axis=0)))


@pytest.mark.parametrize("turned", [False, True])
def test_segments_are_as_far_from_a_box_as_the_search_finds(turned: bool) -> None:
    rng = np.random.default_rng(2)
    T = transform((30.0, -20.0, 10.0), (20.0, 30.0, 40.0) if turned else (0.0, 0.0, 0.0))
    box = Box(T[:3, 3], T[:3, :3], np.array([60.0, 100.0, 30.0]))
    a, b = _random_segments(rng, MANY, 250.0)
    expected = _least_value(lambda t: _signed_distance(box, a + t * (b - a)), MANY)
    distances = box.distance(a, b)
    assert np.abs(distances - expected).max() < 1e-9
    assert (np.sign(distances) == np.sign(np.where(np.abs(expected) < 1e-12, 0.0, expected))).mean() > 0.999
    assert 0.05 < (distances < 0).mean() < 0.9


def test_depth_is_the_way_to_the_nearest_face() -> None:
    box = Box(np.zeros(3), np.eye(3), np.array([10.0, 20.0, 30.0]))
    point = np.array([[7.0], [0.0], [0.0]])
    assert box.distance(point, point).item() == -3.0
    through = np.array([[-50.0], [0.0], [0.0]]), np.array([[50.0], [0.0], [0.0]])
    assert box.distance(*through).item() == -10.0


def test_points_are_segments_without_length() -> None:
    rng = np.random.default_rng(4)
    p = rng.uniform(-150, 150, (3, MANY))
    T = transform((30.0, -20.0, 10.0), (20.0, 30.0, 40.0))
    line = rng.uniform(-100, 100, (2, 3))
    for shape in (Box(T[:3, 3], T[:3, :3], np.array([60.0, 100.0, 30.0])), Floor(5.0), Capsule(line[0], line[1], 40.0)):
        assert np.abs(shape.of_points(p) - shape.distance(p, p)).max() < 1e-9
    assert Capsule(line[0], line[0], 1.0).of_points(line[0]).item() == -1.0


def test_floor_and_capsule_keep_to_their_formulas() -> None:
    a, b = np.array([[0.0], [0.0], [30.0]]), np.array([[100.0], [0.0], [-5.0]])
    assert Floor(10.0).distance(a, b).item() == -15.0
    capsule = Capsule(np.array([0.0, 400.0, 0.0]), np.array([0.0, 400.0, 900.0]), 60.0)
    assert capsule.distance(a, b).item() == pytest.approx(340.0, abs=1e-9)
