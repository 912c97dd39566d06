"""`armkin home`, rehearsed on the simulated board with switches where the robot file says."""

from pathlib import Path

import numpy as np
import pytest

import armkin
from armkin.board.firmware.configuration import configure
from armkin.board.firmware.homing import switch_levels
from armkin.board.sim.sim_board import SimBoard
from armkin.board_catalogue import BOARDS
from command_line import ROOT, THREE_DOF, run
from pty_board import PtyBoard
from sim_wire import plug_in

LOWER, UPPER = (-20, 75, -105), (20, 105, -75)  # where the switches are, not far from home
WRIST = """  - name: q4
    dh: {alpha: 0, a: 50, d: 0, theta: 0}
    limits: [-90, 90]
    home: 10
    max_speed: 60
    max_accel: 120
    drive: {axis: A, full_steps: 200, microsteps: 16, gear: 4}
"""


def arm_with_switches(folder: Path, *, four: bool, normally: str = "closed", upper: bool = False) -> str:
    """The three-axis arm with a switch on every axis; four: and a wrist that has none."""
    text = (ROOT / THREE_DOF).read_text().replace("task: xyz\n", "")
    for axis, switch_value in zip("XYZ", UPPER if upper else LOWER, strict=True):
        way = 1 if upper else -1
        homing = (
            f"{{switch: {axis}, direction: {way}, at: {switch_value}, speed: 40, backoff: 3, normally: {normally}}}"
        )
        text = text.replace(f"    drive: {{axis: {axis},", f"    homing: {homing}\n    drive: {{axis: {axis},")
    head, joints, tail = text.partition("\n# The paper has a gripper")
    path = folder / "switched.yaml"
    path.write_text(head + (WRIST if four else "") + joints + tail)
    return str(path)


def behind_a_port(path: str, monkeypatch: pytest.MonkeyPatch) -> SimBoard:
    """A board whose switches are where the robot file says."""
    arm = armkin.load(path)
    board = SimBoard(BOARDS["uno_cnc_shield"], switch_levels(arm, configure(arm)))
    plug_in(board, monkeypatch)
    return board


@pytest.mark.parametrize(("normally", "upper"), [("closed", False), ("open", True)])
def test_homing_is_rehearsed_and_ends_in_the_home_pose(tmp_path: Path, normally: str, upper: bool) -> None:
    path = arm_with_switches(tmp_path, four=False, normally=normally, upper=upper)
    completed = run("home", path, "--port", "sim", "--json")
    assert completed.code == 0
    assert (completed.json["position"], completed.json["pulses"]) == ("known", [0, 0, 0])
    assert [line for line in completed.err.splitlines() if "homing" in line] == [
        f"note: homing q{i}" for i in (1, 2, 3)
    ]
    stays = run("home", path, "--port", "sim", "--stay", "--json").json["joints"]
    switch_values = UPPER if upper else LOWER
    step = np.rad2deg(armkin.load(path).motor_gain.max(axis=1) ** -1)
    assert np.all(np.abs(np.subtract(stays, switch_values)) < 1.0 + 2 * step)  # stops behind the edge, within a degree


def test_a_joint_without_a_switch_rests_at_home(tmp_path: Path) -> None:
    path = arm_with_switches(tmp_path, four=True)
    refused = run("home", path, "--port", "sim")
    assert refused.code == 2
    assert "has no homing for q4" in refused.err
    assert "--rest-at-home" in refused.err
    completed = run("home", path, "--port", "sim", "--rest-at-home", "--json")
    assert completed.code == 0
    assert completed.json["joints"] == pytest.approx([0, 90, -90, 10])


def test_homing_that_leaves_a_joint_lost_fails_and_says_the_next_step(tmp_path: Path) -> None:
    path = arm_with_switches(tmp_path, four=True)
    three_homed = run("home", path, "q1", "q2", "q3", "--port", "sim")
    assert (three_homed.code, three_homed.out) == (5, "")
    assert "homed q1, q2, q3; the position of q4 is still lost" in three_homed.err
    assert f"armkin home {path} --rest-at-home" in three_homed.err
    completed = run("home", arm_with_switches(tmp_path, four=False), "q2", "--port", "sim")
    assert completed.code == 5
    assert f"armkin home {path} q1 q3" in completed.err


def test_the_documented_way_on_a_board_behind_a_port(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The shield's fourth axis has no input: three switches, and a word for the rest."""
    path = arm_with_switches(tmp_path, four=True)
    behind_a_port(path, monkeypatch)
    assert run("send", path, 10, 80, -80, 0, "--port", "COM3").code == 5
    assert run("home", path, "--port", "COM3", "--rest-at-home").code == 0
    completed = run("send", path, 10, 80, -80, 0, "--port", "COM3", "--json")
    assert (completed.code, completed.json["position"]) == (0, "known")
    assert run("send", path, "home", "--port", "COM3", "--assume-home").code == 5


def test_the_order_of_the_file_is_kept(tmp_path: Path) -> None:
    path = arm_with_switches(tmp_path, four=False)
    text = Path(path).read_text()
    for switch, order in (("X", 3), ("Y", 1), ("Z", 2)):
        text = text.replace(f"{{switch: {switch},", f"{{switch: {switch}, order: {order},")
    Path(path).write_text(text)
    messages = run("home", path, "--port", "sim").err
    assert [line[-2:] for line in messages.splitlines() if "homing" in line] == ["q2", "q3", "q1"]


def test_a_wrong_board_is_called_by_its_name() -> None:
    with PtyBoard("uno_servos") as board:
        completed = run("status", THREE_DOF, "--port", board.port)
    assert completed.code == 5
    assert f"{board.port} is uno_servos, three_dof's board is uno_cnc_shield" in completed.err


def test_homing_again_reports_the_steps_that_were_lost(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The arm is pushed 40 steps while its count goes on; the switch, met again, tells."""
    path = arm_with_switches(tmp_path, four=False)
    board = behind_a_port(path, monkeypatch)
    first = run("home", path, "--port", "COM3", "--json")
    assert [joint_loss["steps"] for joint_loss in first.json["lost_steps"]] == [
        None,
        None,
        None,
    ]  # nothing was known before
    again = run("home", path, "--port", "COM3", "--json")
    assert all(abs(joint_loss["steps"]) <= 1 for joint_loss in again.json["lost_steps"]), again.json["lost_steps"]
    assert "lost" not in again.err
    board.motors.axes.net[0] -= 40
    pushed = run("home", path, "--port", "COM3", "--json")
    x, y, z = pushed.json["lost_steps"]
    assert x["steps"] == pytest.approx(40, abs=1)
    assert x["difference"] == pytest.approx(x["steps"] / armkin.load(path).motor_gain[0, 0] * 180 / np.pi)
    assert max(abs(y["steps"]), abs(z["steps"])) <= 1
    board.motors.axes.net[0] -= 40
    completed = run("home", path, "--port", "COM3")
    assert (
        f"q1: {x['steps']} steps were lost since its position was last set ({x['difference']:.3f} deg)" in completed.err
    )
    assert "q2" not in completed.err.replace("homing q2", "")


def test_home_without_switches_is_refused_by_name() -> None:
    completed = run("home", THREE_DOF, "--port", "sim")
    assert completed.code == 2
    assert "has no homing for q1, q2, q3" in completed.err
