"""Targets at which several directions are lost, or pencils say nothing: what people type at round postures."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import truth
from geometries import case_of, right_angles
from oracle import goal_of_joints
from shipped_arms import shipped_arm

import armkin
from armkin import Status
from armkin.inverse.closed import anywhere
from armkin.inverse.solvers.solver_of_arm import solver


@pytest.mark.parametrize(
    ("name", "q"),
    [
        # two postures of one self-motion, grouped around others
        ("thor", [-135, 135, 0, 0, 0, 90]),
        ("iiwa7", [135, 135, 0, 180, 180, 90]),
        ("ur10e", [90, 90, 0, 90, 180, 180]),
        # a self-motion that meets the one which the preferred joint 1 gives
        ("wx250s", [-90, -90, 90, 180, 180, -90]),
        ("wx250s", [-135, 90, 90, 45, 0, -45]),
        # self-motions and double roots that the elimination misses at the target itself
        ("fanuc_crx10ia", [0, 90, -90, 0, 0, 90]),
        ("fanuc_crx10ia", [0, 0, 180, -90, 180, 90]),
        ("fanuc_crx10ia", [0, 0, 135, 90, 0, -45]),
        ("fanuc_crx10ia", [180, 90, -90, 0, 45, 180]),
        ("fanuc_crx10ia", [0, -90, 45, -90, 0, -135]),
        ("jaco_j2n6s300", [-90, 180, 0, -90, 0, 0]),
        ("jaco_j2n6s300", [45, 45, -135, 90, 0, -45]),
        # axes 1 and 4 in one line, among three lost directions
        ("fanuc_crx10ia", [0, 180, 90, -90, 180, -90]),
        ("fanuc_crx10ia", [90, 0, 90, 180, 180, 0]),
        # a root of third order on the self-motion of joints 1 and 4: points beside it are no branches
        ("fanuc_crx10ia", [135, 0, 90, 90, -135, 135]),
        ("fanuc_crx10ia", [-135, 180, 90, -135, 135, -135]),
        # points of the valley beside that self-motion, one with it, do not stand for it
        ("fanuc_crx10ia", [-90, 0, 90, -45, 90, -90]),
        ("fanuc_crx10ia", [-90, 180, 90, -90, 90, 180]),
        # self-motions of double roots, known to 1e-8 rad: two postures of each were listed
        ("stanford", [90, 0, 660, -90, 180, -90]),
        ("iiwa7", [90, -45, 0, 180, 0, 0]),
        ("fanuc_crx10ia", [0, 0, -90, 180, -135, 90]),
        ("fanuc_crx10ia", [-90, 90, -90, 0, -90, 180]),
        # and of these, corners that stand for no more than they are
        ("fanuc_crx10ia", [0, -90, -90, 180, 90, 90]),
        ("fanuc_crx10ia", [90, 180, -90, -90, 180, -90]),
        # axes 1 and 4 all but in one line: along the self-motion joints 5 and 6 move, but hardly
        ("ar4", [-92.3614960864, -12.1627815347, -77.8216738881, 64.4795069076, -81.4669898141, -144.7874410383]),
        # a corner that its own self-motion passes, seen from a hair beside it
        ("ur5e", [-90, -90, 180, -90, 0, -90]),
    ],
)
def test_compound_singularities(name: str, q: list[float]) -> None:
    arm, screw = shipped_arm(name)
    task, _ = solver(arm, None)
    joints = np.where(arm.prismatic, [q], np.radians([q]))
    for near in (None, joints):
        verdict = truth.judge(arm, screw, None, joints, goal_of_joints(task, screw, joints).array(), near)
        assert verdict, verdict


@pytest.mark.parametrize(
    ("name", "q"),
    [
        # a short step is drawn back into the corner, and ends 1e-4 rad beside it in joints that do not move
        ("thor", [180, 90, 180, -90, 180, -90]),
        ("ar4", [-90, 0, 90, 180, 180, 180]),
        ("fanuc_crx10ia", [0, 0, -90, 0, 0, 0]),
        ("ur10e", [180, 90, 0, 90, 0, -90]),
        ("ur3e", [90, -90, 180, 90, 180, 0]),
        # a self-motion of roots of high order, which are 3e-5 rad off
        ("thor", [90, 0, 180, 0, 90, 0]),
    ],
)
def test_joints_called_free_do_move(name: str, q: list[float]) -> None:
    arm, screw = shipped_arm(name)
    task, _ = solver(arm, None)
    target = goal_of_joints(task, screw, np.radians([q])).array()
    s = armkin.ik(arm, target)
    assert s.status == Status.SINGULAR
    assert s.free.any()
    assert truth.idle_free_joints(screw, s, target) == []


@pytest.mark.parametrize("q", [[0, -90, 0, -90, 0, 90], [180, 180, 0, 180, 180, 180], [-90, -90, 0, 0, 180, -90]])
def test_compound_singularities_of_a_ur5e(q: list[float]) -> None:
    arm = shipped_arm("ur5e")[0]
    joints = np.radians(q)
    s = armkin.ik(arm, armkin.fk(arm, joints))
    assert s.status in (Status.SINGULAR, Status.BOUNDARY)  # stretched straight up it cannot move
    assert s.valid.any()
    assert {"J2", "J3", "J4", "J6"} >= {name for name, free in zip(arm.joint_names, s.free, strict=True) if free}
    s = armkin.ik(arm, armkin.fk(arm, joints), near=joints)
    np.testing.assert_allclose(s.q[s.best], joints, atol=1e-12)


@pytest.mark.parametrize(
    ("seed", "q"),
    [
        (0, [-90, -90, 180, 90, 180, -90]),  # a corner of the workspace: no target beside it can be reached
        (0, [-45, -90, 45, -135, 0, -135]),
        (4, [90, 90, 0, 180, 0, 180]),  # regular, but the main pencil is singular at this target
        (4, [-90, -90, 0, 180, 90, -90]),
        (4, [-135, -90, 45, -135, -90, 90]),
        # nothing settles these: only Newton's method from many starts tells that they are reached
        (0, [0, -90, 90, -90, 90, 90]),
        (4, [180, 90, 180, -90, 180, -90]),
        (4, [180, 90, 180, -90, 180, 90]),
        (4, [0, 90, -90, 90, 90, 180]),  # and these are roots of sixth order, which it only approaches
        (4, [0, -90, -90, 90, 90, -90]),
        (80, [0, 90, 0, -90, -90, 0]),  # a self-motion of which a target moved a little shows nothing
    ],
)
@pytest.mark.parametrize("closed", [False, True])
def test_singular_pencils_of_right_angled_arms(
    seed: int, q: list[float], closed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the elimination finds for the target itself is no proof that there is nothing."""
    arm, screw, *_ = case_of(right_angles(np.random.default_rng(seed)), "pose")
    arm = replace(arm)  # its solver is kept by arm, and others of this process have the same one
    if not closed:
        monkeypatch.setattr(anywhere, "_Loop", SimpleNamespace(of=lambda *_: None))
    task, geometry = solver(arm, "pose")
    assert (geometry.name == "general elimination") != closed
    joints = np.radians([q])
    target = goal_of_joints(task, screw, joints).array()
    for near in (None, joints):
        verdict = truth.judge(arm, screw, "pose", joints, target, near)
        truth.ask_oracle(arm, screw, verdict, target, np.arange(1), 60, 1)
        assert verdict, verdict


