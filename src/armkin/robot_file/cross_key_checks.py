"""What pydantic's types cannot say: rules that tie several values of a robot file together.

Each rule yields ``(path, message)``; the path leads to the line, the message says what is wrong, what is
allowed and what to do. All rules run, so that a file's problems are found in one go.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from armkin import board_catalogue
from armkin.board_catalogue import BOARDS
from armkin.robot_file.drive_checks import Path, Problem, check_drive, check_drive_reach
from armkin.robot_file.robot_keys import Triple, dot

if TYPE_CHECKING:
    from armkin.board_catalogue import ForeignBoard
    from armkin.robot_file.robot_keys import Board, Drive, Gripper, Joint, Motor, RobotKeys, Screw

_PITCH_TASKS = ("xyz_pitch", "xyz_pitch_roll")
_MIN_WEIGHT = 1e-6  # weight, at least, of a joint on a motor: less would divide by nothing
# A printed table rounds to four digits or so: 0.7071 is a unit vector's component, 0.7 is not.
_ROUNDING = 1e-3


def problems(robot: RobotKeys) -> Iterator[Problem]:
    """All problems of a file whose keys and types are right."""
    if "\n" in robot.name or not robot.name.strip():
        yield ("name",), "must be one line of text"
    if "pitch_offset" in robot.model_fields_set and robot.task not in (None, *_PITCH_TASKS):
        yield ("pitch_offset",), f"task {robot.task} has no pitch; {' and '.join(_PITCH_TASKS)} have"
    if robot.convention == "screws" and robot.zero_pose is None:
        hint = "zero_pose: {xyz: [300, 0, 115]}, the end frame when all joints are 0"
        yield ("convention",), f"screws needs {hint}"
    if robot.convention != "screws" and robot.zero_pose is not None:
        message = f"belongs to convention screws, not to {robot.convention}; a fixed last frame is tool"
        yield ("zero_pose",), message
    yield from _check_repeated("joint", [joint.name for joint in robot.joints], "joints")
    for i, joint in enumerate(robot.joints):
        for path, message in _check_joint(joint, robot.convention):
            yield ("joints", i, *path), message
    yield from _check_poses(robot)
    yield from _check_motors(robot)
    yield from _check_axes(robot)
    if robot.keep_out:
        from armkin.robot_file import keep_out_keys  # imported for files that have some alone

        yield from keep_out_keys.keep_out_problems(robot.keep_out, ["base", *(joint.name for joint in robot.joints)])


def _check_poses(robot: RobotKeys) -> Iterator[Problem]:
    """Named joint values: one a joint, within its limits."""
    n = len(robot.joints)
    for name, values in (robot.poses or {}).items():
        if name == "home":
            yield ("poses", name), "home is always a pose: the joints' own home values; give this one another name"
        if len(values) != n:
            yield ("poses", name), f"has {len(values)} value{'s' * (len(values) != 1)}; the arm has {n} joints"
            continue
        for joint, value in zip(robot.joints, values, strict=True):
            if joint.limits is not None and not joint.limits[0] <= value <= joint.limits[1]:
                low, high = joint.limits
                yield ("poses", name), f"{joint.name} = {value:g} is outside its limits {low:g} to {high:g}"


def _check_repeated(kind: str, names: list[str], key: str) -> Iterator[Problem]:
    earlier_names: set[str] = set()
    for i, name in enumerate(names):
        if name in earlier_names:
            yield (key, i, "name"), f"a {kind} named {name} is there already; {kind} names are unique"
        earlier_names.add(name)


def _check_joint(joint: Joint, convention: str) -> Iterator[Problem]:
    if joint.sign == 0:
        yield ("sign",), "must be 1 or -1, not 0"
    if convention == "screws":
        if joint.dh is not None:
            yield ("dh",), "convention screws takes no DH row; write a screw, or change convention"
        elif joint.screw is None:
            yield (), "has no screw; convention screws needs one: screw: {w: [0, 0, 1], v: [0, 0, 0]}"
        else:
            yield from _check_screw(joint)
    elif joint.screw is not None:
        yield ("screw",), f"convention {convention} takes no screw; write dh, or change convention"
    elif joint.dh is None:
        yield (), f"has no dh; convention {convention} needs a row: dh: {{alpha: 90, a: 0, d: 170}}"
    yield from _check_range(joint)
    if joint.homing is not None:
        yield from _check_homing(joint)


def _check_range(joint: Joint) -> Iterator[Problem]:
    """Limits the wrong way round or without room, and a home outside."""
    if joint.limits is None:
        return
    lower, upper = joint.limits
    if lower > upper:
        yield ("limits",), f"lower {lower:g} is above upper {upper:g}; write [{upper:g}, {lower:g}]"
    elif lower == upper:
        yield ("limits",), f"{lower:g} to {upper:g} leave no room; a joint that never moves is no joint"
    elif not lower <= joint.home <= upper:
        if "home" in joint.model_fields_set:
            yield ("home",), f"{joint.home:g} is outside the limits {lower:g} to {upper:g}"
        else:
            yield ("limits",), f"home is 0 unless given, and outside {lower:g} to {upper:g}; add home:"


def _check_screw(joint: Joint) -> Iterator[Problem]:
    assert joint.screw is not None
    return (_check_direction if joint.type == "prismatic" else _check_axis)(joint.screw)


def _check_direction(screw: Screw) -> Iterator[Problem]:
    """A prismatic joint's screw."""
    if math.hypot(*screw.w) != 0:
        yield ("screw", "w"), "must be [0, 0, 0] for a prismatic joint; its direction is v"
    if screw.q is not None:
        yield ("screw", "q"), "a prismatic joint has no axis point; its direction is v"
    if screw.v is None:
        yield ("screw",), "has no v; for a prismatic joint v is its direction, for example [0, 0, 1]"
    else:
        yield from _check_unit("v", screw.v)


