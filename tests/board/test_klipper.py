"""An arm on Klipper: exact positions, and the truth when something goes wrong.

The other side is a stand-in written from Klipper's public documentation, not Klipper itself.
"""

from __future__ import annotations

import itertools
import os
import random
from collections.abc import Callable

import numpy as np
import pytest

import armkin
from armkin.board import path_run
from armkin.board.backend import StoppedError
from armkin.board.backend.sent_positions import Job
from armkin.board.klipper.extra_axes import axes_of, differences, printer_cfg, settings_of
from armkin.board.klipper.klipper_machine import KlipperMachine
from armkin.board.klipper.trajectory_to_g1_lines import Lines
from armkin.board.sim.sim_klipper import Klipper
from armkin.errors import LinkError, PositionLostError, UsageError
from armkin.model.build_arm import arm_of_file
from armkin.robot_file import parse_robot_file
from command_line import ROOT

FILE = ROOT / "tests/robots/three_dof_klipper.yaml"
ARM = armkin.load(FILE)
AXES = axes_of(ARM)
_numbers = itertools.count()  # of ports: each has a name of its own, and so has its record


def open_klipper(stop: Callable[[], bool] = lambda: False) -> tuple[Klipper, KlipperMachine]:
    """The arm at home, as somebody has said."""
    port = Klipper(settings_of(AXES), f"klipper-{os.getpid()}-{next(_numbers)}")
    port.simulated = False  # so that nobody vouches for the position by itself
    machine = KlipperMachine(port, ARM, stop)
    assert machine.prepare(assume=ARM.home)
    return port, machine


def pin_counts(port: Klipper) -> list[int]:
    """Steps that the motors stand at, counted from home."""
    return [round((port.at[axis.section] - axis.at_home) * axis.steps) for axis in AXES]


def test_200_random_moves_are_read_back_exact_and_keep_their_time() -> None:
    port, machine = open_klipper()
    rng = np.random.default_rng(3)
    for _ in range(200):
        goal = rng.uniform(ARM.lower, ARM.upper)
        plan, began = machine.plan(machine.counts(), goal), port.now()
        machine.run([plan])
        assert list(machine.counts()) == pin_counts(port) == armkin.pulses(ARM, goal).tolist()
        assert plan.duration <= port.now() - began < plan.duration + 0.3
    assert port.jumps == 0  # no corner for which Klipper would slow down


def test_a_curve_goes_on_without_a_stop() -> None:
    """All lines move X, which carries the time: else Klipper would stop between them."""
    port, machine = open_klipper()
    moves = [{"joint": [0, 80, -80]}, {"wait": 0.5}, {"joint": [20, 70, -90]}, {"joint": [0, 90, -90]}]
    plan = armkin.path(ARM, {"start": "home", "blend": 5, "moves": moves})
    began = port.now()
    for part in path_run.plan_parts(plan, machine.counts(), machine.plan_trajectory):
        assert isinstance(part, Job)
        machine.run([part])
        x = [float(line.split()[1][1:]) for line in Lines(part, AXES)]
        assert (np.diff([0, *x]) > 0).all()
        assert x[-1] == pytest.approx(10 * part.duration, abs=1e-4)
    assert pin_counts(port) == [0, 0, 0]
    assert port.now() - began == pytest.approx(plan.duration, abs=0.6)
    assert port.jumps == 0


