"""Converts a robot file to the configuration of its board: motors on axes, limits, rates, home.

The image (firmware/PROTOCOL.md, section 4) is sent to the board once and stays there. Host and board compare its CRC to
detect that they are set up for different arms.
"""

from __future__ import annotations

import json
import math
import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from armkin.board.backend import missing_keys
from armkin.board.firmware.gripper_counts import Grip, as_axis
from armkin.board.firmware.wire.protocol import AxisImage, GuardImage, Image, RowImage
from armkin.board_catalogue import BOARDS, DRIVERS, Board, Driver
from armkin.errors import UsageError
from armkin.motors import motor_accel, pulse_range, pulses

if TYPE_CHECKING:
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm
    from armkin.robot_file import Gripper

_NO_LIMIT = 2**30  # stands for a missing limit [counts]
_RATE_FACTOR = 1.05  # margin on a motor's rate for the rounding of cycles, rates and parabolas
_SERVO_RANGE = (400, 2600)  # pulse lengths [us] that the boards can make


@dataclass(frozen=True)
class Configuration:
    """The configuration of an arm on a board."""

    board: Board
    image: Image
    axes: tuple[int, ...]  # axis of every motor, in the arm's order
    grip: Grip | None  # None also for a gripper without max_speed or max_accel

    @property
    def steppers(self) -> bool:
        """Whether a motor of the arm (or the gripper) is a stepper."""
        used_axes = [i for i, axis in enumerate(self.image.axes) if axis.used]
        return any(i < len(self.board.steppers) for i in used_axes)


def configure(arm: Arm, *, rehearsal: bool = False) -> Configuration:
    """The configuration of an arm.

    rehearsal: for a plan or a simulated board; it uses the robot file's board if that is complete, else a made-up one
    with an axis for every motor. Raises UsageError that lists all missing keys: max_speed, `board`, `axis`, ...
    """
    _refuse_incomplete(arm, board=not rehearsal)
    board, names = _board_and_axes(arm, rehearsal=rehearsal)
    axes = tuple(board.axes.index(name) for name in names[:-1])
    grip = as_axis(board.axes.index(names[-1]), arm.gripper) if arm.gripper is not None else None
    images = [AxisImage() for _ in board.axes]
    low, high = _count_limits(arm)
    home = pulses(arm, arm.home)
    rate, accel = np.abs(arm.motor_gain) @ arm.max_speed, motor_accel(arm)
    for number, (motor, axis) in enumerate(zip(arm.motors, axes, strict=True)):
        if motor.kind == "servo":
            _check_servo(f"motor {motor.name}", low[number], high[number])
        stepper = motor.kind == "stepper"
        images[axis] = AxisImage(
            used=True,
            invert=motor.invert and stepper,  # a servo's counts are inverted already
            lower=low[number],
            upper=high[number],
            home=int(home[number]),
            max_rate=_board_rate(board, rate[number]),
            max_accel=_board_accel(accel[number]),
        )
    if grip is not None and arm.gripper is not None:
        images[grip.axis] = _grip_image(board, arm.gripper, grip)
    driver = _pulse_timing(arm)
    image = Image(
        tuple(images),
        _limit_rows(arm, board, axes, low, high),
        _switch_guards(arm, board, axes),
        abort_closed=arm.board is not None and arm.board.abort == "closed",
        enable_high=arm.board is not None and arm.board.enable == "high",
        power_sensed=arm.board is not None and arm.board.power is not None,
        step_high=driver.step_high,
        step_low=driver.step_low,
        dir_setup=driver.dir_setup,
        wake=driver.wake,
        meaning=_meaning_checksum(arm, grip),
    )
    return Configuration(board, image, axes, grip)


def _board_and_axes(arm: Arm, *, rehearsal: bool) -> tuple[Board, list[str]]:
    """The board, and the names of the axes of all motors and of the gripper; a rehearsal may make a board up."""
    if rehearsal and missing_keys.without_board(arm):
        return _rehearsal_board(arm), [*(motor.name for motor in arm.motors), "gripper"]
    assert arm.board is not None
    gripper = str(arm.gripper.axis) if arm.gripper is not None else ""
    return BOARDS[arm.board.kind], [*(str(motor.axis) for motor in arm.motors), gripper]


