"""Servos of protocol 2.0 behind one of armkin's ports, by the maker's SDK."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from dynamixel_sdk import Protocol2PacketHandler

from armkin.board.ports import Port
from armkin.errors import LinkError

_TRIES = 8  # of a question before a servo counts as gone


class Register(NamedTuple):
    """Where a value stands in the control table of the X series."""

    address: int
    size: int


MOST, LEAST = Register(48, 4), Register(52, 4)  # position limits
TORQUE, FAULT, PROFILE, GOAL = Register(64, 1), Register(70, 1), Register(108, 8), Register(116, 4)
STATE = Register(126, 21)  # load (2 bytes), speed (4), position (4), 8 others, voltage (2), temperature (1)


class Line:
    """An armkin port, with the SDK's names."""

    is_using = False

    def __init__(self, port: Port) -> None:
        self._port, self._end, self._heard = port, 0.0, b""

    def clearPort(self) -> None:  # noqa: N802
        self._heard = b""
        while self._port.read(0.0):
            pass

    def writePort(self, packet: Iterable[int]) -> int:  # noqa: N802
        data = bytes(packet)
        self._port.write(data)
        return len(data)

    def readPort(self, count: int) -> list[int]:  # noqa: N802
        if len(self._heard) < count:
            self._heard += self._port.read(0.001)
        found, self._heard = self._heard[:count], self._heard[count:]
        return list(found)

    def setPacketTimeout(self, count: int) -> None:  # noqa: N802
        self._end = self._port.now() + 0.02 + 2e-4 * count

    def isPacketTimeout(self) -> bool:  # noqa: N802
        return not self._heard and self._port.now() > self._end


class Bus:
    """Servos by their numbers: questions are asked again until they are answered."""

    TORQUE, GOAL_POSITION = TORQUE, GOAL

    def __init__(self, port: Port) -> None:
        self.port, self.alerts = port, dict[int, bool]()  # servo -> whether its last answer had the alert bit
        self._line, self._sdk = Line(port), Protocol2PacketHandler()

    def ping(self, servo: int) -> bool:
        """Whether a servo answers."""
        return self._ask(servo, TORQUE) is not None

    def read(self, servo: int, register: Register) -> int:
        """A register of one servo as a number. Raises LinkError if it does not answer."""
        return int.from_bytes(self._sure(servo, register), "little", signed=register.size > 1)

    def write(self, servo: int, register: Register, value: int) -> None:
        """Write a register until it reads back so. Raises LinkError if it never does."""
        data = value.to_bytes(register.size, "little", signed=value < 0)
        for _ in range(_TRIES):
            self._line.is_using = False
            self._sdk.writeTxOnly(self._line, servo, *register, list(data))
            if self._sure(servo, register) == data:
                return
        raise LinkError(f"servo {servo} on {self.port.name} does not take {value} for register {register.address}")

    def torque(self, servos: Sequence[int], on: bool) -> None:
        """Switch motors on or off."""
        for servo in servos:
            self.write(servo, TORQUE, int(on))

    def states(self, servos: Sequence[int]) -> dict[int, bytes]:
        """STATE of all servos, asked together; those behind a gap again one by one, for it may be anybody's."""
        self._line.is_using, found = False, dict[int, bytes]()
        self._sdk.syncReadTx(self._line, *STATE, list(servos), len(servos), False)
        for servo in servos:
            self._line.setPacketTimeout(STATE.size + 11)
            if (answer := self._answer(servo, STATE)) is None:
                break
            found[servo] = answer
        return {servo: found.get(servo) or self._sure(servo, STATE) for servo in servos}

    def send(self, goals: dict[int, int]) -> None:
        """Goal positions of all servos at one moment; nobody acknowledges it."""
        data = [byte for servo, goal in goals.items() for byte in (servo, *goal.to_bytes(4, "little", signed=True))]
        self._line.is_using = False
        self._sdk.syncWriteTxOnly(self._line, *GOAL, data, len(data))

    def _sure(self, servo: int, register: Register) -> bytes:
        if (found := self._ask(servo, register)) is None:
            raise LinkError(f"servo {servo} on {self.port.name} does not answer: is it powered and plugged in?")
        return found

    def _ask(self, servo: int, register: Register) -> bytes | None:
        for _ in range(_TRIES):
            self._line.is_using = False
            if self._sdk.readTx(self._line, servo, *register) == 0:
                self._line.setPacketTimeout(register.size + 11)
                if (found := self._answer(servo, register)) is not None:
                    return found
        return None

    def _answer(self, servo: int, register: Register) -> bytes | None:
        try:
            data, result, error = self._sdk.readRx(self._line, servo, register.size)
        except (IndexError, TypeError):  # the SDK trips over some damaged packets
            return None
        self.alerts[servo] = bool(error & 0x80)
        return bytes(data) if result == 0 and len(data) == register.size else None
