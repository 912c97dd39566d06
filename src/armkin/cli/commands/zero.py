"""`armkin zero`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from armkin.cli.boards import board_link
from armkin.cli.boards.board_link import Baud, NoReset
from armkin.cli.boards.default_port import PortName
from armkin.cli.parsing import arguments, lerobot_zero
from armkin.cli.parsing.number_parsing import number
from armkin.cli.parsing.options import Json, Robot, RobotOut
from armkin.cli.printing import output, render
from armkin.errors import UsageError
from armkin.model import units

if TYPE_CHECKING:
    from armkin.board.backend.board import Board
    from armkin.model.arm import Arm

_ENDS = ("open", "closed")

StandsIn = Annotated[
    str | None,
    typer.Option("--pose", metavar="NAME|Q,...", help="The pose that the arm stands in. [default: home]"),
]
GripperAt = Annotated[
    str | None,
    typer.Option("--gripper", metavar="open|closed|VALUE", help="Where the gripper stands: its zero, too."),
]
LeRobotFile = Annotated[
    str | None,
    typer.Option(
        "--from",
        metavar="FILE",
        help="A LeRobot calibration file instead: zeros, limits, directions, the gripper's ends. --pose is then "
        "where the middles of all ranges are (default: all joints at 0); --port compares it with the servos.",
    ),
]


def zero(
    robot: Robot,
    port: PortName = None,
    pose: StandsIn = None,
    gripper: GripperAt = None,
    source: LeRobotFile = None,
    out: RobotOut = None,
    baud: Baud = None,
    no_reset: NoReset = False,
    json: Json = False,
) -> None:
    """Record where the zero of bus servos is.

    Put the arm into a pose by hand (armkin relax switches its motors off) and run this: the servos' counts give
    every drive's `zero`. Prints them; --out writes the robot file with them, all else as it stands. The servos'
    own memory is not touched.
    """
    import numpy as np

    arm = arguments.load_arm(robot)
    board = board_link.board_of(arm, rehearsal=True)
    if not board.can("zero") or np.count_nonzero(arm.motor_gain) != arm.n:
        raise UsageError(f"{arm.name}: zero is for arms whose joints have a bus servo each, drive: {{kind: bus, ...}}")
    if source is not None:
        if gripper is not None:
            raise UsageError("--from and --gripper: the file says where the gripper's ends are")

        def check(zeros: Any) -> str | None:
            if port is None:
                return None
            with board_link.open_backend(board, port, baud, reset=not no_reset) as machine:
                zeros.check(machine)
                return machine.port.name

        lerobot_zero.record_zeros(board, robot, source, pose, out, json, check)
        return
    q = units.joints_in(arm, arguments.joint_list(arm, pose or "home", "--pose"))
    jaw = None if gripper is None else _jaw_value(board, gripper)
    with board_link.open_backend(board, port, baud, reset=not no_reset) as machine:
        name = machine.port.name
        counts, grips = board.zero(jaw)
    zeros = np.rint(np.array(counts) - arm.motor_gain @ q).astype(int).tolist()
    if out is not None:
        _write_robot_file(arm, robot, zeros, grips, out)
    if out != "-":
        answer: dict[str, Any] = {**render.head(arm), "port": name, "counts": counts, "zero": zeros}
        answer["gripper_zero"] = None if grips is None else grips[1]
        with output.destination(None) as write:
            write(f"{render.to_json(answer)}\n" if json else _text(board, counts, zeros, grips))


def _jaw_value(board: Board, text: str) -> float:
    return board.grip_value(text if text in _ENDS else number(text, "--gripper"))


def _write_robot_file(arm: Arm, robot: str, zeros: Sequence[int], grips: tuple[int, int] | None, out: str) -> None:
    """The robot file with these zeros, all else as it stands."""
    from armkin.motors import motor_names
    from armkin.robot_file import parse_robot_file
    from armkin.robot_file.catalogue import locate
    from armkin.robot_file.replace_values import with_values

    edits: dict[tuple[str | int, ...], int] = {
        ("joints", arm.joint_names.index(name), "drive", "zero"): count
        for name, count in zip(motor_names(arm), zeros, strict=True)
    }
    if grips is not None:
        edits["gripper", "zero"] = grips[1]
    text = with_values(Path(locate(robot)).read_text(encoding="utf-8"), edits)
    parse_robot_file(text, out)  # nothing is written that no command would take
    with output.destination(out) as write:
        write(text)


def _text(board: Board, counts: Sequence[int], zeros: Sequence[int], grips: tuple[int, int] | None) -> str:
    """What was counted, for people."""
    from armkin.motors import motor_names

    rows = [["joint", "count", "zero", "was"]]
    for joint, count, zero, motor in zip(motor_names(board.arm), counts, zeros, board.arm.motors, strict=True):
        rows.append([joint, str(count), str(zero), f"{motor.zero:g}"])
    if grips is not None:
        rows.append(["gripper", *map(str, grips), f"{board.gripper().zero:g}"])
    return f"{render.table(rows)}\n"
