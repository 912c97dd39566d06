"""Notes on stderr for numbers that look like metres or radians."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from armkin.cli.printing import output
from armkin.model.target_numbers import label_units

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.robot_file import RobotFile

_TINY_REACH = 2.0  # a target this near to the base, or an arm this short [mm], is probably in metres
_MAX_RADIANS = 3.2  # angle [deg] a little above pi
_BIG_REACH = 50.0  # smallest reach [mm] of an arm whose file is certainly in mm
_TURN_ANGLES = (math.pi / 2, math.pi)


def robot_file(arm: Arm) -> None:
    """Lengths that together make two millimetres, angles of 1.5708 degrees."""
    if arm.file is None:
        return
    total = sum(map(abs, _lengths(arm.file)))
    if 0 < total < _TINY_REACH:
        output.note(f"all lengths in {arm.path} together are {total:.4g} mm; if they are metres, multiply them by 1000")
    angle = next(filter(_is_turn, _angles(arm.file)), None)
    if angle is not None:
        output.note(
            f"{arm.path} has an angle of {angle:g} degrees; if it is in radians, write {math.degrees(angle):.4g}"
        )


def _lengths(file: RobotFile) -> Iterator[float]:
    for joint in file.joints:
        yield from () if joint.dh is None else (joint.dh.a, joint.dh.d)
    for pose in (file.base, file.tool, file.zero_pose):
        yield from () if pose is None else pose.xyz


def _angles(file: RobotFile) -> Iterator[float]:
    for joint in file.joints:
        yield from () if joint.dh is None else (joint.dh.alpha, joint.dh.theta)
    for pose in (file.base, file.tool, file.zero_pose):
        yield from () if pose is None else pose.rpy


def _is_turn(angle: float) -> bool:
    """Whether it is a right or a straight angle in radians."""
    return any(abs(abs(angle) - turn) < 1e-3 for turn in _TURN_ANGLES)


def joint_values(arm: Arm, values: Sequence[float], source: str = "joint values") -> None:
    """Joint values that are all below pi, with digits after the point; source: where they stand."""
    rotary = [value for value, prismatic in zip(values, arm.prismatic, strict=True) if not prismatic]
    if not rotary or max(map(abs, rotary)) > _MAX_RADIANS or not any(_has_digits(value) for value in rotary):
        return
    output.note(f"{source} are degrees, and these look like radians ({', '.join(f'{value:g}' for value in values)})")


def note_target(arm: Arm, labels: Sequence[str], values: Sequence[float]) -> None:
    """A position within 2 mm of the base's origin, asked of an arm of ordinary size."""
    position = [value for label, value in zip(labels, values, strict=True) if label in "xyz"]
    is_tiny = bool(position) and max(map(abs, position)) < _TINY_REACH
    if is_tiny and any(map(_has_digits, position)) and arm.reach > _BIG_REACH:
        output.note(
            f"targets are millimetres, and this looks like metres ({', '.join(f'{number:g}' for number in position)})"
        )
    angles = [number for number, unit in zip(values, label_units(labels), strict=True) if unit == "deg"]
    if any(map(_has_digits, angles)) and any(map(_is_turn, angles)):
        output.note(
            f"angles are degrees, and these look like radians ({', '.join(f'{number:g}' for number in angles)})"
        )


def _has_digits(value: float) -> bool:
    return value != round(value)
