"""A bus of servos, whose requests are repeated until they are answered."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from armkin.board.feetech import packet
from armkin.board.feetech.packet import Reply, Splitter
from armkin.board.feetech.registers import GOAL_POSITION, STATE, TORQUE, Register
from armkin.errors import LinkError

if TYPE_CHECKING:
    from armkin.board.ports import Port

BAUD = 1_000_000  # rate [bit/s] of the bus
_ANSWER_TIMEOUT = 0.02  # longest time [s] of an answer; USB adapters delay bytes by up to 16 ms
_MAX_TRIES = 8  # tries before a servo counts as disconnected


class Bus:
    """Servos behind a port, by their numbers."""

    TORQUE, GOAL_POSITION = TORQUE, GOAL_POSITION

    def __init__(self, port: Port) -> None:
        self.port = port
        self.errors: dict[int, int] = {}  # servo: error bits of its last answer
        self.repeats = 0  # repeated requests
        self._splitter = Splitter()

    def ping(self, servo: int) -> bool:
        """Whether a servo answers."""
        return bool(self._ask(packet.packet(servo, packet.Instruction.PING), [servo], 0, tries=_MAX_TRIES))

    def read(self, servo: int, register: Register) -> int:
        """A register of one servo. Raises LinkError if it does not answer."""
        answer = self._require_answers(
            packet.read_registers(servo, register.address, register.size), [servo], register.size
        )
        return register.unpack(answer[servo], register.address)

    def write(self, servo: int, register: Register, value: int) -> None:
        """Write a register, and read it back where the acknowledgement was lost.

        Raises LinkError if the servo does not answer or keeps another value.
        """
        for _ in range(_MAX_TRIES):
            self._ask(packet.write_registers(servo, register.address, register.pack(value)), [servo], 0, tries=1)
            if self.read(servo, register) == value:
                return
        raise LinkError(f"servo {servo} on {self.port.name} does not take {value} for register {register.address}")

    def read_all(self, servos: Sequence[int], address: int, size: int) -> dict[int, bytes]:
        """Contents of the same registers of several servos in one request; silent servos are asked again alone."""
        answers = self._ask(packet.sync_read(servos, address, size), servos, size, tries=2)
        for servo in servos:
            if servo not in answers:
                answers |= self._require_answers(packet.read_registers(servo, address, size), [servo], size)
        return answers

    def write_all(self, address: int, data: Mapping[int, bytes]) -> None:
        """Write the same registers of several servos at once, without acknowledgement."""
        self.port.write(packet.sync_write(address, data))

    def states(self, servos: Sequence[int]) -> dict[int, bytes]:
        """Position, speed, load, voltage and temperature: bytes from `STATE` on."""
        return self.read_all(servos, *STATE)

    def torque(self, servos: Sequence[int], on: bool) -> None:
        """Switch motors on or off."""
        for servo in servos:
            self.write(servo, TORQUE, int(on))

    def _require_answers(self, question: bytes, servos: Sequence[int], size: int) -> dict[int, bytes]:
        answers = self._ask(question, servos, size, tries=_MAX_TRIES)
        silent_servos = [servo for servo in servos if servo not in answers]
        if silent_servos:
            raise LinkError(
                f"servo {silent_servos[0]} on {self.port.name} does not answer: is its cable plugged in, "
                "is the bus powered?"
            )
        return answers

    def _ask(self, question: bytes, servos: Sequence[int], size: int, *, tries: int) -> dict[int, bytes]:
        """Answers by servo; size: bytes of a complete answer."""
        answers: dict[int, bytes] = {}
        for attempt in range(tries):
            self.repeats += attempt > 0
            self._splitter.clear()
            while self.port.read(0.0):
                pass  # discard late answers to an earlier request
            self.port.write(question)
            # wait longer in later tries, for a busy computer
            deadline = self.port.now() + (_ANSWER_TIMEOUT + 0.002 * len(servos)) * (1 + attempt // 2)
            while len(answers) < len(servos) and self.port.now() < deadline:
                for answer in self._splitter.feed(self.port.read(0.002)):
                    self._take_answer(answer, servos, size, answers)
            if len(answers) == len(servos):
                break
        return answers

    def _take_answer(self, answer: Reply, servos: Sequence[int], size: int, answers: dict[int, bytes]) -> None:
        if answer.id in servos and len(answer.data) == size:
            self.errors[answer.id] = answer.errors
            answers[answer.id] = answer.data
