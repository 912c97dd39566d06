"""`armkin zero --from`: a LeRobot calibration file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from armkin.cli.parsing import arguments
from armkin.cli.printing import output, render
from armkin.errors import UsageError
from armkin.files import protect_input
from armkin.model import units

if TYPE_CHECKING:
    from collections.abc import Callable

    from armkin.board.backend.board import Board
    from armkin.model.arm import Arm


def record_zeros(
    board: Board,
    robot: str,
    path: str,
    pose: str | None,
    out: str | None,
    json: bool,
    check: Callable[[Any], str | None],
) -> None:
    """Write the robot file with a calibration file's zeros, limits and directions, and tell them.

    check: compares them with the servos, where a port is named, and says which that is.
    """
    from armkin.robot_file import parse_robot_file
    from armkin.robot_file.catalogue import locate
    from armkin.robot_file.replace_values import with_values

    arm = board.arm
    q = None if pose is None else units.joints_in(arm, arguments.joint_list(arm, pose, "--pose"))
    protect_input(path)
    try:
        calibration = board.calibration(path, q)
    except UsageError as error:
        if "middle" in error.fields and pose is not None:
            raise error.within("--pose") from None
        if "middle" in error.fields:
            error.advice = "the middles of all ranges are another pose: --pose NAME|Q,... says it"
        raise
    port = check(calibration)
    if out is not None:
        text = with_values(Path(locate(robot)).read_text(encoding="utf-8"), calibration.edits)
        parse_robot_file(text, out)  # nothing is written that no command would take
        with output.destination(out) as write:
            write(text)
    if out == "-":
        return
    answer: dict[str, Any] = {
        **render.head(arm),
        "port": port,
        "counts": None,
        "zero": list(calibration.zero),
        "gripper_zero": None if calibration.gripper is None else calibration.gripper.middle,
        "limits": [list(pair) for pair in calibration.limits],
        "invert": [bool(motor.drive_mode) for motor in calibration.motors],
        "gripper_ends": None if calibration.gripper_ends is None else list(calibration.gripper_ends),
    }
    with output.destination(None) as write:
        write(f"{render.to_json(answer) if json else _changes_table(arm, calibration)}\n")


def _changes_table(arm: Arm, calibration: Any) -> str:
    """What changes, a line a servo."""
    from armkin.motors import motor_names

    rows = [["joint", "zero", "was", "limits/deg", "counts"]]
    for name, zero, was, pair, motor in zip(
        motor_names(arm), calibration.zero, arm.motors, calibration.limits, calibration.motors, strict=True
    ):
        counts = "reversed" if motor.drive_mode else ""
        rows.append([name, f"{zero:g}", f"{was.zero:g}", f"{pair[0]:.3f} to {pair[1]:.3f}", counts])
    if calibration.gripper is not None and calibration.gripper_ends is not None and arm.gripper is not None:
        ends = "open {:.3f}, closed {:.3f}".format(*calibration.gripper_ends)
        rows.append(["gripper", f"{calibration.gripper.middle:g}", f"{arm.gripper.zero:g}", ends, ""])
    return render.table(rows, left_aligned=(0, 4))
