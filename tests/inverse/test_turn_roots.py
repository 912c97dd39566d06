"""Roots of trigonometric polynomials over a turn, and the equations of a seven-joint arm that they solve."""

import numpy as np
import pytest
from redundant_arms import arm_with_shoulder_and_wrist

import armkin
from armkin.inverse.redundant.boundaries import boundaries, boundary_angles
from armkin.inverse.redundant.turn_roots import roots, sampled_at
from armkin.model.arm import from_links

DEGREE = 8


def series_values(c: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Of c[0] + 2 Re(sum of c[k] exp(i k t)), at real or complex t."""
    k = np.arange(1, len(c))[:, None]
    return np.asarray(c[0] + (c[1:, None] * np.exp(1j * k * t) + c[1:, None].conj() * np.exp(-1j * k * t)).sum(axis=0))


def test_all_roots_are_those_that_an_eigenvalue_problem_has() -> None:
    rng = np.random.default_rng(0)
    c = rng.normal(size=(100, DEGREE + 1)) + 1j * rng.normal(size=(100, DEGREE + 1))
    c[:, 0] = c[:, 0].real
    listed = roots(np.stack([series_values(coefficients, sampled_at(DEGREE)) for coefficients in c]), DEGREE)
    assert listed.decided.all()
    for k, coefficients in enumerate(c):
        z = np.roots(np.concatenate([coefficients[:0:-1], coefficients[:1], coefficients[1:].conj()]))
        expected = np.sort(np.remainder(np.angle(z[np.abs(np.abs(z) - 1) < 1e-7]), 2 * np.pi))
        angles = np.sort(np.remainder(listed.at[listed.which == k], 2 * np.pi))
        assert np.allclose(angles, expected, atol=1e-9)


@pytest.mark.parametrize(("lift", "count", "decided"), [(-1e-9, 2, True), (1e-9, 0, True), (0.0, None, False)])
def test_two_roots_are_told_from_none_and_one_double_one_is_undecided(
    lift: float, count: int | None, decided: bool
) -> None:
    t = sampled_at(DEGREE)
    listed = roots(((1 + lift - np.cos(t - 0.7)) * (3 + np.cos(2 * t)))[None], DEGREE)
    assert listed.decided.tolist() == [decided]
    assert count is None or len(listed.at) == count


def test_where_a_joint_stands_on_a_limit_there_is_a_place() -> None:
    """Whatever branches are real: of random arms of the class, each limit of each joint in turn."""
    for seed in range(3):
        rng = np.random.default_rng(seed)
        q = rng.uniform(-2.5, 2.5, 7)
        for joint in range(6):
            for side in range(2):
                limits = np.tile([-2.9, 2.9], (7, 1))
                limits[joint, side] = q[joint]
                arm = arm_with_shoulder_and_wrist(np.random.default_rng(100 + seed), limits)
                of = boundaries(arm)
                assert of is not None
                [values], _ = boundary_angles(of, armkin.fk(arm, q)[None])
                assert np.abs(np.remainder(values - q[6] + np.pi, 2 * np.pi) - np.pi).min() < 1e-7


def test_where_branches_of_a_twisted_shoulder_merge_there_is_a_place() -> None:
    """No equation had these places: of the first arm 249 of 250 targets were not complete."""
    for seed in (0, 3):
        rng = np.random.default_rng(seed)
        limits = np.sort(rng.uniform(-3.1, 3.1, (7, 2)), axis=1) + np.array([-1.0, 1.0])
        arm = arm_with_shoulder_and_wrist(rng, limits)
        q = rng.uniform(np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi), (40, 7))
        assert armkin.ik(arm, armkin.fk(arm, q)).complete.mean() > 0.9


def test_an_arm_without_such_a_shoulder_or_wrist_has_none() -> None:
    assert boundaries(armkin.load("kinova_gen3")) is None
    links = armkin.load("panda").link.copy()
    links[5, 0, 3] += 1e-6
    assert boundaries(from_links(links, [False] * 7)) is None
