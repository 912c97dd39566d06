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


TWO_LOST = np.array([  # of a Puma whose elbow is nearly stretched
    [1.833627481, -0.298707509, 1.614041128, -3.07493505, -3.128725599, 0.839968441],
    [1.691701213, -1.834821819, 1.617818475, 2.411774408, -1.579850503, 2.36898957],
    [-2.563827713, -2.841684122, 1.617580845, 1.359001904, 0.003659863, -0.62104233],
    [-0.479825434, 1.17897984, 1.618291834, 2.490298158, 0.052058941, -2.1017677],
    [1.259519517, -2.421425033, 1.618983246, -0.667494987, 0.148093191, -1.374188837],
    [-2.040234652, 1.687193849, 1.61764349, -0.042181822, -2.593692599, 2.413136733],
    [2.435535184, 1.364725771, 1.617775426, 2.949187502, -2.890688097, -1.428557164],
])  # fmt: skip


def test_components_longer_than_a_span_are_told_without_python(monkeypatch: pytest.MonkeyPatch) -> None:
    arm = armkin.load("puma560")
    fast, target = armkin.compile(arm), armkin.fk(arm, TWO_LOST)
    expected = armkin.ik(arm, target)
    left = left_to_python(monkeypatch)
    solutions = fast.ik(target)
    assert sum(left) <= 1
    for field in ("status", "valid", "within_limits", "branch", "free", "complete"):
        assert np.array_equal(getattr(solutions, field), getattr(expected, field)), field
    np.testing.assert_allclose(solutions.q, expected.q, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", ["puma560", "thor", "ar4"])
def test_postures_beside_round_ones_are_what_python_says(name: str) -> None:
    """Joints at multiples of 45 degrees, off by 1e-9 to 0.03 rad, where two singularities meet most often."""
    arm, rng = armkin.load(name), np.random.default_rng(1)
    q = rng.uniform(-np.pi, np.pi, (3000, arm.n))
    beside = np.round(q / (np.pi / 4)) * (np.pi / 4) + 10.0 ** rng.uniform(-9.0, -1.5, q.shape)
    target = armkin.fk(arm, np.where(rng.random(q.shape) < 0.5, beside, q))
    expected, solutions = armkin.ik(arm, target), armkin.compile(arm).ik(target)
    for field in ("status", "valid", "free", "complete"):
        assert np.array_equal(getattr(solutions, field), getattr(expected, field)), field


def test_what_lies_beyond_a_fold_is_told_without_python(monkeypatch: pytest.MonkeyPatch) -> None:
    """UR5e poses whose second pair of branches misses them by 2e-7 to 4e-4 of the reach."""
    arm = armkin.load("ur5e")
    q = np.array([
        [0.46758924, 2.825648173, -1.382242768, -1.249506422, -1.475896038, 1.769276865],
        [0.259115774, -1.878845314, -0.047077875, -1.603162761, 0.731468268, 2.737558509],
        [-1.304509994, 1.623773441, 0.035104359, -2.259852799, 2.138480149, 0.317201446],
    ])  # fmt: skip
    fast, target = armkin.compile(arm), armkin.fk(arm, q)
    expected = armkin.ik(arm, target)
    left = left_to_python(monkeypatch)
    solutions = fast.ik(target)
    assert not sum(left)
    for field in ("status", "valid", "within_limits", "branch", "free", "complete"):
        assert np.array_equal(getattr(solutions, field), getattr(expected, field)), field
