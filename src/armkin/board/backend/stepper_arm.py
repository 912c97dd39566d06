"""An arm of steppers on a board that obeys every program, so that its position needs armkin's own record.

A kind of board reads counts, finds reasons why they are lost, and carries out a job. This base class checks where a
motion begins and ends, takes the operator's statement of a lost position, and writes the messages.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from armkin.board.backend import Backend, Position, Progress, StoppedError
from armkin.board.backend.motion_start import from_counts
from armkin.board.backend.sent_positions import Job
from armkin.errors import LinkError, PositionKnownError, PositionLostError, UsageError
from armkin.model.units import joints_out
from armkin.motors import motor_accel, motor_names, pulses

if TYPE_CHECKING:
    from armkin.board.backend.position_record import Record
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm


def steppers(arm: Arm, board_name: str, letters: Iterable[str]) -> Iterator[tuple[int, Any, str, float, float, float]]:
    """Number, motor, name, steps a unit, greatest speed and acceleration [units/s, units/s2] of the arm's motors.

    Raises UsageError, naming the motor, for one that is no stepper, or has no axis of its own.
    """
    file = arm.path or arm.name
    if not arm.motors:
        raise UsageError(f"{file}: no joint has a drive")
    # with all joints at full speed
    speed = np.nan_to_num(np.abs(arm.motor_gain) @ np.nan_to_num(arm.max_speed), posinf=0.0)
    accel = np.nan_to_num(motor_accel(arm), posinf=0.0)
    unused = list(letters)
    for number, (motor, name) in enumerate(zip(arm.motors, motor_names(arm), strict=True)):
        if motor.kind != "stepper":
            raise UsageError(f"{file}: motor {name} is a {motor.kind}; {board_name} drives steppers alone")
        if motor.axis not in unused:
            raise UsageError(
                f"{file}: motor {name} is on axis {motor.axis}; {board_name} has {', '.join(letters)}, "
                "one motor on each"
            )
        unused.remove(motor.axis)
        steps = motor.pulses_per_unit()
        yield number, motor, name, steps, float(speed[number] / steps), float(accel[number] / steps)


class StepperArm(Backend):
    """An arm of steppers behind an open port."""

    cure: ClassVar[str] = "put it in its home pose and say so"  # advice for a lost position
    piece: ClassVar[float]  # [s] of a curve that is sent as one line
    homes: ClassVar[bool] = False  # whether it can search limit switches
    _stop: Callable[[], bool]
    _record: Record  # what armkin last left on the board

    def position(self) -> Position:
        """Return "known" while the board's values are those that armkin left."""
        return "lost" if self.loss_reason else "known"

    def refresh(self) -> None:
        """Read again where the arm stands."""
        self._read()

    def standing_text(self) -> str:
        """Where the arm has come to rest, and what that means for the next command."""
        if self.loss_reason:
            return f"the arm's position is lost ({self.loss_reason}): {self.cure}"
        return f"the arm stands at {self._joints_text()}, its position is known: the next command starts there"

    def report(self) -> dict[str, Any]:
        """What `armkin status` tells besides the position."""
        return {
            "settings": [str(difference) for difference in self.setting_differences()],
            "lost_because": self.loss_reason or None,
        }

    def prepare(self, *, assume: Array | None = None) -> bool:
        """Check settings and position; True if the position was lost and is now `assume`."""
        self._ready()
        if not self.loss_reason:
            if assume is not None:
                joints = joints_out(self.arm, self.joints()).tolist()
                raise PositionKnownError(f"the position is known ({self._joints_text()})", joints=joints)
            return False
        if assume is None and not self.port.simulated:
            raise PositionLostError(
                f"the arm's position is lost: {self.loss_reason}",
                robot_file=self.arm.path,
                port=self.port.name,
                homing=self.homes and all(self.arm.homing),
            )
        self.vouch(pulses(self.arm, self.arm.home if assume is None else assume).tolist())
        return True

    def run(self, plans: Iterable[Any], progress: Progress = lambda elapsed, total: None) -> None:
        """Carry out jobs, and compare the position at the end of each with its plan. Raises LinkError, StoppedError."""
        total = elapsed = 0.0
        was_read = False  # whether the position is up to date
        for job in from_counts(plans, self.counts):
            if job is None:
                if self._stop():
                    self.hold()
                    raise StoppedError
                self.port.read(0.01)
                was_read = False
                continue
            self._begin(job, position_read=was_read)
            total += job.duration

            def report_time(t: float, elapsed: float = elapsed, total: float = total) -> None:
                progress(min(elapsed + t, total), total)

            try:
                is_complete = self._carry_out(job, report_time)
            except LinkError as error:
                raise self._explain(error) from None
            if not is_complete:
                self.hold()
                raise StoppedError
            if self.loss_reason or self.counts() != tuple(job.end.tolist()):
                cause = (
                    "" if self.loss_reason else ": a line was damaged on its way, or another program has moved the arm"
                )
                mismatch = f"the arm stands at {list(self.counts())} steps, the plan ends at {job.end.tolist()}"
                raise LinkError(f"{mismatch}{cause}\n{self.standing_text()}")
            elapsed, was_read = total, True
            progress(elapsed, total)

    def _begin(self, job: Job, *, position_read: bool) -> None:
        """Check that the arm is at the start of a job, and record the motion."""
        if not position_read:
            self._read()
        if self.loss_reason:
            raise LinkError(self.standing_text())
        if self.counts() != tuple(job.start.tolist()):
            raise LinkError(f"another program has moved the arm since this motion was planned\n{self.standing_text()}")
        self._record.write_motion(job, self.piece)

    def _joints_text(self) -> str:
        """Joint values in words: ``q1 = 0, q2 = 90, q3 = -90``."""
        names = zip(self.arm.joint_names, joints_out(self.arm, self.joints()).tolist(), strict=True)
        return ", ".join(f"{name} = {round(value, 3) + 0.0:g}" for name, value in names)

    # What depends on the board

    @abstractmethod
    def setting_differences(self) -> Sequence[Any]:
        """Settings that differ from the robot file."""

    @abstractmethod
    def vouch(self, counts: Sequence[int]) -> None:
        """Accept the operator's statement that the motors stand at these counts."""

    @abstractmethod
    def _read(self) -> None:
        """Read the arm's position."""

    @abstractmethod
    def _ready(self) -> None:
        """Read the arm's position. Raises LinkError if settings or state forbid a motion."""

    @abstractmethod
    def _carry_out(self, job: Job, report: Callable[[float], None]) -> bool:
        """Carry out a job and read the position at rest; False if it was stopped. report: takes the seconds done."""

    @abstractmethod
    def _explain(self, error: LinkError) -> LinkError:
        """The error, extended by the position at which the arm has come to rest."""
