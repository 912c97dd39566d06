"""Servos of the X series in this process, in simulated time: their control tables, and shafts that follow goals."""

from __future__ import annotations

import random
from collections.abc import Mapping

from dynamixel_sdk import Protocol2PacketHandler

from armkin.board.sim.clock import SimulatedTime
from armkin_dynamixel.bus import GOAL, LEAST, MOST, TORQUE, Register

FASTEST = 4000.0  # [counts/s]
PING, READ, WRITE, STATUS, SYNC_READ, SYNC_WRITE, ALL = 0x01, 0x02, 0x03, 0x55, 0x82, 0x83, 0xFE


class Servo:
    """A control table, and a shaft."""

    def __init__(self, position: float) -> None:
        self.position, self.table = position, bytearray(1024)
        for register, value in ((MOST, 4095), (LEAST, 0), (GOAL, round(position)), (Register(144, 2), 120)):
            self.set(register, value)
        self.advance(0.0)

    def get(self, register: Register) -> int:
        """A register's value."""
        data = self.table[register.address : register.address + register.size]
        return int.from_bytes(data, "little", signed=True)

    def set(self, register: Register, value: int) -> None:
        """Set a register."""
        data = value.to_bytes(register.size, "little", signed=value < 0)
        self.table[register.address : register.address + register.size] = data

    def advance(self, seconds: float) -> None:
        """Let time pass."""
        if self.get(TORQUE):
            goal = min(max(self.get(GOAL), self.get(LEAST)), self.get(MOST))
            self.position += max(-FASTEST * seconds, min(FASTEST * seconds, goal - self.position))
        self.set(Register(132, 4), round(self.position))


class Emulator(SimulatedTime):
    """The port of a bus of them; lost, damaged: shares of answers."""

    step, baud, name = 0.001, 57_600, "sim"

    def __init__(self, at: Mapping[int, float], lost: float = 0.0, damaged: float = 0.0) -> None:
        super().__init__()
        self.servos = {number: Servo(count) for number, count in at.items()}
        self.log: list[dict[int, float]] = []  # where the shafts stood, at every step
        self._sdk, self._heard, self._random = Protocol2PacketHandler(), b"", random.Random(1)
        self._lost, self._damaged = lost, damaged

    def write(self, data: bytes) -> None:
        """What the host sends: whole packets, the damaged ones left out."""
        self._heard += data
        while (begin := self._heard.find(b"\xff\xff\xfd\x00")) >= 0 and len(self._heard) >= begin + 7:
            end = begin + 7 + int.from_bytes(self._heard[begin + 5 : begin + 7], "little")
            if len(self._heard) < end:
                return
            packet, self._heard = list(self._heard[begin:end]), self._heard[end:]
            if self._sdk.updateCRC(0, packet, len(packet) - 2) == packet[-2] | packet[-1] << 8:
                packet = self._sdk.removeStuffing(packet)
                last = 7 + (packet[5] | packet[6] << 8) - 2
                self._obey(packet[4], packet[7], bytes(packet[8:last]))

    def advance(self, seconds: float) -> None:
        """Let simulated time pass."""
        self._now += seconds
        for servo in self.servos.values():
            servo.advance(seconds)
        self.log.append({number: servo.position for number, servo in self.servos.items()})

    def _obey(self, number: int, kind: int, data: bytes) -> None:
        address = int.from_bytes(data[:2], "little")
        if kind in (SYNC_READ, SYNC_WRITE):
            size, rest = int.from_bytes(data[2:4], "little"), data[4:]
            every = 1 if kind == SYNC_READ else 1 + size
            for one, *values in (rest[k : k + every] for k in range(0, len(rest), every)):
                if one in self.servos and kind == SYNC_READ:
                    self._answer(one, self.servos[one].table[address : address + size])
                elif one in self.servos:
                    self.servos[one].table[address : address + size] = bytes(values)
        elif number in self.servos and kind == WRITE:
            self.servos[number].table[address : address + len(data) - 2] = data[2:]
            self._answer(number, b"")
        elif number in self.servos and kind in (READ, PING):
            size = int.from_bytes(data[2:4], "little")
            self._answer(number, b"\x06\x04\x2d" if kind == PING else self.servos[number].table[address:][:size])

    def _answer(self, number: int, values: bytes | bytearray) -> None:
        packet = [0xFF, 0xFF, 0xFD, 0, number, 0, 0, STATUS, 0, *values, 0, 0]
        packet[5:7] = (len(packet) - 7).to_bytes(2, "little")
        self._sdk.addStuffing(packet)
        packet[-2:] = self._sdk.updateCRC(0, packet, len(packet) - 2).to_bytes(2, "little")
        if self._random.random() < self._damaged:
            packet[self._random.randrange(len(packet))] ^= 1 << self._random.randrange(8)
        if self._random.random() >= self._lost:
            self._out += bytes(packet)
