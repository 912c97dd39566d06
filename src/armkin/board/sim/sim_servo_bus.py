"""A bus of simulated STS3215 servos that speak the bus's bytes, in simulated time."""

import random
from collections.abc import Iterable
from typing import NamedTuple

from armkin.board.feetech.packet import BROADCAST, Instruction, Splitter, packet
from armkin.board.feetech.registers import (
    COUNTS_PER_TURN,
    GOAL_POSITION,
    GOAL_SPEED,
    LOAD,
    MAX_POSITION,
    MIN_POSITION,
    MODEL,
    MOVING,
    POSITION,
    SPEED,
    TEMPERATURE,
    TORQUE,
    VOLTAGE,
    Register,
)
from armkin.board.sim.clock import SimulatedTime

MAX_PAUSE = 0.002  # time [s], at most, between the bytes of a packet
MAX_SPEED = 3400  # speed [counts/s], at most, of a servo


class Servo:
    """One servo: its registers, and a shaft that follows the goal at the goal's speed."""

    def __init__(self, number: int, position: float = COUNTS_PER_TURN / 2) -> None:
        self.number, self.position = number, position
        self.speed = 0.0
        self.errors = 0
        self.memory = bytearray(80)
        self.set(MODEL, 777)
        self.set(MIN_POSITION, 0)
        self.set(MAX_POSITION, COUNTS_PER_TURN - 1)
        self.set(VOLTAGE, 74)
        self.set(TEMPERATURE, 31)
        self.set(GOAL_POSITION, round(position))
        self.advance(0.0)

    def get(self, register: Register) -> int:
        """A register's value."""
        return register.unpack(bytes(self.memory), 0)

    def set(self, register: Register, value: int) -> None:
        """Set a register."""
        self.memory[register.address : register.address + register.size] = register.pack(value)

    def advance(self, seconds: float) -> None:
        """Let time pass: with its torque on, the shaft moves towards the goal."""
        is_moving = self.get(TORQUE) == 1 and self.position != self.get(GOAL_POSITION)
        if seconds > 0 and not is_moving and not self.speed:
            return  # it stands, and its registers say so
        old_position = self.position
        if is_moving and seconds > 0:
            max_travel = (abs(self.get(GOAL_SPEED)) or MAX_SPEED) * seconds
            goal, low, high = (self.get(register) for register in (GOAL_POSITION, MIN_POSITION, MAX_POSITION))
            goal = min(max(goal, low), high) if low or high else goal  # it goes no farther than its own limits
            self.position += max(-max_travel, min(max_travel, goal - self.position))
        self.speed = (self.position - old_position) / seconds if seconds > 0 else 0.0
        self.set(POSITION, round(self.position))
        self.set(SPEED, round(self.speed))
        self.set(MOVING, int(self.get(TORQUE) == 1 and self.position != self.get(GOAL_POSITION)))
        self.set(LOAD, 120 if self.speed else 30)

    def write(self, address: int, values: bytes) -> None:
        """Write registers."""
        if address + len(values) > len(self.memory):
            return  # registers that are not there are ignored
        self.memory[address : address + len(values)] = values
        self.advance(0.0)


class Noise(NamedTuple):
    """Shares of packets that are lost and damaged on their way."""

    lost: float = 0.0
    damaged: float = 0.0
    seed: int = 1


class ServoBus(SimulatedTime):
    """The port of a bus of simulated servos; whatever the host writes echoes nowhere."""

    step = 0.001
    baud = 1_000_000

    def __init__(self, servos: Iterable[Servo], name: str = "sim", noise: Noise | None = None) -> None:
        super().__init__()
        self.name = name
        self.servos = {servo.number: servo for servo in servos}
        self.log: list[tuple[float, dict[int, float]]] = []  # where the shafts stood: every millisecond of a motion
        self._noise = noise or Noise()
        self._random = random.Random(self._noise.seed)
        self._splitter = Splitter()
        self._heard = 0.0

    def write(self, data: bytes) -> None:
        """Send bytes to the bus; a servo forgets the beginning of a packet after a pause."""
        if self._now - self._heard > MAX_PAUSE:
            self._splitter.clear()
        self._heard = self._now
        for question in self._splitter.feed(self._spoil(data)):
            self._obey_instruction(question.id, question.errors, question.data)

    def advance(self, seconds: float) -> None:
        """Let simulated time pass."""
        self._now += seconds
        for servo in self.servos.values():
            servo.advance(seconds)
        if any(servo.speed for servo in self.servos.values()):
            self.log.append((self._now, {number: servo.position for number, servo in self.servos.items()}))

    def _obey_instruction(self, number: int, kind: int, parameters: bytes) -> None:
        """Carry out an instruction to one servo or to all, and answer where one does."""
        if number == BROADCAST:
            self._obey_all(kind, parameters)
        elif number in self.servos:
            servo = self.servos[number]
            if kind == Instruction.PING:
                self._send_answer(servo)
            elif kind == Instruction.READ and len(parameters) == 2:
                self._send_answer(servo, *parameters)
            elif kind == Instruction.WRITE and parameters:
                servo.write(parameters[0], parameters[1:])
                self._send_answer(servo)

    def _obey_all(self, kind: int, parameters: bytes) -> None:
        if kind == Instruction.SYNC_READ and len(parameters) >= 2:
            for number in parameters[2:]:
                if number in self.servos:
                    self._send_answer(self.servos[number], parameters[0], parameters[1])
        elif kind == Instruction.SYNC_WRITE and len(parameters) >= 2:
            size = parameters[1] + 1
            for begin in range(2, len(parameters) - size + 1, size):
                if parameters[begin] in self.servos:
                    self.servos[parameters[begin]].write(parameters[0], parameters[begin + 1 : begin + size])

    def _send_answer(self, servo: Servo, address: int = 0, size: int = 0) -> None:
        answer = packet(servo.number, servo.errors, bytes(servo.memory[address : address + size]))
        self._out += self._spoil(answer)

    def _spoil(self, packet_bytes: bytes) -> bytes:
        if self._random.random() < self._noise.lost:
            return b""
        if self._random.random() < self._noise.damaged:
            k = self._random.randrange(len(packet_bytes))
            return packet_bytes[:k] + bytes([packet_bytes[k] ^ 1 << self._random.randrange(8)]) + packet_bytes[k + 1 :]
        return packet_bytes
