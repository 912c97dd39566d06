"""An arm on a simulated board, in simulated time: configuration, coupled joints, homing, noise, what is refused."""

from __future__ import annotations

import random
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armkin.board.backend import StoppedError
from armkin.board.firmware import homing
from armkin.board.firmware.configuration import configure
from armkin.board.firmware.firmware_machine import FirmwareMachine
from armkin.board.firmware.segments.trajectory_to_counts import plan_moves as plan_moves
from armkin.board.firmware.wire.protocol import State
from armkin.board.firmware.wire.session import ReplacedError
from armkin.board.sim.sim_board import SimBoard
from armkin.board.sim.sim_port import SimPort
from armkin.board_catalogue import BOARDS
from armkin.errors import LinkError, UsageError
from armkin.model import build_arm as arms
from armkin.model.arm import Arm
from armkin.motors import joints, pulses
from armkin.robot_file import parse_robot_file
from command_line import THREE_DOF, run

ROBOT = "robots/three_dof.yaml"
WRIST = """
name: wrist
convention: standard
board: {kind: mega_ramps14, driver: TMC2209}
joints:
  - {name: J1, dh: {alpha: 90, a: 0, d: 100}, limits: [-90, 90], max_speed: 60, max_accel: 200, %s}
  - {name: J2, dh: {alpha: 0, a: 100, d: 0}, limits: [-40, 40], max_speed: 60, max_accel: 200, %s}
  - {name: J3, dh: {alpha: 0, a: 100, d: 0}, limits: [-50, 70], max_speed: 60, max_accel: 200, %s}
motors:
  - {name: M1, axis: X, joints: {J1: 1}, full_steps: 200, microsteps: 16, gear: 4}
  - {name: M2, axis: E0, joints: {J2: 1, J3: 1}, full_steps: 200, microsteps: 16, gear: 3}
  - {name: M3, axis: E1, joints: {J2: 1, J3: -1}, full_steps: 200, microsteps: 16, gear: 2}
"""
SWITCHES = [
    f"homing: {{switch: {name}, direction: {way}, at: {at}, speed: 20, backoff: 3, normally: {kind}}}"
    for name, way, at, kind in (
        ("X_MIN", -1, -92, "open"),
        ("Y_MAX", 1, 42, "closed"),
        ("Z_MIN", -1, -53, "open"),
    )
]


@pytest.fixture(scope="module")
def wrist() -> Arm:
    return arms.arm_of_file(parse_robot_file(WRIST % tuple(SWITCHES)))


@pytest.fixture(scope="module")
def three_dof() -> Arm:
    return arms.load_arm(ROBOT)


class NoisyPort(SimPort):
    """A line that flips and drops bytes, both ways."""

    def __init__(self, board: SimBoard, probability: float, seed: int) -> None:
        super().__init__(board)
        self.simulated = False
        self._probability, self._random = probability, random.Random(seed)
        self.damaged = 0

    def write(self, data: bytes) -> None:
        super().write(self._line(data))

    def read(self, timeout: float) -> bytes:
        return self._line(super().read(timeout))

    def _line(self, data: bytes) -> bytes:
        damaged = bytearray()
        for byte in data:
            if self._random.random() < self._probability:
                byte ^= 1 << self._random.randrange(8)
                self.damaged += 1
            if self._random.random() >= self._probability:
                damaged.append(byte)
        return bytes(damaged)


def connect_board(arm: Arm, port: SimPort | None = None) -> FirmwareMachine:
    configuration = configure(arm)
    return FirmwareMachine(port or SimPort(SimBoard(configuration.board)), arm, configuration)


@pytest.mark.parametrize("seed", range(20))
def test_a_noisy_line_ends_at_exact_counts(three_dof: Arm, seed: int) -> None:
    """About 300 segments on a line that damages 2 % of the bytes in each direction."""
    board = SimBoard(BOARDS["uno_cnc_shield"])
    port = NoisyPort(board, 0.01, seed)
    machine = connect_board(three_dof, port)
    machine.prepare(assume=machine.arm.home)
    rng = np.random.default_rng(seed)
    plans, counts = [], list(machine.counts())
    for _ in range(5):
        plans.append(
            plan_moves(three_dof, counts, rng.uniform(np.deg2rad([-60, 20, -100]), np.deg2rad([60, 110, -10])))
        )
        counts = plans[-1].end.tolist()
    status = machine.run(plans)
    assert list(machine.counts()) == counts
    assert board.net[:3] == counts
    assert status.state == State.IDLE
    assert port.damaged > 100


