"""Pulses: the published figures, rounding, any motors matrix, servos, and the search for the nearest tip."""

from itertools import product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import armkin
from armkin import robot_file
from armkin.errors import UsageError
from armkin.forward import position
from armkin.model.arm import Arm, from_links
from armkin.model.build_arm import arm_of_file
from armkin.motors import (
    best_pulses,
    joints,
    motor_names,
    outside_travel,
    pulse_range,
    pulse_units,
    pulses,
    resolution,
    rounding,
)
from armkin.reachability.dexterity import measure_function

ROOT = Path(__file__).parents[1]
THREE_DOF = armkin.load(ROOT / "robots/three_dof.yaml")
WRIST = armkin.load(ROOT / "tests/robots/differential_wrist.yaml")
SCARA = armkin.load(ROOT / "tests/robots/scara_steppers.yaml")
STEPPER_ARMS = pytest.mark.parametrize("arm", [THREE_DOF, WRIST, SCARA], ids=lambda arm: arm.name)


def in_radians(*values: float) -> np.ndarray:
    return np.deg2rad(values)


def test_table_4() -> None:
    r = rounding(THREE_DOF, in_radians(-30, 5, -5))
    assert r.pulses.tolist() == [-1067, -10144, 5667]
    assert np.rad2deg(r.actual_joints).round(6).tolist() == [-30.009375, 4.998371, -4.995]
    assert r.theoretical.round(4).tolist() == [398.3923, -218.4649, 187.1697]
    assert r.actual.round(4).tolist() == [398.3570, -218.5304, 187.1793]
    assert r.difference.round(6).tolist() == [0.035329, 0.065428, 0.009597]
    assert r.error == pytest.approx(np.sqrt(0.035329**2 + 0.065428**2 + 0.009597**2), abs=1e-6)


# Errata E3 and E4 of the paper: the q2 and q3 of these rows are the corrected ones.
@pytest.mark.parametrize(
    ("branch", "q", "counts", "actual"),
    [
        ("left, elbow up", (10.1529, 44.6560, -46.5354), [361, -5411, 2898], (44.6585, -46.5300)),
        ("left, elbow down", (10.1529, -8.4781, 46.5354), [361, -11752, 9102], (-8.4759, 46.5300)),
        ("right, elbow up", (-166.9685, 135.3440, 46.5354), [-5937, 5411, 9102], (135.3415, 46.5300)),
        ("right, elbow down", (-166.9685, -171.5219, -46.5354), [-5937, -31210, 2898], (-171.5241, -46.5300)),
    ],
)
def test_table_5(branch: str, q: tuple[float, ...], counts: list[int], actual: tuple[float, ...]) -> None:
    solutions = armkin.ik(THREE_DOF, [390.0, 80.0, 300.0])
    [row] = [i for i, k in enumerate(solutions.branch) if k >= 0 and solutions.names[k] == branch]
    assert np.rad2deg(solutions.q[row]).round(4).tolist() == pytest.approx(q, abs=1e-9)
    r = rounding(THREE_DOF, solutions.q[row])
    assert r.pulses.tolist() == counts
    assert np.rad2deg(r.actual_joints[1:]).round(4).tolist() == pytest.approx(actual, abs=1e-9)


def test_table_2_resolution() -> None:
    assert np.rad2deg(resolution(THREE_DOF)).round(7).tolist() == [0.028125, 0.0083795, 0.015]


def test_home_is_zero_pulses_and_not_zero_joints() -> None:
    assert pulses(THREE_DOF, THREE_DOF.home).tolist() == [0, 0, 0]
    assert pulses(THREE_DOF, np.zeros(3)).tolist() == [0, -10741, 6000]  # 10740.5 away from zero


def test_halves_round_away_from_zero_in_degrees() -> None:
    """Half a step is a number of degrees that radians cannot hold; it must round as a half all the same."""
    k = np.arange(-4000, 4000)
    q = np.zeros((len(k), 3)) + THREE_DOF.home
    q[:, 0] = np.deg2rad((k + 0.5) * 0.028125)
    assert pulses(THREE_DOF, q)[:, 0].tolist() == [n if n < 0 else n + 1 for n in k.tolist()]
    # ... but what is no half is not drawn to it.
    q[:, 0] = np.deg2rad((k + 0.5 - np.copysign(1e-6, k + 0.5)) * 0.028125)
    assert pulses(THREE_DOF, q)[:, 0].tolist() == [n + 1 if n < 0 else n for n in k.tolist()]


