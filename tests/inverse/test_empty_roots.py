"""Roots of the elimination that stand for nothing: told as such, and never one that stands for a branch."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import truth
from geometries import Case, case_of, random_case, right_angles
from oracle import goal_of_joints

import armkin
from armkin.inverse.elimination import method, passes, polish, roots
from armkin.inverse.numeric import tolerances
from armkin.inverse.numeric.tolerances import LONE_DISTANCE
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.model.rotation import inverse


def right_angled_case(seed: int) -> Case:
    return case_of(right_angles(np.random.default_rng(seed)), "pose")


@pytest.mark.parametrize("seed", [151, 169, 188, 5006])
def test_random_poses_of_right_angled_arms_are_complete(seed: int) -> None:
    """Of arm 169 a real root that no branch has comes with nine in ten poses.

    Of arm 5006 a complex pair that is real to 1e-4 with one in thirty.
    """
    arm, screw, task = right_angled_case(seed)
    assert armkin.method(arm, task)[0] == "general elimination"
    q = np.random.default_rng(1).uniform(-np.pi, np.pi, (300, 6))
    target = goal_of_joints(solver(arm, task)[0], screw, q).array()
    verdict = truth.judge(arm, screw, task, q, target)
    truth.ask_oracle(arm, screw, verdict, target, np.arange(12), 250, 3)
    assert verdict, str(verdict)
    assert verdict.solutions.complete.mean() >= 0.99


@pytest.mark.parametrize("name", [169, 188, 1000, "6R general", "6R modified DH", "RRRPRR general"])
def test_no_root_of_a_branch_is_called_empty(name: int | str, monkeypatch: pytest.MonkeyPatch) -> None:
    # the distance of every root from the others
    monkeypatch.setattr(roots, "tol", SimpleNamespace(**{**vars(tolerances), "NO_PRODUCT": -1.0}))
    arm = (right_angled_case(name) if isinstance(name, int) else random_case(name, 1)).arm
    elimination = method.prepare(arm.link, arm.prismatic)
    closed = elimination.loop
    q = np.random.default_rng(5).uniform(-np.pi, np.pi, (200, 6)) * np.where(arm.prismatic, 100.0, 1.0)
    T = armkin.fk(arm, q)
    branches = method.solve(elimination, T).q
    count = 0
    for pencil in elimination.plans[:3]:
        seed, joint = roots.root_seeds(pencil, inverse(closed.goal(T)), 0.02), pencil.hidden_joint
        unit = closed.length if arm.prismatic[joint] else 1.0
        away = np.abs(branches[seed.pose, :, joint] / unit - seed.q[:, None, joint])
        away = np.where(np.isnan(away), np.inf, away if arm.prismatic[joint] else np.abs(np.angle(np.exp(1j * away))))
        stands = (seed.tilt == 0) & (seed.gap > LONE_DISTANCE) & (away.min(axis=1) < 1e-6)
        count += int(stands.sum())
        assert seed.defect[stands].max() < 1e-6
    assert count > 300


def test_steps_are_not_spent_on_complex_roots_that_stand_for_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a Niryo's 300 poses 577 candidates of 3,004 missed them by 1 and more; 199 are left: roots close by."""
    arm, missed = armkin.load("niryo_ned2"), []
    armkin.method(arm)

    def watch_and_call(*arguments: Any, **more: Any) -> polish.Polished:
        refined = polish.refine(*arguments, **more)
        missed.append(int((refined.guess > 1.0).sum()))
        return refined

    monkeypatch.setattr(passes, "refine", watch_and_call)
    armkin.ik(arm, armkin.fk(arm, np.random.default_rng(0).uniform(-np.pi, np.pi, (300, 6))), examine=False)
    assert 0 < missed[0] < 220
