"""An arm on a GRBL board: settings, motion and homing. `believed_position.py` handles its position."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from armkin.board.backend.sent_positions import Job
from armkin.board.backend.stepper_arm import StepperArm
from armkin.board.grbl import replies, settings, trajectory_to_gcode
from armkin.board.grbl.believed_position import BelievedPosition
from armkin.board.grbl.grbl_session import GrblError, Session
from armkin.board.grbl.motor_axes import axes_of
from armkin.board.grbl.position_watch import Watch
from armkin.board.grbl.spindle_gripper import Spindle
from armkin.errors import LinkError

if TYPE_CHECKING:
    from armkin.board.ports import Port
    from armkin.model.arm import Arm
    from armkin.motion.timing.trajectory import Trajectory
    from armkin.robot_file.robot_keys import Gripper

_HOLD_TIMEOUT = 30.0  # longest time [s] of a hold
_MAX_SETTINGS_AGE = 5.0  # time [s] after which the settings are read again: jogging prepares three times a second


class GrblMachine(StepperArm):
    """An arm on the GRBL board behind an open port."""

    cure = "home it, or put it in its home pose and say so"
    piece = trajectory_to_gcode.PIECE_TIME
    homes = True
    differences = (
        "GRBL has no checksum: a damaged line may move the arm wrongly until a report, some 0.2 s later, tells",
        "GRBL forgets its position at a reset, and an Arduino resets when its port is opened",
        "when the computer falls silent GRBL finishes what it holds, up to 16 lines",
    )

    def __init__(self, port: Port, arm: Arm, stop: Callable[[], bool] = lambda: False) -> None:
        self.arm, self.port, self._stop = arm, port, stop
        self.axes = axes_of(arm)
        self.session = Session(port)
        self.session.open()
        self._place = BelievedPosition(self.session, arm, self.axes)
        self._record = self._place.record
        self.settings, self.settings_time = self.session.settings(), port.now()  # and the time of reading them
        self._spindle = Spindle(self.session)
        self._read()

    # Position

    @property
    def loss_reason(self) -> str:
        """Why the position is lost, in words; empty while it is known."""
        return self._place.loss_reason

    def counts(self) -> tuple[int, ...]:
        """Counts of the arm's motors, as last read."""
        return self._place.counts()

    def report(self) -> dict[str, Any]:
        """What `armkin status` tells besides the position."""
        status = self.session.status()
        firmware_status = {
            "firmware": f"GRBL {self.session.version}",
            "state": status.state.lower(),
            "inputs": status.pins,
        }
        return {**firmware_status, **super().report()}

    # Getting ready

    def setting_differences(self) -> list[settings.SettingDifference]:
        """Settings that differ from the robot file."""
        return settings.differences(self.axes, self.settings, hal=self.session.hal)

    def setup(self) -> list[settings.SettingDifference]:
        """Write the settings that differ, read them back, and return what was written.

        The position is lost: its steps may mean something else now. Raises LinkError if a setting did not take.
        """
        differences = self.setting_differences()
        for difference in differences:
            self.session.ask(difference.line())
        self.settings = self.session.settings()
        if differences:
            self._place.forget("its settings were written")
            with suppress(LinkError):  # an alarm or a lost connection does not matter here
                self._reset()
        remaining = self.setting_differences()
        if remaining:
            raise LinkError(f"GRBL did not keep what was written: {remaining[0]}")
        return differences

    def _ready(self) -> None:
        """Read where the arm stands. Raises LinkError if settings or state forbid a motion."""
        report = self.session.status()
        self.session.demand_rest(report)
        differences = _serious_differences(self)
        if differences:
            others = f", and {len(differences) - 1} more" if len(differences) > 1 else ""
            raise LinkError(
                f"GRBL's settings do not fit {self.arm.name}: {differences[0]}{others}; armkin setup writes them"
            )
        if report.state != "Idle":
            raise LinkError(f"GRBL is in state {report.state}, not Idle: home it, or unlock it once you know why")
        self.session.was_reset = False  # the offsets are read again below
        self._read()

    def vouch(self, counts: Sequence[int]) -> None:
        """Accept the operator's statement of the motors' counts."""
        self._place.vouch(np.asarray(counts, dtype=np.int64))

    # Moving

    def plan_trajectory(self, trajectory: Trajectory, start: NDArray[np.int64]) -> Job:
        """A trajectory that starts at counts (motors,)."""
        return trajectory_to_gcode.job(trajectory, start)

    def _carry_out(self, job: Job, report: Callable[[float], None]) -> bool:
        """Send a job's lines, watch the arm during the motion, and record the position at its end."""
        start_time, watch = self.port.now(), Watch(job, self.axes, self._place.offset)

        def tick() -> bool:
            report(self.port.now() - start_time)
            watch.check_report(self.session.fresh_report(), self.port.now() - start_time)
            return self._stop()

        # GRBL answers the dwell after all earlier lines have been carried out
        if not self.session.stream(
            chain(trajectory_to_gcode.gcode_lines(job, self.axes, self._place.offset), ["G4P0.01"]), tick
        ):
            return False
        if self.session.status().state in ("Run", "Jog"):
            raise LinkError("the arm moves on after its plan: another program drives it")
        self._read()
        if not self.loss_reason and self.counts() == tuple(job.end.tolist()):
            self._place.record_arrival()
        return True

    def _begin(self, job: Job, *, position_read: bool) -> None:
        """Check that the arm is at the start of a job and feeds are not overridden, and record the motion."""
        if not position_read:
            self.session.realtime(replies.PLAIN_FEED)
        super()._begin(job, position_read=position_read)
        if self.session.feed != 100:
            raise LinkError(f"GRBL overrides feeds by {self.session.feed} %, and does not take that back")

    def hold(self) -> None:
        """Stop along the path and clear the queue; the position stays known."""
        self.session.realtime(replies.HOLD)
        deadline = self.port.now() + _HOLD_TIMEOUT
        while (status := self.session.status()).state not in ("Idle", "Alarm") and (
            status.state != "Hold" or status.detail
        ):
            if self.port.now() > deadline:
                raise LinkError(f"GRBL does not come to rest: it says {status.state}; cut the motors' power")
            self.port.read(0.02)
        alarm = self.session.sure_status().state == "Alarm"
        counts = self.counts()
        self._reset()
        self._place.after_reset(counts, "GRBL is in an alarm" if alarm else self.loss_reason)

    def grip(self, gripper: Gripper, value: float) -> float:
        """Set the M3 output of the gripper, and return the S word, as GRBL measures nothing."""
        try:
            return self._spindle.grip(gripper, value, self.settings)
        except GrblError as error:
            raise self._explain(error) from None

    def _reset(self) -> None:
        self.session.reset()
        self._spindle.regrip()

    def _explain(self, error: LinkError) -> LinkError:
        if not isinstance(error, GrblError) or error.error:  # stop the queued motion
            try:
                self.hold()
            except LinkError:
                return error
            return LinkError(f"{error}; the arm was stopped\n{self.standing_text()}")
        if error.alarm == 0 or error.alarm in replies.LOSES_POSITION:
            self._place.forget(str(error))
        return LinkError(f"{error}\n{self.standing_text()}")

    def home(self, counts: Sequence[float]) -> None:
        """Run GRBL's homing cycle; counts: counts where each motor's switch closes.

        Raises LinkError, before anything moves, if GRBL's settings have it look at the other end.
        """
        of_homing = [
            difference for difference in self.setting_differences() if difference.number in settings.HOMING_SETTINGS
        ]
        differences = [difference for difference in of_homing if difference.actual is not None]
        if differences:
            raise LinkError(f"GRBL would not home as {self.arm.name} needs: {differences[0]}; armkin setup writes it")
        self._place.forget("its homing was interrupted")
        try:
            self.session.ask("$H", patience=180.0)
        except GrblError as error:
            raise self._explain(error) from None
        pull = self.settings.get(27, 0.0)
        pull_off = [pull * axis.steps * (1 if axis.upward else -1) for axis in self.axes]
        self.vouch(np.rint(np.asarray(counts) - pull_off).tolist())

    def _read(self) -> None:
        self._place.read()


def _serious_differences(machine: GrblMachine) -> list[settings.SettingDifference]:
    """Serious differences of the settings, read again after a reset or a while: others may have changed them.

    $$ has no checksum: two readings must find them.
    """
    session, present = machine.session, machine.port.now()
    for _ in range(2 if session.was_reset or present > machine.settings_time + _MAX_SETTINGS_AGE else 0):
        machine.settings, machine.settings_time = session.settings(), present
        if not any(difference.serious for difference in machine.setting_differences()):
            break
    return [difference for difference in machine.setting_differences() if difference.serious]
