"""Classification that does not break: axes off by anything between rounding and a thousandth."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from geometries import random_case
from ik_checks import Report, examine_answers, random_joints
from moved_axes import OFF, move_axes
from shipped_arms import shipped_arm

import armkin
from armkin.inverse.numeric import newton
from armkin.inverse.solvers.solver_of_arm import solver


def check_case(name: str, size: float, seed: int, count: int) -> Report:
    case = random_case(name, seed)
    arm, screw = move_axes(case.arm, size, seed)
    report = examine_answers(arm, screw, case.task, random_joints(screw, count, seed))
    assert not report.lost.any(), f"{size:.0e}: {report.lost.sum()} lost; {report.weak[report.lost]}"
    assert report.mm < 1e-9 * arm.reach
    assert report.deg < 1e-9
    assert report.duplicates == 0
    return report


@pytest.mark.parametrize("first", range(0, len(OFF), 2))
@pytest.mark.parametrize(
    "name",
    [
        "RRR 1 || 2", "RRR 2 || 3", "RRR 1 meets 2", "RRR 2 meets 3", "RRR orthogonal, 1 meets 2",
        "RRR anthropomorphic",
        "RPR right angles", "PRR right angles", "RRP spherical", "RPP cylindrical",
        "planar RR", "planar RRR", "planar RRP", "planar PRR", "planar PRP", "SCARA, P at 1", "SCARA, P at 3",
        "pitch arm, 4 joints, usual table", "pitch arm, 5 joints, usual table", "pitch arm, 4 joints, slide first",
    ],
)  # fmt: skip
def test_short_arms(name: str, first: int, sample: Callable[[int, int], int]) -> None:
    """Of two neighbouring sizes the gate takes one for half the arms, the other for the rest."""
    two = OFF[first : first + 2] if len(name) % 2 else OFF[first : first + 2][::-1]
    for size in two[: sample(2, 1)]:
        for seed in range(sample(2, 1)):
            check_case(name, size, seed, sample(40, 16))


@pytest.mark.parametrize("size", [1e-13, 1e-11, 1e-8, 1e-5, 1e-3])
@pytest.mark.parametrize(
    "name",
    [
        "spherical wrist, elbow",
        "RPR and spherical wrist",
        "spherical shoulder",
        "UR table",
        "three parallel axes 3, 4, 5",
    ],
)
def test_six_joints(name: str, size: float) -> None:
    report = check_case(name, size, 1, 30)
    # nobody claims to have proved what rests on the neighbour of an arm
    s = report.solutions
    assert s.complete.any() == (not s.method.startswith("near"))
    if size > 1e-12 and s.method.startswith("near"):
        assert "corrected on the true arm" in s.why


@pytest.mark.parametrize(
    "name", ["spherical wrist, elbow", "UR table", "pitch arm, 5 joints, usual table", "RRR 1 || 2"]
)
def test_as_many_branches_as_the_ideal_arm(name: str) -> None:
    """Away from singular postures a small change of the arm neither makes nor loses branches."""
    case = random_case(name, 3)
    q = random_joints(case.screw, 60, 2)
    ideal = examine_answers(case.arm, case.screw, case.task, q)
    arm, screw = move_axes(case.arm, 1e-8, 4)
    report = examine_answers(arm, screw, case.task, q)
    strong = (ideal.weak > 1e-2) & (report.weak > 1e-2)
    assert strong.sum() > 20
    same = ideal.counts[strong] == report.counts[strong]
    assert same.mean() > 0.95  # others of their branches may be near a singularity


def test_names_of_near_arms_are_those_of_the_ideal_one() -> None:
    case = random_case("spherical wrist, elbow", 0)
    q = random_joints(case.screw, 50, 3)
    ideal = examine_answers(case.arm, case.screw, case.task, q).solutions
    arm, screw = move_axes(case.arm, 1e-7, 0)
    near = examine_answers(arm, screw, case.task, q).solutions
    assert not near.method.startswith("spherical")  # the elimination, or the class's own branches corrected
    for k in range(50):
        for b in np.flatnonzero(near.valid[k]):
            d = ideal.q[k] - near.q[k, b]
            d = np.abs(d - 2 * np.pi * np.rint(d / (2 * np.pi))).max(axis=1)
            if np.nanmin(d) < 1e-4:
                twin = int(np.nanargmin(d))
                assert ideal.names[ideal.branch[k, twin]] == near.names[near.branch[k, b]]


def test_rounded_tables() -> None:
    """pi/2 as 1.5708 and 90 as 89.99998: all eight branches of a Puma."""
    from geometries import case_of

    angle = float(np.degrees(1.5708))
    rows = [(angle, 0, 0), (0, 431.8, 0), (-angle, 20.3, 150.05), (angle, 0, 431.8), (-angle, 0, 0), (0, 0, 56.25)]
    joints = [{"dh": {"alpha": al, "a": a, "d": d, "theta": 0}} for al, a, d in rows]
    c = case_of({"convention": "standard", "joints": joints}, "pose")
    report = examine_answers(c.arm, c.screw, c.task, random_joints(c.screw, 200, 7))
    assert not report.lost.any()
    assert report.counts.mean() > 7.9
    assert report.mm < 1e-9


@pytest.mark.parametrize("size", [1e-8, 1e-5, 1e-3])
@pytest.mark.parametrize("name", ["three_dof", "labvolt_5150", "ur5e", "irb120"])
def test_singular_neighbourhoods(name: str, size: float, sample: Callable[[int, int], int]) -> None:
    """Some poses of thousands lie as close to a singularity as the arm to its class; none is lost."""
    arm, screw = move_axes(shipped_arm(name)[0], size, 1)
    report = examine_answers(arm, screw, None, random_joints(screw, sample(3000, 1000), 1))
    assert not report.lost.any(), f"{report.weak[report.lost]}"


def test_folds_far_apart() -> None:
    """A sliding pitch arm 1e-3 off: the two branches of a fold lie half a radian apart."""
    case = random_case("pitch arm, 5 joints, slide first", 12)
    arm, screw = move_axes(case.arm, 1e-3, 12)
    report = examine_answers(arm, screw, case.task, random_joints(screw, 1000, 12))
    assert not report.lost.any()


@pytest.mark.parametrize("size", [1e-5, 1e-4, 1e-3, 1e-2])
def test_four_roots_of_three_joints_are_all(size: float, sample: Callable[[int, int], int]) -> None:
    """Seeds and Newton steps in straight-line code: `complete` where four are there, by the quartic's degree."""
    arm, screw = move_axes(armkin.load("three_dof"), size, 5)
    case_joints = random_joints(screw, sample(2000, 500), 5)
    report = examine_answers(arm, screw, "xyz", case_joints)
    solutions = report.solutions
    assert not report.lost.any()
    assert report.duplicates == 0
    four = solutions.valid.sum(axis=1) == 4
    assert four.mean() > 0.94
    assert solutions.complete.all()  # where seeds do not lead to four, the pencil has them all
    compiled = armkin.compile(arm).ik(solutions.target)
    assert (compiled.valid == solutions.valid).all()
    assert (compiled.complete == solutions.complete).all()
    near = np.isclose(compiled.q, solutions.q, atol=1e-7, rtol=0.0) | ~solutions.valid[..., None]
    assert near.mean() > 0.999
    k = np.flatnonzero(four)[0]
    alone = armkin.ik(arm, solutions.target[k])
    assert np.allclose(alone.q[alone.valid], solutions.q[k][solutions.valid[k]], atol=1e-9)