@pytest.mark.parametrize(
    ("q", "count"),
    [
        # joint 1 hardly moves: at the value that `near` has for it, two of the four self-motions have no posture
        ([75, 20, 40, 30, 80], 4),
        ([-60, 65, 5, 20, -15], 4),
        # beside this posture it moves by 1e-4 rad, and another of the same self-motion was listed
        ([0, 75, -80, 95, -80], 1),
    ],
)
def test_a_tool_that_points_straight_down_by_its_axis(q: list[float], count: int) -> None:
    """An SO-101 turns about a vertical tool: what is listed does not depend on where it stands."""
    arm, _ = shipped_arm("so101")
    joints = np.radians(q)
    T = armkin.fk(arm, joints)
    for near in (None, joints):
        s = armkin.ik(arm, [*T[:3, 3], 0, 0, -1], "xyz_axis", near=near)
        assert s.status == Status.SINGULAR
        assert s.valid.sum() == count
        assert not s.complete


def test_a_tool_along_parallel_axes_by_its_axis() -> None:
    """An SO-100: joints 2, 3 and 4 move by themselves on either side; one side was lost, and complete true."""
    arm, _ = shipped_arm("so100")
    joints = np.radians([120, 0, -150, -60, 0])
    T = armkin.fk(arm, joints)
    for near in (None, joints):
        s = armkin.ik(arm, [*T[:3, 3], *T[:3, 2]], "xyz_axis", near=near)
        assert sorted(np.degrees(s.q[s.valid][:, 0]).round(6)) == [-60, 120]
        assert s.free.tolist() == [False, True, True, True, False]


@pytest.mark.parametrize("q", [[-45, 180, -135], [10, 180, 20], [30, 180, 45], [20, 180, -30]])
def test_poses_of_three_joints_of_which_two_are_in_one_line(q: list[float]) -> None:
    """Axes 1 and 3 coincide: ten postures of their self-motion were isolated branches, and the answer complete."""
    right = {"alpha": 90, "a": 100, "d": 0, "theta": 0}
    rows = [right, right, {"alpha": 0, "a": 100, "d": 0, "theta": 0}]
    arm, *_ = case_of({"convention": "standard", "joints": [{"dh": row} for row in rows]}, "pose")
    s = armkin.ik(arm, armkin.fk(arm, np.radians(q)), "pose")
    assert s.status == Status.SINGULAR
    assert s.free.tolist() == [True, False, True]
    assert s.valid.sum() == 1
    turned = np.degrees(s.q[0])
    assert abs(abs(turned[1]) - 180) < 1e-6
    assert abs(np.sin(np.radians(turned[0] + turned[2] - q[0] - q[2]) / 2)) < 1e-8


def test_a_pose_that_only_a_moved_target_settled_is_not_complete() -> None:
    arm, screw, *_ = case_of(right_angles(np.random.default_rng(80)), "pose")
    task, _ = solver(arm, "pose")
    s = armkin.ik(arm, goal_of_joints(task, screw, np.radians([[0, 90, 0, -90, -90, 0]])).array(), "pose")
    assert s.status[0] == Status.SINGULAR
    assert s.free[0].tolist() == [False, True, True, True, False, True]
    assert s.valid.sum() == 3
    assert not s.complete[0]
