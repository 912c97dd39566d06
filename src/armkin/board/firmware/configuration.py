"""A robot file as its board must know it: which motor on which axis, limits, rates, home.

The image (firmware/PROTOCOL.md, section 4) travels to the board once and stays there; its CRC is how host
and board notice that they mean different arms.
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

_NO_LIMIT = 2**30  # limit [counts] of an axis without one
_RATE_FACTOR = 1.05  # factor on a motor's rate: cycles, rates of 15 bits and parabolas make a ramp's end so much faster
_SERVO_RANGE = (400, 2600)  # pulse lengths [us] that the boards can make


@dataclass(frozen=True)
class Configuration:
    """An arm on a board."""

    board: Board
    image: Image
    axes: tuple[int, ...]  # axis of every motor, in the arm's order
    grip: Grip | None  # None also if the gripper cannot move: it has no max_speed or max_accel

    @property
    def steppers(self) -> bool:
        """Whether a motor of the arm (or the gripper) is a stepper."""
        used = [i for i, axis in enumerate(self.image.axes) if axis.used]
        return any(i < len(self.board.steppers) for i in used)


def configure(arm: Arm, *, rehearsal: bool = False) -> Configuration:
    """The configuration of an arm.

    rehearsal: for a plan or a simulated board. The robot file's board where it is complete, else one with an
    axis for every motor. Raises UsageError, naming all that is missing at once: max_speed, `board`, `axis`, ...
    """
    _refuse_incomplete(arm, board=not rehearsal)
    board, names = _board_and_axes(arm, rehearsal=rehearsal)
    axes = tuple(board.axes.index(name) for name in names[:-1])
    grip = as_axis(board.axes.index(names[-1]), arm.gripper) if arm.gripper is not None else None
    images = [AxisImage() for _ in board.axes]
    low, high = _count_limits(arm)
    home = pulses(arm, arm.home)
    rate, accel = np.abs(arm.motor_gain) @ arm.max_speed, motor_accel(arm)
    for k, (motor, axis) in enumerate(zip(arm.motors, axes, strict=True)):
        if motor.kind == "servo":
            _check_servo(f"motor {motor.name}", low[k], high[k])
        stepper = motor.kind == "stepper"
        images[axis] = AxisImage(
            used=True,
            invert=motor.invert and stepper,  # a servo's is in its counts
            lower=low[k],
            upper=high[k],
            home=int(home[k]),
            max_rate=_board_rate(board, rate[k]),
            max_accel=_board_accel(accel[k]),
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
    """The board, and the names of the axes of all motors and of the gripper; made up for a rehearsal without one."""
    if rehearsal and missing_keys.without_board(arm):
        return _rehearsal_board(arm), [*(motor.name for motor in arm.motors), "gripper"]
    assert arm.board is not None
    gripper = str(arm.gripper.axis) if arm.gripper is not None else ""
    return BOARDS[arm.board.kind], [*(str(motor.axis) for motor in arm.motors), gripper]


def _refuse_incomplete(arm: Arm, *, board: bool) -> None:
    """Raise UsageError for an arm that lacks what a board, or a plan, must know, all of it at once."""
    if arm.board is None and any(motor.kind == "bus" for motor in arm.motors):
        line = "board: {kind: feetech}"
        raise UsageError(
            f"{arm.name}: bus servos have a board of their own; add to {arm.path or 'its file'}:\n  {line}",
            robot_file=arm.path,
            lines_to_add=[line],
        )
    if lacks := missing_keys.find_lacks(arm, board=board):
        summary = ", ".join(words for words, _ in lacks)
        lines = [line for _, added in lacks for line in added]
        raise UsageError(
            "".join([f"{arm.name}: {summary}; add to {arm.path or 'its file'}:", *(f"\n  {x}" for x in lines)]),
            robot_file=arm.path,
            lines_to_add=lines,
        )


def _rehearsal_board(arm: Arm) -> Board:
    """A board that does not exist, with an axis for every motor and a switch for every joint's homing."""
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
    for k, gain in enumerate(arm.motor_gain):
        for side, sign in enumerate((-1, 1)):
            corner = np.where(gain * sign >= 0, arm.upper, arm.lower)
            corner = np.where(gain == 0, arm.home, corner)
            if np.all(np.isfinite(corner)):
                ends[side].append(max(-_NO_LIMIT, min(_NO_LIMIT, int(pulses(arm, corner)[k]))))
            else:
                ends[side].append(sign * _NO_LIMIT)
    servo = pulse_range(arm)
    low = [max(a, int(s)) if s > -math.inf else a for a, s in zip(ends[0], servo[:, 0], strict=True)]
    high = [min(a, int(s)) if s < math.inf else a for a, s in zip(ends[1], servo[:, 1], strict=True)]
    return low, high


