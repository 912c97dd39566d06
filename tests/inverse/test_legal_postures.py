"""Edges of which other postures than those closest to `near` are within limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from oracle import goal_of_joints, pose_error
from shipped_arms import shipped_arm

import armkin
from armkin import Status
from armkin.inverse.numeric import newton
from armkin.inverse.numeric.newton import misses as missed

CASES = [
    # joint 4 is outside its limits where joint 1 is closest to home, and not where it is turned
    ("thor", None, [-90, 0, 0, -90, -90, 0], Status.SINGULAR),
    # an SO-101 that points straight down: joint 5 may turn, joint 1 hardly
    ("so101", "xyz_axis", [-5, -85, -95, -90, 90], Status.SINGULAR),
    # a double root at a limit of joint 5, which rounding moves by 2e-8 rad beyond it
    ("stanford", None, [45, 0, 902, -45, -90, 45], Status.BOUNDARY),
]


@pytest.mark.parametrize(("name", "task", "q", "status"), CASES)
def test_a_legal_posture_of_an_edge_is_listed(name: str, task: str | None, q: list[float], status: Status) -> None:
    """No branch was within limits, and the nearest pose within limits 0.0000 mm away."""
    arm, screw = shipped_arm(name)
    joints = np.where(arm.prismatic, q, np.radians(q))
    target = armkin.fk(arm, joints)
    if task is not None:
        target = np.array([*target[:3, 3], 0.0, 0.0, -1.0])
    s = armkin.ik(arm, target, task)
    assert s.status == status
    assert s.best >= 0
    legal = s.q[s.best]
    assert (legal >= arm.lower - 1e-9).all()
    assert (legal <= arm.upper + 1e-9).all()
    mm, rad = pose_error(screw, goal_of_joints(s.task, screw, joints[None]), legal[None])
    assert mm[0] < 1e-9 * arm.reach
    assert rad[0] < 1e-8
    second_target = armkin.fk(arm, joints * 0.9)
    second_target = np.array([*second_target[:3, 3], *second_target[:3, 2]]) if task is not None else second_target
    batch = armkin.ik(arm, np.array([second_target, target]), task)
    np.testing.assert_array_equal(batch.q[1][batch.valid[1]], s.q[s.valid])


def test_what_else_was_found_stays_beside_a_legal_posture() -> None:
    """Self-motions cross where `near` stands, outside its limits; those of joints 4 and 6 were listed no more."""
    arm, _ = shipped_arm("wx250s")
    q = np.radians([0.0, 90, 90, 180, 180, 180])
    s = armkin.ik(arm, armkin.fk(arm, q), near=q)
    assert s.best >= 0
    listed = s.q[s.valid]
    assert len(listed) == 8
    same = np.abs(newton.difference(arm, listed, q))[:, [0, 1, 2, 4]].max(axis=1) < 1e-9
    assert same.sum() == 1


def test_two_roots_in_one_stay_a_boundary_where_a_legal_one_is_found() -> None:
    arm = armkin.load("planar_2dof")
    q = np.array([0.3, 1e-5])  # all but stretched, and outside its limits by less than arithmetic can tell
    lower, upper = arm.lower.copy(), arm.upper.copy()
    lower[1], upper[1] = -1e-5 + 5e-8, 1e-5 - 5e-8
    arm = replace(arm, lower=lower, upper=upper)
    s = armkin.ik(arm, armkin.fk(arm, q)[:2, 3], "xy", near=[0.1, 0.2])
    assert s.best >= 0
    assert s.status == Status.BOUNDARY


def narrow_limits(robot: str, width: float) -> tuple[armkin.Arm, np.random.Generator]:
    """An arm with a wrist whose joints have so many degrees each, around random middles; joint 5 passes zero."""
    arm, rng = armkin.load(robot), np.random.default_rng(4)
    middle = rng.uniform(-1, 1, arm.n)
    middle[4] = 0.0
    half = np.radians(width) / 2
    return replace(arm, lower=middle - half, upper=middle + half), rng


@pytest.mark.parametrize("width", [40, 150])
@pytest.mark.parametrize("robot", ["irb120", "puma560", "wx250s"])
def test_what_stands_within_limits_is_not_said_to_be_outside(robot: str, width: float) -> None:
    """A quarter of these were: listed was where joint 4 or joint 6 is as in `near`, and the other one was outside."""
    arm, rng = narrow_limits(robot, width)
    q, near = rng.uniform(arm.lower, arm.upper, (2, 120, arm.n))
    q[:, 4] = 0.0
    target = armkin.fk(arm, q)
    solutions = armkin.ik(arm, target, near=near)
    assert (solutions.status == armkin.Status.SINGULAR).all()
    assert (solutions.best >= 0).all()
    best = solutions.q[np.arange(len(q)), solutions.best]
    assert ((best >= arm.lower) & (best <= arm.upper)).all()
    assert missed(arm, solutions.task, best, target).max() < 1e-9
    for k in range(5):
        single = armkin.ik(arm, target[k], near=near[k])
        np.testing.assert_allclose(single.q[single.best], best[k], atol=1e-12)


def test_near_outside_limits_gives_way_to_a_posture_within() -> None:
    """Joint 4 at -180 degrees is beyond its -160; with joint 6 turned back it need not stand there."""
    arm = armkin.load("irb120")
    near = np.radians([45.0, 90.0, 0.0, -180.0, 0.0, 45.0])
    solutions = armkin.ik(arm, armkin.fk(arm, near), near=near)
    assert solutions.within_limits.any()
    np.testing.assert_allclose(armkin.fk(arm, solutions.q[solutions.best]), armkin.fk(arm, near), atol=1e-6)
