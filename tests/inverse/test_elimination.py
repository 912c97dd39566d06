"""The general solver: Newton's polish, and every branch of arms with and without closed forms."""

import numpy as np
import pytest
from general_arms import (
    ARMS,
    PRISMATIC_PATTERNS,
    Arm,
    Array,
    Bool,
    dh_arm,
    joint_distance,
    nearest_distance,
    pose_of,
    pose_residual,
    random_arm,
    random_joints,
    random_motions,
)

import armkin
from armkin.inverse.elimination import method
from armkin.inverse.elimination.polish import refine
from armkin.inverse.numeric.newton import nudged
from armkin.model.rotation import shrink_translations


def numeric_jacobian(arm: Arm, q: Array) -> Array:
    """Jacobians (N, 6, 6) by central differences, lengths in metres: linear rows in the base's axes, angular
    ones in the tool's."""
    T, columns = pose_of(arm, q), []
    for i in range(6):
        h = 1e-5 * np.eye(6)[i] * np.where(arm[1], 1000, 1)
        D = (pose_of(arm, q + h) - pose_of(arm, q - h)) / 2e-5
        spin = np.swapaxes(T[:, :3, :3], 1, 2) @ D[:, :3, :3]
        columns.append(np.concatenate([D[:, :3, 3] / 1000, spin[:, [2, 0, 1], [1, 2, 0]]], axis=1))
    return np.stack(columns, axis=-1)


def smallest_singular_value(arm: Arm, q: Array) -> Array:
    """Of the Jacobian, (N, 6) -> (N,)."""
    return np.asarray(np.linalg.svd(numeric_jacobian(arm, q), compute_uv=False)[:, -1], dtype=float)


def polish_guesses(
    link: Array, prismatic: Bool, q: Array, T: Array, steps: int, damped: bool = False
) -> tuple[Array, Array]:
    """Guesses (M, 6) moved onto their targets (M, 4, 4), and the residuals (M,), lengths over the links' sum."""
    length = float(np.linalg.norm(link[1:, :3, 3], axis=1).sum()) or 300.0
    unit = np.where(prismatic, length, 1.0)
    refined = refine(
        shrink_translations(link, length), prismatic, q / unit, shrink_translations(T, length), steps, damped
    )
    return refined.q * unit, refined.residual


def solve_arm(arm: Arm, T: Array) -> tuple[Array, Bool]:
    return method.solve(method.prepare(*arm), T)[:2]


# ---- polish ------------------------------------------------------------------------------------------------


def test_one_singular_member_does_not_fail_its_batch() -> None:
    matrices = np.stack([np.eye(6), np.diag([1.0, 1, 1, 1, 1, 0])])
    inverse = nudged(np.linalg.inv, matrices)
    np.testing.assert_allclose(inverse[0], np.eye(6), atol=1e-11)
    assert np.isfinite(inverse).all()


@pytest.mark.parametrize("name", ["JACO", "STANFORD"])
@pytest.mark.parametrize("damped", [False, True])
def test_polish_converges_to_the_nearby_solution(name: str, damped: bool) -> None:
    arm = ARMS[name]
    q = random_joints(arm, 50, 2)
    q = q[smallest_singular_value(arm, q) > 0.02]
    near = q + np.where(arm[1], 1.0, 1e-3) * np.random.default_rng(3).uniform(-1, 1, q.shape)
    polished, residual = polish_guesses(*arm, near, pose_of(arm, q), steps=10, damped=damped)
    assert residual.max() < 1e-13
    assert joint_distance(arm, polished, q).max() < 1e-10


def test_polish_keeps_the_best_point_and_says_how_far_it_is() -> None:
    arm = ARMS["JACO"]
    q = random_joints(arm, 5, 4)
    polished, residual = polish_guesses(*arm, q + 0.1, pose_of(arm, q), steps=0)
    np.testing.assert_array_equal(polished, q + 0.1)
    assert residual.min() > 1e-3


# ---- every branch ------------------------------------------------------------------------------------------


def check_postures(arm: Arm, q: Array, within: float = 1e-6) -> tuple[Array, Bool]:
    """Solve for the poses of q: the generating joints are found, every branch is exact, none comes twice."""
    T = pose_of(arm, q)
    plan = method.prepare(*arm)
    assert plan.complete
    solutions, near_singular, *_ = method.solve(plan, T)
    lost = nearest_distance(arm, q, solutions) > within
    assert not lost.any(), f"{lost.sum()} of {len(q)} lost, the first: {q[lost][0]}"
    assert pose_residual(arm, solutions, T) < 1e-10
    revolute = solutions[..., ~arm[1]]
    assert np.nanmax(revolute) <= np.pi
    assert np.nanmin(revolute) > -np.pi
    assert solutions.shape[1] <= 16
    for branches in solutions:
        rows = branches[~np.isnan(branches[:, 0])]
        assert np.isnan(branches[len(rows) :]).all()
        apart = joint_distance(arm, rows[:, None], rows[None]) + np.eye(len(rows))
        assert apart.min(initial=1.0) > 1e-7
    return solutions, near_singular


