"""Self-motions that meet others or pass close by: each is listed once, and none is lost."""

from __future__ import annotations

import numpy as np
import pytest
import truth
from geometries import case_of, right_angles
from oracle import goal_of_joints, weakness
from shipped_arms import shipped_arm

import armkin
from armkin import Status
from armkin.inverse.solvers.solver_of_arm import solver


def test_points_of_a_self_motion_beside_its_crossing_are_no_branches() -> None:
    """Where another one crosses, postures 1e-6 rad beside it solve the target to rounding."""
    arm, screw, *_ = case_of(right_angles(np.random.default_rng(168)), "pose")
    task, _ = solver(arm, "pose")
    q = np.array([[1.94395758534494, -0.2752189104766, 1.68745465008634, 9.1e-11, 1.93145804841238, 0.17129731932685]])
    for near in (None, q):
        verdict = truth.judge(arm, screw, "pose", q, goal_of_joints(task, screw, q).array(), near)
        assert verdict, verdict
        assert verdict.solutions.free[0].tolist() == [False, False, True, False, True, False]
    assert armkin.ik(arm, goal_of_joints(task, screw, q).array(), "pose").valid.sum() == 2


@pytest.mark.parametrize("q", [[0, 0, -90, -90, 180, -90], [-135, 180, -90, -45, 0, 45], [-90, -90, -90, 0, 90, 180]])
def test_self_motions_that_meet_are_listed_once_each_and_none_by_its_corner(q: list[float]) -> None:
    """Two of joints 1 and 4 and two of joints 2 and 5, which cross four times: their corners were listed instead."""
    arm, screw = shipped_arm("fanuc_crx10ia")
    task, _ = solver(arm, "pose")
    joints = np.radians([q])
    goals = goal_of_joints(task, screw, joints)
    for near in (None, joints):
        verdict = truth.judge(arm, screw, "pose", joints, goals.array(), near)
        assert verdict, verdict
        listed = verdict.solutions.q[0][verdict.solutions.valid[0]]
        across = np.abs(np.cos(listed[:, 0])) < 1e-12  # joint 1 at 90 or -90: joints 2 and 5 move
        assert sorted(np.sin(listed[across, 0]).round(9)) == [-1, 1]
        assert sorted(np.cos(listed[~across, 1]).round(9)) == [-1, 1]  # joint 2 at 180 or 0: joints 1 and 4
        assert weakness(screw, goals.take([0] * 4), listed).max() < 1e-15


@pytest.mark.parametrize(
    ("seed", "q"),
    [
        (
            1089,
            [-90, -90, 0, 180, 90, 180],
        ),  # joint 2 is free where joint 3 is a double root, which rounding parts by 1e-8
        (1089, [0, -90, 0, 180, 90, 180]),  # eight places where self-motions meet, each found four times
        (1089, [-90, 90, 0, -90, 0, -90]),  # the wrist is in line at a round value of joint 2
        (1089, [0, 135, 0, 45, -90, 135]),  # where it is, the second singular value rises unevenly
        # the branches change places there, and another singular value is smaller between the steps
        (1037, [135, 0, 90, -135, -90, -45]),
        (1037, [-90, 0, 90, 180, -90, 180]),
    ],
)
def test_a_wrist_is_in_line_somewhere_on_a_self_motion_of_the_shoulder(seed: int, q: list[float]) -> None:
    arm, screw, *_ = case_of(right_angles(np.random.default_rng(seed)), "pose")
    task, geometry = solver(arm, "pose")
    assert geometry.name == "spherical wrist"
    joints = np.radians([q])
    verdict = truth.judge(arm, screw, "pose", joints, goal_of_joints(task, screw, joints).array())
    assert verdict, verdict


@pytest.mark.parametrize("q", [[-90, 90, 180, -90, 0, 90], [180, 90, 90, -90, -90, -90], [0, 90, 135, -90, -90, -90]])
def test_a_self_motion_of_two_dimensions_that_meets_another(q: list[float]) -> None:
    """Five axes through one point: joints 2 and 6, 3 and 5 move in pairs, and where joint 2 is at 90 joints 1, 3, 5."""
    arm, screw, *_ = case_of(right_angles(np.random.default_rng(3152)), "pose")
    task, _ = solver(arm, "pose")
    joints = np.radians([q])
    target = goal_of_joints(task, screw, joints).array()
    for near in (None, joints):
        verdict = truth.judge(arm, screw, "pose", joints, target, near)
        assert verdict, verdict
        assert not verdict.solutions.complete[0]


