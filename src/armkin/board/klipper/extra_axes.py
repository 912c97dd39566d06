"""An arm's motors as Klipper's extra axes, and the sections of printer.cfg that they need.

Klipper's millimetre is a degree (or mm) of what the motor turns. Source: Klipper's documentation, Config_Reference.md
([printer], [manual_stepper], [idle_timeout]) and G-Codes.md (MANUAL_STEPPER ... GCODE_AXIS).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from armkin.board.backend.stepper_arm import steppers

if TYPE_CHECKING:
    from armkin.model.arm import Arm

LETTERS = tuple("ABCDHIJKL")  # letters that Klipper leaves to extra axes and that begin no G-code
SOCKETS = "~/printer_data/comms/klippy.sock", "/tmp/klippy_uds"  # paths where Klipper's API server mostly is
TIME_RATE = 10.0  # speed [units/s] of the virtual axis X that carries the time: see trajectory_to_g1_lines.py
PIECE_TIME = 0.01  # length [s] of one line
MAX_ACCEL = 1000.0  # acceleration [units/s2] of X


@dataclass(frozen=True)
class Axis:
    """A motor as one of Klipper's manual steppers, in degrees or mm of what it turns."""

    letter: str
    name: str  # the motor's
    steps: float  # [steps a unit]
    at_home: float  # [units] where the motor's count is 0
    full_steps: int
    microsteps: int
    invert: bool
    max_speed: float  # [units/s]
    max_accel: float  # [units/s2]

    @property
    def section(self) -> str:
        """The name after `manual_stepper`."""
        return f"axis_{self.letter.lower()}"

    @property
    def turn(self) -> float:
        """rotation_distance [units a turn of the motor]."""
        return self.full_steps * self.microsteps / self.steps

    @property
    def corner(self) -> float:
        """[units/s] that the speed may change from one line to the next: what its acceleration makes of PIECE_TIME."""
        return 1.5 * self.max_accel * PIECE_TIME + 1.0 / self.steps / PIECE_TIME


@dataclass(frozen=True)
class OptionDifference:
    """An option of printer.cfg that is not as the robot file wants it."""

    setting: str
    actual: str | None
    expected: str

    def __str__(self) -> str:
        """For people."""
        actual_text = "is not there" if self.actual is None else f"is {self.actual}"
        return f"{self.setting} {actual_text}: the robot file wants {self.expected}"


def axes_of(arm: Arm) -> list[Axis]:
    """One axis a motor, in the arm's order. Raises UsageError, naming the motor, for what Klipper cannot drive so."""
    home = arm.motor_gain @ arm.home  # [counts] of the motors at the home pose, if 0 is where all joint values are 0
    axes = []
    for k, motor, name, steps, *rates in steppers(arm, "Klipper", LETTERS):
        full, micro = motor.full_steps or 0, motor.microsteps or 0
        axes.append(Axis(motor.axis, name, steps, float(home[k] / steps), full, micro, motor.invert, *rates))
    return axes


def printer_cfg(axes: Sequence[Axis]) -> str:
    """The sections that an arm needs, pins left open."""
    text = [
        "[printer]",
        "kinematics: none",
        f"max_velocity: {TIME_RATE:g}",
        f"max_accel: {MAX_ACCEL:g}",
        "",
        "[idle_timeout]",
        "# Motors that are switched off lose the arm's position.",
        "timeout: 31536000",
        "gcode: G4 P0",
    ]
    for axis in axes:
        text += [
            "",
            f"[manual_stepper {axis.section}]",
            f"# {axis.name}",
            "step_pin: ?",
            f"dir_pin: {'' if axis.invert else '!'}?",
            "enable_pin: !?",
            f"rotation_distance: {axis.turn:.12g}",
            f"full_steps_per_rotation: {axis.full_steps}",
            f"microsteps: {axis.microsteps}",
            f"velocity: {axis.max_speed:.6g}",
            f"accel: {axis.max_accel:.6g}",
        ]
    return "\n".join(text) + "\n"


def settings_of(axes: Sequence[Axis]) -> dict[str, dict[str, Any]]:
    """The settings of the axes' sections as Klipper tells them: section -> option -> value."""
    sections: dict[str, dict[str, Any]] = {
        "printer": {"kinematics": "none", "max_velocity": TIME_RATE, "max_accel": MAX_ACCEL}
    }
    for axis in axes:
        sections[f"manual_stepper {axis.section}"] = {
            "rotation_distance": axis.turn,
            "full_steps_per_rotation": axis.full_steps,
            "microsteps": axis.microsteps,
        }
    return sections


def differences(axes: Sequence[Axis], actual: Mapping[str, Any]) -> list[OptionDifference]:
    """What does not fit in `configfile.settings`: section -> option -> value, as Klipper has read its file.

    Pins are not compared: no program can know them. Ratios of `gear_ratio` count.
    """
    printer = actual.get("printer")
    printer = printer if isinstance(printer, Mapping) else {}
    found_differences = []
    kinematics = printer.get("kinematics")
    if kinematics != "none":
        found_differences.append(OptionDifference("[printer] kinematics", _value_text(kinematics), "none"))
    for option, minimum in (("max_velocity", TIME_RATE), ("max_accel", MAX_ACCEL)):
        value = printer.get(option)
        if not isinstance(value, int | float) or value < minimum:
            found_differences.append(
                OptionDifference(f"[printer] {option}", _value_text(value), f"at least {minimum:g}")
            )
    for axis in axes:
        name = f"[manual_stepper {axis.section}]"
        section = actual.get(name[1:-1])
        if not isinstance(section, Mapping):
            found_differences.append(OptionDifference(name, None, f"one for motor {axis.name}"))
            continue
        steps = _steps_per_unit(section)
        if steps is None or not math.isclose(steps, axis.steps, rel_tol=1e-9):
            steps_text = None if steps is None else f"{steps:.9g}"
            found_differences.append(OptionDifference(f"{name} steps a unit", steps_text, f"{axis.steps:.9g}"))
    return found_differences


def _steps_per_unit(section: Mapping[str, Any]) -> float | None:
    """Steps a unit of a section, None if it does not tell."""
    try:
        ratio = math.prod(float(a) / float(b) for a, b in section.get("gear_ratio") or ())
        full_steps = float(section.get("full_steps_per_rotation", 200))
        return full_steps * float(section["microsteps"]) * ratio / float(section["rotation_distance"])
    except (KeyError, TypeError, ValueError, OverflowError, ZeroDivisionError):
        return None


def _value_text(value: object) -> str | None:
    if isinstance(value, float):
        return f"{value:g}"
    return None if value is None else str(value)
