"""From the command line to the pins: `armkin send` against the compiled firmware in the emulator."""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from emulator import EmulatedBoard

from armkin.board.firmware.configuration import configure
from armkin.board.firmware.cutting import plan as plan_moves
from armkin.board.firmware.machine import Machine
from armkin.board.firmware.protocol import Flag
from armkin.board.ports import SerialPort
from armkin.model import build as arms
from command_line import ROOT, THREE_DOF, process, run

POSE = (-30, 5, -5)
COUNTS = [-1067, -10144, 5667]
KILLS = 50


@pytest.fixture
def board() -> Iterator[EmulatedBoard]:
    with EmulatedBoard() as one:
        yield one


def net(board: EmulatedBoard) -> list[int]:
    """Net steps on the pins of X, Y, Z."""
    found = board.net()
    return [found[axis] for axis in "XYZ"]


def at_rest(board: EmulatedBoard, timeout: float = 10.0) -> list[int]:
    """Net steps once they have not changed for 0.15 s."""
    end = time.monotonic() + timeout
    before = net(board)
    while time.monotonic() < end:
        board.wait(0.15)
        now = net(board)
        if now == before:
            return now
        before = now
    raise AssertionError("the arm does not come to rest")


def on_the_line(now: Sequence[int], start: Sequence[int], end: Sequence[int]) -> bool:
    """Within two steps of the straight line between two counts."""
    far = int(np.argmax(np.abs(np.subtract(end, start))))
    share = (now[far] - start[far]) / (end[far] - start[far])
    return 0 <= share <= 1 and all(abs(n - a - share * (b - a)) <= 2 for n, a, b in zip(now, start, end, strict=True))