@pytest.mark.parametrize("name", [name for name in ARMS if name not in ("PUMA", "STANFORD")])
def test_generating_joints_are_among_the_branches(name: str) -> None:
    _, near_singular = check_postures(ARMS[name], random_joints(ARMS[name], 300, 1))
    assert near_singular.mean() < 0.05


@pytest.mark.parametrize("name", ["PUMA", "STANFORD"])
def test_spherical_wrists_are_slower_but_found(name: str) -> None:
    branches, _ = check_postures(ARMS[name], random_joints(ARMS[name], 60, 1))
    assert (~np.isnan(branches[..., 0])).sum(axis=1).max() == 8


@pytest.mark.parametrize("seed", range(8))
def test_general_arms(seed: int) -> None:
    arm = random_arm(seed)
    check_postures(arm, random_joints(arm, 100, seed))


@pytest.mark.parametrize("pattern", PRISMATIC_PATTERNS)
def test_prismatic_joints_anywhere(pattern: str) -> None:
    arm = random_arm(len(pattern) + PRISMATIC_PATTERNS.index(pattern), pattern)
    branches, _ = check_postures(arm, random_joints(arm, 40, 5))
    if pattern.count("P") == 3:
        assert branches.shape[1] == 2


def test_sixteen_branches() -> None:
    """A pose of the Manocha-Canny arm on which all sixteen branches are real."""
    arm = ARMS["MC"]
    q = np.array([[-0.552, 1.427, 0.77, -2.413, -2.23, 1.76]])
    branches, _ = check_postures(arm, q)
    assert branches.shape == (1, 16, 6)
    assert not np.isnan(branches).any()


# ---- against an independent oracle -------------------------------------------------------------------------


def oracle_branches(arm: Arm, T: Array, starts: int, seed: int) -> list[Array]:
    """All solutions of one pose that damped Newton steps reach from many random starts."""
    sets = []
    for pose in T:
        q = random_joints(arm, starts, seed)
        q, residual = polish_guesses(*arm, q, np.repeat(pose[None], starts, axis=0), steps=40, damped=True)
        q = q[residual < 1e-11]
        distinct: list[Array] = []
        while len(q):
            distinct.append(q[0])
            q = q[joint_distance(arm, q, q[0]) > 1e-5]
        sets.append(np.array(distinct).reshape(-1, 6))
    return sets


@pytest.mark.parametrize("name", ["JACO", "CRX", "MD16", "GEN3L", "UR5e", "random", "RRPRRR"])
def test_branches_equal_a_multi_start_oracle(name: str) -> None:
    arm = random_arm(21, name) if "P" in name else random_arm(20) if name == "random" else ARMS[name]
    T = pose_of(arm, random_joints(arm, 6, 8))
    listed, _ = solve_arm(arm, T)
    for branches, expected in zip(listed, oracle_branches(arm, T, 500, 9), strict=True):
        rows = branches[~np.isnan(branches[:, 0])]
        assert len(rows) == len(expected)
        assert joint_distance(arm, rows[:, None], expected[None]).min(axis=1).max() < 1e-7


# ---- where elimination is known to be hard -----------------------------------------------------------------

OFF = [0.0, 1e-15, 1e-12, 1e-9, 1e-7, 1e-5, 1e-3]


@pytest.mark.parametrize("tilt", OFF)
def test_axes_that_are_almost_parallel(tilt: float) -> None:
    jaco = dh_arm(
        [90, 180 + np.degrees(tilt), 90, 60, 60, 180],
        [0, 410, 0, 0, 0, 0],
        [275.5, 0, -9.8, -250.081655, -85.56331, -202.781655],
        [0, -90, 90, 0, -180, 90],
    )
    check_postures(jaco, random_joints(jaco, 60, 6))
    angle = np.degrees(tilt)
    ur = dh_arm(
        [90, angle, -angle, 90, -90, 0],
        [0, -425, -392.2, 0, 0, 0],
        [162.5, 0, 0, 133.3, 99.7, 99.6],
        [0.0] * 6,
    )
    check_postures(ur, random_joints(ur, 60, 6))


