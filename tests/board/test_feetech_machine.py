"""An arm of bus servos: it follows its trajectory, stops on it, and tells what is wrong with a servo."""

from __future__ import annotations

import numpy as np
import pytest
from three_servos import ARM, HOME, connect_servos, servo_bus

import armkin
from armkin.board.backend import StoppedError
from armkin.board.backend.servo_arm import MAX_LAG, SETTLED_DISTANCE
from armkin.board.feetech import registers
from armkin.board.feetech.feetech_machine import ServoMachine
from armkin.board.sim.sim_servo_bus import Noise, Servo, ServoBus
from armkin.errors import LinkError, NoSolutionError


def test_zero_and_invert_are_the_robot_files() -> None:
    assert HOME == [2058, 2068, 2078]
    assert armkin.pulses(ARM, np.deg2rad([90, 90, -90])).tolist() == [2058 + 1024, 2068 - 1024, 2078 - 1024]


@pytest.mark.parametrize("noise", [None, Noise(0.01, 0.01, 5)])
def test_random_moves_arrive_and_stay_near_their_line(noise: Noise | None) -> None:
    port = servo_bus(noise)
    machine = connect_servos(port)
    rng = np.random.default_rng(1)
    for _ in range(8 if noise else 20):
        start, goal = np.array(machine.counts()), rng.uniform(-2.4, 2.4, 3)
        port.log.clear()
        plan = machine.plan(machine.counts(), goal)
        machine.run([plan])
        assert np.abs(np.array(machine.counts()) - armkin.pulses(ARM, goal)).max() <= SETTLED_DISTANCE
        places = np.array([[position_of[k] for k in (1, 2, 3)] for _, position_of in port.log])
        way = plan.end - start
        share = ((places - start) @ way) / (way @ way)
        aside = np.linalg.norm(places - start - share[:, None] * way, axis=1)
        assert aside.max() < 0.03 * np.linalg.norm(way) + 8


def test_nothing_moves_when_the_motors_go_on() -> None:
    port = servo_bus()
    for servo in port.servos.values():
        servo.set(registers.GOAL_POSITION, 100)  # an old goal
    connect_servos(port)
    port.advance(0.5)
    assert [round(servo.position) for servo in port.servos.values()] == HOME


def test_a_stop_slows_down_on_the_line() -> None:
    port = servo_bus()
    polls = iter(range(10_000))
    machine = connect_servos(port, lambda: next(polls) > 40)
    goal = np.deg2rad([120, 60, -90])
    plan = machine.plan(machine.counts(), goal)
    with pytest.raises(StoppedError):
        machine.run([plan])
    gone = (np.array(machine.counts()) - HOME) / (plan.end - HOME)
    assert 0.05 < gone.mean() < 0.95
    assert np.ptp(gone) < 0.03
    port.advance(0.5)
    assert np.abs(np.array([servo.position for servo in port.servos.values()]) - machine.counts()).max() <= 1


def test_a_blocked_servo_holds_the_arm() -> None:
    port = servo_bus()
    machine = connect_servos(port)
    port.servos[2].write = lambda address, values: None  # type: ignore[method-assign]
    with pytest.raises(LinkError, match=r"servo 2 \(j2\) is \d+ counts behind: blocked or overloaded"):
        machine.run([machine.plan(machine.counts(), np.deg2rad([0, 120, 0]))])
    assert abs(port.servos[2].position - HOME[1]) < 1
    assert MAX_LAG < 1024


def test_a_servos_errors_are_told() -> None:
    port = servo_bus()
    machine = connect_servos(port)
    port.servos[3].errors = 36
    with pytest.raises(LinkError, match=r"servo 3 \(j3\) reports overheating, overload"):
        machine.run([machine.plan(machine.counts(), np.deg2rad([20, 20, 20]))])
    servo = machine.report()["servos"][2]
    assert servo["errors"] == ["overheating", "overload"]
    assert (servo["voltage"], servo["temperature"], servo["torque"]) == (7.4, 31, True)


def test_servos_that_are_missing_are_named() -> None:
    with pytest.raises(LinkError, match="no answer from servos 2, 3 on sim: is the bus powered"):
        ServoMachine(ServoBus([Servo(1)]), ARM)


