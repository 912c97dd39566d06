"""Reads a LeRobot calibration file: zeros, limits and directions of an arm's bus servos.

For each motor name LeRobot writes `id`, `drive_mode` (1: inverted counts), `homing_offset` (also in register 31 of
the servo, so that reported counts include it), and `range_min` and `range_max`, the reported counts at the ends of the
motion that its owner has made by hand.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from armkin.board.feetech import registers
from armkin.board.feetech.registers import COUNTS_PER_TURN
from armkin.errors import FileError, LinkError, UsageError
from armkin.model.units import DEGREE, joint_as_typed, poses_out

if TYPE_CHECKING:
    from armkin.board.feetech.feetech_machine import ServoMachine
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm

_MAX_BYTES = 1_000_000  # size [bytes], at most, of a calibration file
_MIDDLE_DISTANCE = 5.0  # greatest distance [deg] of a joint's zero from the middle of its limits
_VALUE_RANGES = {
    "id": (0, 253),
    "drive_mode": (0, 1),
    "homing_offset": (-4095, 4095),
    "range_min": (0, 4095),
    "range_max": (0, 4095),
}
Edits = dict[tuple[str | int, ...], float | int | str]


@dataclass(frozen=True)
class Motor:
    """A motor of a calibration file."""

    name: str  # LeRobot's
    id: int
    drive_mode: int
    homing_offset: int  # [counts]
    range_min: int  # [counts]
    range_max: int

    @property
    def middle(self) -> float:
        """Reported counts in the middle of its range."""
        return (self.range_min + self.range_max) / 2


@dataclass(frozen=True)
class ServoCalibration:
    """The calibration of an arm from a file."""

    motors: tuple[Motor, ...]  # motors in the arm's order
    zero: tuple[float, ...]  # [counts] of every drive
    limits: tuple[tuple[float, float], ...]  # [deg] of every joint
    gripper: Motor | None
    gripper_ends: tuple[float, float] | None  # open, closed [deg], counted from the gripper's middle
    edits: Edits  # changes of the robot file

    def check(self, machine: ServoMachine) -> None:
        """Raise LinkError, naming the motor, if the register 31 of a servo is not the file's homing_offset."""
        for motor in (*self.motors, *([self.gripper] if self.gripper is not None else [])):
            offset = machine.bus.read(motor.id, registers.OFFSET)
            if offset != motor.homing_offset:
                raise LinkError(
                    f"servo {motor.id} ({motor.name}): its homing offset (register 31) is {offset}, the file says "
                    f"{motor.homing_offset}: the file is another arm's, or the servo was calibrated again since"
                )


def read_calibration(path: str) -> dict[int, Motor]:
    """The motors of a calibration file, by their ids. Raises FileError, naming the motor, for what is none."""
    try:
        with open(path, encoding="utf-8") as file:
            text = file.read(_MAX_BYTES + 1)
        entries = json.loads(text) if len(text) <= _MAX_BYTES else None
    except OSError as error:
        raise FileError(f"{path}: {error.strerror or error}", file=path) from None
    except (ValueError, RecursionError):
        entries = None
    if not isinstance(entries, dict) or not entries:
        raise FileError(f"{path} is no calibration file of LeRobot: a JSON object of motors by their names", file=path)
    motors: dict[int, Motor] = {}
    for name, values in entries.items():
        motor = Motor(name, **{key: _whole_number(path, name, values, key) for key in _VALUE_RANGES})
        if motor.id in motors:
            raise FileError(f"{path}: {motors[motor.id].name} and {name} have the same id {motor.id}", file=path)
        if motor.range_min >= motor.range_max:
            ends = f"{motor.range_min} to {motor.range_max}"
            raise FileError(f"{path}: {name}: range_min to range_max is {ends}: calibrate it again", file=path)
        motors[motor.id] = motor
    return motors


def _whole_number(path: str, name: str, values: Any, key: str) -> int:
    value = values.get(key) if isinstance(values, Mapping) else None
    low, high = _VALUE_RANGES[key]
    if type(value) is not int or not low <= value <= high:
        complaint = "is missing" if value is None else f"is {str(value)[:40]}"
        raise FileError(f"{path}: {name}: {key} {complaint}: a whole number from {low} to {high}", file=path)
    return value