def looked_ahead(lines: list[str]) -> tuple[float, int]:
    """Seconds that Klipper's look-ahead takes for lines, and how many of them begin at rest.

    As Klipper's Kinematics.md has it (look-ahead: v2^2 = v1^2 + 2 a d from move to move, forwards and backwards), for
    moves along X; each extra axis limits a move's speed and acceleration, and the speed between two moves by what its
    own speed may jump there (G-Codes.md: LIMIT_VELOCITY, LIMIT_ACCEL, INSTANTANEOUS_CORNER_VELOCITY).
    """
    words = [{word[0]: float(word[1:]) for word in line.split()[1:]} for line in lines]
    places = np.array([[word[axis.letter] for axis in AXES] for word in words])
    way = np.diff([0.0, *(word["X"] for word in words)])
    slope = np.diff(np.vstack([[axis.at_home for axis in AXES], places]), axis=0) / way[:, None]
    limits = {key: np.array([getattr(axis, key) for axis in AXES]) for key in ("max_speed", "max_accel", "corner")}
    with np.errstate(divide="ignore"):
        top = np.minimum(10.0, (1.001 * limits["max_speed"] / np.abs(slope)).min(axis=1))
        accel = np.minimum(1000.0, (limits["max_accel"] / np.abs(slope)).min(axis=1))
        between = (limits["corner"] / np.abs(np.diff(slope, axis=0))).min(axis=1)
    gain = 2 * accel * way
    begin = np.zeros(len(way) + 1)  # squares of the speeds where the moves begin, and where the last one ends
    for k in range(1, len(way)):
        begin[k] = min(top[k] ** 2, top[k - 1] ** 2, between[k - 1] ** 2, begin[k - 1] + gain[k - 1])
    for k in reversed(range(len(way))):
        begin[k] = min(begin[k], begin[k + 1] + gain[k])
    a, b = np.sqrt(begin[:-1]), np.sqrt(begin[1:])
    cruise = np.sqrt(np.minimum(top**2, (begin[:-1] + begin[1:] + gain) / 2))
    ramps = (2 * cruise**2 - a**2 - b**2) / (2 * accel)  # way of both
    seconds = (2 * cruise - a - b) / accel + np.maximum(way - ramps, 0.0) / cruise
    return float(seconds.sum()), int((begin[:-1] < 1e-9).sum())


def test_klipper_s_look_ahead_makes_the_plan_s_own_time_of_the_lines() -> None:
    _, machine = open_klipper()
    moves = [{"joint": [0, 80, -80]}, {"joint": [20, 70, -90]}, {"line": [390, 80, 300]}, {"line": [390, -60, 300]}]
    path = armkin.path(ARM, {"start": "home", "blend": 5, "tolerance": 0.1, "moves": moves})
    jobs = [machine.plan(machine.counts(), np.deg2rad(goal)) for goal in ([60, 20, -60], [-100, 0, 20], [0.5, 89, -89])]
    for job in [*jobs, *path_run.plan_parts(path, machine.counts(), machine.plan_trajectory)]:
        assert isinstance(job, Job)
        seconds, rests = looked_ahead(list(Lines(job, AXES)))
        assert job.duration <= seconds < job.duration + 0.03
        assert rests == 1


@pytest.mark.parametrize("after", [3, 40, 90, 140])
def test_a_stop_brakes_on_the_way_and_the_next_command_goes_on(after: int) -> None:
    polls = iter(range(100_000))
    port, machine = open_klipper(lambda: next(polls) > after)
    plan = machine.plan(machine.counts(), np.deg2rad([60, 20, -60]), speed=0.4)
    with pytest.raises(StoppedError):
        machine.run([plan])
    assert machine.position() == "known"
    assert list(machine.counts()) == pin_counts(port)
    share = [count / end for count, end in zip(pin_counts(port), plan.end.tolist(), strict=True)]
    assert max(share) - min(share) < 2e-3
    assert port.jumps == 0
    again = KlipperMachine(port, ARM)
    assert (again.position(), again.counts()) == ("known", machine.counts())
    assert not again.prepare()
    again.run([again.plan(again.counts(), np.deg2rad([60, 20, -60]))])
    assert pin_counts(port) == plan.end.tolist()


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (lambda port: port.shutdown(), "state shutdown in the motion"),
        (lambda port: port.restart(), "has no axis"),
        (lambda port: setattr(port, "dead", True), "unanswered|did not answer"),
    ],
)
def test_what_loses_the_position_is_told(fault: Callable[[Klipper], None], message: str) -> None:
    polls = iter(range(100_000))

    def stop() -> bool:
        if next(polls) == 40:
            fault(port)
        return False

    port, machine = open_klipper(stop)
    with pytest.raises(LinkError, match=message):
        machine.run([machine.plan(machine.counts(), np.deg2rad([60, 20, -60]), speed=0.2)])
    if not port.dead:
        assert KlipperMachine(port, ARM).position() == "lost"


