"""Dense points with noise: it is no corner, and takes little time."""

from __future__ import annotations

import numpy as np
import pytest
from closed_curves import CENTRE, executed_tips, harmonic_curve, on_path

import armkin
from armkin.motion.tool_path import fit_points


@pytest.fixture(scope="module")
def three_dof() -> armkin.Arm:
    return armkin.load("three_dof")


def loop_points(seed: int, count: int) -> np.ndarray:
    """A random closed curve in reach; that of seed 4 has bends of 1 mm, where 600 points are 0.05 mm apart."""
    return np.asarray(CENTRE - [0, 40, 0] + np.pad(harmonic_curve(seed, count), ((0, 0), (0, 1))))


def test_noise_is_no_corner_and_a_small_square_is() -> None:
    rng = np.random.default_rng(5)
    x = np.linspace(0, 10, 200)
    noisy = np.stack([x, rng.uniform(-0.02, 0.02, 200), 0 * x], axis=1)
    assert not fit_points.corner_points(noisy, 0.05).any()
    small = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]], dtype=float)
    assert fit_points.corner_points(small, 0.05).tolist() == [False, True, True, False]


def test_noise_in_a_tight_bend_is_no_corner() -> None:
    """Points 0.1 mm apart about a bend of 1 mm: seen from afar the way turns, from point to point the noise does."""
    a = np.linspace(0, np.pi, 32)
    bend = np.stack([np.cos(a), np.sin(a)], axis=1)
    legs = np.linspace(10, 0.1, 100)[:, None]
    way = np.concatenate([[1, 0] - legs * [0, 1], bend, [-1, 0] - legs[::-1] * [0, 1]])
    corner_count = 0
    for seed in range(5):
        noise = np.random.default_rng(seed).uniform(-0.02, 0.02, way.shape)
        corner_count += int(fit_points.corner_points(way + noise, 0.05).sum())
    assert corner_count <= 1  # 42 where it is seen from afar alone
    sharp = np.concatenate([np.linspace([0, 0], [10, 0], 100), np.linspace([10, 0], [10, 10], 100)[1:]])
    assert np.flatnonzero(fit_points.corner_points(sharp, 0.05)).tolist() == [99]


def test_noise_in_tight_bends_takes_little_time(three_dof: armkin.Arm) -> None:
    """1.059 of the smooth curve's time: four points of a bend were corners, with sides of 0.05 mm to be rounded in."""
    exact = loop_points(4, 600)
    points = exact + np.random.default_rng(19).uniform(-0.02, 0.02, exact.shape)
    plan = armkin.path(three_dof, points, corners="tolerance")
    assert plan.deviation <= plan.tolerance
    assert on_path(plan) <= 1.04 * on_path(armkin.path(three_dof, loop_points(4, 20_000), corners="tolerance"))
    way, index = executed_tips(plan), 0
    for point in points:  # in order: each behind the first place where the one before it is passed
        index += int(np.flatnonzero(np.linalg.norm(way[index:] - point, axis=1) <= plan.tolerance + 1e-3)[0])


def test_noise_that_leaves_the_tolerance_never_brings_the_law_to_rest(three_dof: armkin.Arm) -> None:
    """The greatest speed before a bend led to rest behind it, where the law stood for 1e298 s."""
    points, rng = loop_points(0, 600), np.random.default_rng(1)
    rng.uniform(size=points.shape)
    plan = armkin.path(three_dof, points + rng.normal(0, 0.02, points.shape), corners="tolerance")
    assert plan.duration < 7


def test_noise_in_a_cusp_is_no_row_of_corners() -> None:
    """Points 0.03 to 0.1 mm apart about a bend of 0.3 mm: 13 of 15 were corners, each rounded by itself."""
    a = np.linspace(-2.0, 2.0, 240)
    y = np.sign(a) * np.abs(a) ** 3
    cusp = np.stack([4 * a**2, y, 0 * a], axis=1)
    corner_count = 0
    for seed in range(5):
        noise = np.random.default_rng(seed).uniform(-0.02, 0.02, cusp.shape)
        corner_count += int(fit_points.corner_points(cusp + noise, 0.05).sum())
    assert corner_count <= 1