def calibration_edits(arm: Arm, path: str, pose: Array | None) -> ServoCalibration:
    """The calibration of an arm from a file; each of its joints must have a bus servo.

    pose: (n,) [rad] where the middles of all ranges are; None: every joint's value is 0 there. Raises FileError for
    what is no calibration file; UsageError, naming the joint, where it does not fit the arm.
    """
    calibrated = read_calibration(path)
    middle = np.zeros(arm.n) if pose is None else pose
    motors, zero, limits = list[Motor](), list[float](), list[tuple[float, float]]()
    edits = Edits()
    for drive, gain in zip(arm.motors, arm.motor_gain, strict=True):
        joint = int(np.flatnonzero(gain)[0])
        name = arm.joint_names[joint]
        motor = _calibrated_motor(calibrated, drive.id, name, path, drive.counts)
        if pose is None:
            _check_middle(arm, joint)
        counts_per_degree = drive.pulses_per_unit() * (-1 if motor.drive_mode else 1)  # [counts/deg]
        zero_count = motor.middle - counts_per_degree * float(middle[joint]) / DEGREE
        low, high = sorted((count - zero_count) / counts_per_degree for count in (motor.range_min, motor.range_max))
        _check_poses(arm, joint, joint_as_typed(arm, joint, middle[joint]), (low, high))
        motors.append(motor)
        zero.append(zero_count)
        limits.append((low, high))
        edits["joints", joint, "limits"] = f"[{low:.6f}, {high:.6f}]"
        edits["joints", joint, "drive", "zero"] = _int_if_whole(zero_count)
        edits["joints", joint, "drive", "invert"] = "true" if motor.drive_mode else "false"
    gripper, ends = _gripper_calibration(arm, calibrated, path, edits)
    return ServoCalibration(
        motors=tuple(motors), zero=tuple(zero), limits=tuple(limits), gripper=gripper, gripper_ends=ends, edits=edits
    )


def _calibrated_motor(
    motors: Mapping[int, Motor], number: int | None, name: str, path: str, counts: int | None
) -> Motor:
    """The motor of a calibrated servo; UsageError where number, name or counts do not fit the file."""
    if number is None or number not in motors:
        has = ", ".join(f"{motor.name} {key}" for key, motor in sorted(motors.items()))
        raise UsageError(f"{path}: joint {name} is servo {number}, which the file has not: it has {has}")
    motor = motors[number]
    if counts != COUNTS_PER_TURN:
        raise UsageError(f"{path}: joint {name} has {counts} counts a turn; LeRobot's files are for {COUNTS_PER_TURN}")
    if motor.name != name and name in (other_motor.name for other_motor in motors.values()):
        raise UsageError(f"{path}: joint {name} is servo {number}, which is {motor.name} in the file")
    return motor


def _check_middle(arm: Arm, joint: int) -> None:
    """Raise UsageError if a joint's zero is far from the middle of its limits, LeRobot's calibration pose."""
    middle = float(arm.lower[joint] + arm.upper[joint]) / 2 / DEGREE
    if not abs(middle) <= _MIDDLE_DISTANCE:
        raise UsageError(
            f"{arm.name}: the zero of {arm.joint_names[joint]} lies {abs(middle):.4g} deg from the middle of its "
            f"limits, more than {_MIDDLE_DISTANCE:g}",
            advice="say which pose the middles of all ranges are",
            joint=arm.joint_names[joint],
            middle=middle,
        )


def _check_poses(arm: Arm, joint: int, middle: float, limits: tuple[float, float]) -> None:
    """Raise UsageError if a pose of the robot file, home first, is outside a joint's new limits; all in [deg]."""
    name, (low, high) = arm.joint_names[joint], limits
    for pose, values in poses_out(arm).items():
        value = values[joint]
        if round(low, 6) <= value <= round(high, 6):  # as they are written
            continue
        lower, upper = value + low - middle, value + high - middle
        raise UsageError(
            f"{name} at {middle:g} deg in the middle of its range makes its limits {low:g} to {high:g} deg, and "
            f"its pose {pose} is at {value:g}: the middle must be from {lower:g} to {upper:g} deg",
            joint=name,
            middle=middle,
            lower=lower,
            upper=upper,
        )


def _gripper_calibration(
    arm: Arm, motors: Mapping[int, Motor], path: str, edits: Edits
) -> tuple[Motor | None, tuple[float, float] | None]:
    """The gripper's motor and its ends, open and closed [deg]: LeRobot closes it at 0 %, range_min of drive_mode 0."""
    drive = arm.gripper
    if drive is None or drive.kind != "bus":
        return None, None
    motor = _calibrated_motor(motors, drive.id, "gripper", path, drive.counts)
    half_range = (motor.range_max - motor.middle) / drive.pulses_per_unit()
    values: Sequence[tuple[str, float | int | str]] = (
        ("zero", _int_if_whole(motor.middle)),
        ("invert", "true" if motor.drive_mode else "false"),
        ("open", f"{half_range:.6f}"),
        ("closed", f"{-half_range:.6f}"),
    )
    edits.update({("gripper", key): value for key, value in values})
    return motor, (half_range, -half_range)


def _int_if_whole(count: float) -> int | float:
    return int(count) if count.is_integer() else round(count, 6)