def test_motors_that_are_switched_off_lose_the_position() -> None:
    _, machine = open_klipper()
    machine.run([machine.plan(machine.counts(), np.deg2rad([10, 80, -70]))])
    machine.api.run("M84")
    machine.refresh()
    assert machine.position() == "lost"
    with pytest.raises(PositionLostError):
        machine.prepare()
    assert machine.prepare(assume=ARM.home)
    assert machine.counts() == (0, 0, 0)


def test_another_program_s_move_is_found() -> None:
    port, machine = open_klipper()
    machine.run([machine.plan(machine.counts(), np.deg2rad([10, 80, -70]))])
    for line in ("G1 A3 F600", "G91\nG1 B-2 F600"):
        counts = machine.counts()
        machine.api.run(f"{line}\nM400")
        with pytest.raises(PositionLostError, match="another program has moved it"):
            machine.prepare()
        assert machine.position() == KlipperMachine(port, ARM).position() == "lost"
        assert machine.prepare(assume=armkin.joints(ARM, counts))
        machine.run([machine.plan(machine.counts(), np.deg2rad([12, 80, -70]))])

    class Meddled(Klipper):
        def _obey(self, line: str) -> None:
            super()._obey(line)
            if line == "M400" and self.x > 1:
                self.steppers["axis_a"].place += 1.0

    port = Meddled(settings_of(AXES))
    machine = KlipperMachine(port, ARM)
    machine.prepare()
    with pytest.raises(LinkError, match="another program has moved it"):
        machine.run([machine.plan(machine.counts(), np.deg2rad([10, 80, -70]))])


def test_a_program_that_moves_the_arm_between_plan_and_motion_is_told() -> None:
    _, machine = open_klipper()
    plan = machine.plan(machine.counts(), np.deg2rad([10, 80, -70]))
    machine.api.run("G1 A3 F600\nM400")
    with pytest.raises(LinkError, match="another program has moved it"):
        machine.run([plan])
    machine.refresh()
    assert machine.position() == "lost"


@pytest.mark.parametrize("asks", [3, 40, 120])
def test_a_shutdown_in_motion_is_told_as_such(asks: int) -> None:
    count = itertools.count()

    def stop() -> bool:
        if next(count) == asks:
            port.shutdown()
        return False

    port, machine = open_klipper(stop)
    with pytest.raises(
        LinkError, match="Klipper went into state shutdown in the motion: Printer is shutdown"
    ) as caught:
        machine.run([machine.plan(machine.counts(), np.deg2rad([60, 20, -60]), speed=0.3)])
    assert "another program" not in str(caught.value)


def test_a_shutdown_after_the_last_line_is_told_as_such() -> None:
    class Late(Klipper):
        def _obey(self, line: str) -> None:
            super()._obey(line)
            if line == "M400" and self.x > 1:
                self.state = "shutdown"

    port = Late(settings_of(AXES))
    machine = KlipperMachine(port, ARM)
    machine.prepare()
    with pytest.raises(LinkError, match="Klipper is in state shutdown: Printer is shutdown") as caught:
        machine.run([machine.plan(machine.counts(), np.deg2rad([10, 80, -70]))])
    assert "another program" not in str(caught.value)


