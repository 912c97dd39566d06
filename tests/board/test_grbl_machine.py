"""An arm on GRBL: exact positions, and the truth when something goes wrong."""

from __future__ import annotations

import os
import random
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import armkin
from armkin.board import path_run
from armkin.board.backend import Planned, StoppedError
from armkin.board.backend.sent_positions import Job
from armkin.board.grbl import trajectory_to_gcode
from armkin.board.grbl.grbl_machine import GrblMachine
from armkin.board.grbl.motor_axes import axes_of
from armkin.board.grbl.settings import expected_settings
from armkin.board.kinds import board_of
from armkin.board.sim.sim_grbl import Grbl
from armkin.errors import LinkError, UsageError
from armkin.model.build_arm import arm_of_file
from armkin.robot_file import parse_robot_file
from armkin.robot_file.robot_keys import Gripper
from command_line import ROOT, THREE_DOF

ARM = armkin.load("three_dof")
FITS = {number: value for number, (_, value) in expected_settings(axes_of(ARM)).items()}


def grbl_board(**more: Any) -> Grbl:
    name = f"machine-{os.getpid()}"  # its record is no other worker's
    grbl = Grbl(4, name, {**FITS, **more.pop("settings", {})}, **more)
    grbl.simulated = False  # so that nobody vouches for the position by itself
    return grbl


def connect_grbl(port: Grbl, stop: Callable[[], bool] = lambda: False) -> GrblMachine:
    return GrblMachine(port, ARM, stop)


def pin_counts(port: Grbl) -> list[int]:
    """Steps at the pins, counted from where the arm was taken to stand at home."""
    return [port.steps[k] for k in range(3)]


def test_200_random_moves_are_read_back_exact() -> None:
    port = grbl_board()
    machine = connect_grbl(port)
    assert machine.prepare(assume=machine.arm.home)
    rng = np.random.default_rng(3)
    for _ in range(200):
        goal = rng.uniform(ARM.lower, ARM.upper)
        machine.run([machine.plan(machine.counts(), goal)])
        assert list(machine.counts()) == pin_counts(port) == armkin.pulses(ARM, goal).tolist()


def test_the_published_pose_puts_the_published_steps_on_the_pins() -> None:
    port = grbl_board()
    machine = connect_grbl(port)
    machine.prepare(assume=machine.arm.home)
    machine.run([machine.plan(machine.counts(), np.deg2rad([-30, 5, -5]))])
    assert pin_counts(port) == [-1067, -10144, 5667]


def test_the_position_outlives_the_command_but_no_reset() -> None:
    port = grbl_board()
    machine = connect_grbl(port)
    machine.prepare(assume=machine.arm.home)
    machine.run([machine.plan(machine.counts(), np.deg2rad([10, 80, -70]))])
    counts = machine.counts()
    again = connect_grbl(port)
    assert (again.position(), again.counts()) == ("known", counts)
    assert not again.prepare()
    with pytest.raises(LinkError, match="position is known"):
        again.prepare(assume=again.arm.home)
    port.boot()
    lost = connect_grbl(port)
    assert lost.position() == "lost"
    with pytest.raises(LinkError, match="position is lost"):
        lost.prepare()


def test_settings_that_do_not_fit_are_refused_and_setup_writes_them() -> None:
    port = Grbl(4, f"machine-{os.getpid()}")
    port.simulated = False
    machine = connect_grbl(port)
    with pytest.raises(LinkError, match=r"GRBL's settings do not fit three_dof: \$100 .* is 250.*, and 2 more"):
        machine.prepare(assume=machine.arm.home)
    assert not port.history
    written = {difference.number for difference in machine.setup()}
    assert {100, 101, 102, 110, 111, 112} <= written
    assert machine.setup() == []
    assert machine.prepare(assume=machine.arm.home)


def test_a_stop_holds_on_the_path_and_the_next_command_goes_on() -> None:
    port = grbl_board()
    goal = np.deg2rad([60, 20, -60])
    for after in (5, 30, 60, 90):
        polls = iter(range(10_000))
        port.boot()
        machine = connect_grbl(port, lambda polls=polls, after=after: next(polls) > after)  # type: ignore[misc]
        machine.prepare(assume=machine.arm.home)
        plan = machine.plan(machine.counts(), goal)
        with pytest.raises(StoppedError):
            machine.run([plan])
        assert list(machine.counts()) == pin_counts(port)
        share = [count / end for count, end in zip(pin_counts(port), plan.end.tolist(), strict=True) if end]
        assert max(share) - min(share) < 2e-3
        again = connect_grbl(port)
        assert again.position() == "known"
        again.prepare()
        again.run([again.plan(again.counts(), goal)])
        assert pin_counts(port) == plan.end.tolist()