def test_a_stop_holds_on_the_path(three_dof: Arm) -> None:
    configuration = configure(three_dof)
    port = SimPort(SimBoard(configuration.board))
    machine = FirmwareMachine(port, three_dof, configuration, lambda: port.board.net[1] < -4000)
    machine.prepare()
    plan = plan_moves(three_dof, machine.counts(), np.deg2rad([-30, 5, -5]))
    with pytest.raises(StoppedError) as stopped:
        machine.run([plan])
    status = stopped.value.status
    assert status is not None
    assert status.state == State.IDLE
    assert -7500 < status.counts[1] < -4000
    assert status.counts[0] == pytest.approx(status.counts[1] * 1067 / 10144, abs=2)
    assert status.known == 7


def test_lost_known_and_changed(three_dof: Arm) -> None:
    board = SimBoard(BOARDS["uno_cnc_shield"])
    port = NoisyPort(board, 0.0, 1)
    with pytest.raises(LinkError, match="position is lost"):
        connect_board(three_dof, port).prepare()
    assert connect_board(three_dof, port).prepare(assume=three_dof.home)
    with pytest.raises(LinkError, match="position is known"):
        connect_board(three_dof, port).prepare(assume=three_dof.home)
    assert connect_board(three_dof, port).position() == "known"
    board.reset()
    assert connect_board(three_dof, port).position() == "retained"
    changed_arm = arms.arm_of_file(parse_robot_file(Path(ROBOT).read_text().replace("pulley: 4", "pulley: 5")))
    changed = connect_board(changed_arm, port)
    assert changed.position() == "lost"
    with pytest.raises(LinkError, match="configured for another arm"):
        changed.prepare()
    assert connect_board(three_dof, port).position() == "retained"  # nothing was changed by asking
    with pytest.raises(ReplacedError, match="another program has taken over the board"):
        changed.prepare(assume=changed.arm.home)
    assert connect_board(changed_arm, port).prepare(assume=changed_arm.home)
    assert connect_board(three_dof, port).position() == "lost"


def test_motors_that_stand_elsewhere_than_stated_are_named(three_dof: Arm) -> None:
    machine = connect_board(three_dof)
    machine.prepare()
    counts = list(machine.counts())
    with pytest.raises(LinkError, match=rf"q2 at {counts[1]} counts, not {counts[1] + 5}: home the arm"):
        machine.vouch({0: counts[0], 1: counts[1] + 5})
    assert list(machine.counts()) == counts


def test_another_board_is_refused(three_dof: Arm, wrist: Arm) -> None:
    with pytest.raises(LinkError, match="sim is mega_ramps14, three_dof's board is uno_cnc_shield"):
        connect_board(three_dof, SimPort(SimBoard(BOARDS["mega_ramps14"])))


def test_the_image_of_the_published_arm(three_dof: Arm) -> None:
    configuration = configure(three_dof)
    x, y, z, a, servo = configuration.image.axes
    assert (x.lower, x.upper, x.max_rate, x.max_accel) == (-4267, 4267, 2240, 4267)
    assert (y.lower, y.upper, y.max_rate) == (-13127, 3580, 7519)
    assert (z.lower, z.upper) == (-2000, 14000)
    assert not a.used
    assert (servo.lower, servo.upper, servo.home) == (833, 1833, 833)
    assert configuration.image.rows == ()


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        (", driver: A4988", "", "has no driver"),
        ("axis: Y, ", "", "motor q2 has no axis"),
        ("    max_accel: 120\n", "", "its joints have no max_accel"),
    ],
)
def test_what_is_missing_is_named(before: str, after: str, message: str) -> None:
    text = Path(ROBOT).read_text()
    assert before in text
    with pytest.raises(UsageError, match=message):
        configure(arms.arm_of_file(parse_robot_file(text.replace(before, after))))