def test_printer_cfg_is_compared() -> None:
    fits = settings_of(AXES)
    assert differences(AXES, fits) == []
    b = fits["manual_stepper axis_b"]
    geared = b | {"rotation_distance": 360.0, "gear_ratio": [[26.85125, 1.0]], "full_steps_per_rotation": 200}
    assert differences(AXES, fits | {"manual_stepper axis_b": geared}) == []
    wrong = fits | {"printer": {"kinematics": "cartesian"}, "manual_stepper axis_b": b | {"microsteps": 16}}
    del wrong["manual_stepper axis_c"]
    assert [str(difference) for difference in differences(AXES, wrong)] == [
        "[printer] kinematics is cartesian: the robot file wants none",
        "[printer] max_velocity is not there: the robot file wants at least 10",
        "[printer] max_accel is not there: the robot file wants at least 1000",
        "[manual_stepper axis_b] steps a unit is 238.677778: the robot file wants 119.338889",
        "[manual_stepper axis_c] is not there: the robot file wants one for motor q3",
    ]
    port = Klipper(wrong)
    with pytest.raises(LinkError, match=r"printer\.cfg does not fit three_dof_klipper: .*, and 4 more"):
        KlipperMachine(port, ARM).prepare()
    text = printer_cfg(AXES)
    assert "[manual_stepper axis_b]\n# q2\nstep_pin: ?\ndir_pin: !?\n" in text
    assert "rotation_distance: 13.40719" in text


def test_arms_that_klipper_cannot_drive_are_refused() -> None:
    text = FILE.read_text()
    with pytest.raises(UsageError, match="motor q1 is on axis X; Klipper has A, B, C, D, H"):
        axes_of(arm_of_file(parse_robot_file(text.replace("axis: A", "axis: X").replace("board: {kind: klipper}", ""))))
    with pytest.raises(UsageError, match="Klipper drives steppers alone"):
        axes_of(armkin.load("ra02"))


LIES: list[object] = [None, True, -1, 1e300, float("nan"), "x", "", [], [1], {}, {"a": 1}, "\u0003", [[[]]], 10**400]


@pytest.mark.parametrize("seed", range(40))
def test_an_api_that_lies_is_believed_in_nothing_that_cannot_be(seed: int) -> None:
    """Of every answer one value is another: what is told then is a place that can be, lost, or an error in words."""
    rng = random.Random(seed)

    def spoilt(value: object, depth: int) -> object:
        if depth == 0 or not isinstance(value, dict) or not value:
            return rng.choice(LIES)
        key = rng.choice(sorted(value))
        return {**value, key: spoilt(value[key], depth - 1)}

    class Liar(Klipper):
        lies = False

        def _send(self, message: dict[str, object]) -> None:
            super()._send(spoilt(message, rng.randrange(6)) if self.lies and rng.random() < 0.5 else message)  # type: ignore[arg-type]

    port = Liar(settings_of(AXES))
    port.simulated = False
    machine = KlipperMachine(port, ARM)
    machine.prepare(assume=ARM.home)
    port.lies, errors = True, list[LinkError]()
    for _ in range(8):
        try:
            again = KlipperMachine(port, ARM)
            again.report()
            again.prepare()
            again.run([again.plan(again.counts(), np.deg2rad([1, 89, -89]))])
        except LinkError as error:
            errors.append(error)
            continue
        assert all(abs(count) < 1e12 for count in again.counts())
    assert all(len(str(error).splitlines()) <= 2 for error in errors)


def test_answers_that_are_none_end_in_words() -> None:
    class Other(Klipper):
        text = b""

        def read(self, timeout: float) -> bytes:
            self._now += timeout
            return self.text

    for text in (b"\x03", b"[]\x03", b"[" * 100_000 + b"\x03", b"\xff\x03", b"x" * 70_000):
        port = Other(settings_of(AXES))
        port.text = text
        with pytest.raises(LinkError, match=r"does not answer as Klipper's API server does|did not answer info"):
            KlipperMachine(port, ARM)