def act_during(port: Grbl, act: Callable[[], None]) -> Callable[[], bool]:
    polls = iter(range(10_000))

    def stop() -> bool:
        if next(polls) == 40:
            act()
        return False

    return stop


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (lambda port: port.alarm(1), "a limit switch closed in motion"),
        (lambda port: port.boot(), "GRBL was reset in motion"),
        (lambda port: setattr(port, "dead", True), r"without an answer|does not answer"),
    ],
)
def test_what_loses_the_position_is_told(fault: Callable[[Grbl], None], message: str) -> None:
    port = grbl_board()
    machine = connect_grbl(port, act_during(port, lambda: fault(port)))
    machine.prepare(assume=machine.arm.home)
    with pytest.raises(LinkError, match=message):
        machine.run([machine.plan(machine.counts(), np.deg2rad([60, 20, -60]))])
    if not port.dead:
        assert connect_grbl(port).position() == "lost"


@pytest.mark.parametrize("seed", range(6))
def test_a_noisy_line_never_gives_a_false_position(seed: int) -> None:
    """GRBL has no checksum: a damaged line may move wrongly, but what is said of the position is true."""
    rng = random.Random(seed)

    class Noisy(Grbl):
        def write(self, data: bytes) -> None:
            spoilt = bytearray(data)
            for k in range(len(spoilt)):
                if rng.random() < 0.002:
                    spoilt[k] ^= 1 << rng.randrange(7)
            super().write(bytes(spoilt))

    port = Noisy(axes=4, settings=FITS)
    port.simulated = False
    right = 0
    for _ in range(12):
        try:
            machine = connect_grbl(port)
            machine.prepare(assume=machine.arm.home if machine.position() == "lost" else None)
            origin = np.array(pin_counts(port)) - machine.counts()
            plan = machine.plan(
                machine.counts(), np.radians([rng.uniform(-90, 90), rng.uniform(0, 90), rng.uniform(-90, 0)])
            )
            machine.run([plan])
        except (LinkError, armkin.UsageError, armkin.NoSolutionError):
            continue
        assert (np.array(pin_counts(port)) - origin).tolist() == plan.end.tolist() == list(machine.counts())
        right += 1
    assert right > 0


def test_arms_that_grbl_cannot_drive_are_refused() -> None:
    text = (ROOT / THREE_DOF).read_text().replace("board: {kind: uno_cnc_shield, driver: A4988}", "")
    for before, after, message in (
        ("axis: X", "axis: Q", "motor q1 is on axis Q; GRBL has X, Y, Z, A, B, C"),
        ("microsteps: 16", "microsteps: 256", "enough for 500 steps a unit at most"),
    ):
        with pytest.raises(UsageError, match=message):
            axes_of(arm_of_file(parse_robot_file(text.replace(before, after))))
    with pytest.raises(UsageError, match="GRBL drives steppers alone"):
        axes_of(armkin.load("ra02"))


@pytest.mark.parametrize("seed", range(3))
def test_damaged_answers_never_give_a_false_position(seed: int) -> None:
    """Of what GRBL says one byte in 250 is changed and one in 250 is lost: what is believed was said three times."""
    rng = random.Random(seed)

    class Mumbling(Grbl):
        mumbles = False

        def read(self, timeout: float) -> bytes:
            clear = super().read(timeout)
            if not self.mumbles:
                return clear
            return bytes(b ^ (rng.random() < 0.004) << rng.randrange(8) for b in clear if rng.random() > 0.004)

    port = Mumbling(axes=4, settings=FITS)
    port.simulated = False
    machine = connect_grbl(port)
    machine.prepare(assume=machine.arm.home)
    machine.run([machine.plan(machine.counts(), np.deg2rad([-30, 5, -5]))])
    port.mumbles, error_count = True, 0
    for _ in range(120):
        try:
            machine.refresh()
        except LinkError:
            continue
        assert machine.position() == "known"
        assert list(machine.counts()) == pin_counts(port)
        error_count += 1
    assert error_count > 10