def _refuse_incomplete(arm: Arm, *, board: bool) -> None:
    """Raise UsageError that lists all keys that the board, or a plan, needs and the robot file lacks."""
    if arm.board is None and any(motor.kind == "bus" for motor in arm.motors):
        line = "board: {kind: feetech}"
        raise UsageError(
            f"{arm.name}: bus servos have a board of their own; add to {arm.path or 'its file'}:\n  {line}",
            robot_file=arm.path,
            lines_to_add=[line],
        )
    if lacks := missing_keys.find_lacks(arm, board=board):
        summary = ", ".join(words for words, _ in lacks)
        lines = [line for _, lack_lines in lacks for line in lack_lines]
        raise UsageError(
            "".join([f"{arm.name}: {summary}; add to {arm.path or 'its file'}:", *(f"\n  {x}" for x in lines)]),
            robot_file=arm.path,
            lines_to_add=lines,
        )


def _rehearsal_board(arm: Arm) -> Board:
    """A made-up board with an axis for every motor and a switch for every joint's homing."""
    motors = arm.motors
    steppers = [motor.name for motor in motors if motor.kind == "stepper"]
    servos = [motor.name for motor in motors if motor.kind == "servo"]
    if arm.gripper is not None:
        (servos if arm.gripper.kind == "servo" else steppers).append("gripper")
    switches = dict.fromkeys(homing.switch for homing in arm.homing if homing is not None)
    return Board(
        kind="sim",
        number=0,
        steppers=tuple(steppers),
        servos=tuple(servos),
        switches=tuple(switches),
        queue=128,
        frame=240,
        min_interval=129,
    )


def _count_limits(arm: Arm) -> tuple[list[int], list[int]]:
    """Lowest and highest count of every motor that the joint limits allow."""
    ends: list[list[int]] = [[], []]
    for motor, gain in enumerate(arm.motor_gain):
        for side, sign in enumerate((-1, 1)):
            corner = np.where(gain * sign >= 0, arm.upper, arm.lower)
            corner = np.where(gain == 0, arm.home, corner)
            if np.all(np.isfinite(corner)):
                ends[side].append(max(-_NO_LIMIT, min(_NO_LIMIT, int(pulses(arm, corner)[motor]))))
            else:
                ends[side].append(sign * _NO_LIMIT)
    for motor, (shortest, longest) in enumerate(pulse_range(arm)):
        if shortest > -math.inf:
            ends[0][motor] = max(ends[0][motor], int(shortest))
        if longest < math.inf:
            ends[1][motor] = min(ends[1][motor], int(longest))
    return ends[0], ends[1]


def _limit_rows(arm: Arm, board: Board, axes: tuple[int, ...], low: list[int], high: list[int]) -> tuple[RowImage, ...]:
    """A row for every limited joint that does not have a motor of its own."""
    per_count = np.linalg.pinv(arm.motor_gain)  # (n, motors)
    per_count[np.abs(per_count) < 1e-12 * np.abs(per_count).max()] = 0.0
    largest_counts = np.maximum(np.abs(low), np.abs(high)).astype(float)
    rows = []
    for joint in range(arm.n):
        motors = np.flatnonzero(per_count[joint])
        if len(motors) == 1 and np.count_nonzero(arm.motor_gain[motors[0]]) == 1:
            continue  # the axis has the limits
        if not (math.isfinite(arm.lower[joint]) or math.isfinite(arm.upper[joint])):
            continue
        rows.append(_limit_row(arm, board, axes, per_count[joint], joint, largest_counts))
    if len(rows) > board.rows:
        raise UsageError(f"{arm.name} has {len(rows)} coupled joints with limits; {board.kind} takes {board.rows}")
    return tuple(rows)


