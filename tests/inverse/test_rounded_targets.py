"""An arm that stands at a singular posture and is asked for its own pose, rounded, stays where it is."""

from __future__ import annotations

import numpy as np
import pytest
from shipped_arms import shipped_arm

import armkin
import right_angles
from armkin import Status
from armkin.errors import UsageError
from armkin.inverse.answers.rounding import of_targets, printed_rounding
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.inverse.tasks.task import LABELS
from armkin.model.target_numbers import targets_out
from command_line import run

DIGITS = ("6f", "8f", "12f", "7g", "float32")  # decimals, significant digits


def typed_postures(name: str, count: int, seed: int) -> tuple[armkin.Arm, np.ndarray]:
    """Within limits, joint 5 straight (of a CRX joint 3 folded), every other one at typed angles."""
    arm, _ = shipped_arm(name)
    rng = np.random.default_rng(seed)
    q = rng.uniform(np.clip(arm.lower, -3.0, 3.0), np.clip(arm.upper, -3.0, 3.0), (count, arm.n))
    q[::2] = np.radians(15.0 * np.rint(np.degrees(q[::2]) / 15.0))
    q[:, 4] = 0.0
    return arm, np.clip(q, arm.lower, arm.upper)


def round_poses(T: np.ndarray, digits: str) -> np.ndarray:
    if digits == "float32":
        return T.astype(np.float32)
    return np.array([float(f"{x:.{digits}}") for x in T.ravel()]).reshape(T.shape)


@pytest.mark.parametrize("name", ["ur5e", "puma560", "irb120", "jaco_j2n6s300", "fanuc_crx10ia"])
def test_its_own_pose_in_few_digits_moves_no_joint(name: str) -> None:
    """Up to 37 of 40 moved by more than 10 degrees; some were called unreachable."""
    arm, q = typed_postures(name, 4, 3)
    T = armkin.fk(arm, q)
    for number, digits in enumerate(DIGITS):
        rounded_T = round_poses(T, digits)
        batch = armkin.ik(arm, rounded_T, near=q)
        assert (batch.best >= 0).all(), digits
        best = batch.q[np.arange(len(q)), batch.best]
        np.testing.assert_allclose(best, q, rtol=0, atol=1e-6, err_msg=digits)
        k = number % len(q)
        single = armkin.ik(arm, rounded_T[k], near=q[k])
        np.testing.assert_array_equal(single.q[single.best], best[k])
        assert single.status == batch.status[k]


@pytest.mark.parametrize("name", ["ur5e", "puma560"])
def test_machine_code_stays_as_python_does(name: str) -> None:
    arm, q = typed_postures(name, 4, 5)
    T, fast = armkin.fk(arm, q), armkin.compile(armkin.load(name))
    for digits in ("7f", "float32"):
        compiled, slow = fast.ik(round_poses(T, digits), near=q), armkin.ik(arm, round_poses(T, digits), near=q)
        best = compiled.q[np.arange(len(q)), compiled.best]
        np.testing.assert_array_equal(best, slow.q[np.arange(len(q)), slow.best])
        np.testing.assert_allclose(best, q, rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("q", "rows"),
    [
        # nearest is another branch: that of its own self-motion turned joint 4 by 89 degrees
        ([-0.04155860148898505, -1.6726825875976936, -1.5535001016934755, -0.16762153633218402, 0.0,
          3.005712444405921], 7),
        # an elbow folded to 1e-6: half way along the bent self-motion the straight line misses by too much
        ([-2.7321296946729916, -0.4230729454436415, 1.6177742431431656, -2.8807123576303404, -1.2049253263525124,
          1.0652089617143359], 4),
    ],
)  # fmt: skip
def test_it_stands_for_the_self_motion_that_it_is_on_but_for_rounding(q: list[float], rows: int) -> None:
    """It was a row besides the self-motion's: of 426 singular and round postures of a Puma in eight decimals 8."""
    arm, _ = shipped_arm("puma560")
    T = np.round(armkin.fk(arm, q), 8)
    assert armkin.ik(arm, T).valid.sum() == rows
    solutions = armkin.ik(arm, T, near=q)
    assert solutions.valid.sum() == rows
    np.testing.assert_array_equal(solutions.q[solutions.best], q)


def test_a_turn_about_one_axis_shows_its_rounding_by_its_digits() -> None:
    """The columns of such a rotation stay at right angles, and may keep their length: one of some 40 was moved."""
    arm, _ = shipped_arm("puma560")
    q = np.tile(np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0]), (200, 1))
    q[:, 0] = np.random.default_rng(1).uniform(-2.0, 2.0, len(q))
    T = armkin.fk(arm, q)
    for digits in ("6f", "7f", "7g"):
        solutions = armkin.ik(arm, round_poses(T, digits), near=q)
        best = solutions.q[np.arange(len(q)), solutions.best]
        np.testing.assert_allclose(best, q, rtol=0, atol=1e-6, err_msg=digits)


@pytest.mark.parametrize("name", right_angles.POSTURES)
def test_a_rotation_by_right_angles_hides_its_rounding_but_the_position_shows_it(name: str) -> None:
    """17 of 24 such postures of a Thor and 13 of a Puma turned a joint by up to 180 degrees."""
    arm, _ = shipped_arm(name)
    q = np.radians(right_angles.POSTURES[name])
    T, fast = armkin.fk(arm, q), armkin.compile(arm)
    np.testing.assert_allclose(T[:, :3, :3], np.rint(T[:, :3, :3]), atol=1e-14)
    for digits in ("6g", "7g", "8f", "9g", "float32"):
        rounded_T = np.asarray(round_poses(T, digits), float)
        solutions, coded = armkin.ik(arm, rounded_T, near=q), fast.ik(rounded_T, near=q)
        best = solutions.q[np.arange(len(q)), np.maximum(solutions.best, 0)]
        np.testing.assert_allclose(best, q, rtol=0, atol=1e-6, err_msg=digits)
        np.testing.assert_array_equal(coded.q[np.arange(len(q)), coded.best], best)
        for k in range(len(q)):
            for alone in (armkin.ik(arm, rounded_T[k], near=q[k]), fast.ik(rounded_T[k], near=q[k])):
                np.testing.assert_array_equal(alone.q[alone.best], best[k])


