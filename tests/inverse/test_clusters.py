"""Means of clusters, against the definition: every candidate that has two others within `CLUSTER` of it."""

import numpy as np
import pytest

import armkin
from armkin.formula.arrays import Array
from armkin.inverse.numeric import newton
from armkin.inverse.numeric.tolerances import CLUSTER
from armkin.inverse.singular.roots import means
from armkin.model.arm import Arm


def by_definition(arm: Arm, q: Array) -> Array:
    """One target's candidates (B, n), each compared with every other."""
    out = q.copy()
    unit = np.where(arm.prismatic, arm.reach, 1.0)
    for i, one in enumerate(q):
        away = newton.difference(arm, q, one)
        around = [d for d in away if np.abs(d).max() < CLUSTER]
        if len(around) > 2:
            out[i] = one + np.mean(around, axis=0) * unit
    return out


@pytest.mark.parametrize("name", ["puma560", "stanford"])
@pytest.mark.parametrize("count", [3, 9, 70])
def test_means_are_those_of_the_definition_however_many_candidates(name: str, count: int) -> None:
    arm = armkin.load(name)
    rng = np.random.default_rng(count)
    q = rng.uniform(-3, 3, (5, count, arm.n))
    half = (count + 1) // 2
    q[:, :half] = q[:, :1] + rng.normal(0, 6e-3, (5, half, arm.n)) * np.where(arm.prismatic, arm.reach, 1.0)
    q += 2 * np.pi * rng.integers(-1, 2, q.shape) * ~arm.prismatic
    q[rng.random((5, count)) < 0.2] = np.nan
    found = means(arm, q)
    for one, expected in zip(found, (by_definition(arm, target) for target in q), strict=True):
        np.testing.assert_allclose(one, expected, atol=1e-11)
    if count > 3:
        assert (np.nan_to_num(found) != np.nan_to_num(q)).any()


def test_a_target_is_averaged_alike_alone_and_beside_one_with_more_candidates() -> None:
    arm = armkin.load("puma560")
    rng = np.random.default_rng(1)
    q = np.full((2, 60, 6), np.nan)
    q[0, :4] = rng.uniform(-1, 1, 6) + rng.normal(0, 3e-3, (4, 6))
    q[1] = rng.uniform(-3, 3, (60, 6))
    alone = means(arm, q[:1, :4])
    np.testing.assert_array_equal(means(arm, q)[0, :4], alone[0])
    assert (alone != q[:1, :4]).all()