@pytest.mark.parametrize("size", [1e-8, 1e-6, 1e-4, 1e-3])
@pytest.mark.parametrize("name", ["RRR 1 meets 2", "RRR 1 || 2", "RRR anthropomorphic"])
def test_the_pencil_has_all_roots_of_a_near_arm(name: str, size: float) -> None:
    """Generating joints are among the real roots; the others come in complex pairs.

    Beyond the reach no root is real; where it begins, two of them meet.
    """
    arm, screw = move_axes(random_case(name, 1).arm, size, 2)
    _, geometry = solver(arm, "xyz")
    assert geometry.doubts is not None
    assert geometry.doubts.rows is not None
    q = random_joints(screw, 300, 3)
    target = armkin.fk(arm, q)[:, :3, 3]
    seeds = geometry.doubts.rows(target)
    away = newton.wrapped_distance(arm, seeds.q, q[:, None])
    hit = np.nanmin(np.where(np.isnan(away), 9.0, away), axis=1) < 1e-6
    assert (hit | seeds.doubt).all()
    assert seeds.doubt.mean() < 0.02
    assert (np.isfinite(seeds.q[..., 0]).sum(axis=1)[~seeds.doubt] % 2 == 0).all()  # complex roots come in pairs
    assert seeds.complete.all()
    beyond = geometry.doubts.rows(target * (3.0 * arm.reach / np.linalg.norm(target, axis=1))[:, None])
    assert np.isnan(beyond.q).all()
    assert not beyond.doubt.any()


@pytest.mark.parametrize("name", ["planar RR", "SCARA, P at 1", "pitch arm, 5 joints", "UR table"])
def test_no_target_at_all(name: str) -> None:
    case = random_case(name, 1)
    arm, screw = move_axes(case.arm, 1e-5, 1)
    single_report = examine_answers(arm, screw, case.task, random_joints(screw, 1, 1))
    s = armkin.ik(arm, single_report.goals.array()[:0], case.task)
    assert (s.q.shape, s.method) == ((0, *s.q.shape[1:]), single_report.solutions.method)


@pytest.mark.parametrize("size", [1e-5, 1e-4, 1e-3])
def test_both_branches_of_a_stretched_scara(size: float) -> None:
    """Where the elbow is nearly straight, corrections of one seed each leave it open; the pair keeps its names."""
    arm, screw = move_axes(armkin.load("cobra600"), size, 5)
    q = random_joints(screw, 400, 6)
    rng = np.random.default_rng(7)
    q[:, 1] = np.pi * rng.integers(0, 2, 400) + rng.choice([-1, 1], 400) * 10 ** rng.uniform(-2.9, -1, 400)
    report = examine_answers(arm, screw, "xyz_yaw", q)
    solutions = report.solutions
    assert not report.lost.any()
    assert report.duplicates == 0
    two = (solutions.valid.sum(axis=1) == 2) & (solutions.branch[:, :2] == [0, 1]).all(
        axis=1
    )  # none of a number of its own
    assert two.mean() > 0.99
    bent = newton.wrapped_distance(arm, solutions.q[two, 0], solutions.q[two, 1]) > 0.0
    side = np.sin(solutions.q[two, 0, 1] - solutions.q[two, 1, 1]) * np.cos(solutions.q[two, 0, 1])
    assert bent.all()
    assert (side > 0.0).all()  # one elbow is on one side of the fold, wherever that is
    assert not solutions.complete.any()
    target = solutions.target.reshape(400, -1)
    for k in range(30):  # the plain numbers of one target know no infinity
        assert armkin.ik(arm, target[k]).valid.sum() == solutions.valid[k].sum()