def test_a_position_that_is_typed_beside_right_angles_is_exact() -> None:
    """390.25 mm are not rounded, nor is what has twelve digits."""
    arm, _ = shipped_arm("puma560")
    T = np.tile(np.diag([1.0, -1.0, -1.0, 1.0]), (3, 1, 1))
    T[:, :3, 3] = [390.25, 120.0, 210.5], [390.123456789012, 120.0, 0.0], [390.123, 120.0, 0.0]
    task, _ = solver(arm, None)
    _, most = of_targets(arm, task, T, (T, np.zeros(3)), False, None, (3,))
    np.testing.assert_allclose(most, 1e-9 + np.array([0.0, 0.0, 3.0**0.5 * 0.5e-3 / arm.reach]))


def test_where_it_is_the_only_row_the_target_is_a_boundary() -> None:
    """Stretched, and printed a little beyond the reach."""
    arm, _ = shipped_arm("planar_2dof")
    target, near = [500.0004, 0.0], np.zeros(2)
    assert armkin.ik(arm, target, near=near).status == Status.UNREACHABLE
    for targets in (target, [target] * 3):
        s = armkin.ik(arm, targets, near=near, rounding=1e-6)
        assert np.all(s.status == Status.BOUNDARY)
        assert np.all(s.valid.sum(axis=-1) == 1)
        assert np.all(s.best == 0)
        assert np.all(s.q[..., 0, :] == near)
        assert np.all(s.rounding == 1e-6)


def test_a_near_outside_limits_is_no_answer_however_the_target_is_rounded() -> None:
    arm, _ = shipped_arm("irb120")
    q = np.full(6, 0.3)
    q[4], q[0] = 0.0, arm.upper[0] + 1e-3
    s = armkin.ik(arm, np.round(armkin.fk(arm, q), 6), near=q)
    assert s.best < 0 or np.abs(s.q[s.best] - q).max() > 1e-4


@pytest.mark.parametrize("wrong", [-1e-9, np.nan, [1e-9, 1e-9]])
def test_a_rounding_that_is_none_is_refused(wrong: float | list[float]) -> None:
    arm, _ = shipped_arm("ur5e")
    with pytest.raises(UsageError, match="rounding: expected finite numbers from 0"):
        armkin.ik(arm, armkin.fk(arm, arm.home), rounding=wrong)


def test_printed_decimals_are_counted_from_the_third_on() -> None:
    rows = np.array([[390.0, 400.5, 12.25], [390.125, 0.0, 0.0], [0.123456, -2.5, 1.0 / 3.0]])
    rounding = printed_rounding(["mm", "mm", "deg"], rows, 1000.0)
    np.testing.assert_allclose(
        rounding,
        [
            0.0,
            np.hypot(np.hypot(0.5e-6, 0.5e-6), np.radians(0.5e-3)),
            np.hypot(np.hypot(0.5e-9, 0.5e-9), np.radians(0.5e-6)),
        ],
        rtol=1e-9,
    )


def test_zeros_that_are_printed_count_and_the_halves_of_angles_add() -> None:
    rounding = printed_rounding(
        ["mm", "mm", "deg", "deg"], np.array([[345.04, 400.0, 28.675, 0.0]]), 1000.0, [[3, 1, 4, 4]]
    )
    np.testing.assert_allclose(rounding, np.hypot(0.5e-6, np.radians(1e-4)))


@pytest.mark.parametrize(
    ("name", "q", "digits"),
    [("irb120", [0, 0, 45, 90, 0, -180], 3), ("puma560", [135, 90, 135, -45, -90, -45], 4),
     ("thor", [0, -45, -90, -135, -90, -135], 4)],
)  # fmt: skip
def test_a_posture_on_its_limits_is_its_own_printed_pose(name: str, q: list[int], digits: int) -> None:
    """A number ends in a zero; or roll and yaw are both off by half a decimal, about nearly one axis."""
    T = armkin.fk(armkin.load(name), np.radians([q]))
    words = [f"{value:.{digits}f}" for value in targets_out(LABELS["pose"], T)[0]]
    completed = run("ik", name, *words, "--near", ",".join(map(str, q)), "--json")
    assert completed.code == 0
    assert completed.json["branches"][completed.json["best"]]["joints"] == pytest.approx(q, abs=1e-9)
    rows = ",".join(LABELS["pose"]) + "\n" + ",".join(words)
    batch = run("ik", name, "--batch", "-", "--near", ",".join(map(str, q)), "--json", stdin=rows.encode())
    assert batch.json["branches"][batch.json["best"]]["joints"] == pytest.approx(q, abs=1e-9)


def test_six_printed_decimals_on_the_command_line_move_no_joint() -> None:
    q = [10.0, -80.0, 70.0, -30.0, 0.0, 20.0]
    T = armkin.fk(armkin.load("ur5e"), np.radians([q]))
    words = [f"{value:.6f}" for value in targets_out(LABELS["pose"], T)[0]]
    completed = run("ik", "ur5e", *words, "--near", ",".join(map(str, q)), "--json")
    assert completed.code == 0
    best = completed.json["branches"][completed.json["best"]]
    np.testing.assert_allclose(best["joints"], q, atol=1e-9)
