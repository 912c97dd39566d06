"""Finds what a robot file lacks for `pulses`, for motion in simulation and on a board, and for homing.

Each missing key comes with a text and, where possible, with lines to add to the file. The figures in these lines are
examples that load; the right ones are in the motor's data sheet.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from armkin import board_catalogue
from armkin.board_catalogue import BOARDS, DRIVERS
from armkin.errors import UsageError
from armkin.motion.joint_moves import missing_rates, rate_lines
from armkin.motors import joints_per_pulse, undriven_joints

if TYPE_CHECKING:
    from armkin.board_catalogue import ForeignBoard
    from armkin.model.arm import Arm
    from armkin.robot_file.robot_keys import Board, Drive

Lack = tuple[str, list[str]]  # text of what is missing, and lines to add
_DRIVER = "A4988"  # driver named in lines to add


def missing_by_command(arm: Arm) -> dict[str, list[str]]:
    """What the robot file lacks for `pulses`, `simulate`, `send` and `home`, in words; an empty list for nothing.

    >>> import armkin
    >>> found = missing_by_command(armkin.load("three_dof"))
    >>> found["send"], found["home"]
    ([], ['its joints have no homing'])
    """
    send = missing_for_motion(arm)
    return {
        "pulses": _without_drives(arm),
        "simulate": missing_for_motion(arm, board=False),
        "send": send,
        "home": send + _without_homing(arm),
    }


def missing_for_motion(arm: Arm, *, board: bool = True) -> list[str]:
    """What the robot file lacks before the arm can be moved, in words; board: on a board, not in simulation."""
    return [words for words, _ in find_lacks(arm, board=board)]


def lines_to_add(arm: Arm) -> list[str]:
    """Lines to add to a robot file so that its arm moves on a board."""
    return [line for _, lack_lines in find_lacks(arm) for line in lack_lines]


def find_lacks(arm: Arm, *, board: bool = True) -> list[Lack]:
    """What the robot file lacks before the arm can be moved; board: on a board, not in simulation."""
    return _without_rates(arm, board) + (without_board(arm) if board else [])


def _without_rates(arm: Arm, board: bool) -> list[Lack]:
    """Missing drives and rates, which every plan needs."""
    lacks_found: list[Lack] = []
    try:
        joints_per_pulse(arm)  # raises if a joint has no motor
    except UsageError as error:
        undriven = undriven_joints(arm)
        lacks_found.append(
            (_lack_text(arm, undriven, "drive"), _drive_lines(arm, undriven, board)) if undriven else (str(error), [])
        )
    rates = missing_rates(arm)
    lacks_found += [(_lack_text(arm, names, key), []) for key, names in rates.items()]
    if rates:
        lacks_found[-1] = (lacks_found[-1][0], rate_lines(arm))
    return lacks_found


def _drive_lines(arm: Arm, joints: list[str], board: bool) -> list[str]:
    """Lines with a stepper for each joint without a motor; board: with an axis of its own."""
    axes = list(_axis_names(arm)) if board else []
    used_axes = {motor.axis for motor in arm.motors}
    free_axes = iter([axis for axis in axes if axis not in used_axes])
    groups: dict[str, list[str]] = {}
    for name in joints:
        lead = ", lead: 8" if arm.prismatic[arm.joint_names.index(name)] else ""
        axis = next(free_axes, None)
        axis_key = "" if axis is None else f"axis: {axis}, "
        groups.setdefault(f"drive: {{{axis_key}full_steps: 200, microsteps: 16{lead}}}", []).append(name)
    return [f"{drive}   # for example; {_to_joints(names)}" for drive, names in groups.items()]


def _axis_names(arm: Arm) -> tuple[str, ...]:
    """Names of the stepper axes of the arm's board, or of the one that `without_board` proposes."""
    kind = _board_for(arm) if arm.board is None else arm.board.kind
    foreign_board = board_catalogue.foreign_board(kind)
    return BOARDS[kind].steppers if foreign_board is None else foreign_board.axes