def _limit_row(
    arm: Arm, board: Board, axes: tuple[int, ...], per_count: Array, joint: int, largest_counts: Array
) -> RowImage:
    """The row of a joint with 16-bit weights, its bounds widened by the rounding of weights and counts."""
    largest_sum = float(np.abs(per_count) @ largest_counts)
    scale = min(32767 / float(np.abs(per_count).max()), (2**30 - 2**20) / largest_sum)
    weight = np.rint(per_count * scale)
    # The rounded sum is off by the weights' rounding times the counts. The counts themselves are rounded by up to a
    # half, and up to a quarter off at the end of a segment.
    slack = float(np.abs(weight - per_count * scale) @ largest_counts + 0.8 * np.abs(weight).sum())
    offset = float(weight @ arm.motor_bias)
    bounds = []
    for limit, sign in ((arm.lower[joint], -1), (arm.upper[joint], 1)):
        value = (limit - arm.home[joint]) * scale + offset + sign * slack if math.isfinite(limit) else sign * _NO_LIMIT
        rounded = math.floor(value) if sign < 0 else math.ceil(value)
        bounds.append(max(-_NO_LIMIT, min(_NO_LIMIT, rounded)))
    weights = [0] * len(board.axes)
    for axis, axis_weight in zip(axes, weight, strict=True):
        weights[axis] = int(axis_weight)
    return RowImage(bounds[0], bounds[1], tuple(weights))


def _switch_guards(arm: Arm, board: Board, axes: tuple[int, ...]) -> tuple[GuardImage, ...]:
    """The guard of every switch input of the board: it stops the joint that it homes in the switch's direction."""
    guards = [GuardImage() for _ in board.switches]
    per_count = np.linalg.pinv(arm.motor_gain)
    for joint, (homing, is_hard_limit) in enumerate(zip(arm.homing, arm.hard_limits, strict=True)):
        if homing is None or not is_hard_limit:
            continue
        motor_weights = per_count[joint] * homing.direction
        motor_weights[np.abs(motor_weights) < 1e-12 * np.abs(motor_weights).max()] = 0.0
        weights = [0] * len(board.axes)
        for axis, weight in zip(axes, _weight_bytes(motor_weights), strict=True):
            weights[axis] = weight
        guards[board.switches.index(homing.switch)] = GuardImage(homing.normally == "closed", tuple(weights))
    return tuple(guards)


def _weight_bytes(weights: Array) -> list[int]:
    """Weights as signed bytes: exact where they are small whole multiples of the least, else to 1/127."""
    smallest = np.abs(weights[weights != 0]).min()
    scaled_weights = weights / smallest
    if np.abs(scaled_weights).max() > 127 or np.abs(scaled_weights - np.rint(scaled_weights)).max() > 1e-9:
        scaled_weights = weights * (127 / np.abs(weights).max())
    return [int(value) for value in np.rint(scaled_weights)]


def _check_servo(name: str, low: int, high: int) -> None:
    shortest, longest = _SERVO_RANGE
    if low < shortest or high > longest:
        raise UsageError(
            f"{name}: its limits need pulses of {low} to {high} us; the boards make {shortest} to {longest}"
        )


def _board_rate(board: Board, rate: float) -> int:
    fastest = board.clock // board.min_interval
    return max(1, min(math.ceil(rate * _RATE_FACTOR - 1e-9), fastest))


def _board_accel(accel: float) -> int:
    return max(1, min(math.ceil(accel - 1e-9), 2**24 - 1))


def _grip_image(board: Board, gripper: Gripper, grip: Grip) -> AxisImage:
    """The gripper's axis in the board's configuration; an unused one where it has no rate."""
    if grip.top is None or grip.accel is None:
        return AxisImage()
    low, high = sorted((grip.open, grip.closed))
    if gripper.kind == "servo":
        _check_servo("the gripper", low, high)
    invert = gripper.invert and gripper.kind == "stepper"
    return AxisImage(
        used=True,
        invert=invert,
        lower=low,
        upper=high,
        home=grip.open,
        max_rate=_board_rate(board, grip.top),
        max_accel=_board_accel(grip.accel),
    )


def _pulse_timing(arm: Arm) -> Driver:
    """The pulse timing of the driver; an arbitrary one without steppers or on a made-up board."""
    name = None if arm.board is None else arm.board.driver
    return Driver(1, 1, 1, 1) if name is None else DRIVERS[name]


def _meaning_checksum(arm: Arm, grip: Grip | None) -> int:
    """A checksum of the step chains and the home pose, which the limits in counts do not show."""
    exact: list[object] = [
        [[f"{value:.12g}" for value in row] for row in arm.motor_gain],
        [f"{value:.12g}" for value in (*arm.motor_bias, *arm.home)],
        None if grip is None else [f"{grip.per_unit:.12g}", f"{grip.at_zero:.12g}"],
    ]
    return zlib.crc32(json.dumps(exact).encode())
