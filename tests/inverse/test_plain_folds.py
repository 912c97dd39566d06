"""What short ways decide of edge targets is what the long ones decide."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import armkin
from armkin.inverse.run import chunks, edges, folds
from armkin.inverse.singular import groups, local_structure, second_order
from armkin.inverse.tasks.choose_task import task_for
from armkin.inverse.tasks.task import targets_of

ARMS = ("three_dof", "puma560", "ur5e")


def stretched(arm: armkin.Arm) -> float:
    """The value of joint 3 at which the elbow is stretched."""
    wrist = (arm.link[3] @ arm.link[4])[:2, 3] if arm.name == "puma560" else np.array([1.0, 0.0])
    return -float(np.arctan2(wrist[1], wrist[0]))


def beside_folds(arm: armkin.Arm, N: int = 16) -> np.ndarray:
    """Postures (N, n) with joint 3 beside a stretched or folded elbow, 1e-6 to 1e-3 rad off."""
    rng = np.random.default_rng(5)
    q = rng.uniform(-np.pi, np.pi, (N, arm.n))
    q[:, 2] = stretched(arm) + rng.choice([0.0, np.pi], N) + rng.choice([-1.0, 1.0], N) * np.geomspace(1e-6, 1e-3, N)
    return q


@pytest.mark.parametrize("name", ARMS)
def test_the_curvature_tells_what_the_followed_curve_tells(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    arm = armkin.load(name)
    task, q = task_for(arm), beside_folds(arm)
    target = np.asarray(targets_of(task, armkin.fk(arm, q), q))
    short = local_structure.local_structure(arm, task, q, target)
    monkeypatch.setattr(second_order, "decide", lambda arm, task, q, *_: np.zeros((2, len(q)), bool))
    long = local_structure.local_structure(arm, task, q, target)
    assert short.known.all()
    assert np.array_equal(short.known, long.known)
    assert np.array_equal(short.boundary, long.boundary)
    assert np.array_equal(short.manifold, long.manifold)
    assert 0 < short.boundary.sum() < len(q)
    np.testing.assert_allclose(short.low, long.low, rtol=0.1)
    np.testing.assert_allclose(short.high, long.high, rtol=0.1)


@pytest.mark.parametrize("name", ARMS)
def test_plain_folds_are_those_that_one_by_one_are_found(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    arm = armkin.load(name)
    rng = np.random.default_rng(6)
    q = np.concatenate([beside_folds(arm), rng.integers(-4, 4, (8, arm.n)) * np.pi / 4])
    target = np.asarray(targets_of(task_for(arm), armkin.fk(arm, q), q))
    short = armkin.ik(arm, target)
    monkeypatch.setattr(groups, "FEW_CANDIDATES", 0)
    long = armkin.ik(arm, target)
    assert {0, 1} <= set(short.status.tolist())
    for field in ("status", "valid", "free", "complete"):
        assert np.array_equal(getattr(short, field), getattr(long, field)), field
    np.testing.assert_allclose(np.nan_to_num(short.q), np.nan_to_num(long.q), atol=1e-3)


@pytest.mark.parametrize("name", ["puma560", "ur5e", "irb120"])
def test_branches_that_are_not_examined_are_what_examining_finds(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    arm = armkin.load(name)
    rng = np.random.default_rng(9)
    q = np.concatenate([beside_folds(arm), rng.integers(-4, 4, (24, arm.n)) * np.pi / 4])
    target = np.asarray(targets_of(task_for(arm), armkin.fk(arm, q), q))
    short, doubts, count = armkin.ik(arm, target), edges._doubted_targets, 0

    def all_examined(*arguments: Any) -> Any:
        nonlocal count
        doubted = doubts(*arguments)
        count += doubted.simple.sum()
        return doubted._replace(simple=np.zeros_like(doubted.simple))

    monkeypatch.setattr(edges, "_doubted_targets", all_examined)
    long = armkin.ik(arm, target)
    assert count > 0
    for field in ("status", "valid", "free", "complete", "branch"):
        assert np.array_equal(getattr(short, field), getattr(long, field)), field
    np.testing.assert_allclose(np.nan_to_num(short.q), np.nan_to_num(long.q), atol=1e-9)


@pytest.mark.parametrize(
    ("name", "task"),
    [*((name, None) for name in ARMS), ("labvolt_5150", None), ("labvolt_5150", "pose"), ("ra02", None)],
)
def test_what_two_jacobians_tell_is_what_examining_finds(
    name: str, task: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    arm = armkin.load(name)
    chosen_task, tell, told_count = task_for(arm, task), folds.decide_folds, 0
    rng = np.random.default_rng(12)
    q = np.concatenate([beside_folds(arm, 80), rng.uniform(-np.pi, np.pi, (40, arm.n))])
    q[:20, 2] = stretched(arm)
    q[80:110, arm.n - 2] = rng.choice([-1.0, 1.0], 30) * np.geomspace(1e-6, 1e-3, 30)
    q[110:, 1:] = rng.integers(-4, 4, (10, arm.n - 1)) * np.pi / 4
    target = np.asarray(targets_of(chosen_task, armkin.fk(arm, q), q))

    def count_and_call(*arguments: Any) -> Any:
        nonlocal told_count
        left = tell(*arguments)
        told_count += len(arguments[3].rows) - len(left)
        return left

    monkeypatch.setattr(chunks, "decide_folds", count_and_call)
    short = armkin.ik(arm, target, task)
    monkeypatch.setattr(chunks, "decide_folds", lambda goals, runner, out, at: at.rows)
    long = armkin.ik(arm, target, task)
    assert told_count > {"three_dof": 60, "puma560": 35, "ur5e": 60}.get(name, 20)
    assert {0, 1} <= set(short.status.tolist())
    for field in ("status", "valid", "free", "complete", "branch", "within_limits"):
        assert np.array_equal(getattr(short, field), getattr(long, field)), field
    np.testing.assert_allclose(np.nan_to_num(short.q), np.nan_to_num(long.q), rtol=0, atol=1e-9)


def test_a_component_is_followed_as_far_as_it_goes() -> None:
    """On 10 degrees the curve of this posture, with a wrist 2e-7 rad off a straight one, is not smooth."""
    arm = armkin.load("puma560")
    q = np.array([[0.75 * np.pi, 0.75 * np.pi, -0.5 * np.pi, -4.28440518e-03, 1.89039945e-07, -0.781113759]])
    structure = local_structure.local_structure(arm, task_for(arm), q, armkin.fk(arm, q))
    assert structure.known.all()
    assert not (structure.manifold | structure.boundary).any()
    assert 0.03 < structure.high[0] - structure.low[0] < 0.05