@pytest.mark.parametrize("q", [[-90, 0, -90, 90, -90, 0], [180, 180, 90, -90, -90, -90]])
def test_two_axes_in_line_where_three_directions_are_lost(q: list[float]) -> None:
    """Joints 3 and 5 turn about one line: of all directions lost that one alone holds the joints beside these."""
    arm, screw, *_ = case_of(right_angles(np.random.default_rng(2385)), "pose")
    task, _ = solver(arm, "pose")
    joints = np.radians([q])
    verdict = truth.judge(arm, screw, "pose", joints, goal_of_joints(task, screw, joints).array())
    assert verdict, verdict
    assert verdict.solutions.free[0].tolist() == [False, False, True, False, True, False]


def test_a_folded_arm_of_equal_links_beside_its_kite() -> None:
    """Joints 2 and 4 alone move the folded arm; it meets the four-bar motion that moves joints 3 and 6 as well."""
    rows = zip([90, 0, 0, 90, -90, 0], [0, -200, -200, 0, 0, 0], [100, 0, 0, 100, 100, 100], strict=True)
    joints = [{"dh": {"alpha": alpha, "a": a, "d": d, "theta": 0}} for alpha, a, d in rows]
    arm = case_of({"convention": "standard", "joints": joints}, "pose").arm
    target = armkin.fk(arm, np.radians([0.0, 90.0, 180.0, 0.0, 0.0, 180.0]))
    for near in ([0.0, 0.0, 0.0, 0.0, 0.0, 0.0], [10.0, 20.0, 30.0, 40.0, 50.0, 60.0]):
        s = armkin.ik(arm, target, near=np.radians(near))
        folded = np.abs(np.cos(s.q[s.valid][:, 2]) + 1.0) < 1e-9
        assert (int(folded.sum()), int(s.valid.sum())) == (1, 6)


def test_self_motions_that_cross_are_found_from_anywhere() -> None:
    """Joint 1 turns with the wrist; where the wrist is straight joints 4 and 6 turn. From some 4 of 8 were found."""
    arm, _ = shipped_arm("wx250s")
    target = armkin.fk(arm, np.radians([0.0, 90.0, 90.0, 90.0, 180.0, 0.0]))
    near = np.radians([[47, -79, -158, -166, 108, 142], [123, -160, 79, -112, 125, 14], [32, -56, -37, 134, -94, 42]])
    for posture in near:
        assert armkin.ik(arm, target, near=posture).valid.sum() == 8


def test_a_self_motion_that_hardly_turns_joint_6_is_listed_once() -> None:
    """Axes 1 and 4 all but in one line: while they turn by 57 degrees joint 6 turns by 0.07, and there were two."""
    arm, _ = shipped_arm("irb2400")
    q = [-15.117339140, -160.561638794, -109.409431080, -58.906870688, -21.966855012, 96.853237894]
    s = armkin.ik(arm, armkin.fk(arm, np.radians(q)))
    assert s.status == Status.SINGULAR
    assert s.valid.sum() == 4


@pytest.mark.parametrize("q", [[90, 0, -90, 180, -90, 0], [180, -90, 90, 180, 90, 90]])
def test_surfaces_that_may_not_all_be_listed_are_not_called_complete(q: list[float]) -> None:
    """J3 and J5 of a folded iiwa7 share a line, and where two surfaces meet three directions are lost."""
    arm = armkin.lock(armkin.load("iiwa7"), {"J7": -0.7941})
    solutions = armkin.ik(arm, armkin.fk(arm, np.radians(q)))
    assert solutions.status == Status.SINGULAR
    assert solutions.free.tolist() == [True, True, True, False, True, True]
    assert solutions.valid.sum() >= 2 or not solutions.complete
