"""From the command line to the pins: `armkin send` and its neighbours against the compiled firmware in the emulator."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from emulator import EmulatedBoard
from pins import net_steps
from switches import assert_found, fit_switches, with_switches

from armkin.board.firmware.configuration import configure
from armkin.board.firmware.firmware_machine import FirmwareMachine
from armkin.board.firmware.segments.trajectory_to_counts import plan_moves as plan_moves
from armkin.board.firmware.wire.protocol import Flag
from armkin.board.ports import SerialPort
from armkin.model import build_arm as arms
from command_line import COUNTS, POSE, ROOT, THREE_DOF, run, run_process


def test_the_published_pose_on_the_pins(board: EmulatedBoard) -> None:
    completed = run_process("send", THREE_DOF, *POSE, "--port", board.port, "--assume-home")
    assert completed.code == 0, completed.err
    assert net_steps(board) == COUNTS
    stats = board.stats()
    for axis in "XYZ":
        assert set(stats["axes"][axis]["violations"].values()) == {0}
    assert stats["axes"]["Y"]["max_rate_hz"] < 7161 * 1.05


def test_waypoints_in_a_file(board: EmulatedBoard, tmp_path: Path) -> None:
    path = tmp_path / "path.csv"
    path.write_text("10,80,-80\n12,78,-82\n-3,70,-85\n-3,70,-85\n0,90,-90\n")
    completed = run("send", THREE_DOF, "--batch", path, "--port", board.port, "--assume-home", "--json")
    assert completed.code == 0, completed.err
    assert completed.json["waypoints"] == 5
    assert net_steps(board) == [0, 0, 0]
    assert board.stats()["axes"]["Y"]["negative"] > 2000


def test_the_gripper(board: EmulatedBoard) -> None:
    refused = run("grip", THREE_DOF, "closed", "--port", board.port)
    assert refused.code == 5
    assert "--assume open" in refused.err
    completed = run("grip", THREE_DOF, "closed", "--port", board.port, "--assume", "open")
    assert completed.code == 0, completed.err
    board.wait(0.05)
    [servo] = board.stats()["servos"].values()
    assert servo["width_us"] == pytest.approx(1833, abs=3)
    # A reset in between has taken the pulses away: consent is asked for again.
    assert run("grip", THREE_DOF, "open", "--port", board.port).code == 5
    # The arm's position is another matter.
    assert run("send", THREE_DOF, *POSE, "--port", board.port).code == 5


def test_homing_finds_the_switches(board: EmulatedBoard, tmp_path: Path) -> None:
    robot = with_switches(tmp_path / "homing.yaml")
    assert "armkin home" in run("send", robot, *POSE, "--port", board.port).err
    fit_switches(board)
    completed = run("home", robot, "--port", board.port, "--json")
    assert completed.code == 0, completed.err
    assert completed.json["position"] == "known"
    assert_found(completed.json["pulses"], net_steps(board))
    finish_at = run("send", robot, *POSE, "--port", board.port, "--json")
    assert finish_at.code == 0, finish_at.err
    assert finish_at.json["pulses"] == COUNTS


def test_a_jog_of_a_lost_arm_is_slow(board: EmulatedBoard) -> None:
    completed = run("jog", THREE_DOF, "q1", 60, "--port", board.port, "--seconds", "1")
    assert completed.code == 0, completed.err
    assert "position is lost" in completed.err
    assert board.stats()["axes"]["X"]["max_rate_hz"] == pytest.approx(60 / 8 * 12800 / 360, rel=0.02)
    assert 20 < net_steps(board)[0] < 300  # for a second of the host's time: a busy machine gives the board less of it


COUPLED = """
name: wrist
convention: standard
board: {kind: mega_ramps14, driver: TMC2209}
joints:
  - {name: J1, dh: {alpha: 90, a: 0, d: 100}, limits: [-90, 90], max_speed: 60, max_accel: 200}
  - {name: J2, dh: {alpha: 0, a: 100, d: 0}, limits: [-40, 40], max_speed: 60, max_accel: 200}
  - {name: J3, dh: {alpha: 0, a: 100, d: 0}, limits: [-50, 50], max_speed: 60, max_accel: 200}