def _check_axis(screw: Screw) -> Iterator[Problem]:
    """A revolute joint's screw."""
    w, v = screw.w, screw.v
    length = math.hypot(*w)
    if length == 0:
        yield ("screw", "w"), "is zero; give the axis direction, or type: prismatic"
        return
    yield from _check_unit("w", w)
    if (v is None) == (screw.q is None):
        has = "neither v nor q" if v is None else "both v and q"
        yield ("screw",), f"has {has}; give v, or a point q on the axis"
    elif v is not None:
        pitch = dot(v, w) / length
        if abs(pitch) > _ROUNDING * max(1.0, math.hypot(*v)):
            yield ("screw", "v"), f"v.w is {pitch:g} and must be 0: a revolute joint has no pitch"


def _check_unit(key: str, vector: Triple) -> Iterator[Problem]:
    length = math.hypot(*vector)
    if length == 0:
        yield ("screw", key), "is zero; give the direction of motion, of length 1"
    elif abs(length - 1) > _ROUNDING:
        unit_vector = ", ".join(f"{x / length:.6g}" for x in vector)
        yield ("screw", key), f"has length {length:g}, must be 1; write [{unit_vector}]"


def _check_homing(joint: Joint) -> Iterator[Problem]:
    assert joint.homing is not None
    homing = joint.homing
    if homing.direction == 0:
        yield ("homing", "direction"), "must be 1 (switch at the upper end) or -1 (at the lower end), not 0"
    if joint.max_speed is not None and homing.speed > joint.max_speed:
        yield ("homing", "speed"), f"{homing.speed:g} is above the joint's max_speed {joint.max_speed:g}"
    if joint.drive is not None and joint.drive.kind != "stepper":
        yield ("homing",), "a servo knows its angle and has no switch; remove homing"


def _check_motors(robot: RobotKeys) -> Iterator[Problem]:
    """What is wrong with the drives, the motors and the gripper."""
    for i, joint in enumerate(robot.joints):
        if joint.drive is not None:
            for path, message in _check_own_drive(joint, joint.drive, only_drive=robot.motors is None):
                yield ("joints", i, *path), message
    if robot.motors is not None:
        yield from _check_repeated("motor", [motor.name for motor in robot.motors], "motors")
        for i, motor in enumerate(robot.motors):
            for path, message in (*check_drive(motor), *_check_weights(motor, robot)):
                yield ("motors", i, *path), message
        yield from _check_determined(robot, robot.motors)
    if robot.gripper is not None:
        yield from _check_gripper(robot)


