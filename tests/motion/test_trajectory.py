"""Laws of trajectories: bounded, from rest to rest, the same however they are sampled; said without a board."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armkin.model import build_arm as arms
from armkin.model.arm import Arm, from_links
from armkin.motion.joint_moves import approach_move, plan_joint_moves
from armkin.motion.timing.cubic_knots import Knots
from armkin.motion.timing.curved_stretch import Curve
from armkin.motion.timing.limit_jerk import Smoothed
from armkin.motion.timing.profile import trapezoid
from armkin.motion.timing.trajectory import Straight

_DIFFERENCED = 1e-6  # of a jerk: what differences of accelerations leave of it


@pytest.fixture(scope="module")
def three_dof() -> Arm:
    return arms.load_arm("robots/three_dof.yaml")


@settings(max_examples=60, deadline=None)
@given(st.floats(1e-3, 1e4), st.floats(1e-2, 1e3), st.floats(1e-2, 1e4))
def test_a_trapezoid_is_bounded_and_ends_at_rest(length: float, speed: float, accel: float) -> None:
    law = trapezoid(length, speed, accel)
    t = np.linspace(0, law.duration, 500)
    x, v, a = (law.evaluate(t, order) for order in range(3))
    assert x[0] == 0
    assert x[-1] == pytest.approx(length)
    assert np.all(np.diff(x) >= -1e-12 * length)
    assert v.max() <= speed * (1 + 1e-12)
    assert np.abs(a).max() <= accel * (1 + 1e-12)
    assert v[-1] == pytest.approx(0, abs=1e-12 * accel * law.duration)
    # No law with these bounds is faster: it cruises, or it has no cruise and reaches sqrt(a l).
    assert law.peak == pytest.approx(min(speed, np.sqrt(accel * length)))


def test_position_speed_and_acceleration_belong_together(three_dof: Arm) -> None:
    goals = np.deg2rad([[-30, 5, -5], [20, 60, -60], [20, 60, -60], [0, 90, -90]])
    trajectory = plan_joint_moves(three_dof, three_dof.home, goals, speed=0.7)
    t, h = np.linspace(0, trajectory.duration, 4001)[1:-1], 1e-5
    laws = [s.law for s in trajectory.stretches if isinstance(s, Straight)]
    assert len(laws) == len(trajectory.stretches)
    edges = np.concatenate([law.times + b for law, b in zip(laws, trajectory.begins, strict=False)])
    clear = np.abs(t[:, None] - edges).min(axis=1) > 2 * h
    assert np.allclose(trajectory.qd(t)[clear], (trajectory.q(t + h) - trajectory.q(t - h))[clear] / (2 * h), atol=1e-7)
    assert np.allclose(
        trajectory.qdd(t)[clear], (trajectory.qd(t + h) - trajectory.qd(t - h))[clear] / (2 * h), atol=1e-6
    )
    assert np.all(np.abs(trajectory.qd(t)) <= 0.7 * three_dof.max_speed * (1 + 1e-12))
    assert np.all(np.abs(trajectory.qdd(t)) <= three_dof.max_accel * (1 + 1e-12))
    assert trajectory.q(trajectory.begins) == pytest.approx(np.vstack([three_dof.home, goals]))
    assert trajectory.q([[-1.0, trajectory.duration + 1]]) == pytest.approx(np.array([[three_dof.home, goals[-1]]]))
    assert trajectory.q(0.5).shape == (3,)


def test_joint_moves_keep_the_max_jerk_of_the_robot_file(three_dof: Arm) -> None:
    jerk = np.deg2rad([100.0, 100.0, 400.0])
    arm = replace(three_dof, max_jerk=jerk)
    goals = np.deg2rad(np.array([[0, 80, -90], [60, 20, -20], [60, 20.5, -20], [0, 90, 90]]))
    trajectory = plan_joint_moves(arm, arm.home, goals)
    assert trajectory.begins[1] == pytest.approx((32 * 10 / 100) ** (1 / 3))  # no law with this jerk is faster
    t = np.linspace(0, trajectory.duration, 40_001)
    changes = np.diff(trajectory.qdd(t), axis=0) / t[1]
    assert np.abs(changes / jerk).max() == pytest.approx(1.0, abs=_DIFFERENCED)
    without = plan_joint_moves(three_dof, arm.home, goals)
    assert without.begins[1] == pytest.approx(2 * np.sqrt(10 / 120))
    assert all(stretch.law.is_trapezoid for stretch in without.stretches if isinstance(stretch, Straight))
    way_back = approach_move(arm, goals[0], arm.home)
    assert way_back is not None
    assert way_back.duration == pytest.approx(trajectory.begins[1])


def test_no_times_have_no_rows(three_dof: Arm) -> None:
    path = Knots(np.array([0.0, 1.0]), np.stack([three_dof.home, three_dof.home + 0.1]), np.full((2, 3), 0.1))
    curve = Curve(path, np.ones(2))
    straight = Straight(three_dof.home, three_dof.home + 0.1, trapezoid(1.0, 1.0, 1.0))
    for stretch in (straight, curve, Smoothed(curve, 0.5)):
        for derivative in range(3):
            assert stretch.evaluate(np.zeros(0), derivative).shape == (0, 3)


def test_an_arm_without_drives_has_trajectories() -> None:
    arm = arms.load_arm("robots/three_dof.yaml")
    bare = from_links(
        arm.link, arm.prismatic, limits=np.stack([arm.lower, arm.upper], 1), max_speed=arm.max_speed,
        max_accel=arm.max_accel,
    )  # fmt: skip
    goal = np.deg2rad([60, 90, -90])
    assert plan_joint_moves(bare, [0, np.pi / 2, -np.pi / 2], goal).duration == pytest.approx(1.5)
