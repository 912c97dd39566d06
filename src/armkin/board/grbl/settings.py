"""GRBL's settings against the robot file: what must agree before anything moves."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from armkin.board.grbl.replies import LETTERS

HOMING = (22, 23)  # settings that only homing needs
COARSE = 500.0  # [steps a unit] beyond which GRBL's three decimals do not tell every step


@dataclass(frozen=True)
class Axis:
    """A motor on one of GRBL's axes, in degrees or mm of what it turns."""

    letter: str
    name: str  # the motor's
    steps: float  # [steps a unit]
    invert: bool
    max_speed: float  # [units/s]
    max_accel: float  # [units/s2]
    upward: bool | None = None  # the limit switch is where the motor's counts are greatest; None: it has none

    @property
    def index(self) -> int:
        """Place among GRBL's axes."""
        return LETTERS.index(self.letter)


@dataclass(frozen=True)
class Difference:
    """A setting that is not as the robot file wants it."""

    number: int
    what: str
    found: float | None
    wanted: float
    serious: bool  # motion would be wrong or too fast; otherwise only slower than planned

    def __str__(self) -> str:
        """For people, and as the line that mends it."""
        found = "is not there" if self.found is None else f"is {self.found:g}"
        return f"${self.number} ({self.what}) {found}: the robot file wants ${self.number}={self.wanted:g}"


def wanted(axes: Sequence[Axis]) -> dict[int, tuple[str, float]]:
    """GRBL's settings for an arm: number -> what it is, value."""
    found: dict[int, tuple[str, float]] = {
        1: ("keep the motors on at rest", 255),
        3: ("inverted directions", sum(1 << axis.index for axis in axes if axis.invert)),
        10: ("report the machine position and the buffer", 3),
        13: ("millimetres", 0),
        20: ("its own soft limits: armkin checks the joints'", 0),
        32: ("laser mode", 0),
    }
    if all(axis.upward is not None for axis in axes):
        found[22] = ("homing", 1)
        found[23] = ("homing downwards", sum(1 << axis.index for axis in axes if not axis.upward))
    for axis in axes:
        found[100 + axis.index] = (f"{axis.name}: steps a unit", round(axis.steps, 3))
    for axis in axes:
        found[110 + axis.index] = (f"{axis.name}: greatest speed, units/min", _floor(60 * axis.max_speed))
    for axis in axes:
        found[120 + axis.index] = (f"{axis.name}: acceleration, units/s2", _floor(axis.max_accel))
    return found


def differences(axes: Sequence[Axis], found: Mapping[int, float]) -> list[Difference]:
    """What is not as the robot file wants it.

    A greatest speed or acceleration below the robot file's is not serious: GRBL is slower than planned, no more.
    """
    result = []
    for number, (what, value) in wanted(axes).items():
        there = found.get(number)
        if there is not None and _same(number, there, value, axes):
            continue
        slower = number // 10 in (11, 12) and there is not None and there < value
        result.append(Difference(number, what, there, value, serious=not slower and number not in (1, *HOMING)))
    return result


def _same(number: int, found: float, value: float, axes: Sequence[Axis]) -> bool:
    if number in (3, 23):  # other axes' directions are not ours
        ours = sum(1 << axis.index for axis in axes)
        return int(found) & ours == int(value) & ours
    if number == 22:  # grblHAL keeps more in its other bits
        return int(found) & 1 == 1
    if number == 10:
        return int(found) & 1 == 1  # machine position; the buffer is good to know, no more
    if number == 1:
        return found == 255
    return math.isclose(found, value, rel_tol=0, abs_tol=0.0006)


def _floor(value: float) -> float:
    return math.floor(value * 1000) / 1000
