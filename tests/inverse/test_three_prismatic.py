"""Arms of three slides and three turning joints where they are singular: slides in one plane, a wrist in line."""

from __future__ import annotations

import numpy as np
import pytest
import truth
from geometries import AXIS, Case, case_of, random_case, random_screws
from ik_checks import examine_answers, random_joints
from moved_axes import move_axes
from oracle import goal_of_joints

import armkin
from armkin import Status
from armkin.inverse.solvers.solver_of_arm import solver


def gantry_case(pattern: str, axes: str) -> Case:
    """Axes along x, y, z at points at random: no two that turn meet."""
    return case_of(random_screws(np.random.default_rng(3), pattern, [AXIS[a] for a in axes], [None] * 6), "pose")


@pytest.mark.parametrize("pattern", ["RPRPRP", "PRRPRP"])
def test_slides_in_one_plane_move_alone(pattern: str) -> None:
    """Three of 29 such targets were answered by the other branch alone: a pseudoinverse had lost their digits."""
    name = "RPRPRP general"
    arm, screw, task = random_case(name, 0)
    if pattern != "RPRPRP":
        rng = np.random.default_rng(5)
        arm, screw, task = case_of(random_screws(rng, pattern, [None] * 6, [None] * 6), "pose")
    definition, _ = solver(arm, task)
    kinds = truth.singular_postures(arm, screw, task, 12)
    assert kinds
    for q in kinds.values():
        target = goal_of_joints(definition, screw, q).array()
        for near in (None, q):
            verdict = truth.judge(arm, screw, task, q, target, near)
            assert verdict, verdict
            assert verdict.solutions.complete.all()


@pytest.mark.parametrize(
    ("pattern", "axes", "turning"),
    [("PPPRRR", "xyzzxz", "J4 J6"), ("RPPRPR", "zzxyyz", "J1 J6"), ("RPRPRP", "zzyxzy", "J1 J5")],
)
def test_a_wrist_in_line_is_a_self_motion(pattern: str, axes: str, turning: str) -> None:
    """Axes 1 and 3 of those that turn are parallel; such targets were all called unreachable."""
    arm, screw, task = gantry_case(pattern, axes)
    definition, _ = solver(arm, task)
    middle = np.flatnonzero(~arm.prismatic)[1]
    for value in (0.0, np.pi):
        q = np.random.default_rng(1).uniform(-3, 3, (12, 6)) * np.where(arm.prismatic, 100.0, 1.0)
        q[:, middle] = value
        target = goal_of_joints(definition, screw, q).array()
        for near in (None, q):
            verdict = truth.judge(arm, screw, task, q, target, near)
            assert verdict, verdict
            s = verdict.solutions
            assert (s.status == Status.SINGULAR).all()
            assert s.complete.all() == (pattern != "RPRPRP")
            joints = [name in turning.split() for name in arm.joint_names]
            assert (s.free[:, ~arm.prismatic] == np.array(joints)[~arm.prismatic]).all()


@pytest.mark.parametrize("seed", [7, 18, 52, 67, 75])
def test_what_only_some_values_of_a_free_joint_reach_is_found(seed: int) -> None:
    """Axes 1 and 3 parallel, or two orientations in one, and slides in one plane: up to 16 of 36 were unreachable.

    Such answers are not called complete; those of arms whose slides turn together are.
    """
    rng = np.random.default_rng([78, seed])
    pattern = "".join(rng.permutation(list("RRRPPP")))
    axes = [np.eye(3)[rng.integers(3)] * rng.choice([-1.0, 1.0]) for _ in range(6)]
    points = [rng.choice([0.0, 0.0, 100.0, 200.0, -150.0], 3) for _ in range(6)]
    arm, screw, _ = case_of(random_screws(rng, pattern, axes, points), "pose")
    definition, _ = solver(arm, "pose")
    q = truth.round_postures(arm, 90, 8, seed=seed)
    target = goal_of_joints(definition, screw, q).array()
    for near in (None, q):
        verdict = truth.judge(arm, screw, "pose", q, target, near)
        assert verdict, verdict
    assert not verdict.solutions.complete.all()


@pytest.mark.parametrize("angle", [1e-13, 1e-11, 1e-9, 1e-7, 1e-5, 1e-3])
def test_nearly_in_line_nothing_is_lost(angle: float) -> None:
    arm, screw, task = gantry_case("PPPRRR", "xyzzxz")
    definition, _ = solver(arm, task)
    q = np.random.default_rng(2).uniform(-3, 3, (20, 6)) * np.where(arm.prismatic, 100.0, 1.0)
    q[:, 4] = angle
    verdict = truth.judge(arm, screw, task, q, goal_of_joints(definition, screw, q).array())
    assert verdict, verdict
    assert (verdict.solutions.status != Status.SINGULAR).all() == (angle > 5e-8)


@pytest.mark.parametrize("rows", [(), (3,), (0,)])
def test_a_batch_without_any_branch_has_no_best_one(rows: tuple[int, ...]) -> None:
    """It was a ValueError: there is no column of branches at all."""
    arm, _, task = random_case("RPRPRP general", 0)
    T = np.eye(4)
    T[:3, :3] = np.diag([-1.0, -1.0, 1.0])
    s = armkin.ik(arm, np.broadcast_to(T, (*rows, 4, 4)), task)
    assert (s.status == Status.UNREACHABLE).all()
    assert s.best.shape == rows
    assert (s.best == -1).all()


@pytest.mark.parametrize("size", [1e-9, 1e-7, 1e-5])
def test_slides_millions_of_links_long_lose_nothing(size: float) -> None:
    """Of a wrist all but in a point the loop's unit is as small: 5 of 200 targets were answered by one branch alone,
    and called complete."""
    arm, screw = move_axes(random_case("PPP and spherical wrist", 1).arm, size, 1)
    report = examine_answers(arm, screw, "pose", random_joints(screw, 200, 1))
    assert not report.lost.any()
    assert (report.counts == 2).all()
