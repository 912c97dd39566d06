"""Registers of the STS3215 (the maker's memory table for SMS and STS servos), low byte first."""

from typing import NamedTuple

COUNTS_PER_TURN = 4096  # positions a turn


class Register(NamedTuple):
    """A register's place; `sign`: the bit that makes a value negative, or None."""

    address: int
    size: int
    sign: int | None = None

    def pack(self, value: int) -> bytes:
        """The register's bytes for a value.

        >>> GOAL_POSITION.pack(-2).hex()
        '0280'
        """
        if self.sign is not None and value < 0:
            value = -value | 1 << self.sign
        return value.to_bytes(self.size, "little")

    def unpack(self, raw: bytes, base: int) -> int:
        """The register's value in bytes that were read from address `base` on."""
        value = int.from_bytes(raw[self.address - base : self.address - base + self.size], "little")
        if self.sign is not None and value >> self.sign & 1:
            return -(value & ~(1 << self.sign))
        return value


MODEL = Register(3, 2)
MIN_POSITION = Register(9, 2)  # least position [counts] that the servo goes to; both 0: it turns without limits
MAX_POSITION = Register(11, 2)  # greatest position [counts] that the servo goes to
OFFSET = Register(31, 2, 11)  # counts taken off the encoder's position
TORQUE = Register(40, 1)
ACCELERATION = Register(41, 1)  # acceleration [100 counts/s^2], 0: none
GOAL_POSITION = Register(42, 2, 15)
GOAL_TIME = Register(44, 2)
GOAL_SPEED = Register(46, 2, 15)  # speed [counts/s], 0: as fast as it can
POSITION = Register(56, 2, 15)
SPEED = Register(58, 2, 15)  # speed [counts/s]
LOAD = Register(60, 2, 10)  # load [0.1 % of the greatest torque]
VOLTAGE = Register(62, 1)  # supply [0.1 V]
TEMPERATURE = Register(63, 1)  # temperature [deg C]
MOVING = Register(66, 1)

LIMITS = (MIN_POSITION.address, 4)  # registers of the least and the greatest position: read together
GOAL = (ACCELERATION.address, 7)  # registers of acceleration, position, time and speed: written together
STATE = (POSITION.address, 8)  # registers of position, speed, load, voltage and temperature: read together

ERRORS = {1: "voltage", 2: "angle sensor", 4: "overheating", 8: "overcurrent", 32: "overload"}


def error_names(bits: int) -> list[str]:
    """Names of the error bits that a servo's answer carries.

    >>> error_names(36)
    ['overheating', 'overload']
    """
    return [name for bit, name in ERRORS.items() if bits & bit]
