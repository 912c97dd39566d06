"""What a motion ends with when its board resets, stops or refuses: why, where the arm stands, what is lost.

A reset shows as an answer without a session (`wire/session.py` raises it, `FirmwareMachine.run` asks here): the session
is opened anew, the board says what it still knows, and nothing of the motion is sent again. Boards with other firmware
have theirs in `grbl_session.py`, `klipper_machine.py` and `feetech_machine.py`.
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
    """What this module asks of an arm on its board: `firmware_machine.FirmwareMachine` answers it."""

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
        """Counts at which every motor stands, (motors,)."""

    def joints(self) -> Array:
        """Joint values (n,) [rad | mm]."""

    def describe(self) -> str:
        """Where the arm stands, in words."""

    def standing_text(self) -> str:
        """Where the arm has come to rest, and what that means for the next command."""


def explain_error(machine: Machine, error: DeviceError) -> LinkError:
    """What the board's error means, and where the arm stands now."""
    why = WHY.get(error.error)
    if why is None:
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
        return LinkError(f"{why}; then the board did not answer any more: armkin status tells where it stands")
    if machine.position() == "lost":
        return position_lost_error(machine, f"{why}\n{machine.standing_text()}")
    return HeldError(
        f"{why}\nthe arm stands at {machine.describe()}, its position is known",
        advice="the next motion starts there",
        joints=joints_out(machine.arm, machine.joints()).tolist(),
    )


def must_be_told(machine: Machine) -> PositionLostError:
    """A motion was asked for while the position is lost."""
    reason = "the arm's position is lost"
    if machine.info.config and not machine.configured:
        changed = f"{machine.arm.path} has changed"
        reason = f"the board is configured for another arm, or {changed}: its position is lost"
    elif machine.configured and (far := why_impossible(machine.arm, machine.counts())):
        reason = f"{reason}: {far}"
    return position_lost_error(machine, reason)


def position_lost_error(machine: Machine, message: str) -> PositionLostError:
    """The position is lost, and by what it is found again."""
    homing = all(machine.arm.homing)
    put = "put the arm in its home pose and prepare(assume=arm.home)"
    return PositionLostError(
        message,
        advice=f"home it, or {put}" if homing else put,
        robot_file=machine.arm.path,
        port=machine.session.port.name,
        homing=homing,
    )
