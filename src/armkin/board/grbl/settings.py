"""Compares GRBL's settings with the robot file; serious differences forbid motion."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from armkin.board.grbl.replies import LETTERS

_INTEGER_SETTINGS = (1, 3, 10, 13, 20, 22, 23, 32, 384)  # settings of whole numbers
HOMING_SETTINGS = (22, 23)  # settings that only homing needs
G92_VOLATILE = 384  # setting of grblHAL: 1 clears G92 when the board loses its power
COARSE_STEPS = 500.0  # greatest resolution [steps a unit] at which three decimals show every step


@dataclass(frozen=True)
class Axis:
    """A motor on one of GRBL's axes, in degrees or mm of its joint."""

    letter: str
    name: str  # the motor's
    steps: float  # [steps a unit]
    invert: bool
    max_speed: float  # [units/s]
    max_accel: float  # [units/s2]
    upward: bool | None = None  # whether the limit switch is at the greatest counts; None: no switch

    @property
    def index(self) -> int:
        """Place among GRBL's axes."""
        return LETTERS.index(self.letter)


@dataclass(frozen=True)
class SettingDifference:
    """A setting that differs from the robot file."""

    number: int
    meaning: str
    actual: float | None
    expected: float
    serious: bool  # whether motion would be wrong or too fast; otherwise it is only slower

    def __str__(self) -> str:
        """The difference in words, with the line that corrects it."""
        actual_text = "is not there" if self.actual is None else f"is {self.actual:g}"
        return f"${self.number} ({self.meaning}) {actual_text}: the robot file wants ${self.number}={self.expected:g}"

    def line(self) -> str:
        """The line that corrects it; grblHAL rejects 255.000 for an integer setting."""
        return f"${self.number}={self.expected:.{0 if self.number in _INTEGER_SETTINGS else 3}f}"


def expected_settings(axes: Sequence[Axis], *, hal: bool = False) -> dict[int, tuple[str, float]]:
    """GRBL's settings for an arm, {number: (meaning, value)}; hal: for grblHAL."""
    expected: dict[int, tuple[str, float]] = {
        1: ("keep the motors on at rest", 255),
        3: ("inverted directions", sum(1 << axis.index for axis in axes if axis.invert)),
        10: ("report the machine position and the buffer", 3),
        13: ("millimetres", 0),
        20: ("its own soft limits: armkin checks the joints'", 0),
        32: ("laser mode", 0),
    }
    if all(axis.upward is not None for axis in axes):
        expected[22] = ("homing", 1)
        expected[23] = ("homing downwards", sum(1 << axis.index for axis in axes if not axis.upward))
    if hal:
        expected[G92_VOLATILE] = ("forget G92 with the power, as GRBL does", 1)
    for axis in axes:
        expected[100 + axis.index] = (f"{axis.name}: steps a unit", round(axis.steps, 3))
    for axis in axes:
        expected[110 + axis.index] = (f"{axis.name}: greatest speed, units/min", _floor_decimals(60 * axis.max_speed))
    for axis in axes:
        expected[120 + axis.index] = (f"{axis.name}: acceleration, units/s2", _floor_decimals(axis.max_accel))
    return expected


def differences(axes: Sequence[Axis], actual: Mapping[int, float], *, hal: bool = False) -> list[SettingDifference]:
    """Settings that differ from the robot file; hal: for grblHAL.

    A lower greatest speed or acceleration is not serious, since GRBL is then only slower than planned.
    """
    found_differences = []
    for number, (meaning, value) in expected_settings(axes, hal=hal or G92_VOLATILE in actual).items():
        actual_value, own_bits = actual.get(number), _own_bits(number, axes)
        if actual_value is not None and own_bits is not None:
            value = int(actual_value) & ~own_bits | int(value) & own_bits  # other bits belong to other axes
        if actual_value is not None and _is_equal(number, actual_value, value):
            continue
        is_slower = number // 10 in (11, 12) and actual_value is not None and actual_value < value
        found_differences.append(
            SettingDifference(
                number, meaning, actual_value, value, serious=not is_slower and number not in (1, *HOMING_SETTINGS)
            )
        )
    return found_differences


def _own_bits(number: int, axes: Sequence[Axis]) -> int | None:
    """The bits of a setting that belong to the arm; None: the whole value does."""
    if number in (3, 23):
        return sum(1 << axis.index for axis in axes)
    return {10: 3, 22: 1}.get(number)


def _is_equal(number: int, actual: float, value: float) -> bool:
    if number == 10:
        return int(actual) & 1 == 1  # the machine position is needed, the buffer is optional
    return math.isclose(actual, value, rel_tol=0, abs_tol=0.0006)


def _floor_decimals(value: float) -> float:
    return math.floor(value * 1000) / 1000
