"""An arm of STS servos: the methods of `ServoArm` that depend on their registers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from armkin.board.backend.servo_arm import ServoArm
from armkin.board.feetech import registers
from armkin.board.feetech.bus import Bus

if TYPE_CHECKING:
    from armkin.board.ports import Port
    from armkin.formula.arrays import Array

_MAX_COUNTS = 1 << 30  # position [counts] that bounds a servo without limits
CATCH_UP_FACTOR = 1.5  # a servo may move at this multiple of the trajectory's speed to catch up


class ServoMachine(ServoArm):
    """An arm of STS servos behind an open port."""

    firmware = "STS servo bus"
    limits_at = "registers 9 and 11"
    differences = (
        "servos hold a position within about a degree; they count no steps",
        "when the computer falls silent every servo goes to the last position it was sent, 20 ms ahead",
        "the bus has an 8-bit checksum: one damaged packet in some hundred passes it, and the next puts it right",
    )

    bus: Bus

    def _bus(self, port: Port) -> Bus:
        """The servos behind an open port."""
        return Bus(port)

    def _faults(self, number: int) -> list[str]:
        """The faults in a servo's last answer."""
        return registers.error_names(self.bus.errors.get(number, 0))

    def _servo_report(self, number: int) -> dict[str, Any]:
        """The fields of a servo's last state."""
        state = self._states[number]
        return {
            "load_percent": self._state_value(registers.LOAD, state) / 10,
            "voltage": self._state_value(registers.VOLTAGE, state) / 10,
            "temperature": self._state_value(registers.TEMPERATURE, state),
        }

    def _own_limits(self) -> NDArray[np.int64]:
        """The limits that are stored in the servos: (motors, 2) [counts]."""
        limit_bytes = self.bus.read_all(self.ids, *registers.LIMITS)
        limits = []
        for number in self.ids:
            lower_limit = self._limit_value(registers.MIN_POSITION, limit_bytes[number])
            upper = self._limit_value(registers.MAX_POSITION, limit_bytes[number])
            limits.append([lower_limit, upper] if lower_limit or upper else [-_MAX_COUNTS, _MAX_COUNTS])  # both 0: none
        return np.array(limits, dtype=np.int64)

    @staticmethod
    def _limit_value(register: registers.Register, raw: bytes) -> int:
        return register.unpack(raw, registers.LIMITS[0])

    def _send(self, counts: NDArray[np.int64], rates: Array) -> None:
        """Send goal positions to all servos at once, with the speeds to go there; 0: as fast as possible."""
        rows = {}
        for number, count, rate in zip(self.ids, counts.tolist(), rates.tolist(), strict=True):
            speed = 0 if rate == 0.0 else min(int(CATCH_UP_FACTOR * rate) + 20, 32767)
            rows[number] = b"".join(
                (
                    registers.ACCELERATION.pack(0),
                    registers.GOAL_POSITION.pack(int(count)),
                    registers.GOAL_TIME.pack(0),
                    registers.GOAL_SPEED.pack(speed),
                )
            )
        self.bus.write_all(registers.GOAL[0], rows)

    def _read(self) -> None:
        self._states = self.bus.states(self.ids)
        self._counts = np.array(
            [self._state_value(registers.POSITION, self._states[number]) for number in self.ids], dtype=np.int64
        )

    @staticmethod
    def _state_value(register: registers.Register, state: bytes) -> int:
        return register.unpack(state, registers.STATE[0])