def moving(board: EmulatedBoard, *words: object) -> subprocess.Popen[bytes]:
    """A send to the pose that is at its full speed, half of the joints'."""
    command = [
        sys.executable,
        "-m",
        "armkin",
        "send",
        THREE_DOF,
        *map(str, POSE),
        "--port",
        board.port,
        "--speed",
        "50",
    ]
    sender = subprocess.Popen([*command, *map(str, words)], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    end = time.monotonic() + 30
    while net(board)[1] > -3000:
        assert time.monotonic() < end, sender.communicate(timeout=5)
        time.sleep(0.01)
    return sender


def finish(board: EmulatedBoard, *words: object) -> None:
    """The next command plans from where the arm stands, to exact counts on the pins."""
    done = run("send", THREE_DOF, *POSE, "--port", board.port, "--json", *words)
    assert done.code == 0, done.err
    assert done.json["pulses"] == COUNTS


def test_the_published_pose_on_the_pins(board: EmulatedBoard) -> None:
    done = process("send", THREE_DOF, *POSE, "--port", board.port, "--assume-home")
    assert done.code == 0, done.err
    assert net(board) == COUNTS
    stats = board.stats()
    for axis in "XYZ":
        assert set(stats["axes"][axis]["violations"].values()) == {0}
    assert stats["axes"]["Y"]["max_rate_hz"] < 7161 * 1.05


def test_a_position_is_kept_through_a_reset_at_rest_and_no_other(board: EmulatedBoard) -> None:
    assert run("send", THREE_DOF, 10, 80, -80, "--port", board.port, "--assume-home").code == 0
    board.control("reset external")
    status = run("status", THREE_DOF, "--port", board.port, "--json").json
    assert status["position"] == "retained"
    assert status["pulses"] == net(board)
    finish(board)
    assert net(board) == COUNTS
    board.control("reset power")
    lost = run("send", THREE_DOF, 10, 80, -80, "--port", board.port)
    assert lost.code == 5
    assert "position is lost" in lost.err
    assert net(board) == COUNTS


def test_a_reset_in_motion_is_a_lost_position(board: EmulatedBoard) -> None:
    sender = moving(board, "--assume-home")
    board.control("reset external")
    _, err = sender.communicate(timeout=30)
    assert sender.returncode == 5
    assert b"the board was reset" in err
    assert b"position is lost" in err
    stopped = at_rest(board)
    again = run("send", THREE_DOF, *POSE, "--port", board.port)
    assert again.code == 5
    assert "position is lost" in again.err
    assert net(board) == stopped


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_stops_on_the_path(board: EmulatedBoard, number: signal.Signals, code: int) -> None:
    sender = moving(board, "--assume-home")
    sender.send_signal(number)
    _, err = sender.communicate(timeout=30)
    assert sender.returncode == code, err
    stopped = net(board)
    assert on_the_line(stopped, [0, 0, 0], COUNTS)
    assert at_rest(board) == stopped
    finish(board)
    assert net(board) == COUNTS


def test_a_killed_process(board: EmulatedBoard) -> None:
    sender = moving(board, "--assume-home")
    sender.kill()
    sender.communicate()
    stopped = at_rest(board)
    assert on_the_line(stopped, [0, 0, 0], COUNTS)
    finish(board)
    assert net(board) == COUNTS


def test_a_boot_loader_hides_the_cause_and_the_position_is_retained() -> None:
    """The stock Uno: it swallows what comes in its first second and a half, and clears MCUSR."""
    with EmulatedBoard(bootloader=1500) as board:
        assert run("send", THREE_DOF, 10, 80, -80, "--port", board.port, "--assume-home").code == 0
        status = run("status", THREE_DOF, "--port", board.port, "--json").json
        assert (status["position"], status["reset_cause"]) == ("retained", 0)
        assert status["boots"] >= 2
        finish(board)
        assert net(board) == COUNTS


class _KilledError(Exception):
    pass


@contextmanager
def machine(board: EmulatedBoard, dies_after: float | None = None) -> Iterator[Machine]:
    """The three-joint arm on this board; a sender that dies falls silent in the middle of whatever it does."""
    arm = arms.load(ROOT / THREE_DOF)
    port = SerialPort(board.port)
    born = time.monotonic()

    def dead() -> bool:
        if dies_after is not None and time.monotonic() - born > dies_after:
            raise _KilledError
        return False

    try:
        yield Machine(port, arm, configure(arm), dead)
    finally:
        port.close()


def _killed_often(seed: int, times: int) -> list[str]:
    """Send back and forth, die at random moments; what went wrong."""
    rng = random.Random(seed)
    wrong: list[Any] = []
    goals = np.deg2rad([[-30, 5, -5], [25, 85, -60]])
    with EmulatedBoard(seed=seed) as board:
        with machine(board) as first:
            first.prepare(assume=first.arm.home)
        for i in range(times):
            start = at_rest(board)
            try:
                with machine(board, rng.uniform(0.15, 1.6)) as one:
                    if one.position() == "lost" or list(one.counts()) != start:
                        return [*wrong, f"kill {i}: the board says {one.position()} {one.counts()}, pins {start}"]
                    one.prepare()
                    plan = plan_moves(one.arm, start, goals[rng.randrange(2)])
                    end = plan.end.tolist()
                    one.run([plan])
            except _KilledError:
                board.wait(0.6)  # the board notices after half a second, at rest or not
            stopped = at_rest(board)
            if end != start and not on_the_line(stopped, start, end):
                wrong.append(f"kill {i}: {start} to {end} stopped at {stopped}")
            board.wait(0.3)
            if net(board) != stopped:
                wrong.append(f"kill {i}: moved again")
    return wrong


def test_a_sender_killed_at_fifty_random_moments() -> None:
    with ThreadPoolExecutor(2) as pool:
        assert list(pool.map(lambda seed: _killed_often(seed, KILLS // 2), (1, 2))) == [[], []]


def test_a_cut_cable(board: EmulatedBoard) -> None:
    sender = moving(board, "--assume-home")
    board.control("cut both")
    stopped = at_rest(board)
    assert on_the_line(stopped, [0, 0, 0], COUNTS)
    _, err = sender.communicate(timeout=30)
    assert sender.returncode == 5
    assert b"does not answer any more" in err
    board.control("restore")
    board.wait(0.3)
    assert net(board) == stopped
    finish(board)
    assert net(board) == COUNTS


def test_the_abort_input(board: EmulatedBoard) -> None:
    sender = moving(board, "--assume-home")
    board.control("pin A0 0")
    _, err = sender.communicate(timeout=30)
    assert sender.returncode == 5
    assert b"the abort input is active" in err
    stopped = net(board)
    assert on_the_line(stopped, [0, 0, 0], COUNTS)
    blocked = run("send", THREE_DOF, *POSE, "--port", board.port)
    assert blocked.code == 5
    assert "abort input" in blocked.err
    assert net(board) == stopped
    board.control("pin A0 z")
    finish(board)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_noisy_line_ends_at_exact_counts(seed: int) -> None:
    """1 % of the bytes flipped and 1 % dropped, in both directions."""
    with EmulatedBoard(seed=seed) as board:
        assert run("send", THREE_DOF, 1, 89, -89, "--port", board.port, "--assume-home").code == 0
        start = net(board)
        board.control(f"noise flip 0.01 drop 0.01 seed {seed}")
        done = run("send", THREE_DOF, *POSE, "--port", board.port, "--json")
        now = at_rest(board)
        if done.code == 0:
            assert now == COUNTS
        else:  # too busy a machine to keep the queue filled: it must end, on the path, and know where
            assert "its position is known" in done.err
            assert on_the_line(now, start, COUNTS)
        board.control("restore")
        finish(board)
        assert net(board) == COUNTS


def test_waypoints_in_a_file(board: EmulatedBoard, tmp_path: Path) -> None:
    path = tmp_path / "path.csv"
    path.write_text("10,80,-80\n12,78,-82\n-3,70,-85\n-3,70,-85\n0,90,-90\n")
    done = run("send", THREE_DOF, "--batch", path, "--port", board.port, "--assume-home", "--json")
    assert done.code == 0, done.err
    assert done.json["waypoints"] == 5
    assert net(board) == [0, 0, 0]
    assert board.stats()["axes"]["Y"]["negative"] > 2000


def test_after_a_cut_of_the_power_the_position_is_declared_lost() -> None:
    with EmulatedBoard(reset_on_open=False) as board:
        assert run("send", THREE_DOF, 1, 89, -89, "--port", board.port, "--assume-home").code == 0
        assert run("status", THREE_DOF, "--port", board.port, "--json").json["position"] == "known"
        done = run("stop", "--power-cut", "--port", board.port)
        assert (done.code, done.err) == (
            0,
            "note: the arm stands; its position is lost: home it, or say --assume-home\n",
        )
        assert run("status", THREE_DOF, "--port", board.port, "--json").json["position"] == "lost"
        assert run("send", THREE_DOF, 0, 90, -90, "--port", board.port).code == 5


def test_the_gripper(board: EmulatedBoard) -> None:
    refused = run("grip", THREE_DOF, "closed", "--port", board.port)
    assert refused.code == 5
    assert "--assume open" in refused.err
    done = run("grip", THREE_DOF, "closed", "--port", board.port, "--assume", "open")
    assert done.code == 0, done.err
    board.wait(0.05)
    [servo] = board.stats()["servos"].values()
    assert servo["width_us"] == pytest.approx(1833, abs=3)
    # A reset in between has taken the pulses away: consent is asked for again.
    assert run("grip", THREE_DOF, "open", "--port", board.port).code == 5
    # The arm's position is another matter.
    assert run("send", THREE_DOF, *POSE, "--port", board.port).code == 5


HOMING = """    homing: {{switch: {switch}, direction: {way}, at: {at}, speed: 20, backoff: 2, normally: open{order}}}
"""


def with_switches(path: Path) -> Path:
    """The three-joint arm with a limit switch on every joint."""
    text = (ROOT / THREE_DOF).read_text()
    for axis, way, at, order in (("X", -1, -121, ", order: 2"), ("Y", 1, 121, ", order: 1"), ("Z", -1, -125, "")):
        head, tail = text.split(f"    drive: {{axis: {axis}", 1)
        text = head + HOMING.format(switch=axis, way=way, at=at, order=order) + f"    drive: {{axis: {axis}" + tail
    path.write_text(text)
    return path


def test_homing_finds_the_switches(board: EmulatedBoard, tmp_path: Path) -> None:
    robot = with_switches(tmp_path / "homing.yaml")
    assert "armkin home" in run("send", robot, *POSE, "--port", board.port).err
    # The arm was left somewhere; its switches are there, in steps from where it stands.
    edges = {"X": -900, "Y": 1500, "Z": -1200}
    for axis, edge in edges.items():
        board.control(f"set-switch {axis} at {edge} {'above' if edge > 0 else 'below'} bounce 2ms")
    done = run("home", robot, "--port", board.port, "--json")
    assert done.code == 0, done.err
    assert done.json["position"] == "known"
    # Where the board believes to be, less what the pins have done, is where the switches are.
    at = {"X": -4302, "Y": 3700, "Z": -2333}  # -121, 121 and -125 deg in steps from home
    for axis, pulses, pins in zip("XYZ", done.json["pulses"], net(board), strict=True):
        assert pulses - at[axis] == pytest.approx(pins - edges[axis], abs=1)
    finish_at = run("send", robot, *POSE, "--port", board.port, "--json")
    assert finish_at.code == 0, finish_at.err
    assert finish_at.json["pulses"] == COUNTS


def test_a_jog_of_a_lost_arm_is_slow(board: EmulatedBoard) -> None:
    done = run("jog", THREE_DOF, "q1", 60, "--port", board.port, "--seconds", "1")
    assert done.code == 0, done.err
    assert "position is lost" in done.err
    assert 200 < net(board)[0] < 300  # an eighth of 60 deg/s for about a second


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
        done = run("send", robot, 10, 40, -30, "--port", board.port, "--assume-home", "--json")
        assert done.code == 0, done.err
        pins = board.net()
        assert [pins[axis] for axis in ("X", "E0", "E1")] == done.json["pulses"] == [356, 267, 1867]
        outside = run("send", robot, 10, 45, 0, "--port", board.port)
        assert (outside.code, board.net()) == (3, pins)
        # A host that forgets its own check meets the board's: joint 2 would go to 45 degrees.
        arm = arms.load(robot)
        assert arm.file is not None
        loose = arms.build(arm.file.model_copy(update={"joints": tuple(
            joint.model_copy(update={"limits": (-90.0, 90.0)}) for joint in arm.file.joints
        )}))  # fmt: skip
        port = SerialPort(board.port)
        try:
            one = Machine(port, arm, configure(arm))
            one.prepare()
            plan = plan_moves(loose, one.counts(), np.deg2rad([10, 45, -30]))
            with pytest.raises(Exception, match="LIMIT_JOINT"):
                one.run([plan])
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
        done = run("send", robot, 20, 20, 20, 20, "--port", board.port, "--assume-home", "--json")
        assert done.code == 0, done.err
        board.wait(0.05)
        widths = [servo["width_us"] for servo in board.stats()["servos"].values()][:4]
        assert widths == pytest.approx(done.json["pulses"], abs=3)
        status = run("status", robot, "--port", board.port, "--json").json
        # Opening the port again has reset the board: nothing holds servos without pulses.
        assert status["position"] == "lost"
        assert run("send", robot, 0, 0, 0, 0, "--port", board.port).code == 5


def test_what_the_host_knows_of_the_boards_is_what_they_say() -> None:
    from armkin.board.firmware.session import Session
    from armkin.hardware import BOARDS

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