def _limit_rows(arm: Arm, board: Board, axes: tuple[int, ...], low: list[int], high: list[int]) -> tuple[RowImage, ...]:
    """A row for every limited joint that does not have a motor of its own."""
    per_count = np.linalg.pinv(arm.motor_gain)  # (n, motors)
    per_count[np.abs(per_count) < 1e-12 * np.abs(per_count).max()] = 0.0
    far = np.maximum(np.abs(low), np.abs(high)).astype(float)
    rows = []
    for j in range(arm.n):
        turning = np.flatnonzero(per_count[j])
        if len(turning) == 1 and np.count_nonzero(arm.motor_gain[turning[0]]) == 1:
            continue  # the axis limits say it
        if not (math.isfinite(arm.lower[j]) or math.isfinite(arm.upper[j])):
            continue
        rows.append(_limit_row(arm, board, axes, per_count[j], j, far))
    if len(rows) > board.rows:
        raise UsageError(f"{arm.name} has {len(rows)} coupled joints with limits; {board.kind} takes {board.rows}")
    return tuple(rows)


def _limit_row(arm: Arm, board: Board, axes: tuple[int, ...], per_count: Array, j: int, widest: Array) -> RowImage:
    """Scaled to 16-bit weights, the bounds widened by what rounding weights and counts may do."""
    most = float(np.abs(per_count) @ widest)
    scale = min(32767 / float(np.abs(per_count).max()), (2**30 - 2**20) / most)
    weight = np.rint(per_count * scale)
    # The exact sum and the rounded one differ by the weights' rounding times the counts, and the counts
    # themselves are rounded by up to half, and up to a quarter away where a segment ends.
    slack = float(np.abs(weight - per_count * scale) @ widest + 0.8 * np.abs(weight).sum())
    offset = float(weight @ arm.motor_bias)
    bounds = []
    for limit, sign in ((arm.lower[j], -1), (arm.upper[j], 1)):
        value = (limit - arm.home[j]) * scale + offset + sign * slack if math.isfinite(limit) else sign * _NO_LIMIT
        rounded = math.floor(value) if sign < 0 else math.ceil(value)
        bounds.append(max(-_NO_LIMIT, min(_NO_LIMIT, rounded)))
    weights = [0] * len(board.axes)
    for axis, w in zip(axes, weight, strict=True):
        weights[axis] = int(w)
    return RowImage(bounds[0], bounds[1], tuple(weights))


def _switch_guards(arm: Arm, board: Board, axes: tuple[int, ...]) -> tuple[GuardImage, ...]:
    """What every switch input of the board guards: the joint that it homes, in the switch's direction."""
    guards = [GuardImage() for _ in board.switches]
    per_count = np.linalg.pinv(arm.motor_gain)
    for j, (homing, guarded) in enumerate(zip(arm.homing, arm.hard_limits, strict=True)):
        if homing is None or not guarded:
            continue
        toward = per_count[j] * homing.direction
        toward[np.abs(toward) < 1e-12 * np.abs(toward).max()] = 0.0
        weights = [0] * len(board.axes)
        for axis, w in zip(axes, _weight_bytes(toward), strict=True):
            weights[axis] = w
        guards[board.switches.index(homing.switch)] = GuardImage(homing.normally == "closed", tuple(weights))
    return tuple(guards)


def _weight_bytes(weights: Array) -> list[int]:
    """Weights as signed bytes: exact where they are small whole multiples of the least, else to 1/127."""
    least = np.abs(weights[weights != 0]).min()
    scaled = weights / least
    if np.abs(scaled).max() > 127 or np.abs(scaled - np.rint(scaled)).max() > 1e-9:
        scaled = weights * (127 / np.abs(weights).max())
    return [int(w) for w in np.rint(scaled)]


def _check_servo(name: str, low: int, high: int) -> None:
    least, most = _SERVO_RANGE
    if low < least or high > most:
        raise UsageError(f"{name}: its limits need pulses of {low} to {high} us; the boards make {least} to {most}")


def _board_rate(board: Board, rate: float) -> int:
    fastest = board.clock // board.min_interval
    return max(1, min(math.ceil(rate * _RATE_FACTOR - 1e-9), fastest))


def _board_accel(accel: float) -> int:
    return max(1, min(math.ceil(accel - 1e-9), 2**24 - 1))


def _grip_image(board: Board, gripper: Gripper, grip: Grip) -> AxisImage:
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
    """Pulse timing; without steppers, or on a made-up board, any will do."""
    name = None if arm.board is None else arm.board.driver
    return Driver(1, 1, 1, 1) if name is None else DRIVERS[name]


def _meaning_checksum(arm: Arm, grip: Grip | None) -> int:
    """Checksum of what counts mean and the limits do not say: the step chains and the home pose."""
    exact: list[object] = [
        [[f"{value:.12g}" for value in row] for row in arm.motor_gain],
        [f"{value:.12g}" for value in (*arm.motor_bias, *arm.home)],
        None if grip is None else [f"{grip.per_unit:.12g}", f"{grip.at_zero:.12g}"],
    ]
    return zlib.crc32(json.dumps(exact).encode())