def _board_for(arm: Arm) -> str:
    """The first kind that has an axis for every motor, or for every joint of an arm without motors."""
    servos = sum(motor.kind == "servo" for motor in arm.motors)
    steppers = len(arm.motors) - servos + len(undriven_joints(arm))
    fits = (b.kind for b in BOARDS.values() if len(b.steppers) >= steppers and len(b.servos) >= servos)
    return next(fits, "pico6")


def without_board(arm: Arm) -> list[Lack]:
    """A missing board, driver or axis, which motion on a board needs."""
    if arm.board is None:
        kind = _board_for(arm)
        has_steppers = any(motor.kind == "stepper" for motor in arm.motors) or undriven_joints(arm)
        driver = f", driver: {_DRIVER}" if has_steppers else ""
        choice = f"kinds: {', '.join(board_catalogue.kind_names())}; drivers: {', '.join(DRIVERS)}"
        return [("it has no board", [f"board: {{kind: {kind}{driver}}}   # for example; {choice}"])]
    foreign_board = board_catalogue.foreign_board(arm.board.kind)
    return _without_driver(arm, arm.board) if foreign_board is None else _without_foreign_axes(arm, foreign_board)


def _without_foreign_axes(arm: Arm, foreign_board: ForeignBoard) -> list[Lack]:
    """Missing axes of a board that has its own drivers and settings."""
    without_axis = [motor.name for motor in arm.motors if motor.kind != "bus" and motor.axis is None]
    if not without_axis:
        return []
    axes = foreign_board.axes
    line = f"axis: {axes[0]}   # into the drives of {', '.join(without_axis)} ({', '.join(axes)})"
    return [(f"motors {', '.join(without_axis)} have no axis", [line])]


def _without_driver(arm: Arm, settings: Board) -> list[Lack]:
    """Missing axes and the missing driver of a board with our firmware."""
    lacks_found: list[Lack] = []
    board = BOARDS[settings.kind]
    driven: list[tuple[str, Drive]] = [(f"motor {motor.name}", motor) for motor in arm.motors]
    driven += [] if arm.gripper is None else [("the gripper", arm.gripper)]
    for owner, motor in driven:
        if motor.axis is None:
            axes = board.servos if motor.kind == "servo" else board.steppers
            addition = f"axis: {(*axes, '?')[0]}   # into the drive of {owner} ({', '.join(axes)})"
            lacks_found.append((f"{owner} has no axis", [addition]))
    if settings.driver is None and any(motor.kind == "stepper" for _, motor in driven):
        text = "its board has no driver: it sets the pulse timing"
        keys = {**settings.model_dump(exclude_none=True), "driver": _DRIVER}
        line = f"board: {{{', '.join(f'{key}: {value}' for key, value in keys.items())}}}"
        lacks_found.append((text, [f"{line}   # for example, in place of board:; drivers: {', '.join(DRIVERS)}"]))
    return lacks_found


def _without_drives(arm: Arm) -> list[str]:
    undriven = undriven_joints(arm)
    if undriven:
        return [_lack_text(arm, undriven, "drive")]
    try:
        joints_per_pulse(arm)
    except UsageError as error:
        return [str(error)]
    return []


def _without_homing(arm: Arm) -> list[str]:
    if arm.motors and all(motor.kind == "bus" for motor in arm.motors):
        return []  # bus servos know where they are
    without_homing = [name for name, homing in zip(arm.joint_names, arm.homing, strict=True) if homing is None]
    return [_lack_text(arm, without_homing, "homing")] if without_homing else []


def _lack_text(arm: Arm, names: list[str], key: str) -> str:
    if len(names) == arm.n > 1:
        return f"its joints have no {key}"
    return f"joint{'s' * (len(names) > 1)} {', '.join(names)} ha{'ve' if len(names) > 1 else 's'} no {key}"


def _to_joints(names: list[str]) -> str:
    return f"to joint{'s' * (len(names) > 1)} {', '.join(names)}"
