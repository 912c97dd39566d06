"""What `armkin status` tells of a board, besides the position."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from armkin.board.firmware.protocol import Error, Flag, Info, State, Status

if TYPE_CHECKING:
    from armkin.board.firmware.configuration import Configuration


def told(info: Info, status: Status, configuration: Configuration) -> dict[str, Any]:
    """A board's last words as JSON."""
    flags = Flag(status.flags)
    return {
        "firmware": ".".join(map(str, info.firmware)),
        "state": State(status.state).name.lower(),
        "error": Error(status.error).name.lower() if status.error else None,
        "drivers_on": Flag.DRIVERS in flags,
        "servo_pulses_on": Flag.SERVOS in flags,
        "abort_input": Flag.ABORT in flags,
        "motor_power": Flag.POWER_CUT not in flags if configuration.image.power_sensed else None,
        "switches": {name: bool(status.switches >> i & 1) for i, name in enumerate(configuration.board.switches)},
        "boots": info.boots,
        "reset_cause": info.cause,
    }