motors:
  - {name: M1, axis: X, joints: {J1: 1}, full_steps: 200, microsteps: 16, gear: 4}
  - {name: M2, axis: E0, joints: {J2: 1, J3: 1}, full_steps: 200, microsteps: 16, gear: 3}
  - {name: M3, axis: E1, joints: {J2: 1, J3: -1}, full_steps: 200, microsteps: 16, gear: 3}
"""


def test_coupled_motors_and_their_joint_limits_on_both_sides(tmp_path: Path) -> None:
    robot = tmp_path / "wrist.yaml"
    robot.write_text(COUPLED)
    with EmulatedBoard("mega_ramps14") as board:
        completed = run("send", robot, 10, 40, -30, "--port", board.port, "--assume-home", "--json")
        assert completed.code == 0, completed.err
        pins = board.net()
        assert [pins[axis] for axis in ("X", "E0", "E1")] == completed.json["pulses"] == [356, 267, 1867]
        outside = run("send", robot, 10, 45, 0, "--port", board.port)
        assert (outside.code, board.net()) == (3, pins)
        # A host that forgets its own check meets the board's: joint 2 would go to 45 degrees.
        arm = arms.load_arm(robot)
        assert arm.file is not None
        loose = arms.arm_of_file(arm.file.model_copy(update={"joints": tuple(
            joint.model_copy(update={"limits": (-90.0, 90.0)}) for joint in arm.file.joints
        )}))  # fmt: skip
        port = SerialPort(board.port)
        try:
            machine = FirmwareMachine(port, arm, configure(arm))
            machine.prepare()
            plan = plan_moves(loose, machine.counts(), np.deg2rad([10, 45, -30]))
            with pytest.raises(Exception, match="LIMIT_JOINT"):
                machine.run([plan])
        finally:
            port.close()
        board.wait(0.2)
        stopped = board.net()
        joints = arm.home + (np.array([stopped[a] for a in ("X", "E0", "E1")]) @ np.linalg.pinv(arm.motor_gain).T)
        assert np.rad2deg(joints[1]) <= 40.1


def test_servos_ramp_from_the_pose_that_they_are_said_to_have(tmp_path: Path) -> None:
    text = (ROOT / "robots" / "ra02.yaml").read_text()
    robot = tmp_path / "servos.yaml"
    robot.write_text(
        text.replace("    drive: {kind: servo", "    max_speed: 90\n    max_accel: 360\n    drive: {kind: servo")
    )
    with EmulatedBoard("uno_servos") as board:
        refused = run("send", robot, 20, 20, 20, 20, "--port", board.port)
        assert refused.code == 5
        completed = run("send", robot, 20, 20, 20, 20, "--port", board.port, "--assume-home", "--json")
        assert completed.code == 0, completed.err
        board.wait(0.05)
        widths = [servo["width_us"] for servo in board.stats()["servos"].values()][:4]
        assert widths == pytest.approx(completed.json["pulses"], abs=3)
        status = run("status", robot, "--port", board.port, "--json").json
        # Opening the port again has reset the board: nothing holds servos without pulses.
        assert status["position"] == "lost"
        assert run("send", robot, 0, 0, 0, 0, "--port", board.port).code == 5


def test_what_the_host_knows_of_the_boards_is_what_they_say() -> None:
    from armkin.board.firmware.wire.session import Session
    from armkin.board_catalogue import BOARDS

    for kind, known in BOARDS.items():
        with EmulatedBoard(kind) as board:
            port = SerialPort(board.port)
            try:
                info = Session(port).open()
            finally:
                port.close()
        assert (info.board, info.axes, info.servos) == (known.number, len(known.axes), known.servo_mask)
        assert (info.switches, info.rows, info.queue) == (len(known.switches), known.rows, known.queue)
        assert (info.frame, info.min_interval, info.clock) == (known.frame, known.min_interval, known.clock)
        assert not info.flags & Flag.CONFIGURED
