"""A program that its computer gives no time for seconds: it was deaf then, and the arm goes on along its path."""

from __future__ import annotations

import numpy as np
import pytest
from three_servos import ARM, connect_servos, servo_bus

from armkin.board.firmware.configuration import configure
from armkin.board.firmware.firmware_machine import FirmwareMachine
from armkin.board.sim.sim_board import SimBoard
from armkin.board.sim.sim_servo_bus import ServoBus
from armkin.errors import LinkError
from armkin.model import build_arm as arms
from command_line import COUNTS, POSE, ROOT
from sim_wire import Wire

PAUSE = 3.0  # [s]


class Suspended(Wire):
    """A port whose program stands still now and then, while the clock goes on and the board's time waits."""

    every = 0.0  # [s] of the board's time between two pauses; 0: none
    silent = False  # whether the board has stopped to answer
    paused = 0.0  # [s] in all
    _next = 0.0

    def read(self, timeout: float) -> bytes:
        data = super().read(timeout)
        if self.every and self._now >= self._next:
            self.paused += PAUSE
            self._next = self._now + self.every
        return b"" if self.silent else data

    def now(self) -> float:
        return super().now() + self.paused


def prepare_board() -> tuple[Suspended, FirmwareMachine]:
    """A board that knows its arm at home, and the program that speaks with it."""
    arm = arms.load_arm(ROOT / "robots/three_dof.yaml")
    configuration = configure(arm)
    port = Suspended(SimBoard(configuration.board))
    machine = FirmwareMachine(port, arm, configuration)
    machine.prepare(assume=arm.home)
    return port, machine


def test_a_program_that_was_suspended_does_not_take_the_board_for_gone() -> None:
    port, machine = prepare_board()
    port.every = 0.3
    machine.run([machine.plan(machine.counts(), np.deg2rad(POSE)[None])])
    assert port.paused > 5 * PAUSE
    assert machine.counts() == tuple(COUNTS)


def test_a_board_that_is_gone_is_told_within_two_seconds() -> None:
    port, machine = prepare_board()
    port.silent, began = True, port.now()
    with pytest.raises(LinkError, match="does not answer any more"):
        machine.run([machine.plan(machine.counts(), np.deg2rad(POSE)[None])])
    assert port.now() - began < 2.0


class SuspendedBus(ServoBus):
    """A bus whose program stands still once a motion; the servos go on."""

    due = float("inf")

    def read(self, timeout: float) -> bytes:
        if self._now >= self.due:
            self.due = float("inf")
            for _ in range(round(PAUSE / self.step)):
                self.advance(self.step)
        return super().read(timeout)


def test_servos_go_on_where_they_were() -> None:
    port = SuspendedBus(servo_bus().servos.values())
    machine = connect_servos(port)
    start, began = np.array(machine.counts()), port.now()
    plan = machine.plan(machine.counts(), np.array([2.0, -1.5, 1.0]))
    port.due = port.now() + plan.duration / 2
    machine.run([plan])
    assert port.now() - began > PAUSE
    places = np.array([[position_of[k] for k in (1, 2, 3)] for _, position_of in port.log])
    way = plan.end - start
    share = ((places - start) @ way) / (way @ way)
    assert np.abs(places - start - share[:, None] * way).max() < 25  # 2 degrees, as without a pause
    assert np.abs(np.diff(places, axis=0)).max() / port.step < 1.6 * np.abs(ARM.motor_gain @ ARM.max_speed).max()
