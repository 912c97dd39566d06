"""Branches that are about to merge, told by machine code: what Python says of them."""

from __future__ import annotations

import numpy as np
import pytest
from left_to_python import left_to_python

import armkin
from armkin.inverse.tasks.fitting import task_for
from armkin.inverse.tasks.task import targets_of

WRISTS = {"three_dof": False, "puma560": True, "ur5e": False, "irb120": True}  # whether the forearm's end is its wrist
COUNT = 48


def beside_folds(arm: armkin.Arm) -> np.ndarray:
    """Targets of postures whose joint 3 is 1e-8 to 1e-3 rad beside a stretched elbow."""
    rng = np.random.default_rng(11)
    q = rng.uniform(-np.pi, np.pi, (COUNT, arm.n))
    x, y = (arm.link[3] @ arm.link[4])[:2, 3] if WRISTS[arm.name] else (1.0, 0.0)
    q[:, 2] = np.geomspace(1e-8, 1e-3, COUNT) * rng.choice([-1.0, 1.0], COUNT) - np.arctan2(y, x)
    return np.asarray(targets_of(task_for(arm), armkin.fk(arm, q), q))


@pytest.mark.parametrize("name", WRISTS)
def test_merging_branches_are_told_without_python(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    arm = armkin.load(name)
    fast, target = armkin.compile(arm), beside_folds(arm)
    expected = armkin.ik(arm, target)
    left = left_to_python(monkeypatch)
    found = fast.ik(target)
    assert sum(left) < COUNT / 4
    assert {0, 1} <= set(found.status.tolist())
    for field in ("status", "valid", "within_limits", "branch", "free", "complete"):
        assert np.array_equal(getattr(found, field), getattr(expected, field)), field
    np.testing.assert_allclose(found.q, expected.q, rtol=0, atol=1e-12)
    alone = [fast.ik(one) for one in target]
    assert [int(one.status) for one in alone] == expected.status.tolist()
    for one, q in zip(alone, expected.q, strict=True):
        np.testing.assert_allclose(one.q, q, rtol=0, atol=1e-12)


def test_a_posture_on_a_fold_that_near_has_stays() -> None:
    arm = armkin.load("three_dof")
    q = np.array([0.3, 0.5, 1e-6])
    found = armkin.compile(arm).ik(armkin.fk(arm, q)[:3, 3], near=q)
    assert found.status == armkin.Status.BOUNDARY
    assert np.array_equal(found.q[found.best], q)
