"""`armkin zero --from`: a LeRobot calibration file gives zeros, limits, directions, and the gripper's ends."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import armkin
from armkin.board.feetech import registers
from armkin.board.sim.sim_servo_bus import Servo, ServoBus
from command_line import run
from pty_port import PtyPort

FILE: dict[str, dict[str, int]] = {
    "shoulder_pan": {"id": 1, "drive_mode": 0, "homing_offset": -1365, "range_min": 746, "range_max": 3477},
    "shoulder_lift": {"id": 2, "drive_mode": 0, "homing_offset": 1200, "range_min": 822, "range_max": 3210},
    "elbow_flex": {"id": 3, "drive_mode": 1, "homing_offset": -986, "range_min": 901, "range_max": 3110},
    "wrist_flex": {"id": 4, "drive_mode": 0, "homing_offset": -1696, "range_min": 849, "range_max": 3216},
    "wrist_roll": {"id": 5, "drive_mode": 0, "homing_offset": 12, "range_min": 0, "range_max": 4095},
    "gripper": {"id": 6, "drive_mode": 0, "homing_offset": 700, "range_min": 1899, "range_max": 3363},
}


@pytest.fixture
def calibration(tmp_path: Path) -> Path:
    path = tmp_path / "my_arm.json"
    path.write_text(json.dumps(FILE))
    return path


def write_changed(path: Path, name: str, **values: Any) -> None:
    """The calibration file with other values of a motor; None: without that key."""
    answer = json.loads(path.read_text())
    answer[name] = {key: value for key, value in (answer[name] | values).items() if value is not None}
    path.write_text(json.dumps(answer))


def test_zeros_limits_and_directions_are_the_file_s(calibration: Path, tmp_path: Path) -> None:
    mine = tmp_path / "mine.yaml"
    completed = run("zero", "so101", "--from", calibration, "-o", mine, "--json")
    assert completed.code == 0, completed.err
    assert completed.json["zero"] == [2111.5, 2016, 2005.5, 2032.5, 2047.5]
    arm = armkin.load(mine)
    motors = list(FILE.values())[:5]
    for j, motor in enumerate(motors):
        ends = []
        for value in (arm.lower[j], arm.upper[j]):
            q = np.zeros(5)
            q[j] = value
            ends.append(int(armkin.pulses(arm, q)[j]))
        want = [motor["range_min"], motor["range_max"]]
        assert np.abs(np.array(ends[::-1] if motor["drive_mode"] else ends) - want).max() <= 1
        assert arm.upper[j] == pytest.approx(-arm.lower[j])
        assert np.rad2deg(arm.upper[j]) == pytest.approx((want[1] - want[0]) / 2 * 360 / 4096, abs=1e-5)
    jaw = arm.gripper
    assert jaw is not None
    assert jaw.zero + jaw.open * 4096 / 360 == pytest.approx(3363, abs=1e-3)
    assert jaw.zero + jaw.closed * 4096 / 360 == pytest.approx(1899, abs=1e-3)
    assert completed.json["gripper_ends"] == pytest.approx([732 * 360 / 4096, -732 * 360 / 4096])
    assert "2111.5" in run("zero", "so101", "--from", calibration).out


def test_only_zero_limits_invert_and_the_gripper_s_ends_change(calibration: Path, tmp_path: Path) -> None:
    mine = tmp_path / "mine.yaml"
    assert run("zero", "so101", "--from", calibration, "-o", mine).code == 0
    ours, theirs = mine.read_text(), Path("robots/so101.yaml").read_text()
    assert len(ours.splitlines()) == len(theirs.splitlines())
    for a, b in zip(ours.splitlines(), theirs.splitlines(), strict=True):
        assert a == b or a.strip().split(":")[0] in ("limits", "drive", "gripper")


def test_a_zero_far_from_the_middle_of_its_limits_wants_the_pose(calibration: Path, tmp_path: Path) -> None:
    """An SO-100's URDF has its zeros at an end of some joints: LeRobot's middle is another pose."""
    refused = run("zero", "so100", "--from", calibration, "-o", tmp_path / "mine.yaml")
    assert refused.code == 2
    assert "deg from the middle of its limits" in refused.err
    assert "--pose NAME|Q,... says it" in refused.err
    assert not (tmp_path / "mine.yaml").exists()
    arm = armkin.load("so100")
    middle = np.rad2deg(arm.lower + arm.upper) / 2
    pose = ",".join(f"{value:.4f}" for value in middle)
    completed = run("zero", "so100", "--from", calibration, "--pose", pose, "-o", tmp_path / "mine.yaml", "--json")
    assert completed.code == 0, completed.err
    mine = armkin.load(tmp_path / "mine.yaml")
    for j, motor in enumerate(list(FILE.values())[:5]):
        assert armkin.pulses(mine, np.deg2rad(middle))[j] == pytest.approx(
            (motor["range_min"] + motor["range_max"]) / 2, abs=1
        )
    np.testing.assert_allclose(np.rad2deg(mine.lower + mine.upper) / 2, middle, atol=1e-3)


@pytest.mark.parametrize(
    ("name", "values", "code", "says"),
    [
        ("elbow_flex", {"id": 9}, 2, "joint elbow_flex is servo 3, which the file has not"),
        ("elbow_flex", {"id": 2}, 1, "shoulder_lift and elbow_flex have the same id 2"),
        ("wrist_flex", {"range_min": 3216}, 1, "wrist_flex: range_min to range_max is 3216 to 3216"),
        ("wrist_flex", {"range_max": 5000}, 1, "wrist_flex: range_max is 5000: a whole number from 0 to 4095"),
        ("wrist_flex", {"range_max": 3216.5}, 1, "wrist_flex: range_max is 3216.5"),
        ("wrist_flex", {"range_max": True}, 1, "wrist_flex: range_max is True"),
        ("shoulder_pan", {"homing_offset": None}, 1, "shoulder_pan: homing_offset is missing"),
        ("shoulder_pan", {"drive_mode": 2}, 1, "shoulder_pan: drive_mode is 2"),
        ("gripper", {"id": 7}, 2, "joint gripper is servo 6, which the file has not"),
    ],
)
def test_a_file_that_does_not_fit_is_refused_with_the_joint(
    calibration: Path, tmp_path: Path, name: str, values: dict[str, Any], code: int, says: str
) -> None:
    write_changed(calibration, name, **values)
    completed = run("zero", "so101", "--from", calibration, "-o", tmp_path / "mine.yaml")
    assert (completed.code, completed.out) == (code, "")
    assert says in completed.err
    assert not (tmp_path / "mine.yaml").exists()


def test_two_motors_that_have_changed_places_are_refused(calibration: Path) -> None:
    write_changed(calibration, "elbow_flex", id=4)
    write_changed(calibration, "wrist_flex", id=3)
    completed = run("zero", "so101", "--from", calibration)
    assert (completed.code, "joint elbow_flex is servo 3, which is wrist_flex in the file" in completed.err) == (
        2,
        True,
    )


@pytest.mark.parametrize("text", ["", "[]", "{}", "null", '{"a": 1}', "[" * 100_000, "\x00", '{"a": {"id": NaN}}'])
def test_what_is_no_calibration_file_is_said(tmp_path: Path, text: str) -> None:
    path = tmp_path / "no.json"
    path.write_text(text)
    completed = run("zero", "so101", "--from", path)
    assert (completed.code, completed.out, completed.err.count("\n") <= 2) == (1, "", True)
    assert str(path) in completed.err
    assert run("zero", "so101", "--from", tmp_path / "missing.json").code == 1
    assert run("zero", "three_dof", "--from", path).code == 2


def test_with_a_port_the_file_is_compared_with_the_servos(calibration: Path, tmp_path: Path) -> None:
    servos = [Servo(motor["id"], 2047) for motor in FILE.values()]
    for servo, motor in zip(servos, FILE.values(), strict=True):
        servo.set(registers.OFFSET, motor["homing_offset"])
    with PtyPort(ServoBus(servos)) as pty:
        mine = tmp_path / "mine.yaml"
        completed = run("zero", "so101", "--from", calibration, "--port", pty.name, "-o", mine, "--json")
        assert (completed.code, completed.json["port"]) == (0, pty.name), completed.err
        servos[2].set(registers.OFFSET, -985)
        mine.unlink()
        refused = run("zero", "so101", "--from", calibration, "--port", pty.name, "-o", mine)
    assert (refused.code, refused.out, mine.exists()) == (5, "", False)
    assert "servo 3 (elbow_flex): its homing offset (register 31) is -985, the file says -986" in refused.err


def test_a_pose_that_leaves_home_outside_its_limits_is_refused_with_what_is_allowed(
    calibration: Path, tmp_path: Path
) -> None:
    """The limits move with the pose: such a file would be none, with or without --out."""
    mine = tmp_path / "mine.yaml"
    for more in ((), ("-o", mine)):
        refused = run("zero", "so101", "--from", calibration, "--pose", "500,0,0,0,0", *more, "--json")
        answer = json.loads(refused.err)
        assert (refused.code, refused.out, mine.exists()) == (2, "", False)
        assert answer["error"] == (
            "--pose: shoulder_pan at 500 deg in the middle of its range makes its limits 379.985 to "
            "620.015 deg, and its pose home is at 0: the middle must be from -120.015 to 120.015 deg"
        )
        assert (answer["joint"], answer["middle"]) == ("shoulder_pan", 500)
        assert (answer["lower"], answer["upper"]) == pytest.approx((-120.0146, 120.0146), abs=1e-4)
    allowed = run("zero", "so101", "--from", calibration, "--pose", "120,0,0,0,0", "-o", mine)
    assert (allowed.code, mine.exists()) == (0, True)


def test_a_named_pose_outside_the_new_limits_is_told(calibration: Path, tmp_path: Path) -> None:
    robot = tmp_path / "robot.yaml"
    robot.write_text(Path("robots/so101.yaml").read_text() + "poses: {high: [0, 0, 95, 0, 0]}\n")
    write_changed(calibration, "elbow_flex", range_min=1500, range_max=2500)
    refused = run("zero", robot, "--from", calibration, "-o", tmp_path / "mine.yaml")
    assert (refused.code, (tmp_path / "mine.yaml").exists()) == (2, False)
    assert "elbow_flex at 0 deg in the middle of its range makes its limits -43.9453 to 43.9453 deg" in refused.err
    assert "its pose high is at 95: the middle must be from 51.0547 to 138.945 deg" in refused.err
    assert "--pose NAME|Q,... says it" in refused.err
