"""A motion that an RC servo cannot make is refused before anything moves; a joint without limits is no exception."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import armkin
from armkin.board.kinds import board_of
from armkin.errors import NoSolutionError
from armkin.motion.joint_moves import plan_joint_moves
from armkin.motors import pulses
from command_line import run

BEYOND = 120  # [deg]; the servos of planar_3dof turn 90 to both sides
TRAVEL = "outside its travel, 500 to 2500 (q1 from -90 to 90 deg): nothing was moved"


@pytest.fixture
def servo_file(tmp_path: Path) -> Path:
    """A copy of planar_3dof that has all that motion needs."""
    text = run("export", "planar_3dof", "--dh").out.replace(
        "    drive:", "    max_speed: 60\n    max_accel: 120\n    drive:"
    )
    file = tmp_path / "servos.yaml"
    file.write_text(text)
    return file


def test_every_command_that_moves_refuses_it(servo_file: Path, tmp_path: Path) -> None:
    path = tmp_path / "path.yaml"
    path.write_text(f"moves:\n  - joint: [45, 0, 0]\n  - joint: [{BEYOND}, 0, 0]\n")
    rows = tmp_path / "rows.csv"
    rows.write_text(f"45,0,0\n{BEYOND},0,0\n")
    answer = run("pulses", servo_file, BEYOND, 0, 0, "--json")
    assert answer.json["outside_travel"] == ["q1"]
    for words, stdin in (
        (("send", servo_file, BEYOND, 0, 0, "--port", "sim"), b""),
        (("send", servo_file, BEYOND, 0, 0, "--dry-run"), b""),
        (("send", servo_file, "--batch", rows, "--port", "sim"), b""),
        (("send", "--port", "sim"), answer.out.encode()),
        (("path", servo_file, path), b""),
        (("path", servo_file, path, "--port", "sim"), b""),
    ):
        completed = run(*words, stdin=stdin)
        assert (completed.code, completed.out) == (3, ""), words
        assert TRAVEL in completed.err, words


def test_a_batch_of_pulses_warns_as_a_single_pose_does(servo_file: Path) -> None:
    rows = f"10,0,0\n{BEYOND},0,0\n0,-{BEYOND},0\n".encode()
    for option in ((), ("--json",)):
        completed = run("pulses", servo_file, "--batch", "-", *option, stdin=rows)
        assert completed.code == 0
        assert "2 of 3 rows are outside the limits or what a servo can turn; the first is row 2" in completed.err


def test_both_ends_of_the_travel_can_be_reached(servo_file: Path) -> None:
    assert run("send", servo_file, 90, -90, 90, "--port", "sim").code == 0


def test_a_servo_that_starts_beyond_may_come_back_and_goes_no_farther(servo_file: Path) -> None:
    arm = armkin.load(servo_file)
    board, beyond = board_of(arm), np.deg2rad([100.0, 0.0, 0.0])
    for goal, is_allowed in ((80.0, True), (100.0, True), (101.0, False)):
        trajectory = plan_joint_moves(arm, beyond, np.deg2rad([[goal, 0.0, 0.0]]))
        if is_allowed:
            board.plan_trajectory(trajectory, pulses(arm, beyond))
        else:
            with pytest.raises(NoSolutionError, match="the servo of q1 cannot turn that far"):
                board.plan_trajectory(trajectory, pulses(arm, beyond))
