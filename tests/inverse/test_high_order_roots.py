"""Roots of high order and what lies beside them: points in a valley, complex roots, a root found many times."""

from __future__ import annotations

import numpy as np
import pytest
import truth
from geometries import case_of, right_angles
from oracle import goal_of_joints
from shipped_arms import shipped_arm

import armkin
from armkin import Status
from armkin.inverse.solvers.solver_of_arm import solver


@pytest.mark.parametrize("q", [[180, 180, 180, 180, -90, 0], [0, 180, 0, 0, 90, 90]])
def test_what_is_one_with_a_branch_takes_its_own_likes_along(q: list[float]) -> None:
    """A root of third order, found 18 times: a neighbour in its valley was one with some of these, and the others one
    more branch, 1e-7 rad away."""
    arm, screw, *_ = case_of(right_angles(np.random.default_rng(130)), "pose")
    task, _ = solver(arm, "pose")
    joints = np.radians([q])
    verdict = truth.judge(arm, screw, "pose", joints, goal_of_joints(task, screw, joints).array())
    assert verdict, verdict


@pytest.mark.parametrize(
    "q",
    [
        [
            -1.81528044303384,
            -0.578513013433144,
            1.28802382226464,
            -3.14159265459377,
            -1.16754010958679,
            -2.58009190677196,
        ],
        [1.79985719326818, 0.597891726666232, 1.26397661739479, -3.14159264632712, 1.90889802799518, 1.71036861976579],
    ],
)
def test_roots_of_third_order_on_a_self_motion_are_no_branches(q: list[float]) -> None:
    """Postures 1e-3 rad beside it solve the target to 1e-9, and so does what lies between them and the self-motion."""
    arm, screw, *_ = case_of(right_angles(np.random.default_rng(168)), "pose")
    task, _ = solver(arm, "pose")
    verdict = truth.judge(arm, screw, "pose", np.array([q]), goal_of_joints(task, screw, np.array([q])).array())
    assert verdict, verdict


@pytest.mark.parametrize("twist", [90.0, -90.0])
def test_a_quartic_that_says_nothing_leaves_its_joint_free(twist: float) -> None:
    """Joint 3 in one line with joint 1: any value will do."""
    rows = [(90.0, 100.0, 50.0), (twist, 100.0, 0.0), (0.0, 200.0, 0.0)]
    joints = [{"dh": {"alpha": alpha, "a": a, "d": d, "theta": 0.0}} for alpha, a, d in rows]
    arm, screw, *_ = case_of({"convention": "standard", "joints": joints}, "xyz")
    task, geometry = solver(arm, "xyz")
    assert geometry.why == "RRR: a quartic gives joint 3"
    q = np.radians([[20.0, 180.0, 70.0], [-100.0, 180.0, -130.0]])
    target = goal_of_joints(task, screw, q).array()
    for near in (None, q):
        verdict = truth.judge(arm, screw, "xyz", q, target, near)
        assert verdict, verdict
        s = verdict.solutions
        assert (s.status == Status.SINGULAR).all()
        assert s.free.tolist() == [[True, False, True]] * 2
        assert (s.valid.sum(axis=1) == 1).all()
    s = armkin.ik(arm, target, near=np.radians([40.0, 170.0, 50.0]))
    np.testing.assert_allclose(np.degrees(s.q[:, 0, 1:]), [[180.0, 50.0]] * 2, atol=1e-9)


@pytest.mark.parametrize("q", [[180, 90, -90, -90, -90, 0], [180, 90, 180, -90, -90, 180], [0, -90, 0, -90, -90, 180]])
def test_complex_roots_of_a_quartic_are_no_branches(q: list[float]) -> None:
    """Of a spherical shoulder: put back onto the unit circle they were a real root for the second and third time."""
    arm, screw, *_ = case_of(right_angles(np.random.default_rng(39)), "pose")
    task, geometry = solver(arm, "pose")
    assert geometry.name == "spherical shoulder"
    joints = np.radians([q])
    verdict = truth.judge(arm, screw, "pose", joints, goal_of_joints(task, screw, joints).array())
    assert verdict, verdict
    assert verdict.solutions.status[0] == Status.EXACT
    assert verdict.solutions.valid.sum() == 4


def test_two_roots_a_hair_apart_are_one_branch() -> None:
    arm = shipped_arm("three_dof")[0]
    s = armkin.ik(arm, [342.9180457599, 209.5308314133, 383.6095610676])
    assert s.status == Status.BOUNDARY
    assert s.valid.sum() == 2  # left and right, each with its elbow straight
    rng = np.random.default_rng(6)
    q = rng.uniform(-3, 3, (400, 3))
    q[:, 2] = 0.0
    T = armkin.fk(arm, q)[:, :3, 3]
    for digits in (9, 10, 12):
        s = armkin.ik(arm, np.round(T, digits))
        inside = s.status != Status.UNREACHABLE
        assert (s.valid.sum(axis=1)[inside] == 2).all()
        assert (s.status[inside] == Status.BOUNDARY).all()


def test_a_lost_branch_is_no_complete_answer() -> None:
    """A JACO posture with an isolated branch of singular value 9e-4, beside a singular one."""
    arm, screw = shipped_arm("jaco_j2n6s300")
    task, _ = solver(arm, None)
    q = np.radians([[0, -90, 90, 90, 0, -90]])
    target = goal_of_joints(task, screw, q).array()
    verdict = truth.judge(arm, screw, None, q, target)
    truth.ask_oracle(arm, screw, verdict, target, np.arange(1), 250, 1)
    assert verdict


@pytest.mark.parametrize(
    ("name", "q", "count"),
    [
        # six isolated branches and one self-motion, off which a curved valley leads at a corner
        ("fanuc_crx10ia", [0, 180, 90, 90, 90, 90], 7),
        # roots of third order in curved valleys: points up to 6e-3 rad away are none of their own
        (4, [135, 180, 45, -90, 0, 45], 1),
        (4, [45, 0, 45, -90, 135, 0], 1),
        (168, [90, 180, 0, -90, 90, 90], 4),
        (168, [0, 0, 0, -90, -90, 0], 4),
    ],
)
def test_points_in_a_curved_valley_are_one_branch(name: str | int, q: list[float], count: int) -> None:
    arm, screw = (
        shipped_arm(name) if isinstance(name, str) else case_of(right_angles(np.random.default_rng(name)), "pose")[:2]
    )
    task, _ = solver(arm, "pose")
    joints = np.radians([q])
    for near in (None, joints):
        verdict = truth.judge(arm, screw, "pose", joints, goal_of_joints(task, screw, joints).array(), near)
        assert verdict, verdict
        assert verdict.solutions.valid.sum() == count
