"""What a robot file still lacks for `pulses`, for motion in simulation and on a board, and for homing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armkin.board.firmware.configuration import missing
from armkin.errors import UsageError
from armkin.motors import joints_per_pulse, undriven

if TYPE_CHECKING:
    from armkin.model.arm import Arm


def needs(arm: Arm) -> dict[str, list[str]]:
    """What each of `pulses`, `simulate`, `send` and `home` lacks, in words; an empty list: nothing.

    >>> import armkin
    >>> found = needs(armkin.load("three_dof"))
    >>> found["send"], found["home"]
    ([], ['joints q1, q2, q3 have no homing'])
    """
    send = missing(arm)
    return {
        "pulses": _without_drives(arm),
        "simulate": missing(arm, board=False),
        "send": send,
        "home": send + _without_homing(arm),
    }


def _without_drives(arm: Arm) -> list[str]:
    still = undriven(arm)
    if still:
        return [_have(still, "drive")]
    try:
        joints_per_pulse(arm)
    except UsageError as error:
        return [str(error)]
    return []


def _without_homing(arm: Arm) -> list[str]:
    if arm.motors and all(motor.kind == "bus" for motor in arm.motors):
        return []  # bus servos know where they are
    bare = [name for name, homing in zip(arm.joint_names, arm.homing, strict=True) if homing is None]
    return [_have(bare, "homing")] if bare else []


def _have(names: list[str], what: str) -> str:
    return f"joint{'s' * (len(names) > 1)} {', '.join(names)} ha{'ve' if len(names) > 1 else 's'} no {what}"
