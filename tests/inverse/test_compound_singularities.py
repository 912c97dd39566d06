"""Targets at which several things meet: crossing self-motions, roots of high order, pencils that say nothing."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import truth
from geometries import case, right_angles
from oracle import goal, weakness
from test_every_branch import shipped

import armkin
from armkin import Status
from armkin.inverse.closed import anywhere
from armkin.inverse.recognise import solver


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
    arm, screw = shipped(name)
    task, _ = solver(arm, None)
    joints = np.where(arm.prismatic, [q], np.radians([q]))
    for near in (None, joints):
        verdict = truth.judge(arm, screw, None, joints, goal(task, screw, joints).array(), near)
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
    arm, screw = shipped(name)
    task, _ = solver(arm, None)
    target = goal(task, screw, np.radians([q])).array()
    s = armkin.ik(arm, target)
    assert s.status == Status.SINGULAR
    assert s.free.any()
    assert truth.idle(screw, s, target) == []


@pytest.mark.parametrize("q", [[0, -90, 0, -90, 0, 90], [180, 180, 0, 180, 180, 180], [-90, -90, 0, 0, 180, -90]])
def test_compound_singularities_of_a_ur5e(q: list[float]) -> None:
    arm = shipped("ur5e")[0]
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
    arm, screw, *_ = case(right_angles(np.random.default_rng(seed)), "pose")
    if not closed:
        monkeypatch.setattr(anywhere, "_Loop", SimpleNamespace(of=lambda *_: None))
    task, geometry = solver(arm, "pose")
    assert (geometry.name == "general elimination") != closed
    joints = np.radians([q])
    target = goal(task, screw, joints).array()
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
    arm, _ = shipped("so101")
    joints = np.radians(q)
    T = armkin.fk(arm, joints)
    for near in (None, joints):
        s = armkin.ik(arm, [*T[:3, 3], 0, 0, -1], "xyz_axis", near=near)
        assert s.status == Status.SINGULAR
        assert s.valid.sum() == count
        assert not s.complete


def test_a_tool_along_parallel_axes_by_its_axis() -> None:
    """An SO-100: joints 2, 3 and 4 move by themselves on either side; one side was lost, and complete true."""
    arm, _ = shipped("so100")
    joints = np.radians([120, 0, -150, -60, 0])
    T = armkin.fk(arm, joints)
    for near in (None, joints):
        s = armkin.ik(arm, [*T[:3, 3], *T[:3, 2]], "xyz_axis", near=near)
        assert sorted(np.degrees(s.q[s.valid][:, 0]).round(6)) == [-60, 120]
        assert s.free.tolist() == [False, True, True, True, False]


@pytest.mark.parametrize("q", [[180, 180, 180, 180, -90, 0], [0, 180, 0, 0, 90, 90]])
def test_what_is_one_with_a_branch_takes_its_own_likes_along(q: list[float]) -> None:
    """A root of third order, found 18 times: a neighbour in its valley was one with some of these, and the others one
    more branch, 1e-7 rad away."""
    arm, screw, *_ = case(right_angles(np.random.default_rng(130)), "pose")
    task, _ = solver(arm, "pose")
    joints = np.radians([q])
    verdict = truth.judge(arm, screw, "pose", joints, goal(task, screw, joints).array())
    assert verdict, verdict


@pytest.mark.parametrize("q", [[-45, 180, -135], [10, 180, 20], [30, 180, 45], [20, 180, -30]])
def test_poses_of_three_joints_of_which_two_are_in_one_line(q: list[float]) -> None:
    """Axes 1 and 3 coincide: ten postures of their self-motion were isolated branches, and the answer complete."""
    right = {"alpha": 90, "a": 100, "d": 0, "theta": 0}
    rows = [right, right, {"alpha": 0, "a": 100, "d": 0, "theta": 0}]
    arm, *_ = case({"convention": "standard", "joints": [{"dh": row} for row in rows]}, "pose")
    s = armkin.ik(arm, armkin.fk(arm, np.radians(q)), "pose")
    assert s.status == Status.SINGULAR
    assert s.free.tolist() == [True, False, True]
    assert s.valid.sum() == 1
    turned = np.degrees(s.q[0])
    assert abs(abs(turned[1]) - 180) < 1e-6
    assert abs(np.sin(np.radians(turned[0] + turned[2] - q[0] - q[2]) / 2)) < 1e-8


def test_a_pose_that_only_a_moved_target_settled_is_not_complete() -> None:
    arm, screw, *_ = case(right_angles(np.random.default_rng(80)), "pose")
    task, _ = solver(arm, "pose")
    s = armkin.ik(arm, goal(task, screw, np.radians([[0, 90, 0, -90, -90, 0]])).array(), "pose")
    assert s.status[0] == Status.SINGULAR
    assert s.free[0].tolist() == [False, True, True, True, False, True]
    assert s.valid.sum() == 3
    assert not s.complete[0]


def test_points_of_a_self_motion_beside_its_crossing_are_no_branches() -> None:
    """Where another one crosses, postures 1e-6 rad beside it solve the target to rounding."""
    arm, screw, *_ = case(right_angles(np.random.default_rng(168)), "pose")
    task, _ = solver(arm, "pose")
    q = np.array([[1.94395758534494, -0.2752189104766, 1.68745465008634, 9.1e-11, 1.93145804841238, 0.17129731932685]])
    for near in (None, q):
        verdict = truth.judge(arm, screw, "pose", q, goal(task, screw, q).array(), near)
        assert verdict, verdict
        assert verdict.solutions.free[0].tolist() == [False, False, True, False, True, False]
    assert armkin.ik(arm, goal(task, screw, q).array(), "pose").valid.sum() == 2


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
    arm, screw, *_ = case(right_angles(np.random.default_rng(168)), "pose")
    task, _ = solver(arm, "pose")
    verdict = truth.judge(arm, screw, "pose", np.array([q]), goal(task, screw, np.array([q])).array())
    assert verdict, verdict


@pytest.mark.parametrize("twist", [90.0, -90.0])
def test_a_quartic_that_says_nothing_leaves_its_joint_free(twist: float) -> None:
    """Joint 3 in one line with joint 1: any value will do."""
    rows = [(90.0, 100.0, 50.0), (twist, 100.0, 0.0), (0.0, 200.0, 0.0)]
    joints = [{"dh": {"alpha": alpha, "a": a, "d": d, "theta": 0.0}} for alpha, a, d in rows]
    arm, screw, *_ = case({"convention": "standard", "joints": joints}, "xyz")
    task, geometry = solver(arm, "xyz")
    assert geometry.why == "RRR: a quartic gives joint 3"
    q = np.radians([[20.0, 180.0, 70.0], [-100.0, 180.0, -130.0]])
    target = goal(task, screw, q).array()
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
    arm, screw, *_ = case(right_angles(np.random.default_rng(39)), "pose")
    task, geometry = solver(arm, "pose")
    assert geometry.name == "spherical shoulder"
    joints = np.radians([q])
    verdict = truth.judge(arm, screw, "pose", joints, goal(task, screw, joints).array())
    assert verdict, verdict
    assert verdict.solutions.status[0] == Status.EXACT
    assert verdict.solutions.valid.sum() == 4


def test_two_roots_a_hair_apart_are_one_branch() -> None:
    arm = shipped("three_dof")[0]
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
    arm, screw = shipped("jaco_j2n6s300")
    task, _ = solver(arm, None)
    q = np.radians([[0, -90, 90, 90, 0, -90]])
    target = goal(task, screw, q).array()
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
    arm, screw = shipped(name) if isinstance(name, str) else case(right_angles(np.random.default_rng(name)), "pose")[:2]
    task, _ = solver(arm, "pose")
    joints = np.radians([q])
    for near in (None, joints):
        verdict = truth.judge(arm, screw, "pose", joints, goal(task, screw, joints).array(), near)
        assert verdict, verdict
        assert verdict.solutions.valid.sum() == count


@pytest.mark.parametrize("q", [[0, 0, -90, -90, 180, -90], [-135, 180, -90, -45, 0, 45], [-90, -90, -90, 0, 90, 180]])
def test_self_motions_that_meet_are_listed_once_each_and_none_by_its_corner(q: list[float]) -> None:
    """Two of joints 1 and 4 and two of joints 2 and 5, which cross four times: their corners were listed instead."""
    arm, screw = shipped("fanuc_crx10ia")
    task, _ = solver(arm, "pose")
    joints = np.radians([q])
    at = goal(task, screw, joints)
    for near in (None, joints):
        verdict = truth.judge(arm, screw, "pose", joints, at.array(), near)
        assert verdict, verdict
        found = verdict.solutions.q[0][verdict.solutions.valid[0]]
        across = np.abs(np.cos(found[:, 0])) < 1e-12  # joint 1 at 90 or -90: joints 2 and 5 move
        assert sorted(np.sin(found[across, 0]).round(9)) == [-1, 1]
        assert sorted(np.cos(found[~across, 1]).round(9)) == [-1, 1]  # joint 2 at 180 or 0: joints 1 and 4
        assert weakness(screw, at.take([0] * 4), found).max() < 1e-15


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
    arm, screw, *_ = case(right_angles(np.random.default_rng(seed)), "pose")
    task, geometry = solver(arm, "pose")
    assert geometry.name == "spherical wrist"
    joints = np.radians([q])
    verdict = truth.judge(arm, screw, "pose", joints, goal(task, screw, joints).array())
    assert verdict, verdict


@pytest.mark.parametrize("q", [[-90, 90, 180, -90, 0, 90], [180, 90, 90, -90, -90, -90], [0, 90, 135, -90, -90, -90]])
def test_a_self_motion_of_two_dimensions_that_meets_another(q: list[float]) -> None:
    """Five axes through one point: joints 2 and 6, 3 and 5 move in pairs, and where joint 2 is at 90 joints 1, 3, 5."""
    arm, screw, *_ = case(right_angles(np.random.default_rng(3152)), "pose")
    task, _ = solver(arm, "pose")
    joints = np.radians([q])
    target = goal(task, screw, joints).array()
    for near in (None, joints):
        verdict = truth.judge(arm, screw, "pose", joints, target, near)
        assert verdict, verdict
        assert not verdict.solutions.complete[0]


def test_a_folded_arm_of_equal_links_beside_its_kite() -> None:
    """Joints 2 and 4 alone move the folded arm; it meets the four-bar motion that moves joints 3 and 6 as well."""
    rows = zip([90, 0, 0, 90, -90, 0], [0, -200, -200, 0, 0, 0], [100, 0, 0, 100, 100, 100], strict=True)
    joints = [{"dh": {"alpha": alpha, "a": a, "d": d, "theta": 0}} for alpha, a, d in rows]
    arm = case({"convention": "standard", "joints": joints}, "pose").arm
    target = armkin.fk(arm, np.radians([0.0, 90.0, 180.0, 0.0, 0.0, 180.0]))
    for near in ([0.0, 0.0, 0.0, 0.0, 0.0, 0.0], [10.0, 20.0, 30.0, 40.0, 50.0, 60.0]):
        s = armkin.ik(arm, target, near=np.radians(near))
        folded = np.abs(np.cos(s.q[s.valid][:, 2]) + 1.0) < 1e-9
        assert (int(folded.sum()), int(s.valid.sum())) == (1, 6)


def test_self_motions_that_cross_are_found_from_anywhere() -> None:
    """Joint 1 turns with the wrist; where the wrist is straight joints 4 and 6 turn. From some 4 of 8 were found."""
    arm, _ = shipped("wx250s")
    target = armkin.fk(arm, np.radians([0.0, 90.0, 90.0, 90.0, 180.0, 0.0]))
    near = np.radians([[47, -79, -158, -166, 108, 142], [123, -160, 79, -112, 125, 14], [32, -56, -37, 134, -94, 42]])
    for one in near:
        assert armkin.ik(arm, target, near=one).valid.sum() == 8


def test_a_self_motion_that_hardly_turns_joint_6_is_listed_once() -> None:
    """Axes 1 and 4 all but in one line: while they turn by 57 degrees joint 6 turns by 0.07, and there were two."""
    arm, _ = shipped("irb2400")
    q = [-15.117339140, -160.561638794, -109.409431080, -58.906870688, -21.966855012, 96.853237894]
    s = armkin.ik(arm, armkin.fk(arm, np.radians(q)))
    assert s.status == Status.SINGULAR
    assert s.valid.sum() == 4
