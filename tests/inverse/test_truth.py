"""What people ask: round postures, singular surfaces, rounded targets; and what judges the answers.

These are samples; `python tests/bench/check_ik.py --postures --surfaces --rounded` asks thousands.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import truth
from geometries import random_case
from oracle import goal_of_joints, newton
from shipped_arms import UNLIKE, shipped_arm

import armkin
from armkin import Status
from armkin.errors import UsageError
from armkin.inverse.answers.batch import Goals
from armkin.inverse.singular import groups
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.model.arm import from_links


@pytest.mark.parametrize("name", UNLIKE)
def test_round_postures(name: str, sample: Callable[[int, int], int]) -> None:
    arm, screw = shipped_arm(name)
    task, _ = solver(arm, None)
    kinds = {f"multiples of {step}": truth.round_postures(arm, step, sample(24, 8), seed=1) for step in (90, 45)}
    q = np.concatenate(list(kinds.values()))
    for near in (None, q):
        verdict, report = truth.judge_kinds(arm, screw, kinds, goal_of_joints(task, screw, q).array(), near)
        assert verdict, report


@pytest.mark.parametrize("name", UNLIKE)
def test_singular_surfaces(name: str, sample: Callable[[int, int], int]) -> None:
    arm, screw = shipped_arm(name)
    task, _ = solver(arm, None)
    postures_of = truth.singular_postures(arm, screw, None, 12, seed=1)
    kinds = {kind: q[: sample(12, 3)] for kind, q in postures_of.items()}
    assert kinds, "no singular surface found"
    q = np.concatenate(list(kinds.values()))
    target = goal_of_joints(task, screw, q).array()
    for near in (None, q):
        verdict, report = truth.judge_kinds(arm, screw, kinds, target, near)
        assert verdict, report
    verdict, report = truth.judge_kinds(arm, screw, kinds, truth.typed_targets(task, target, 9))
    verdict.lost = []  # what solves a target by 1e-9 no more than just is not asked for
    assert verdict, f"9 digits, {report}"


@pytest.mark.parametrize(
    "name",
    [
        "RRR and spherical wrist",
        "spherical wrist, oblique",
        "spherical shoulder",
        "three parallel axes 2, 3, 4",
        "three parallel axes 3, 4, 5",
        "axis, pitch arm",
    ],
)
def test_singular_surfaces_of_oblique_wrists(name: str) -> None:
    """Two roots of joint 5 merge at its extremes, at which a wrist of right angles moves by itself."""
    arm, screw, task, *_ = random_case(name, 0)
    definition, _ = solver(arm, task)
    kinds = truth.singular_postures(arm, screw, task, 24, seed=1)
    q = np.concatenate(list(kinds.values()))
    target = goal_of_joints(definition, screw, q).array()
    for near in (None, q):
        verdict, report = truth.judge_kinds(arm, screw, kinds, target, near, task)
        assert verdict, report


@pytest.mark.parametrize("name", UNLIKE)
def test_rounded_targets(name: str) -> None:
    arm, screw = shipped_arm(name)
    task, _ = solver(arm, None)
    rng = np.random.default_rng(2)
    q = rng.uniform(-np.pi, np.pi, (24, arm.n))
    q = np.where(arm.prismatic, q * arm.reach / 10, q)
    target = goal_of_joints(task, screw, q).array()
    targets_of = {f"{n} digits": truth.typed_targets(task, target, n) for n in (3, 4, 5, 6, 7, 7.5, 8, 10, 13, 16)}
    if task.orientation == "full":
        targets_of |= {f"matrices of {n} digits": truth.printed_matrices(target, n) for n in (7, 7.5, 8, 10, 13, 16)}
    verdict, report = truth.judge_kinds(
        arm, screw, dict.fromkeys(targets_of, q), np.concatenate(list(targets_of.values()))
    )
    assert verdict, report


@pytest.mark.parametrize("name", ["puma560", "ur5e", "jaco_j2n6s300", "moveo", "kinova_gen3"])
def test_random_poses_are_complete(name: str) -> None:
    arm, screw = shipped_arm(name)
    task, _ = solver(arm, None)
    q = np.random.default_rng(9).uniform(-np.pi, np.pi, (500, arm.n))
    s = armkin.ik(arm, goal_of_joints(task, screw, q).array())
    assert s.complete.mean() >= 0.99


@pytest.mark.parametrize("name", ["three_dof", "puma560", "stanford", "jaco_j2n6s300"])
def test_the_fifth_call_is_the_first_bit_for_bit(name: str) -> None:
    arm, screw = shipped_arm(name)
    q = np.random.default_rng(8).uniform(-1, 1, (40, arm.n))
    q = np.where(arm.prismatic, 300 * q, q)
    task, _ = solver(arm, None)
    T = goal_of_joints(task, screw, q).array()
    first, batch = armkin.ik(arm, T[0]).q.tobytes(), armkin.ik(arm, T).q.tobytes()
    armkin.ik(arm, np.repeat(T, 4, axis=0))  # enough to be recorded
    for _ in range(5):
        assert armkin.ik(arm, T[0]).q.tobytes() == first
        assert armkin.ik(arm, T).q.tobytes() == batch


def test_the_judge_notices_answers_spoilt_on_purpose(monkeypatch: pytest.MonkeyPatch) -> None:
    arm, screw = shipped_arm("ur5e")
    task, _ = solver(arm, None)
    q = np.random.default_rng(3).uniform(-np.pi, np.pi, (20, 6))
    q[10:, 4] = 0.0  # its wrist moves by itself
    target = goal_of_joints(task, screw, q).array()
    right = armkin.ik(arm, target, near=q)
    answers: list[armkin.Solutions] = []
    monkeypatch.setattr(armkin, "ik", lambda *_, **__: answers[-1])

    def judged_as(**changed: Any) -> truth.Verdict:
        answers.append(replace(right, **changed))
        return truth.judge(arm, screw, None, q, target, near=q)

    assert judged_as()
    assert (right.status[10:] == Status.SINGULAR).all()
    rows, first, regular = np.arange(20), right.best, list(range(10))
    without = right.valid.copy()
    without[rows, first] = False
    spoilt = np.where(without[:, :, None], right.q, np.nan)
    assert judged_as(valid=without, q=spoilt).lost[:10] == regular
    # a curve that is not reported, and a branch half a radian along it
    along = right.q.copy()
    null = np.linalg.svd(armkin.jacobian(arm, q[10:]))[2][:, -1]
    along[rows[10:], first[10:]], _ = newton(screw, truth.goal_of(task, target[10:]), q[10:] + 0.5 * null, 60)
    verdict = judged_as(q=along, status=np.zeros_like(right.status))
    assert verdict.lost == list(range(10, 20)), verdict
    twice = right.q.copy()
    twice[rows, (first + 1) % right.q.shape[1]] = right.q[rows, first]
    assert set(judged_as(q=twice, valid=right.valid | (np.arange(right.valid.shape[1]) == 1)).twice) >= set(regular)
    false = right.q.copy()
    false[rows, first, 0] += 1e-6
    assert judged_as(q=false).false == rows.tolist()
    assert judged_as(status=np.full_like(right.status, Status.UNREACHABLE)).unreachable == rows.tolist()


def test_the_judge_notices_a_self_motion_listed_by_two_of_its_postures(monkeypatch: pytest.MonkeyPatch) -> None:
    arm, screw = shipped_arm("puma560")
    task, _ = solver(arm, None)
    q = np.random.default_rng(3).uniform(-np.pi, np.pi, (8, 6))
    q[:, 4] = 0.0
    target = goal_of_joints(task, screw, q).array()
    right = armkin.ik(arm, target, near=q)
    assert not right.valid[:, -1].any()
    assert truth.judge(arm, screw, None, q, target)
    two, valid = right.q.copy(), right.valid.copy()
    along = np.sqrt(2) * np.linalg.svd(armkin.jacobian(arm, q))[2][:, -1]  # joints 4 and 6 at one rad/s
    two[:, -1], valid[:, -1] = q + np.array([0.5, 1, 2, np.pi, 3.5, 4, 5, 6])[:, None] * along, True
    monkeypatch.setattr(armkin, "ik", lambda *_, **__: replace(right, q=two, valid=valid))
    assert truth.judge(arm, screw, None, q, target).twice == list(range(8))


@pytest.mark.parametrize(
    ("name", "q"),
    [
        # beside it, on its self-motion, joint 5 moves by 5e-4 of joint 1's way; a second singular value is 4e-5
        ("thor", [0.2436046829014562, -3.1396693827386457, -3.141929721989846, 0.34582602660730455, 2.9490512257290407,
                  2.7385825936085215]),
        # one of two roots between which the residual comes to 9.1e-10
        ("ar4", [-1.611883606173275, -2.5761486601803623, -1.570899601452263, 0.47842766165614736, -0.7096764853685502,
                 -1.3689599663962295]),
    ],
)  # fmt: skip
def test_the_judge_takes_no_posture_for_lost_that_is_on_a_branch_s_component(name: str, q: list[float]) -> None:
    arm, screw = shipped_arm(name)
    task, _ = solver(arm, None)
    verdict = truth.judge(arm, screw, None, np.array([q]), goal_of_joints(task, screw, np.array([q])).array())
    assert verdict, str(verdict)


def test_a_rounded_rotation_is_made_orthonormal_first() -> None:
    arm = shipped_arm("puma560")[0]
    q = np.random.default_rng(0).uniform(-2, 2, (300, 6))
    T = armkin.fk(arm, q)
    for rounded_T in (np.asarray(T, np.float32), np.round(T, 7)):
        s = armkin.ik(arm, rounded_T)
        assert (s.valid.sum(axis=1) == 8).all()
        assert (s.rounding > 1e-9).all()
        assert (s.rounding < 1e-6).all()
        R = s.target[:, :3, :3]
        np.testing.assert_allclose(R @ np.swapaxes(R, 1, 2), np.tile(np.eye(3), (300, 1, 1)), atol=1e-15)
        np.testing.assert_allclose(R, rounded_T[:, :3, :3], atol=1e-6)
        assert np.nanmax(s.residual()[0]) < 1e-9
        assert np.nanmax(s.residual()[1]) < 1e-12
    assert (armkin.ik(arm, T).rounding < 1e-14).all()
    skewed = T[0].copy()
    skewed[0, 0] += 1e-5
    with pytest.raises(UsageError, match="a rotation to 5e-6"):
        armkin.ik(arm, skewed)


def test_a_rounded_pose_takes_no_second_look(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor does one of an arm a thousand times as long: the closed form's own answers are accepted."""
    examined: list[int] = []
    examine = groups.examine

    def count_and_call(goals: Goals, *arguments: object) -> object:
        examined.append(len(goals.target))
        return examine(goals, *arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(groups, "examine", count_and_call)
    arm = shipped_arm("puma560")[0]
    q = np.random.default_rng(0).uniform(-2, 2, (1000, 6))
    link = arm.link.copy()
    link[:, :3, 3] *= 1000
    for sized_arm in (arm, from_links(link, arm.prismatic)):
        s = armkin.ik(sized_arm, np.asarray(armkin.fk(sized_arm, q)), "pose")
        assert (s.valid.sum(axis=1) == 8).all()
        s = armkin.ik(sized_arm, np.round(armkin.fk(sized_arm, q), 7), "pose")
        assert (s.valid.sum(axis=1) == 8).all()
    assert sum(examined) <= 8