def test_a_lost_answer_ends_the_wait_and_tells_where_the_arm_stands() -> None:
    """Reports go on coming, so that silence alone would never end it."""

    class Deaf(Grbl):
        lose = 0

        def _send(self, text: str) -> None:
            if text == "ok" and self.lose and self._blocks:
                self.lose -= 1
            else:
                super()._send(text)

    port = Deaf(axes=4, settings=FITS)
    port.simulated = False
    machine = connect_grbl(port)
    machine.prepare(assume=machine.arm.home)
    port.lose = 1
    plan = machine.plan(machine.counts(), np.deg2rad([30, 60, -60]))
    began = port.now()
    with pytest.raises(LinkError, match="without an answer; the arm was stopped\nthe arm stands at q1 = 30"):
        machine.run([plan])
    assert port.now() - began < plan.duration + 5
    assert connect_grbl(port).counts() == machine.counts() == tuple(pin_counts(port)) == tuple(plan.end.tolist())


def test_what_the_gripper_holds_is_gripped_again_after_a_stop() -> None:
    """A stop clears GRBL's queue by a reset, which switches M3 off."""
    port = grbl_board()
    polls = iter(range(10_000))
    machine = connect_grbl(port, lambda: next(polls) > 30)
    machine.prepare(assume=machine.arm.home)
    machine.grip(Gripper.model_validate({"kind": "spindle", "open": 0, "closed": 120}), 120)
    assert port.spindle == 120
    with pytest.raises(StoppedError):
        machine.run([machine.plan(machine.counts(), np.deg2rad([60, 20, -60]))])
    assert port.spindle == 120
    again = connect_grbl(port)
    assert again.position() == "known"
    again.hold()
    assert port.spindle == 120
    port.alarm(1)
    with pytest.raises(LinkError, match="a limit switch closed"):
        again.hold()
    assert connect_grbl(port).position() == "lost"


def _seconds_of_lines(lines: list[str]) -> float:
    """What lines from home last where each goes at its feed, and dwells [s]."""
    place, seconds = {"X": 0.0, "Y": 0.0, "Z": 0.0}, 0.0
    for line in lines:
        words = {letter: float(number) for letter, number in re.findall(r"([XYZFP])([-0-9.]+)", line)}
        travel = np.linalg.norm([words.get(letter, value) - value for letter, value in place.items()])
        place |= {letter: words[letter] for letter in place if letter in words}
        seconds += words.get("P", 0.0) + (60 * float(travel) / words["F"] if "F" in words else 0.0)
    return seconds


@pytest.mark.parametrize("jerk", [1, 100, 2000])  # [deg/s3]
def test_a_joint_move_with_max_jerk_takes_its_time(jerk: float) -> None:
    """GRBL knows no jerk: as one line it was ahead of the plan, and held."""
    port, arm = grbl_board(), replace(ARM, max_jerk=np.deg2rad([jerk] * 3))
    machine = GrblMachine(port, arm, lambda: False)
    machine.prepare(assume=arm.home)
    job = machine.plan(machine.counts(), np.deg2rad([[0, 80, -90], [20, 70, -60]]))
    assert isinstance(job, Job)
    lines = list(trajectory_to_gcode.gcode_lines(job, machine.axes, np.zeros(3, dtype=np.int64)))
    assert _seconds_of_lines(lines) == pytest.approx(job.duration, abs=2 * trajectory_to_gcode.PIECE_TIME)
    assert len(lines) <= job.segments
    machine.run([job])
    assert pin_counts(port) == list(machine.counts()) == job.end.tolist()


def test_a_jog_keeps_max_jerk(monkeypatch: pytest.MonkeyPatch) -> None:
    arm = replace(armkin.load(ROOT / "tests/robots/three_dof_grbl.yaml"), max_jerk=np.deg2rad([100.0] * 3))
    board = board_of(arm)
    machine, plans = board.connect(board.simulated()), list[Planned]()
    monkeypatch.setattr(machine, "run", plans.extend)
    board.jog(0, board.ready_to_jog(0, np.deg2rad(50.0)), 0.3)
    [stretch] = [stretch for plan in plans for stretch in plan.trajectory.stretches]
    assert stretch.end[0] - stretch.start[0] == pytest.approx(np.deg2rad(15.0), abs=np.deg2rad(0.03))  # a step
    assert stretch.duration >= (32 * 15 / 100) ** (1 / 3)