def test_a_cable_that_is_pulled_in_motion_is_told() -> None:
    port = servo_bus()
    polls = iter(range(10_000))

    def pull() -> bool:
        if next(polls) == 20:
            port.servos.clear()
        return False

    machine = connect_servos(port, pull)
    with pytest.raises(LinkError, match="does not answer"):
        machine.run([machine.plan(machine.counts(), np.deg2rad([60, 60, 60]))])


def test_relaxed_motors_can_be_moved_by_hand_and_read() -> None:
    port = servo_bus()
    machine = connect_servos(port)
    machine.relax()
    for k, servo in port.servos.items():
        servo.position += 100 * k
        servo.advance(0.0)
    assert all(servo.get(registers.TORQUE) == 0 for servo in port.servos.values())
    np.testing.assert_allclose(np.rad2deg(machine.read()), np.array([100, -200, 300]) * 360 / 4096, atol=1e-9)


class Stuck(Servo):
    """A servo whose shaft cannot pass a place."""

    stop = 10_000.0

    def advance(self, seconds: float) -> None:
        """Let time pass."""
        super().advance(seconds)
        self.position = min(self.position, self.stop)


def connect_stuck(number: int, after: float) -> tuple[ServoBus, ServoMachine]:
    """An arm one of whose servos stops so many counts from home."""
    port = servo_bus()
    port.servos[number] = Stuck(number, HOME[number - 1])
    machine = connect_servos(port)
    port.servos[number].stop = HOME[number - 1] + after  # type: ignore[attr-defined]
    return port, machine


@pytest.mark.parametrize("number", [1, 3])
def test_a_move_has_arrived_when_every_servo_has(number: int) -> None:
    port, machine = connect_stuck(number, 100)
    with pytest.raises(LinkError, match=rf"servo {number} \(j{number}\) stands 1[0-9][0-9] counts from its goal"):
        machine.run([machine.plan(machine.counts(), np.deg2rad([20, -20, 20]))])
    blocked = port.servos[number]
    assert blocked.get(registers.GOAL_POSITION) == pytest.approx(blocked.position, abs=10)  # it pushes no longer


def test_all_servos_are_held_where_they_stand_when_one_falls_behind() -> None:
    port, machine = connect_stuck(1, 100)
    with pytest.raises(LinkError, match=r"servo 1 \(j1\) is \d+ counts behind"):
        machine.run([machine.plan(machine.counts(), np.deg2rad([120, -120, 120]))])
    positions = [servo.position for servo in port.servos.values()]
    assert [servo.get(registers.GOAL_POSITION) for servo in port.servos.values()] == pytest.approx(positions, abs=40)
    port.advance(2.0)
    assert [servo.position for servo in port.servos.values()] == pytest.approx(positions, abs=40)


def test_a_goal_outside_a_servo_s_own_limits_is_refused_before_anything_moves() -> None:
    """Whoever set up the servo gave it limits: it would stop there, and never arrive."""
    port = servo_bus()
    port.servos[2].set(registers.MIN_POSITION, 1500)
    port.servos[2].set(registers.MAX_POSITION, 2300)
    machine = connect_servos(port)
    goal = np.deg2rad([10, -30, 10])  # servo 2 is inverted: 2068 + 341
    with pytest.raises(NoSolutionError, match=r"servo 2 \(j2\): 2409 counts is outside its own limits 1500 to 2300"):
        machine.run([machine.plan(machine.counts(), goal)])
    assert [round(servo.position) for servo in port.servos.values()] == HOME
    machine.run([machine.plan(machine.counts(), np.deg2rad([10, -20, 10]))])
    port.servos[2].set(registers.MAX_POSITION, 2000)  # what it stands at is outside: it may come back, not go farther
    two = connect_servos(port)
    with pytest.raises(NoSolutionError, match="outside its own limits 1500 to 2000"):
        two.run([two.plan(two.counts(), np.deg2rad([10, -21, 10]))])
    two.run([two.plan(two.counts(), np.deg2rad([10, 20, 10]))])
    assert np.abs(np.array(two.counts()) - armkin.pulses(ARM, np.deg2rad([10, 20, 10]))).max() <= SETTLED_DISTANCE