@STEPPER_ARMS
def test_pulses_are_the_robot_files_figures_in_degrees(arm: Arm) -> None:
    """Written out from the file, without the arm's matrix."""
    q = np.random.default_rng(1).uniform(arm.lower, arm.upper, (200, arm.n))
    assert arm.file is not None
    value = dict(zip(arm.joint_names, np.where(arm.prismatic, q, np.rad2deg(q)).T, strict=True))
    home = {joint.name: joint.home for joint in arm.file.joints}
    for k, motor in enumerate(arm.file.motor_list()):
        turn = sum(w * (value[name] - home[name]) for name, w in motor.joints.items())
        assert motor.full_steps is not None
        assert motor.microsteps is not None
        ratio = motor.full_steps * motor.microsteps * motor.gear * motor.pulley / (motor.lead or 360.0)
        exact = turn * ratio
        assert np.all(np.abs(pulses(arm, q)[:, k] - exact) <= 0.5 + 1e-6)


@STEPPER_ARMS
@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_there_and_back_within_half_a_pulse(arm: Arm, data: st.DataObject) -> None:
    share = np.array(data.draw(st.lists(st.floats(0, 1), min_size=arm.n, max_size=arm.n)))
    q = arm.lower + share * (arm.upper - arm.lower)
    p = pulses(arm, q)
    assert p.dtype == np.int64
    back = joints(arm, p)
    assert np.all(np.abs(back - q) <= 0.5 * resolution(arm) * (1 + 1e-9) + 1e-12)
    assert pulses(arm, back).tolist() == p.tolist()
    # To first order the tip is off by no more than the worst half pulses; the second order is far below.
    assert rounding(arm, q).error <= measure_function(arm, "step_error")(q[None])[0] * 1.001 + 1e-9


def test_differential_wrist() -> None:
    """Motor 5 = q5 + 2 q6, motor 6 = -q5 + 2 q6, 12800 pulses a turn, home (10, -20)."""
    q = np.zeros(6)
    q[4:] = in_radians(10 + 36, -20 + 18)
    p = dict(zip(motor_names(WRIST), pulses(WRIST, q).tolist(), strict=True))
    assert p == {"M1": 0, "M2a": 0, "M2b": 0, "M3": 0, "M4": 0, "M5": 2560, "M6": 0}
    assert np.rad2deg(joints(WRIST, list(p.values()))).round(9).tolist() == [0, 0, 0, 0, 46, -2]
    # A pulse of either motor turns J5 by 1/2 and J6 by 1/4 of 360/12800 degrees; both may be off.
    assert np.rad2deg(resolution(WRIST))[4:] == pytest.approx([360 / 12800, 180 / 12800])


def test_two_motors_on_one_shoulder() -> None:
    q = np.zeros(6)
    q[1] = in_radians(1.0)[0]
    p = pulses(WRIST, q)
    assert p[1] == p[2] == 267  # invert is wiring: the count is the same
    assert np.rad2deg(resolution(WRIST))[1] == pytest.approx(360 / 96000)
    p[2] += 10
    with pytest.raises(UsageError, match=r"contradict each other: motor M2[ab] is 5.0 pulses"):
        joints(WRIST, p)


def servo_arm(invert: bool) -> Arm:
    text = (ROOT / "robots/planar_2dof.yaml").read_text()
    if invert:
        text = text.replace("axis: S1,", "axis: S1, invert: true,")
    return arm_of_file(robot_file.parse_robot_file(text))


def test_servo_pulse_widths() -> None:
    arm = servo_arm(invert=False)
    assert pulses(arm, in_radians(0, 0)).tolist() == [1500, 1500]
    assert pulses(arm, in_radians(20, 50)).tolist() == [1722, 2056]
    assert pulses(servo_arm(invert=True), in_radians(20, 50)).tolist() == [1722, 944]  # mirrored about zero
    assert np.rad2deg(resolution(arm)).tolist() == pytest.approx([0.09, 0.09])
    assert pulse_units(arm) == ["us", "us"]
    assert pulse_units(THREE_DOF) == ["step"] * 3
    assert np.rad2deg(joints(arm, [1722, 2056])).tolist() == pytest.approx([19.98, 50.04])


def test_servo_outside_its_travel_is_told_and_not_clamped() -> None:
    arm = servo_arm(invert=False)
    p = pulses(arm, np.deg2rad([[91.0, 0.0], [0.0, -90.1], [90.0, -90.0]]))
    assert p.tolist() == [[2511, 1500], [1500, 499], [2500, 500]]
    assert outside_travel(arm, p).tolist() == [[True, False], [False, True], [False, False]]
    assert pulse_range(arm).tolist() == [[500, 2500], [500, 2500]]
    assert not outside_travel(THREE_DOF, [10**9, 0, 0]).any()


