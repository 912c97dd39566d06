"""The truth about edges: boundaries, singular postures, self-motions, what lies just beyond."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from geometries import CLASSES, Case, case_of, random_case
from ik_checks import examine_answers, random_joints
from oracle import distance, forward, goal_of_joints, pose_error, screws_of

import armkin
from armkin import Status
from armkin.errors import UsageError
from armkin.inverse.run import edges
from armkin.inverse.solvers.solver_of_arm import solver

ROBOTS = Path(__file__).parents[2] / "robots"
QUARTER = np.pi / 2


def load_robot(name: str) -> armkin.Arm:
    return armkin.load(ROBOTS / f"{name}.yaml")


def free_joints(s: armkin.Solutions) -> list[str]:
    return [name for name, loose in zip(s.arm.joint_names, s.free, strict=True) if loose]


@pytest.mark.parametrize(
    ("name", "target", "status", "joints", "count"),
    [
        # on the base axis joint 1 is free; the two elbows remain
        ("yaw_two_link", [0, 0, 900], Status.SINGULAR, ["q1"], 2),
        # folded onto the shoulder joint 2 is free as well
        ("yaw_two_link", [0, 0, 660], Status.SINGULAR, ["q1", "q2"], 1),
        # stretched: both elbows are one, left and right remain
        ("yaw_two_link", [860, 0, 660], Status.BOUNDARY, [], 2),
        # 1e-10 of the reach inside: the straight posture solves the target as well as the two bent ones do
        ("yaw_two_link", [859.9999999, 0, 660], Status.BOUNDARY, [], 2),
        ("yaw_two_link", [859.99999, 0, 660], Status.EXACT, [], 4),
        ("yaw_two_link", [860.001, 0, 660], Status.UNREACHABLE, [], 0),
        ("three_dof", [0, 0, 300], Status.UNREACHABLE, [], 0),  # its shoulder is 10 mm off the axis
        ("three_dof", [0, 10, 367], Status.BOUNDARY, [], 2),  # left and right are one at that distance
        ("labvolt_5150", [0, 0, 400, 0, 0], Status.SINGULAR, ["q1"], 2),
        ("ra02", [0, 0, 300, 0.1], Status.SINGULAR, ["q1"], 2),
        ("ra02", [300, 0, 115, 0], Status.BOUNDARY, [], 1),
        ("ra02", [0, 0, 415, QUARTER], Status.SINGULAR, ["q1"], 1),
        ("planar_2dof", [500, 0], Status.BOUNDARY, [], 1),
        ("planar_2dof", [0, 100], Status.BOUNDARY, [], 1),  # folded
        ("planar_2dof", [501, 0], Status.UNREACHABLE, [], 0),
        ("planar_2dof", [99, 0], Status.UNREACHABLE, [], 0),
    ],
)
def test_status(name: str, target: list[float], status: Status, joints: list[str], count: int) -> None:
    s = armkin.ik(load_robot(name), target)
    assert s.status == status
    assert free_joints(s) == joints
    assert s.valid.sum() == count
    if count:
        assert s.residual()[0][s.valid].max() < 1e-9 * s.arm.reach  # home solves one of them so far


@pytest.mark.parametrize(
    ("name", "boundary", "count"), [("yaw_two_link", [860, 0, 660], 2), ("planar_2dof", [500, 0], 1)]
)
@pytest.mark.parametrize(("beyond", "reached"), [(1e-12, True), (5e-10, True), (3e-9, False)])
def test_just_beyond_the_boundary(name: str, boundary: list[float], count: int, beyond: float, reached: bool) -> None:
    """Less than 1e-9 of the reach outside is answered, with its residual; more is not."""
    arm = load_robot(name)
    s = armkin.ik(arm, [boundary[0] + arm.reach * beyond, *boundary[1:]])
    if reached:
        assert s.status == Status.BOUNDARY
        assert s.valid.sum() == count
        assert s.residual()[0][s.valid].max() <= 1e-9 * arm.reach
    else:
        assert s.status == Status.UNREACHABLE
        assert not s.valid.any()
        assert np.isnan(s.q).all()


@pytest.mark.parametrize(
    ("name", "elbow", "joint", "loose", "curves"),
    [
        # wrist stretched: axes 4 and 6 are one
        ("puma560", [-1.0, 1.2], 4, [3, 5], 1),
        ("irb120", [-1.0, 1.2], 4, [3, 5], 1),
        ("stanford", [0.5, 400], 4, [3, 5], 1),  # its joint 3 slides [mm]
        ("ar4", [-1.0, 1.2], 4, [3, 5], 1),
        # axis 6 parallel to 2, 3 and 4: a linkage of four bars, the elbow up or down
        ("ur5e", [-1.0, 1.2], 4, [1, 2, 3, 5], 2),
        ("ur3e", [-1.0, 1.2], 4, [1, 2, 3, 5], 2),
    ],
)
def test_a_wrist_singularity_is_a_self_motion(
    name: str, elbow: list[float], joint: int, loose: list[int], curves: int
) -> None:
    arm = load_robot(name)
    q = np.array([0.3, *elbow, -0.4, 0.0, 0.7])
    q[joint] = 0.0
    s = armkin.ik(arm, armkin.fk(arm, q), near=q)
    assert s.status == Status.SINGULAR
    assert np.flatnonzero(s.free).tolist() == loose
    assert np.abs(s.q[s.valid] - q).max(axis=1).min() < 1e-12
    # each curve is reported by one of its points: the same in every joint that is not free
    held = np.setdiff1d(np.arange(6), loose)
    turn = s.q[:, held] - q[held]
    turn -= np.where(arm.prismatic[held], 0.0, 2 * np.pi * np.rint(turn / (2 * np.pi)))
    assert (np.abs(turn[s.valid]).max(axis=1) < 1e-6).sum() == curves


def test_singular_answers_move_the_free_joint_least() -> None:
    """A target on the base axis: joint 1 stays where `near` has it."""
    arm = load_robot("yaw_two_link")
    s = armkin.ik(arm, [[0, 0, 900]] * 2, near=np.array([[0.7, 0, 0], [-0.2, 0, 0]]))
    np.testing.assert_allclose(np.cos(s.q[:, :2, 0] - [[0.7], [-0.2]]) ** 2, 1.0, atol=1e-12)


def test_tangent_roots_come_once() -> None:
    """Straight elbows: the double root is one branch, and the other branches stay."""
    arm = load_robot("labvolt_5150")
    screw = screws_of(arm.file)
    q = np.random.default_rng(1).uniform(-3, 3, (300, 5))
    q[:, 2] = 0.0
    task, _ = solver(arm, None)
    goals = goal_of_joints(task, screw, q)
    s = armkin.ik(arm, goals.array())
    assert (s.status == Status.BOUNDARY).all()
    rows, columns = np.nonzero(s.valid)
    mm, rad = pose_error(screw, goals.take(rows), s.q[rows, columns])
    assert mm.max() < 1e-9
    assert rad.max() < 1e-11
    straight = np.abs(np.sin(s.q[:, :, 2])) < 1e-4
    assert (straight & s.valid).sum(axis=1).max() == 1


@pytest.mark.parametrize("seed", range(6))
def test_double_roots_of_random_arms_are_kept(seed: int, sample: Callable[[int, int], int]) -> None:
    """Every kind of position arm on its singular surface, found by bisection along joint 3."""
    names = [name for name in CLASSES if CLASSES[name][1] == "xyz" and name.startswith("RR")]
    steps = 3 - sample(2, 1)  # the gate: one seed takes every second one, the next the others
    for name in names[seed % steps :: steps]:
        case = random_case(name, 400 + seed)
        rng = np.random.default_rng(seed)

        def determinant(q: np.ndarray, case: Case = case) -> np.ndarray:
            return np.asarray(np.linalg.det(armkin.jacobian(case.arm, q)[:, :3]))

        low = rng.uniform(-3, 3, (sample(200, 50), 3)) * np.where(case.arm.prismatic, 100, 1)
        high = low + np.array([0, 0, 1.0]) * np.where(case.arm.prismatic, 100, 1)
        change = determinant(low) * determinant(high) < 0
        low, high = low[change], high[change]
        sign = np.sign(determinant(low))
        for _ in range(60):
            middle = (low + high) / 2
            same = (np.sign(determinant(middle)) == sign)[:, None]
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        if not len(low):
            continue
        s = armkin.ik(case.arm, forward(case.screw, low)[:, :3, 3], "xyz")
        assert s.valid.any(axis=1).all(), name
        assert ((s.status == Status.BOUNDARY) | (s.status == Status.SINGULAR)).mean() > 0.95, name
        d = s.q - low[:, None]
        d = np.where(case.arm.prismatic, d / case.arm.reach, d - 2 * np.pi * np.rint(d / (2 * np.pi)))
        nearest = np.nanmin(np.abs(d).max(axis=2), axis=1)
        isolated = s.status == Status.BOUNDARY
        assert (nearest[isolated] < 1e-3).all(), name


@pytest.mark.parametrize("name", ["PRP", "RPP", "PPR"])
def test_arms_that_move_a_point_in_a_plane_are_refused(name: str) -> None:
    """Three joints, two degrees of freedom: every answer would be one of a curve."""
    from geometries import AXIS, case_of, random_screws

    plane = {"PRP": "xzy", "RPP": "zxy", "PPR": "xyz"}[name]
    rng = np.random.default_rng(0)
    arm = case_of(random_screws(rng, name, [AXIS[k] for k in plane], [None] * 3), "xyz").arm
    with pytest.raises(UsageError, match="can meet 2 at a time"):
        armkin.ik(arm, armkin.fk(arm, rng.uniform(-1, 1, (20, 3)))[:, :3, 3], "xyz")


@pytest.mark.parametrize(("kinds", "task"), [("RRR", "xyz"), ("PPPPPP", "pose"), ("RRRRRR", "pose")])
def test_arms_whose_axes_are_all_parallel_are_refused(kinds: str, task: str) -> None:
    """Such an arm reaches its own poses, on curves of solutions: 'unreachable' or 'complete' would be wrong."""
    from geometries import AXIS, case_of, random_screws

    rng = np.random.default_rng(0)
    n = len(kinds)
    arm = case_of(random_screws(rng, kinds, [AXIS["z"]] * n, [None] * n), task).arm
    with pytest.raises(UsageError, match="infinitely many solutions or none"):
        armkin.ik(arm, armkin.fk(arm, arm.home) if task == "pose" else [1, 2, 3], task)


def test_an_unreachable_pose_of_a_general_arm_of_few_joints() -> None:
    """No branch at all leaves no branch to name."""
    from geometries import AXIS, case_of, random_screws

    arm = case_of(random_screws(np.random.default_rng(0), "RR", [AXIS["z"], AXIS["x"]], [None] * 2), "pose").arm
    far = np.eye(4)
    far[:3, 3] = 1e9
    s = armkin.ik(arm, far, "pose")
    assert (int(s.status), bool(s.valid.any())) == (Status.UNREACHABLE, False)
    six = case_of(random_screws(np.random.default_rng(0), "RRRRRR", [None] * 6, [None] * 6), "pose").arm
    assert not armkin.ik(six, far, "pose").valid.any()


@pytest.mark.parametrize("name", [name for name in CLASSES if "P" in name])
def test_slides_far_longer_than_the_links(name: str, sample: Callable[[int, int], int]) -> None:
    """Right-angled and random postures, slides of up to 20 reaches; what is farther does not claim to be complete."""
    for seed in range(sample(3, 1)):
        c = random_case(name, seed)
        rng = np.random.default_rng(seed)
        shape = (sample(200, 200 if c.arm.n < 5 else 24), c.arm.n)
        turn = np.where(rng.random(shape) < 0.3, rng.uniform(-3, 3, shape), rng.integers(-1, 3, shape) * np.pi / 2)
        q = np.where(c.screw.prismatic, c.arm.reach * rng.uniform(-12, 12, shape), turn)
        report = examine_answers(c.arm, c.screw, c.task, q)
        assert not (report.lost & (report.solutions.status != Status.SINGULAR)).any()
        q = np.where(c.screw.prismatic, 100 * q, q)[: sample(200, 16)]
        assert not examine_answers(c.arm, c.screw, c.task, q).solutions.complete.all()


@pytest.mark.parametrize(
    ("name", "seed", "sample"),
    [("RRR 2 meets 3", 112, 12), ("RRR 2 meets 3", 114, 14), ("RRR orthogonal, no offsets", 118, 18)],
)
def test_neighbours_of_weak_jacobians_are_no_self_motion(name: str, seed: int, sample: int) -> None:
    """Among 50,000 random poses a few have isolated branches at singular values below 1e-6."""
    case = random_case(name, seed)
    report = examine_answers(case.arm, case.screw, case.task, random_joints(case.screw, 50_000, sample))
    assert report.weak.min() < 1e-6
    assert not report.lost.any()


def special_arms(count: int, seed: int) -> Iterator[Case]:
    """Three-joint arms of round angles and lengths, many of which are singular in whole families of postures."""
    rng = np.random.default_rng(seed)
    while count:
        rows = [
            {
                "dh": {
                    "alpha": float(rng.choice([0, 30, 45, 60, 90, -90, 180])),
                    "a": float(rng.choice([0, 0, 100, -100, 200])),
                    "d": float(rng.choice([0, 0, 50, 100])),
                    "theta": float(rng.choice([0, 90, 180])),
                },
                "type": str(kind),
            }
            for kind in rng.choice(["revolute", "prismatic"], 3, p=[0.6, 0.4])
        ]
        special = case_of({"convention": "standard", "joints": rows}, "xyz")
        with suppress(UsageError):  # its joints cannot place a point
            solver(special.arm, "xyz")
            count -= 1
            yield special


def test_round_angles_and_lengths(sample: Callable[[int, int], int]) -> None:
    """The generating joints are found, or the target is said to be singular; a root of fourth order is vague."""
    rng = np.random.default_rng(5)
    for c in special_arms(sample(200, 60), 2):
        q = rng.integers(-1, 3, (40, 3)) * QUARTER
        q = np.where(rng.random((40, 3)) < 0.3, rng.uniform(-3, 3, (40, 3)), q)
        report = examine_answers(
            c.arm, c.screw, "xyz", np.where(c.screw.prismatic, rng.integers(-2, 3, (40, 3)) * 50.0, q)
        )
        s = report.solutions
        distances = distance(c.screw, s.q, report.q[:, None]).min(axis=1)
        assert not ((s.status != Status.SINGULAR) & (distances > np.where(report.weak < 1e-6, 2e-2, 1e-6))).any()


def test_two_slides_that_become_parallel() -> None:
    """Turned so that both slides point one way, nothing is left of the equation: a self-motion, not noise."""
    rows = [
        {"dh": {"alpha": 30, "a": 100, "d": 0, "theta": 0}, "type": "prismatic"},
        {"dh": {"alpha": 30, "a": 100, "d": 100, "theta": 180}},
        {"dh": {"alpha": 45, "a": 200, "d": 0, "theta": 90}, "type": "prismatic"},
    ]
    arm = case_of({"convention": "standard", "joints": rows}, "xyz").arm
    s = armkin.ik(arm, armkin.fk(arm, [100, 0, 100])[:3, 3])
    assert (int(s.status), s.free.tolist(), int(s.valid.sum())) == (Status.SINGULAR, [True, False, True], 1)


def test_no_target_is_too_odd() -> None:
    """Zeros, huge numbers and axis-aligned targets: no nan in an answer, no warning (they are errors here)."""
    targets = [
        v * np.array([x, y, z]) for v in (0.0, 1.0, 100.0, 1e6, 1e12) for x in (0, 1) for y in (0, -1) for z in (0, 1)
    ]
    for name in ("three_dof", "yaw_two_link"):
        s = armkin.ik(load_robot(name), targets)
        assert np.isfinite(s.q[s.valid]).all()
        assert s.valid.any(axis=1).tolist() == (s.status != Status.UNREACHABLE).tolist()
    for name in ("puma560", "ur5e", "stanford", "jaco_j2n6s300"):
        T = np.tile(np.eye(4), (len(targets), 1, 1))
        T[:, :3, 3] = targets
        s = armkin.ik(load_robot(name), T)
        assert np.isfinite(s.q[s.valid]).all()


def test_a_corner_of_a_self_motion_is_not_listed_beside_it() -> None:
    """Four parallel axes in line: the self-motion ends in a posture where three directions are lost at once."""
    arm = armkin.load("mycobot_280")
    target = armkin.fk(arm, np.radians([180, 180, 180, 0, -90, 0]))
    s = armkin.ik(arm, target)
    assert s.status == Status.SINGULAR
    assert s.free[[1, 2, 3, 5]].all()
    assert s.valid.sum() == 1


def test_where_joint_3_has_no_real_root_no_joint_is_free(monkeypatch: pytest.MonkeyPatch) -> None:
    # nearer to joint 1's axis than the shoulder's 154 mm: the nearest slide is 0, and the wrist then on axis 2
    arm, rng = armkin.load("stanford"), np.random.default_rng(1)
    T = armkin.fk(arm, rng.uniform(-1.0, 1.0, (500, 6)) * [1, 1, 100, 1, 1, 1] + [0, 0, 500, 0, 0, 0])
    beside, angle = rng.uniform(10.0, 150.0, 500), rng.uniform(-3.0, 3.0, 500)
    wrist = np.column_stack([beside * np.cos(angle), beside * np.sin(angle), rng.uniform(300.0, 500.0, 500)])
    T[:, :3, 3] = wrist + 263.0 * T[:, :3, 2]
    monkeypatch.setattr(edges, "examine_targets", None)  # takes 50 ms a target
    s = armkin.ik(arm, T)
    assert (s.status == Status.UNREACHABLE).all()


def test_on_an_axis_that_an_offset_keeps_the_arm_from_nothing_is_missing() -> None:
    """The tip stays 10 mm beside the first axis: a point on it has no root, whatever joint 1 does."""
    arm = load_robot("three_dof")
    targets = np.array([[0.0, 0.0, -300.0], [0.0, 0.0, 0.0], [0.0, 0.0, 300.0], [0.0, 0.0, 500.0], [1e-300, 0.0, 0.0]])
    for ik in (partial(armkin.ik, arm), armkin.compile(arm).ik):
        solutions = ik(targets)
        assert (solutions.status == Status.UNREACHABLE).all()
        assert solutions.complete.all()
