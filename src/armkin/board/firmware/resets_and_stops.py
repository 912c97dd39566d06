"""Errors of a motion whose board resets, stops or refuses: the cause, the arm's position, and what is lost.

A reset shows as an answer without a session: `wire/session.py` raises an error, and `FirmwareMachine.run` calls this
module. The session is opened again to read the position, and nothing of the motion is sent again. Boards with
other firmware have this in `grbl_session.py`, `klipper_machine.py` and `feetech_machine.py`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from armkin.board.backend.motion_start import why_impossible
from armkin.board.firmware.board_status import WHY
from armkin.board.firmware.wire.protocol import Error
from armkin.errors import HeldError, LinkError, PositionLostError
from armkin.model.units import joints_out

if TYPE_CHECKING:
    from armkin.board.backend import Position
    from armkin.board.firmware.wire.protocol import Info, Status
    from armkin.board.firmware.wire.session import DeviceError, Session
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm


class Machine(Protocol):
    """The part of `firmware_machine.FirmwareMachine` that this module uses."""

    arm: Arm
    session: Session
    info: Info
    status: Status

    @property
    def configured(self) -> bool:
        """Whether the board holds this arm's configuration."""

    def position(self) -> Position:
        """Known, retained or lost."""

    def counts(self) -> tuple[int, ...]:
        """Counts of every motor, (motors,)."""

    def joints(self) -> Array:
        """Joint values (n,) [rad | mm]."""

    def describe(self) -> str:
        """The arm's position in words."""

    def standing_text(self) -> str:
        """A sentence on where the arm has come to rest, and where the next command starts."""


def explain_error(machine: Machine, error: DeviceError) -> LinkError:
    """The error for the user: the meaning of the board's error, and the arm's position."""
    cause = WHY.get(error.error)
    if cause is None:
        return LinkError(
            f"the board refused what it was sent: {error.error.name} ({error.detail}); it stands still\n"
            "armkin and its firmware disagree: please report it with the robot file"
        )
    try:
        machine.status = machine.session.wait_for_rest()
        if machine.status.error == Error.NO_SESSION:
            machine.info = machine.session.reopen()
            machine.status = machine.session.status()
    except LinkError:
        return LinkError(f"{cause}; then the board did not answer any more: armkin status tells where it stands")
    if machine.position() == "lost":
        return position_lost_error(machine, f"{cause}\n{machine.standing_text()}")
    return HeldError(
        f"{cause}\nthe arm stands at {machine.describe()}, its position is known",
        advice="the next motion starts there",
        joints=joints_out(machine.arm, machine.joints()).tolist(),
    )


def must_be_told(machine: Machine) -> PositionLostError:
    """The error of a motion while the position is lost."""
    reason = "the arm's position is lost"
    if machine.info.config and not machine.configured:
        change_text = f"{machine.arm.path} has changed"
        reason = f"the board is configured for another arm, or {change_text}: its position is lost"
    elif machine.configured and (impossible := why_impossible(machine.arm, machine.counts())):
        reason = f"{reason}: {impossible}"
    return position_lost_error(machine, reason)


def position_lost_error(machine: Machine, message: str) -> PositionLostError:
    """The error of a lost position, with advice on how to restore it."""
    homing = all(machine.arm.homing)
    home_by_hand = "put the arm in its home pose and prepare(assume=arm.home)"
    return PositionLostError(
        message,
        advice=f"home it, or {home_by_hand}" if homing else home_by_hand,
        robot_file=machine.arm.path,
        port=machine.session.port.name,
        homing=homing,
    )