def _check_own_drive(joint: Joint, drive: Drive, *, only_drive: bool) -> Iterator[Problem]:
    """A joint's own drive: all drives stand at joints or none, and it moves as the joint does."""
    if not only_drive:
        yield ("drive",), "the file also has motors; put all drives there, or use drives only"
    for path, message in check_drive(drive):
        yield ("drive", *path), message
    if joint.type == "prismatic":
        if drive.kind != "stepper":
            hint = f"use motors: with joints: {{{joint.name}: degrees per mm}}"
            yield ("drive",), f"a servo turns, and the joint is prismatic; {hint}"
        elif drive.lead is None:
            yield ("drive",), "a prismatic joint's stepper needs lead, the mm per turn"
    elif drive.lead is not None:
        yield ("drive", "lead"), "is for prismatic joints; use gear or pulley"
    else:
        yield from check_drive_reach(drive, joint)


def _check_weights(motor: Motor, robot: RobotKeys) -> Iterator[Problem]:
    types = {joint.name: joint.type for joint in robot.joints}
    for name, weight in motor.joints.items():
        if name not in types:
            yield ("joints", name), f"there is no joint {name}; the joints are {', '.join(types)}"
        if abs(weight) < _MIN_WEIGHT:
            yield ("joints", name), f"weight {weight:g} does nothing; leave {name} out"
    joint_types = {types[name] for name in motor.joints if name in types}
    if motor.lead is not None and "revolute" in joint_types:
        yield ("lead",), "is for motors of prismatic joints only; give weights in degrees per mm instead"
    if motor.kind == "stepper" and motor.lead is None and joint_types == {"prismatic"}:
        yield (), "a prismatic joint's stepper needs lead, the mm per turn"


def _check_determined(robot: RobotKeys, motors: tuple[Motor, ...]) -> Iterator[Problem]:
    """The joints must follow from the motors: the weights' rank is the number of joints they name."""
    names = [joint.name for joint in robot.joints if any(joint.name in motor.joints for motor in motors)]
    rows = [[motor.joints.get(name, 0.0) for name in names] for motor in motors]
    for column, name in enumerate(names):
        pivot = max(rows, key=lambda row: abs(row[column]), default=None)
        if pivot is None or abs(pivot[column]) < 1e-9 * max(1.0, *(abs(x) for x in pivot)):
            yield ("motors",), f"leave joint {name} undetermined; as many independent motors as joints"
            return
        rows = [_eliminate(row, pivot, column) for row in rows if row is not pivot]


def _eliminate(row: list[float], pivot: list[float], column: int) -> list[float]:
    """The row less so much of the pivot row that its number in the column is 0."""
    factor = row[column] / pivot[column]
    return [value - factor * pivot_value for value, pivot_value in zip(row, pivot, strict=True)]


def _check_gripper(robot: RobotKeys) -> Iterator[Problem]:
    """What is wrong with the gripper's drive, ends and travel."""
    gripper = robot.gripper
    assert gripper is not None
    for path, message in check_drive(gripper):
        yield ("gripper", *path), message
    if gripper.open == gripper.closed:
        yield ("gripper", "closed"), f"is the same as open, {gripper.open:g}"
    if gripper.kind == "spindle":
        yield from _check_spindle(gripper, robot.board)
    if gripper.kind == "servo" and gripper.travel is not None:
        yield from _check_servo_travel(gripper, *gripper.travel)


def _check_spindle(gripper: Gripper, board: Board | None) -> Iterator[Problem]:
    if board is not None and board.kind != "grbl":
        yield ("gripper", "kind"), f"a spindle is GRBL's M3 output, which {board.kind} has not"
    for key in ("open", "closed"):
        if not 0 <= getattr(gripper, key) <= 1e5:
            yield ("gripper", key), f"is an S word of M3, from 0 to GRBL's $30; {getattr(gripper, key):g} is none"


