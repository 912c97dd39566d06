"""Targets on an edge that are decided all at once come out as each alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import truth
from oracle import goal_of_joints
from shipped_arms import shipped_arm

import armkin
from armkin import Status
from armkin.inverse.answers.batch import Examined, Goals
from armkin.inverse.closed.candidates import recorded_formula
from armkin.inverse.numeric import newton
from armkin.inverse.singular import groups
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.inverse.tasks.task import shifted_targets, targets_of
from armkin.model.arm import Arm

NAMES = ["three_dof", "planar_3dof", "cobra600", "ra02", "labvolt_5150", "puma560", "ur5e", "irb2400", "stanford"]


def nearly_singular(name: str, least: float, most: float) -> tuple[Arm, armkin.Solutions]:
    """Answers for targets 10^least to 10^most rad off singular postures."""
    arm, screw = shipped_arm(name)
    task, _ = solver(arm, None)
    rng = np.random.default_rng(3)
    q = np.concatenate(list(truth.singular_postures(arm, screw, None, 12, seed=3).values()))
    steps = 10.0 ** rng.uniform(least, most, (len(q), 1)) * rng.uniform(-1, 1, q.shape)
    q = q + steps * np.where(arm.prismatic, arm.reach, 1.0)
    return arm, armkin.ik(arm, goal_of_joints(task, screw, q).array())


@pytest.mark.parametrize(
    ("name", "least", "most"),
    [*((name, -7.0, -3.0) for name in NAMES), ("puma560", -9.5, -7.5), ("ur5e", -9.5, -7.5), ("irb120", -9.5, -7.5)],
)
def test_all_at_once_is_as_one_by_one(name: str, least: float, most: float) -> None:
    """Off singular postures by what makes folds, and by so little that the arm all but moves by itself."""
    arm, at_once = nearly_singular(name, least, most)
    sampled = np.random.default_rng(5).choice(len(at_once.target), 24)
    for k in sampled:
        alone = armkin.ik(arm, at_once.target[k], near=at_once.near[k])
        a, b = alone.q[alone.valid], at_once.q[k][at_once.valid[k]]
        assert len(a) == len(b)
        assert alone.status == at_once.status[k]
        if alone.status == Status.EXACT:
            assert newton.wrapped_distance(arm, a[:, None], b[None]).min(axis=1).max(initial=0.0) < 1e-6
        assert alone.complete == at_once.complete[k]
        assert (alone.free == at_once.free[k]).all()


@pytest.mark.parametrize("name", ["three_dof", "puma560", "ur5e"])
def test_most_doubtful_targets_are_decided_at_once(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Random targets of which two branches lie 3e-5 to 3e-4 rad apart: most are told by their Jacobians, the others at
    once."""
    doubtful_counts = []
    examine = groups.examine

    def count_and_call(goals: Goals, *more: Any) -> Examined:
        doubtful_counts.append(len(goals.target))
        return examine(goals, *more)

    monkeypatch.setattr(groups, "examine", count_and_call)
    arm, _ = shipped_arm(name)
    task, _ = solver(arm, None)
    screw = shipped_arm(name)[1]
    rng = np.random.default_rng(4)
    q = rng.uniform(-np.pi, np.pi, (100, arm.n))
    straight = {"three_dof": 0.0, "puma560": np.arctan2(20.32, 431.8) - np.pi / 2, "ur5e": 0.0}[name]
    q[:, 2] = straight + 10.0 ** rng.uniform(-4.5, -3.6, 100) * rng.choice([-1.0, 1.0], 100)
    answers = armkin.ik(arm, goal_of_joints(task, screw, q).array())
    assert len(doubtful_counts) <= 1
    assert sum(doubtful_counts) < 20
    assert set(np.unique(answers.status)) == {Status.EXACT, Status.BOUNDARY}


def test_two_folds_in_one_posture_are_a_boundary() -> None:
    """A stretched elbow under a wrist over the shoulder: eight candidates in three postures, each a multiple root."""
    arm = shipped_arm("ur5e")[0]
    T = armkin.fk(arm, np.radians([[180.0, 90.0, 0.0, 90.0, 135.0, -135.0], [-90.0, -90.0, 0.0, 90.0, -135.0, -90.0]]))
    s = armkin.ik(arm, T)
    assert (s.status == Status.BOUNDARY).all()
    assert s.valid.sum(axis=1).tolist() == [3, 3]


def test_a_linkage_that_cannot_move_is_one_posture() -> None:
    """A UR stretched out with a straight wrist: one value of the free joint alone solves its target."""
    arm = shipped_arm("ur5e")[0]
    q = np.radians([180.0, -135.0, 0.0, -90.0, -180.0, 90.0])
    s = armkin.ik(arm, armkin.fk(arm, q))
    assert s.status == Status.BOUNDARY
    assert s.valid.sum() == 1
    assert s.complete
    assert newton.wrapped_distance(arm, s.q[s.valid], q).max() < 1e-6


@pytest.mark.parametrize("name", ["three_dof", "ra02", "labvolt_5150"])
def test_a_little_beyond_a_stretched_arm_is_proved_unreachable(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two branches end where the elbow is straight: both are on one side, on the other none; nothing is searched."""
    arm, screw = shipped_arm(name)
    task, _ = solver(arm, None)
    monkeypatch.setattr(groups, "examine", lambda *_: pytest.fail("searched from many starts"))
    for posture in np.random.default_rng(5).uniform(0.3, 0.7, (4, arm.n)):
        posture[2] = 0.0
        target = goal_of_joints(task, screw, posture[None]).array()
        _, J = newton.scaled_residual_and_jacobian(arm, task, posture[None], target)
        U, S, _ = np.linalg.svd(J[0])
        assert S[-1] < 1e-9 < 1e-3 < S[-2]
        for size in (1e-6, 1e-5, 1e-4):
            shift = np.resize(U[:, -1], 6) * (np.arange(6) < len(U)) * size
            two_sides = [armkin.ik(arm, shifted_targets(arm, task, target, sign * shift)) for sign in (1.0, -1.0)]
            assert sorted(bool(solutions.valid.any()) for solutions in two_sides) == [False, True]
            beyond = next(solutions for solutions in two_sides if not solutions.valid.any())
            assert beyond.status[0] == Status.UNREACHABLE
            assert beyond.complete[0]


@pytest.mark.parametrize("name", ["three_dof", "puma560"])
def test_no_targets_have_no_candidates(name: str) -> None:
    """A compiled batch may leave none to ask the formulas about; every target has as many columns."""
    arm = armkin.load(name)
    task, geometry = solver(arm, None)
    formula = recorded_formula(arm, task, geometry)
    target = targets_of(task, armkin.fk(arm, np.zeros((2, arm.n))), np.zeros((2, arm.n)))
    two, none = formula.rows(target), formula.rows(target[:0])
    assert [x.shape for x in none] == [(0, *x.shape[1:]) for x in two]
