"""Branches that are about to merge, told by machine code: what Python says of them."""

from __future__ import annotations

import numpy as np
import pytest
from left_to_python import left_to_python

import armkin
from armkin.inverse.tasks.choose_task import task_for
from armkin.inverse.tasks.task import targets_of

# whether the forearm's end is its wrist; of the last two a target prescribes sums of joints
WRISTS = {"three_dof": False, "puma560": True, "ur5e": False, "irb120": True, "labvolt_5150": False, "ra02": False}
COUNT = 48
BESIDE = np.geomspace(1e-8, 1e-3, COUNT)
OPTIMISED = "three_dof", "puma560", "ur5e", "labvolt_5150"  # in other tests, too
ROOT = 3e-8  # [rad] how far rounding of a target parts the two branches of a fold that are one


@pytest.fixture
def arm(name: str, request: pytest.FixtureRequest) -> armkin.Arm:
    if name not in OPTIMISED:
        request.getfixturevalue("quickly")
    return armkin.load(name)


def beside_folds(arm: armkin.Arm) -> np.ndarray:
    """Targets of postures whose joint 3 is 1e-8 to 1e-3 rad beside a stretched elbow."""
    rng = np.random.default_rng(11)
    q = rng.uniform(-np.pi, np.pi, (COUNT, arm.n))
    x, y = (arm.link[3] @ arm.link[4])[:2, 3] if WRISTS[arm.name] else (1.0, 0.0)
    q[:, 2] = BESIDE * rng.choice([-1.0, 1.0], COUNT) - np.arctan2(y, x)
    return np.asarray(targets_of(task_for(arm), armkin.fk(arm, q), q))


@pytest.mark.parametrize("name", WRISTS)
def test_merging_branches_are_told_without_python(arm: armkin.Arm, monkeypatch: pytest.MonkeyPatch) -> None:
    fast, target = armkin.compile(arm), beside_folds(arm)
    expected = armkin.ik(arm, target)
    left = left_to_python(monkeypatch)
    solutions = fast.ik(target)
    assert sum(left) < COUNT / 4
    assert {0, 1} <= set(solutions.status.tolist())
    for field in ("status", "valid", "within_limits", "branch", "free", "complete"):
        assert np.array_equal(getattr(solutions, field), getattr(expected, field)), field
    # before a sum of joints is taken off a target is rounded otherwise
    tolerance = np.full(COUNT, 1e-12)
    if len(task_for(arm).sums):
        tolerance += np.minimum(ROOT, ROOT**2 / BESIDE)
    for q in (solutions.q, np.stack([fast.ik(goal).q for goal in target])):
        assert np.array_equal(np.isnan(q), np.isnan(expected.q))
        assert (np.nan_to_num(np.abs(q - expected.q)).max(axis=(1, 2)) < tolerance).all()
    np.testing.assert_array_equal([fast.ik(goal).status for goal in target], expected.status)


def test_a_posture_on_a_fold_that_near_has_stays() -> None:
    arm = armkin.load("three_dof")
    q = np.array([0.3, 0.5, 1e-6])
    solutions = armkin.compile(arm).ik(armkin.fk(arm, q)[:3, 3], near=q)
    assert solutions.status == armkin.Status.BOUNDARY
    assert np.array_equal(solutions.q[solutions.best], q)


@pytest.mark.parametrize("name", ["puma560", "ur5e", "irb120"])
def test_short_self_motions_are_told_without_python(arm: armkin.Arm, monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside a straight wrist, whose joints 4 and 6 may move by some tenths of a radian."""
    q = np.random.default_rng(12).uniform(-np.pi, np.pi, (COUNT, arm.n))
    q[:, 4] = np.geomspace(6e-9, 6e-8, COUNT)
    fast, target = armkin.compile(arm), armkin.fk(arm, q)
    expected = armkin.ik(arm, target)
    left = left_to_python(monkeypatch)
    solutions = fast.ik(target)
    told_count = COUNT - sum(left)
    assert told_count > (expected.status != armkin.Status.SINGULAR).sum() + COUNT / 4
    for field in ("status", "valid", "within_limits", "branch", "free", "complete"):
        assert np.array_equal(getattr(solutions, field), getattr(expected, field)), field
    np.testing.assert_allclose(solutions.q, expected.q, rtol=0, atol=1e-12)
    for answer, status, free in zip(map(fast.ik, target), expected.status, expected.free, strict=True):
        assert answer.status == status
        assert np.array_equal(answer.free, free)