def _check_servo_travel(gripper: Gripper, low: float, high: float) -> Iterator[Problem]:
    turn = -1.0 if gripper.invert else 1.0
    for key in ("open", "closed"):
        angle = gripper.zero + turn * getattr(gripper, key)
        if not low <= angle <= high:
            yield ("gripper", key), f"needs servo angle {angle:g}, outside the travel {low:g} to {high:g}"


def _check_axes(robot: RobotKeys) -> Iterator[Problem]:
    """Each axis is used once, and the board has it."""
    board = robot.board
    foreign = None if board is None else board_catalogue.foreign_board(board.kind)
    used_keys: set[tuple[str, object]] = set()
    for path, drive in _drives(robot, foreign):
        if board is not None and drive.kind == "bus" and board.kind in BOARDS:
            yield (*path, "kind"), f"{board.kind} has no bus; leave board out, or name one that has"
        if foreign is not None and drive.kind != foreign.motors:
            yield (*path, "kind"), f"{foreign.kind} takes drives of kind {foreign.motors} alone, not {drive.kind}"
        for key in _USED_ONCE:
            if (key, getattr(drive, key)) in used_keys:
                yield (*path, key), f"{getattr(drive, key)} is used already; {_USED_ONCE[key]}"
        used_keys |= {(key, getattr(drive, key)) for key in _USED_ONCE if getattr(drive, key) is not None}
        if drive.axis is not None:
            yield from _check_board_axis(board, foreign, drive, path)
    if board is not None:
        yield from _check_board(robot, board)


_USED_ONCE = {"id": "each servo has its own number on the bus", "axis": "each motor has its own axis"}


def _drives(robot: RobotKeys, foreign: ForeignBoard | None) -> Iterator[tuple[Path, Drive]]:
    """The drives that the board turns, each with its place in the file; foreign: what kind of board it is."""
    for i, joint in enumerate(robot.joints):
        if joint.drive is not None:
            yield ("joints", i, "drive"), joint.drive
    for i, motor in enumerate(robot.motors or ()):
        yield ("motors", i), motor
    if robot.gripper is not None and (foreign is None or robot.gripper.kind == foreign.motors):
        yield ("gripper",), robot.gripper  # one of another kind is not the board's: `armkin grip` refuses


def _check_board_axis(board: Board | None, foreign: ForeignBoard | None, drive: Drive, path: Path) -> Iterator[Problem]:
    """The board has no such axis."""
    if board is None:
        return
    if foreign is not None:
        allowed = foreign.axes
    else:
        allowed = BOARDS[board.kind].steppers if drive.kind == "stepper" else BOARDS[board.kind].servos
    if drive.axis not in allowed:
        problem = f"{board.kind} has no {drive.kind} axis {drive.axis}"
        yield (*path, "axis"), f"{problem}; it has {', '.join(allowed) or f'no {drive.kind}s at all'}"


def _check_board(robot: RobotKeys, settings: Board) -> Iterator[Problem]:
    """Settings that the board's kind has not, and inputs that it lacks."""
    if settings.kind not in BOARDS:
        for key in ("driver", "enable", "abort"):
            if getattr(settings, key) is not None:
                yield ("board", key), f"{settings.kind} has settings of its own for this; remove it"
        return
    board = BOARDS[settings.kind]
    for key in () if board.steppers else ("driver", "enable"):
        if getattr(settings, key) is not None:
            yield ("board", key), f"{settings.kind} has no stepper drivers; remove it"
    yield from _check_inputs(robot, settings, board)


def _check_inputs(robot: RobotKeys, settings: Board, board: board_catalogue.Board) -> Iterator[Problem]:
    """The board senses what it is to sense."""
    if settings.power not in (None, board.power):
        yield ("board", "power"), f"{settings.kind} senses the motors' power at {board.power}, not {settings.power}"
    for i, joint in enumerate(robot.joints):
        if joint.hard_limits and joint.homing is None:
            yield ("joints", i, "hard_limits"), "the joint has no limit switch; add homing:, which names it"
        if joint.homing is not None and joint.homing.switch not in board.switches:
            problem = f"{settings.kind} has no limit input {joint.homing.switch}"
            message = f"{problem}; it has {', '.join(board.switches) or 'none at all'}"
            yield ("joints", i, "homing", "switch"), message