@pytest.mark.parametrize("offset", [1e-6, 1e-4, 1e-2, 10.0])
def test_axes_that_almost_meet(offset: float) -> None:
    """A spherical wrist with its fifth link this long [mm]."""
    puma = dh_arm([90, 0, -90, 90, -90, 0], [0, 431.8, 20.3, 0, offset, 0], [671.83, 0, 150.05, 431.8, 0, 0], [0.0] * 6)
    check_postures(puma, random_joints(puma, 40, 12))


def test_frames_far_along_near_parallel_axes() -> None:
    """A DH table fitted to axes 7e-6 rad from parallel: its frames are 38 km away from the arm."""
    arm = dh_arm(
        [90, 180 - 4.2e-4, 90, 90, 90, 0],
        [0, 0, 0, 0, 0, 0],
        [115, -38113823.17678443, -38113833.177298686, 245, 57, 105],
        [0, 90, 90, 90, 180, 90],
    )
    q = random_joints(arm, 60, 2)
    branches, _ = solve_arm(arm, pose_of(arm, q))
    # At 4e7 mm of lever arm a double's rounding is 1e-8 mm, and joints 2 and 3 share it.
    assert nearest_distance(arm, q, branches).max() < 1e-6


@pytest.mark.parametrize("name", ["JACO", "CRX", "MD16", "MC", "GEN3L", "UR5e", "IRB2400"])
def test_joints_at_round_angles(name: str) -> None:
    """Half of the joints at multiples of 45 degrees: poses on which many solutions share joint values."""
    arm = ARMS[name]
    rng = np.random.default_rng(10)
    round_angles = np.pi / 4 * rng.integers(-3, 5, (80, 6))
    q = np.where(rng.random((80, 6)) < 0.5, round_angles, random_joints(arm, 80, 11))
    q = q[smallest_singular_value(arm, q) > 5e-3]
    T = pose_of(arm, q)
    branches, _ = solve_arm(arm, T)
    assert nearest_distance(arm, q, branches).max() < 1e-6
    assert pose_residual(arm, branches, T) < 1e-9


@pytest.mark.parametrize("nearness", [1e-3, 1e-5, 1e-7])
@pytest.mark.parametrize("name", ["JACO", "MD16"])
def test_near_singular_poses(name: str, nearness: float) -> None:
    """One joint moved to where det J = 0, then off by so much: two branches that close to each other."""
    arm = ARMS[name]
    q = singular_joints(arm, 25)
    q[:, 4] += nearness
    branches, near_singular = solve_arm(arm, pose_of(arm, q))
    # The two may be told apart down to 2e-6; below, one answer between them is as good as the pose tells.
    assert nearest_distance(arm, q, branches).max() < max(1e-6, 3e-7 if nearness > 1e-6 else 3e-6)
    assert (~np.isnan(branches[..., 0])).sum(axis=1).max() <= 16
    if nearness < 1e-4:
        assert near_singular.all()


def singular_joints(arm: Arm, count: int) -> Array:
    """Joint values (<= count, 6) with the fifth joint where the Jacobian loses rank, by bisection."""

    def determinant(q: Array) -> Array:
        return np.asarray(np.linalg.det(numeric_jacobian(arm, q)))

    low = random_joints(arm, 4 * count, 13)
    high = low.copy()
    high[:, 4] += 1.0
    change = determinant(low) * determinant(high) < 0
    low, high = low[change][:count], high[change][:count]
    sign = np.sign(determinant(low))
    for _ in range(60):
        middle = (low + high) / 2
        same = (np.sign(determinant(middle)) == sign)[:, None]
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return low


def test_double_root_on_the_singularity_is_one_answer() -> None:
    arm = ARMS["JACO"]
    q = singular_joints(arm, 20)
    listed, near_singular = solve_arm(arm, pose_of(arm, q))
    assert nearest_distance(arm, q, listed).max() < 1e-4  # a double root: the square root of rounding
    assert near_singular.all()
    for branches, generating in zip(listed, q, strict=True):
        assert (joint_distance(arm, branches, generating) < 1e-3).sum() == 1


