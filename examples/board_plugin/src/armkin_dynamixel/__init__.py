"""Dynamixel X servos as a kind of armkin's boards: `board: {kind: dynamixel}`.

bus.py has the maker's SDK on armkin's port, emulator.py servos in this process.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armkin.board.backend.servo_arm import ServoArm, servo_ids
from armkin.board.kinds.feetech import ServoBusBoard
from armkin.board.ports import Port
from armkin.board_catalogue import ForeignBoard
from armkin.formula.arrays import Array
from armkin.motors import pulses
from armkin_dynamixel.bus import FAULT, LEAST, MOST, PROFILE, Bus
from armkin_dynamixel.emulator import Emulator

FAULTS = {0: "voltage", 2: "overheating", 3: "encoder", 4: "electrical shock", 5: "overload"}  # bits of FAULT


class Servos(ServoArm):
    """An arm of servos behind an open port: armkin's stream of positions, other registers."""

    firmware = "Dynamixel X"
    limits_at = "registers 48 and 52"
    differences = ("servos hold a position within about a degree; they count no steps",)
    bus: Bus

    def prepare(self, *, assume: Array | None = None) -> bool:
        """Switch the motors on where they stand; the plan says how fast, no profile of theirs."""
        for servo in self.ids:
            self.bus.write(servo, PROFILE, 0)
        return super().prepare(assume=assume)

    def _bus(self, port: Port) -> Bus:
        return Bus(port)

    def _own_limits(self) -> NDArray[np.int64]:
        return np.array([[self.bus.read(servo, end) for end in (LEAST, MOST)] for servo in self.ids], dtype=np.int64)

    def _read(self) -> None:
        self._states = self.bus.states(self.ids)
        self._counts = np.array([_number(self._states[servo][6:10]) for servo in self.ids], dtype=np.int64)

    def _send(self, counts: NDArray[np.int64], rates: Array) -> None:
        self.bus.send(dict(zip(self.ids, counts.tolist(), strict=True)))

    def _faults(self, number: int) -> list[str]:
        bits = self.bus.read(number, FAULT) if self.bus.alerts.get(number) else 0
        return [name for bit, name in FAULTS.items() if bits >> bit & 1]

    def _servo_report(self, number: int) -> dict[str, Any]:
        state = self._states[number]
        return {
            "load_percent": _number(state[:2]) / 10,
            "voltage": _number(state[18:20]) / 10,
            "temperature": state[20],
        }


class DynamixelBoard(ServoBusBoard):
    """The bus of an arm's servos."""

    baud = 57_600
    gripper_drive, gripper_taken = "none", "it moves none"

    def simulated(self) -> Port:
        """Servos in this process, at the arm's home pose."""
        return Emulator(dict(zip(servo_ids(self.arm), pulses(self.arm, self.arm.home).tolist(), strict=True)))

    def attach(self, port: Port, stop: Callable[[], bool]) -> Servos:
        """The arm on the bus behind an open port."""
        return Servos(port, self.arm, stop)

    def replies(self, link: Port, stop: Callable[[], bool]) -> bool:
        """Whether every servo of the arm answers to its id. Raises LinkError if one does not."""
        Bus(link).states(servo_ids(self.arm))
        return not stop()


def _number(data: bytes) -> int:
    return int.from_bytes(data, "little", signed=True)


KIND = ForeignBoard("dynamixel", "bus", "none", ())
BOARD = DynamixelBoard
