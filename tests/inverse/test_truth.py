"""What people ask: round postures, singular surfaces, rounded targets, `near` at the answer.

These are samples; `python tests/bench/check_ik.py --postures --surfaces --rounded` asks thousands.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import truth
from geometries import case, right_angles
from oracle import Screws, distance, goal, newton, screws
from test_every_branch import NAMES, shipped

import armkin
from armkin import Status
from armkin.errors import UsageError
from armkin.inverse import singularities
from armkin.inverse.recognise import solver
from armkin.model.arm import Arm, from_links

ROBOTS = Path(__file__).parents[2] / "robots"


def load(name: str) -> Arm:
    return armkin.load(ROBOTS / f"{name}.yaml")


# ---- samples of the tables -----------------------------------------------------------------------------------


def judged(
    arm: Arm, screw: Screws, kinds: dict[str, np.ndarray], target: np.ndarray, near: np.ndarray | None = None
) -> tuple[truth.Verdict, str]:
    """Postures of several kinds and their targets, all judged in one call; and of which kind the wrong ones are."""
    q = np.concatenate(list(kinds.values()))
    verdict = truth.judge(arm, screw, None, q, target, near)
    kind = np.repeat(list(kinds), [len(each) for each in kinds.values()])
    wrong = {*verdict.unreachable, *verdict.lost, *verdict.false, *verdict.twice, *verdict.moves}
    return verdict, f"{sorted({str(kind[k]) for k in wrong})}: {verdict}"


@pytest.mark.parametrize("name", NAMES)
def test_round_postures(name: str) -> None:
    arm, screw = shipped(name)
    task, _ = solver(arm, None)
    kinds = {f"multiples of {step}": truth.round_postures(arm, step, 24, seed=1) for step in (90, 45)}
    q = np.concatenate(list(kinds.values()))
    for near in (None, q):
        verdict, what = judged(arm, screw, kinds, goal(task, screw, q).array(), near)
        assert verdict, what


@pytest.mark.parametrize("name", NAMES)
def test_singular_surfaces(name: str) -> None:
    arm, screw = shipped(name)
    task, _ = solver(arm, None)
    kinds = truth.singular_postures(arm, screw, None, 12, seed=1)
    assert kinds, "no singular surface found"
    q = np.concatenate(list(kinds.values()))
    target = goal(task, screw, q).array()
    for near in (None, q):
        verdict, what = judged(arm, screw, kinds, target, near)
        assert verdict, what
    verdict, what = judged(arm, screw, kinds, truth.typed(task, target, 9))
    verdict.lost = []  # what solves a target by 1e-9 no more than just is not asked for
    assert verdict, f"9 digits, {what}"


@pytest.mark.parametrize("name", NAMES)
def test_rounded_targets(name: str) -> None:
    arm, screw = shipped(name)
    task, _ = solver(arm, None)
    rng = np.random.default_rng(2)
    q = rng.uniform(-np.pi, np.pi, (24, arm.n))
    q = np.where(arm.prismatic, q * arm.reach / 10, q)
    target = goal(task, screw, q).array()
    asked = {f"{n} digits": truth.typed(task, target, n) for n in (3, 4, 5, 6, 7, 7.5, 8, 10, 13, 16)}
    if task.orientation == "full":
        asked |= {f"matrices of {n} digits": truth.printed(target, n) for n in (7, 7.5, 8, 10, 13, 16)}
    verdict, what = judged(arm, screw, dict.fromkeys(asked, q), np.concatenate(list(asked.values())))
    assert verdict, what


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
    ],
)
def test_compound_singularities(name: str, q: list[float]) -> None:
    arm, screw = shipped(name)
    task, _ = solver(arm, None)
    joints = np.radians([q])
    for near in (None, joints):
        verdict = truth.judge(arm, screw, None, joints, goal(task, screw, joints).array(), near)
        assert verdict, verdict


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
def test_singular_pencils_of_right_angled_arms(seed: int, q: list[float]) -> None:
    """What the elimination finds for the target itself is no proof that there is nothing."""
    arm, screw, *_ = case(right_angles(np.random.default_rng(seed)), "pose")
    task, geometry = solver(arm, "pose")
    assert geometry.name == "general elimination"
    joints = np.radians([q])
    target = goal(task, screw, joints).array()
    for near in (None, joints):
        verdict = truth.judge(arm, screw, "pose", joints, target, near)
        truth.ask_oracle(arm, screw, verdict, target, np.arange(1), 60, 1)
        assert verdict, verdict


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


def test_the_judge_notices_answers_spoilt_on_purpose(monkeypatch: pytest.MonkeyPatch) -> None:
    arm, screw = shipped("ur5e")
    task, _ = solver(arm, None)
    q = np.random.default_rng(3).uniform(-np.pi, np.pi, (20, 6))
    q[10:, 4] = 0.0  # its wrist moves by itself
    target = goal(task, screw, q).array()
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


# ---- what was reported -----------------------------------------------------------------------------------------


def test_a_rounded_rotation_is_made_orthonormal_first() -> None:
    arm = load("puma560")
    q = np.random.default_rng(0).uniform(-2, 2, (300, 6))
    T = armkin.fk(arm, q)
    for given in (np.asarray(T, np.float32), np.round(T, 7)):
        s = armkin.ik(arm, given)
        assert (s.valid.sum(axis=1) == 8).all()
        assert (s.rounding > 1e-9).all()
        assert (s.rounding < 1e-6).all()
        R = s.target[:, :3, :3]
        np.testing.assert_allclose(R @ np.swapaxes(R, 1, 2), np.tile(np.eye(3), (300, 1, 1)), atol=1e-15)
        np.testing.assert_allclose(R, given[:, :3, :3], atol=1e-6)
        assert np.nanmax(s.residual()[0]) < 1e-9
        assert np.nanmax(s.residual()[1]) < 1e-12
    assert (armkin.ik(arm, T).rounding < 1e-14).all()
    off = T[0].copy()
    off[0, 0] += 2e-6
    with pytest.raises(UsageError, match="a rotation to 1e-6"):
        armkin.ik(arm, off)


def test_a_rounded_pose_takes_no_second_look(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor does one of an arm a thousand times as long: the closed form's own answers are accepted."""
    asked: list[int] = []
    examine = singularities.examine

    def counted(arm: Arm, task: object, q: np.ndarray, *rest: object) -> object:
        asked.append(len(q))
        return examine(arm, task, q, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(singularities, "examine", counted)
    arm = load("puma560")
    q = np.random.default_rng(0).uniform(-2, 2, (1000, 6))
    link = arm.link.copy()
    link[:, :3, 3] *= 1000
    for one in (arm, from_links(link, arm.prismatic)):
        s = armkin.ik(one, np.asarray(armkin.fk(one, q)), "pose")
        assert (s.valid.sum(axis=1) == 8).all()
        s = armkin.ik(one, np.round(armkin.fk(one, q), 7), "pose")
        assert (s.valid.sum(axis=1) == 8).all()
    assert sum(asked) <= 8


@pytest.mark.parametrize("q", [[0, -90, 0, -90, 0, 90], [180, 180, 0, 180, 180, 180], [-90, -90, 0, 0, 180, -90]])
def test_compound_singularities_of_a_ur5e(q: list[float]) -> None:
    arm = load("ur5e")
    joints = np.radians(q)
    s = armkin.ik(arm, armkin.fk(arm, joints))
    assert s.status in (Status.SINGULAR, Status.BOUNDARY)  # stretched straight up it cannot move
    assert s.valid.any()
    assert {"J2", "J3", "J4", "J6"} >= {name for name, free in zip(arm.joint_names, s.free, strict=True) if free}
    s = armkin.ik(arm, armkin.fk(arm, joints), near=joints)
    np.testing.assert_allclose(s.q[s.best], joints, atol=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_near_as_a_batch_is_near_one_by_one(name: str) -> None:
    arm, screw = shipped(name)
    task, _ = solver(arm, None)
    rng = np.random.default_rng(4)
    q = rng.uniform(-1, 1, (16, arm.n)) * np.where(arm.prismatic, arm.reach / 4, np.pi)
    q = np.concatenate([q, truth.round_postures(arm, 90, 8, seed=3), truth.round_postures(arm, 45, 8, seed=3)])
    target = goal(task, screw, q).array()
    near = q + (rng.random((32, 1)) < 0.7) * rng.normal(size=q.shape) * np.where(arm.prismatic, 50.0, 1.0)
    many = armkin.ik(arm, target, near=near)
    for k in range(32):
        one = armkin.ik(arm, target[k], near=near[k])
        assert (one.status, one.complete) == (many.status[k], many.complete[k])
        assert one.free.tolist() == many.free[k].tolist()
        assert one.valid.sum() == many.valid[k].sum()
        assert one.within_limits.sum() == many.within_limits[k].sum()
        assert (one.best < 0) == (many.best[k] < 0)
        if one.best >= 0:
            assert abs(one.motion[one.best] - many.motion[k, many.best[k]]) < 1e-4
        if one.valid.any():  # roots of a round target come in any order
            apart = distance(screw, one.q[one.valid][:, None], many.q[k][many.valid[k]][None])
            assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) < 1e-5


@pytest.mark.parametrize("name", NAMES)
def test_a_posture_on_its_limits_stays_where_its_target_is_rounded(name: str) -> None:
    """The exact answer for a rounded target may lie beyond the limit that `near`, which solves it, too, is on."""
    arm, screw = shipped(name)
    task, _ = solver(arm, None)
    rng = np.random.default_rng(12)
    q = rng.uniform(np.clip(arm.lower, -np.pi, np.pi), np.clip(arm.upper, -np.pi, np.pi), (30, arm.n))
    on = rng.random(q.shape) < 0.5
    ends = np.where(rng.random(q.shape) < 0.5, arm.lower, arm.upper)
    q = np.where(on & np.isfinite(ends), ends, q)
    target = goal(task, screw, q).array()
    kinds = {f"{n} digits": truth.typed(task, target, n) for n in (11, 12)}
    verdict, what = judged(
        arm, screw, dict.fromkeys(kinds, q), np.concatenate(list(kinds.values())), np.tile(q, (2, 1))
    )
    verdict.lost = []
    assert verdict, what


def test_a_posture_on_its_limit_stays_alone_and_in_a_batch() -> None:
    arm = load("kuka_kr6_r700")
    q = np.radians([0.0, 45.0, 0.0, 0.0, 90.0, 0.0])
    T = armkin.fk(arm, q)
    T[:3, 3] = np.round(T[:3, 3], 6)
    one, many = armkin.ik(arm, T, near=q), armkin.ik(arm, np.stack([T] * 3), near=q)
    np.testing.assert_allclose(one.q[one.best], q, atol=1e-12)
    np.testing.assert_allclose(many.q[np.arange(3), many.best], [q] * 3, atol=1e-12)
    assert one.status == Status.EXACT


def test_copies_are_the_legal_ones_nearest_to_near() -> None:
    """Against all copies, for limits of every kind."""
    from armkin.inverse.branches.turns import nearest_copy

    rng = np.random.default_rng(5)
    value = np.concatenate([rng.uniform(-np.pi, np.pi, 300), [np.pi, -np.pi, 0.0]])
    near = rng.uniform(-10, 10, len(value))
    turns = value[:, None] + 2 * np.pi * np.arange(-6, 7)
    for low, high in ((-np.pi, 2.0), (-2.0, np.pi), (-np.pi, np.pi), (-7, 1), (-1, 7), (-20, 20), (2, 5), (-9, -4)):
        copy, ok = nearest_copy(value, near, float(low), float(high))
        legal = (turns >= low - 1e-9) & (turns <= high + 1e-9)
        assert (np.broadcast_to(ok, value.shape) == legal.any(axis=1)).all(), (low, high)
        apart = np.where(legal, np.abs(turns - near[:, None]), np.inf).min(axis=1)
        some = legal.any(axis=1)
        np.testing.assert_allclose(np.abs(copy - near)[some], apart[some], atol=1e-9)
        np.testing.assert_allclose(copy[~some], value[~some], atol=1e-12)


def test_two_roots_a_hair_apart_are_one_branch() -> None:
    arm = load("three_dof")
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
    arm = load("jaco_j2n6s300")
    screw = screws(arm.file)
    task, _ = solver(arm, None)
    q = np.radians([[0, -90, 90, 90, 0, -90]])
    target = goal(task, screw, q).array()
    verdict = truth.judge(arm, screw, None, q, target)
    truth.ask_oracle(arm, screw, verdict, target, np.arange(1), 250, 1)
    assert verdict


@pytest.mark.parametrize("name", ["three_dof", "puma560", "stanford", "jaco_j2n6s300"])
def test_the_fifth_call_is_the_first_bit_for_bit(name: str) -> None:
    arm = load(name)
    q = np.random.default_rng(8).uniform(-1, 1, (40, arm.n))
    q = np.where(arm.prismatic, 300 * q, q)
    task, _ = solver(arm, None)
    T = goal(task, screws(arm.file), q).array()
    first, few = armkin.ik(arm, T[0]).q.tobytes(), armkin.ik(arm, T).q.tobytes()
    armkin.ik(arm, np.repeat(T, 4, axis=0))  # enough to be recorded
    for _ in range(5):
        assert armkin.ik(arm, T[0]).q.tobytes() == first
        assert armkin.ik(arm, T).q.tobytes() == few


@pytest.mark.parametrize("name", ["puma560", "ur5e", "jaco_j2n6s300", "moveo", "kinova_gen3"])
def test_random_poses_are_complete(name: str) -> None:
    arm, screw = shipped(name)
    task, _ = solver(arm, None)
    q = np.random.default_rng(9).uniform(-np.pi, np.pi, (500, arm.n))
    s = armkin.ik(arm, goal(task, screw, q).array())
    assert s.complete.mean() >= 0.99