def test_targets_just_beyond_the_boundary_are_answered() -> None:
    """Poses with a single double root, moved by 1e-10 m both ways along the direction the arm cannot go."""
    arm = random_arm(3)
    plan = method.prepare(*arm)
    q = singular_joints(arm, 60)
    solutions, _, *_ = method.solve(plan, pose_of(arm, q))
    q = q[(~np.isnan(solutions[..., 0])).sum(axis=1) == 1]
    assert len(q) >= 3
    T = pose_of(arm, q)
    left, _, _ = np.linalg.svd(numeric_jacobian(arm, q))
    for way in (1e-10, -1e-10):
        beyond = T.copy()
        beyond[:, :3, 3] += way * 1000 * left[:, :3, 5]
        solutions, near_singular, *_ = method.solve(plan, beyond)
        assert (~np.isnan(solutions[..., 0])).sum(axis=1).min() >= 1
        assert near_singular.all()
        assert pose_residual(arm, solutions, beyond) < 1e-9
        beyond[:, :3, 3] += 1e5 * way * 1000 * left[:, :3, 5]  # and 1e-5 m: inside two answers, outside none
        solutions, _, *_ = method.solve(plan, beyond)
        assert set((~np.isnan(solutions[..., 0])).sum(axis=1)) <= {0, 2}


# ---- the interface -----------------------------------------------------------------------------------------


def test_no_targets_unreachable_targets_and_targets_that_are_no_numbers() -> None:
    arm = ARMS["JACO"]
    plan = method.prepare(*arm)
    solutions, near_singular, *_ = method.solve(plan, np.empty((0, 4, 4)))
    assert solutions.shape == (0, 0, 6)
    assert near_singular.shape == (0,)
    T = pose_of(arm, random_joints(arm, 3, 14))
    alone, _, *_ = method.solve(plan, T[2:])
    T[0, 0, 3] += 1e4
    T[1, 1, 1] = np.nan
    solutions, near_singular, *_ = method.solve(plan, T)
    assert np.isnan(solutions[:2]).all()
    assert not near_singular[:2].any()
    np.testing.assert_allclose(solutions[2], alone[0], atol=1e-11)


def test_a_pose_has_the_same_branches_in_any_batch(monkeypatch: pytest.MonkeyPatch) -> None:
    arm = ARMS["CRX"]
    plan = method.prepare(*arm)
    T = pose_of(arm, random_joints(arm, 600, 15))
    in_one_batch, doubt, *_ = method.solve(plan, T)
    monkeypatch.setattr(method, "BLOCK_POSES", 512)
    together, near_singular, *_ = method.solve(plan, T)
    np.testing.assert_array_equal(np.isnan(together), np.isnan(in_one_batch))
    np.testing.assert_allclose(together, in_one_batch, atol=1e-9)
    np.testing.assert_array_equal(near_singular, doubt)
    together, _, *_ = method.solve(plan, T)
    for i in (0, 255, 256, 599):
        alone, _, *_ = method.solve(plan, T[i : i + 1])
        rows = together[i][~np.isnan(together[i][:, 0])]
        assert joint_distance(arm, alone[0], rows).max() < 1e-9


def test_base_and_tool_anywhere() -> None:
    link, prismatic = ARMS["JACO"]
    base, tool = random_motions(np.random.default_rng(16), 2)
    base[:3, 3] *= 3000
    tool[:3, 3] *= 200
    moved = link.copy()
    moved[0], moved[6] = base @ link[0], link[6] @ tool
    q = random_joints((moved, prismatic), 50, 17)
    branches, _ = solve_arm((moved, prismatic), pose_of((moved, prismatic), q))
    plain, _ = solve_arm((link, prismatic), pose_of((link, prismatic), q))
    assert nearest_distance((moved, prismatic), q, branches).max() < 1e-7
    np.testing.assert_array_equal(np.isnan(branches), np.isnan(plain))


def test_arms_with_redundant_axes_are_doubtful_not_fatal() -> None:
    """Joints 1 and 2 on one line: every solution lies on a curve of solutions."""
    arm = dh_arm([0, 90, 90, 60, 60, 0], [0, 300, 0, 50, 0, 0], [100, 50, 20, 250, 80, 100], [0.0] * 6)
    plan = method.prepare(*arm)
    assert not plan.complete
    solutions, near_singular, *_ = method.solve(plan, pose_of(arm, random_joints(arm, 20, 18)))
    assert solutions.shape[1] <= 16
    assert near_singular[~np.isnan(solutions[:, :1, 0]).all(axis=1)].all()


def test_answers_of_equal_keys_are_not_taken_for_one() -> None:
    """Eight regular branches, two of which have the same number in the projection that sorts them."""
    arm = armkin.load("jaco_j2n6s300")
    q = np.deg2rad([-108.9918203, 6.12739868, -75.65079096, 170.20650872, -116.97452296, 22.97350995])
    for solutions in (armkin.ik(arm, armkin.fk(arm, q)), armkin.compile(arm).ik(armkin.fk(arm, q))):
        assert solutions.valid.sum() == 8
        assert bool(solutions.complete)
