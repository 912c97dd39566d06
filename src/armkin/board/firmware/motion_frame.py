"""What a MOTION frame carries, and what the board's refusals mean in words."""

from __future__ import annotations

from dataclasses import dataclass

from armkin.board.firmware import protocol
from armkin.board.firmware.protocol import Error, Segment

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


@dataclass(frozen=True)
class Batch:
    """Segments of some axes, from counts to counts."""

    axes: list[int]
    start: list[int]
    end: list[int]
    segments: list[Segment]
    at_rest: bool
    clock: int
    brake: float = 1.0  # share of the accelerations that a hold takes

    @property
    def seconds(self) -> float:
        """About how long it takes."""
        return sum(s.units() for s in self.segments) * 256 / self.clock

    def payload(self, tag: int) -> bytes:
        """Its frame."""
        rest, brake = self.at_rest, self.brake
        return protocol.motion(tag, self.axes, self.start, self.end, self.segments, at_rest=rest, brake=brake)