@settings(max_examples=200, deadline=None)
@given(st.lists(st.floats(-95, 95), min_size=3, max_size=3))
def test_the_boards_rows_are_the_joint_limits(wrist: Arm, degrees: Sequence[float]) -> None:
    """Every legal pose passes, and a pose outside by more than the rounding of a few steps does not."""
    configuration = configure(wrist)
    assert len(configuration.image.rows) == 2
    q = np.deg2rad(degrees)
    counts = [0] * len(configuration.board.axes)
    for axis, count in zip(configuration.axes, pulses(wrist, q).tolist(), strict=True):
        counts[axis] = count
    inside = all(
        row.lower <= sum(w * c for w, c in zip(row.weight, counts, strict=True)) <= row.upper
        for row in configuration.image.rows
    ) and all(not a.used or a.lower <= c <= a.upper for a, c in zip(configuration.image.axes, counts, strict=True))
    beyond = np.maximum(wrist.lower - q, q - wrist.upper).max()
    if beyond <= 0:
        assert inside
    if beyond > np.deg2rad(0.1):
        assert not inside


def test_coupled_joints_move_together_to_exact_counts(wrist: Arm) -> None:
    machine = connect_board(wrist)
    machine.prepare()
    plan = plan_moves(wrist, machine.counts(), np.deg2rad([[80, 40, 70], [0, -40, -50], [0, 0, 0]]))
    assert np.all(plan.trajectory.top_speed <= wrist.max_speed * (1 + 1e-9))
    machine.run([plan])
    assert machine.counts() == (0, 0, 0)


def test_coupled_joints_home_one_after_another(wrist: Arm) -> None:
    start = np.deg2rad([10.0, -15.0, 20.0])  # where the arm stands, and nobody knows
    configuration = configure(wrist)
    axes = list(configuration.axes)
    edges = np.deg2rad([-92.0, 42.0, -53.0])
    per_count = np.linalg.pinv(wrist.motor_gain)

    def switch(number: int, net: Sequence[int]) -> bool:
        """Level of an input: joint 2's switch opens when pressed."""
        q = start + per_count @ [net[axis] for axis in axes]
        pressed = {0: q[0] <= edges[0], 3: q[1] >= edges[1], 4: q[2] <= edges[2]}.get(number, False)
        return bool(pressed) if number == 3 else not pressed

    board = SimBoard(configuration.board, switch)
    machine = FirmwareMachine(NoisyPort(board, 0.0, 1), wrist, configuration)
    names: list[str] = []
    homing.home_joints(machine, announce=names.append)
    assert names == ["J1", "J2", "J3"]
    assert machine.position() == "known"
    real_joints = joints(wrist, pulses(wrist, start) + np.array([board.net[axis] for axis in axes]))
    assert np.rad2deg(machine.joints()) == pytest.approx(np.rad2deg(real_joints), abs=0.15)
    # From behind its switches, outside the limits, the arm comes back.
    machine.prepare()
    machine.run([plan_moves(wrist, machine.counts(), np.zeros(3))])
    assert machine.counts() == (0, 0, 0)


def test_a_joint_without_homing_is_named(three_dof: Arm) -> None:
    with pytest.raises(UsageError, match="has no homing for q1, q2, q3"):
        homing.searches(three_dof, configure(three_dof))


def test_moves_behind_a_long_ramp_do_not_pass_for_a_dry_queue() -> None:
    """27 segments of a ramp's end leave room for 5 of the next one's beginning: 9 ms where 11 are asked for."""
    rows = [[10, 80, -80], [-30, 5, -5], [40, 100, -100], [0, 90, -90]]
    for count in (2, 4):
        data = "\n".join(",".join(map(str, row)) for row in rows[:count]).encode()
        completed = run("send", THREE_DOF, "--batch", "-", "--port", "sim", "--json", stdin=data)
        assert completed.code == 0, completed.err
        assert completed.json["waypoints"] == count
