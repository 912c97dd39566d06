"""Moves the gripper, which is an axis of the board."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armkin.board.firmware.segments.straight_lines import straight_line
from armkin.errors import GripperKnownError, GripperLostError, LinkError, UsageError

if TYPE_CHECKING:
    from armkin.board.firmware.configuration import Configuration
    from armkin.board.firmware.firmware_machine import FirmwareMachine
    from armkin.board.firmware.gripper_counts import Grip
    from armkin.board.firmware.segments.counts_to_segments import Move


def gripper_of(name: str, configuration: Configuration) -> Grip:
    """The arm's gripper. Raises UsageError if it has none, or one without max_speed or max_accel."""
    gripper = configuration.grip
    if gripper is None:
        raise UsageError(f"{name} has no gripper; add gripper: to its robot file")
    for key, rate in (("max_speed", gripper.top), ("max_accel", gripper.accel)):
        if rate is None:
            raise UsageError(f"the gripper has no {key}: motion needs one; add {key}: to gripper:")
    return gripper


def count_of(gripper: Grip, value: str | float) -> int:
    """Counts of open, closed, or a value of the drive. Raises UsageError for a value that is not between them."""
    counts_by_name = {"open": gripper.open, "closed": gripper.closed}
    if isinstance(value, str):
        return counts_by_name[value]
    count = gripper.count(value)
    low, high = sorted(counts_by_name.values())
    if not low <= count <= high:  # the value of the nearest count, which is printed, may be typed again
        gripper.drive.check_value(value)
    return count


def gripper_known(machine: FirmwareMachine, gripper: Grip) -> bool:
    """Whether the board knows the gripper's position."""
    return machine.configured and bool(machine.status.known >> gripper.axis & 1)


def prepare_gripper(machine: FirmwareMachine, gripper: Grip, start: int | None) -> None:
    """Configure the gripper's axis, set its position and switch it on; start: assumed counts of a lost one."""
    is_known = gripper_known(machine, gripper)
    if is_known and start is not None:
        raise GripperKnownError("the gripper's position is known, and only a lost one may be assumed")
    if not is_known and start is None and not machine.session.port.simulated:
        raise GripperLostError(
            "the gripper's position is lost: a servo jumps to where it is taken to stand at once, at its full speed: "
            "keep your fingers out"
        )
    if not machine.configured:
        machine.configure()
    if not is_known:
        machine.vouch({gripper.axis: gripper.open if start is None else start})
    machine.enable((gripper.axis,))


def move_gripper(machine: FirmwareMachine, gripper: Grip, target: int) -> int:
    """Move the gripper to counts, and return its counts at the end."""
    assert gripper.top is not None
    assert gripper.accel is not None
    top, accel, board = gripper.top, gripper.accel, machine.configuration.board

    def plan_move(position: int) -> Move | None:
        distance = abs(target - position)
        clock, interval = board.clock, board.min_interval
        return (
            straight_line([position], [target], top / distance, accel / distance, clock=clock, min_interval=interval)
            if distance
            else None
        )

    if machine.status.counts[gripper.axis] != target:
        machine.run_axis(plan_move, gripper.axis, board.clock)
        machine.check_late_ticks()
        if not gripper_known(machine, gripper):
            raise GripperLostError("the board has lost the gripper's position on the way")
        if machine.status.counts[gripper.axis] != target:
            raise LinkError(
                f"the board says that the gripper stands at {machine.status.counts[gripper.axis]}, it was sent to "
                f"{target}: please report this as a bug"
            )
    return machine.status.counts[gripper.axis]