@pytest.mark.parametrize("tool_speed", [0.2, 1.0, 20.0])
def test_a_slow_curve_takes_its_time(tool_speed: float) -> None:
    """Where a step takes longer than a line, lines without one went at once: 1 mm/s was held as faster than planned."""
    port = grbl_board()
    machine = connect_grbl(port)
    machine.prepare(assume=machine.arm.home)
    plan = armkin.path(ARM, {"start": "home", "moves": [{"line": [258, 15, 367]}]}, tool_speed=tool_speed)
    job = trajectory_to_gcode.job(plan.motion, np.array(machine.counts()))
    lines = list(trajectory_to_gcode.gcode_lines(job, machine.axes, np.zeros(3, dtype=np.int64)))
    assert _seconds_of_lines(lines) == pytest.approx(plan.duration, abs=trajectory_to_gcode.PIECE_TIME)
    machine.run([job])
    assert pin_counts(port) == armkin.pulses(ARM, plan.motion.end).tolist()


def test_a_pause_of_a_path_is_a_dwell() -> None:
    port = grbl_board()
    machine = connect_grbl(port)
    machine.prepare(assume=machine.arm.home)
    plan = armkin.path(
        ARM, {"start": "home", "moves": [{"joint": [0, 80, -80]}, {"wait": 1.5}, {"joint": [0, 90, -90]}]}
    )
    before = port.now()
    for part in path_run.plan_parts(plan, machine.counts(), machine.plan_trajectory):
        assert isinstance(part, Job)
        machine.run([part])
    assert port.now() - before > 1.5
    assert pin_counts(port) == [0, 0, 0]


def test_rows_in_one_direction_rest_at_each_as_planned() -> None:
    """GRBL goes over from line to line without a stop: it would be half a second ahead of its plan at each row."""
    port = grbl_board()
    machine = connect_grbl(port)
    assert machine.prepare(assume=machine.arm.home)
    goals = np.deg2rad([[angle, 90.0, -90.0] for angle in (20.0, 40.0, 60.0, 80.0, 60.0, 10.0)])
    job = machine.plan(machine.counts(), goals)
    began = port.now()
    machine.run([job])
    assert list(machine.counts()) == pin_counts(port) == job.end.tolist()
    assert 0.0 <= port.now() - began - job.duration < 0.5
    times = np.array([time for time, _ in port.history])
    counts = np.array([steps[0] for _, steps in port.history])
    speed = np.abs(np.diff(counts)) / np.diff(times)
    for goal in armkin.pulses(ARM, goals)[:-1, 0]:
        at = np.flatnonzero(np.abs(counts - goal) <= 5)
        assert speed[at[0] : at[-1]].min() < 0.1 * speed.max()


def test_the_simulated_grbl_passes_a_straight_joint_of_two_lines_at_full_speed() -> None:
    """20 and 40 units at 10 units/s and 10 units/s2, by $11 also round a corner of 90 degrees."""
    settings: dict[int, float] = {}
    for axis in range(3):
        settings |= {100 + axis: 250, 110 + axis: 600, 120 + axis: 10}
    durations = []
    for lines in ("X20 X40", "X20 P0 X40", "X20 Y20", "X20 X0"):
        port, answers = Grbl(3, "sim", settings), b""
        began, words = port.now(), [*lines.split(), "P0"]
        port.write("".join(f"{'G4' if word == 'P0' else 'G1F600'}{word}\n" for word in words).encode())
        while answers.count(b"ok") < len(words):
            answers += port.read(0.01)
        durations.append(port.now() - began)
    straight, stopped, corner, back = durations
    assert straight == pytest.approx(5.0, abs=0.1)  # 4 s at full speed, and 1 s more to speed up and slow down
    assert stopped == pytest.approx(6.0, abs=0.1)
    corner_speed = (10 * 2**0.5 * 0.01 * 0.5**0.5 / (1 - 0.5**0.5)) ** 0.5
    assert stopped - corner == pytest.approx(2 * corner_speed / 10, abs=0.02)
    assert back == pytest.approx(6.0, abs=0.1)