def test_best_pulses_is_the_best_of_all_neighbours() -> None:
    rng = np.random.default_rng(2)
    q = rng.uniform(THREE_DOF.lower * 0.9, THREE_DOF.upper * 0.9, (20, 3))
    best = best_pulses(THREE_DOF, q)
    assert np.all(best.gain >= 0)
    assert np.any(best.gain > 1e-3)
    for i in range(len(q)):
        exact = (q[i] - THREE_DOF.home) @ THREE_DOF.motor_gain.T
        around = np.floor(exact) + np.array(list(product((-1, 0, 1, 2), repeat=3)))
        tips = position(THREE_DOF, THREE_DOF.home + around / np.diag(THREE_DOF.motor_gain))
        least = np.linalg.norm(tips - position(THREE_DOF, q[i]), axis=1).min()
        assert best.chosen.error[i] == pytest.approx(least, abs=1e-9)


def test_best_pulses_of_the_published_pose() -> None:
    best = best_pulses(THREE_DOF, in_radians(-30, 5, -5))
    assert best.rounded.pulses.tolist() == [-1067, -10144, 5667]
    assert best.chosen.pulses.tolist() == [-1067, -10142, 5665]
    assert float(best.gain) == pytest.approx(0.000225829, abs=1e-9)
    assert best.tried == 65


def test_best_pulses_keeps_limits_and_does_not_strain_the_shoulder() -> None:
    q = np.random.default_rng(3).uniform(WRIST.lower, WRIST.upper, (30, 6))
    q[:10] = np.where(q[:10] > 0, WRIST.upper, WRIST.lower)  # into the corners
    best = best_pulses(WRIST, q)
    p = best.chosen.pulses
    assert np.all(p[:, 1] == p[:, 2])
    over = np.maximum(WRIST.lower - best.chosen.actual_joints, best.chosen.actual_joints - WRIST.upper)
    rounded_over = np.maximum(WRIST.lower - best.rounded.actual_joints, best.rounded.actual_joints - WRIST.upper)
    assert np.all(over.max(axis=1) <= np.maximum(rounded_over.max(axis=1), 0) + 1e-9)
    assert np.all(best.gain >= 0)


@STEPPER_ARMS
def test_batch_axes(arm: Arm) -> None:
    q = np.random.default_rng(4).uniform(arm.lower, arm.upper, (2, 3, arm.n))
    p = pulses(arm, q)
    assert p.shape == (2, 3, len(arm.motor_gain))
    assert p[1, 2].tolist() == pulses(arm, q[1, 2]).tolist()
    assert joints(arm, p).shape == (2, 3, arm.n)
    assert best_pulses(arm, q).gain.shape == (2, 3)
    assert pulses(arm, np.empty((0, arm.n))).shape == (0, len(arm.motor_gain))


def test_errors() -> None:
    add = "; add motors: to its file, or drive: to each joint$"
    with pytest.raises(UsageError, match=f"^labvolt_5150 has no drives{add}"):
        pulses(armkin.load(ROOT / "robots/labvolt_5150.yaml"), np.zeros(5))
    partly = from_links(np.tile(np.eye(4), (3, 1, 1)), [False, False], motor_gain=[[100.0, 0.0]])
    with pytest.raises(UsageError, match=f"^arm has no motor for q2{add}"):
        pulses(partly, [0, 0])
    dependent = from_links(np.tile(np.eye(4), (3, 1, 1)), [False, False], motor_gain=[[1.0, 2.0], [2.0, 4.0]])
    with pytest.raises(UsageError, match=r"^arm's motors do not determine its joints"):
        joints(dependent, [0, 0])
    with pytest.raises(UsageError, match=r"^joint values must be finite"):
        pulses(THREE_DOF, [0, np.nan, 0])
    with pytest.raises(UsageError, match=r"too large: more than 2\^53 pulses"):
        pulses(THREE_DOF, [1e300, 0, 0])
    with pytest.raises(UsageError, match=r"three_dof has 3 motors: expected 3 pulses on the last axis, got 2"):
        joints(THREE_DOF, [1, 2])
    with pytest.raises(UsageError, match=r"pulses must be finite"):
        joints(THREE_DOF, [1, 2, np.inf])
