"""The status of a board as JSON for `armkin status`, and the texts for the errors of a board."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from armkin.board.firmware.wire.protocol import Error, Flag, Info, State, Status

if TYPE_CHECKING:
    from armkin.board.firmware.configuration import Configuration


WHY = {
    Error.NO_SESSION: "the board was reset (its button, its power, another program?)",
    Error.ABORT: "the abort input is active: release it",
    Error.HELD: "it was told to stop",
    Error.SILENCE: "nothing was heard from this computer for half a second",
    Error.DRY: "the line was too slow or too noisy to keep its queue filled",
    Error.OVERRUN: "a tick came late: lower the speed, and report this as a bug",
    Error.SWITCH: "the homing switch is stuck, bounces, or needs a longer backoff:",
    Error.TRAVEL: "no switch was met on the whole way: is it wired, is homing.direction right?",
    Error.TIME: "homing took too long",
    Error.LOST: "its position is lost",
    Error.POWER: "the motors have no power",
    Error.LIMIT_SWITCH: "a limit switch is pressed: move away from it",
    Error.SPILL: "more was sent than the board could keep",
}


def as_json(info: Info, status: Status, configuration: Configuration) -> dict[str, Any]:
    """The last status of a board as JSON."""
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
