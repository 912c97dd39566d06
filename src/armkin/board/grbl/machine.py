"""An arm on a GRBL board: its settings, its motions, its homing. Where it stands is told by place.py."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from armkin.board.backend import Position, Progress, StoppedError
from armkin.board.backend.job import Job, JobMachine
from armkin.board.backend.starting import from_counts
from armkin.board.grbl import gcode, replies, settings
from armkin.board.grbl.axes import axes_of
from armkin.board.grbl.place import Place
from armkin.board.grbl.session import GrblError, Session
from armkin.board.grbl.spindle import Spindle
from armkin.board.grbl.watch import Watch
from armkin.errors import LinkError, PositionKnownError, PositionLostError
from armkin.model.units import joints_out
from armkin.motors import pulses

if TYPE_CHECKING:
    from armkin.board.ports import Port
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm
    from armkin.motion.trajectory import Trajectory
    from armkin.robot_file.model import Gripper

_REST = 30.0  # [s] that a hold may take
_FRESH = 5.0  # [s] after which the settings are read again: jogging prepares three times a second


class GrblMachine(JobMachine):
    """An arm on the GRBL board behind an open port."""

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
        self._place = Place(self.session, arm, self.axes)
        self.settings, self.told = self.session.settings(), port.now()  # when they were read
        self._spindle = Spindle(self.session)
        self._read()

    # Where it stands

    def position(self) -> Position:
        """Known while all that GRBL keeps is what armkin left there."""
        return "lost" if self._place.why else "known"

    @property
    def why(self) -> str:
        """Why the position is lost, in words; empty while it is known."""
        return self._place.why

    def counts(self) -> tuple[int, ...]:
        """Counts of the arm's motors, as last read."""
        return self._place.counts()

    def standing(self) -> str:
        """Where the arm has come to rest, and what that means for the next command."""
        if self.why:
            return f"the arm's position is lost ({self.why}): home it, or put it in its home pose and say so"
        where = _listed(self.arm, joints_out(self.arm, self.joints()).tolist())
        return f"the arm stands at {where}, its position is known: the next command starts there"

    def report(self) -> dict[str, Any]:
        """What `armkin status` tells besides the position."""
        status = self.session.status()
        return {
            "firmware": f"GRBL {self.session.version}",
            "state": status.state.lower(),
            "inputs": status.pins,
            "settings": [str(difference) for difference in self.wrong()],
            "lost_because": self.why or None,
        }

    # Getting ready

    def wrong(self) -> list[settings.Difference]:
        """Settings that are not as the robot file wants them."""
        return settings.differences(self.axes, self.settings, hal=self.session.hal)

    def setup(self) -> list[settings.Difference]:
        """Write the settings that differ, read them back, and return what was written.

        The position is lost: its steps may mean something else now. Raises LinkError if a setting did not take.
        """
        before = self.wrong()
        for difference in before:
            self.session.ask(difference.line())
        self.settings = self.session.settings()
        if before:
            self._place.forget("its settings were written")
            with suppress(LinkError):  # in an alarm, or gone: forgotten all the same
                self._reset()
        left = self.wrong()
        if left:
            raise LinkError(f"GRBL did not keep what was written: {left[0]}")
        return before

    def prepare(self, *, assume: Array | None = None) -> bool:
        """Check settings and position; True if the position was lost: the arm stands at `assume` from now on."""
        report = self.session.status()
        self.session.demand_rest(report)
        serious = _serious(self)
        if serious:
            more = f", and {len(serious) - 1} more" if len(serious) > 1 else ""
            raise LinkError(f"GRBL's settings do not fit {self.arm.name}: {serious[0]}{more}; armkin setup writes them")
        if report.state != "Idle":
            raise LinkError(f"GRBL is in state {report.state}, not Idle: home it, or unlock it once you know why")
        self.session.was_reset = False  # what a reset has taken from it is read now
        self._read()
        if assume is not None and not self.why:
            joints = joints_out(self.arm, self.joints()).tolist()
            raise PositionKnownError(f"the position is known ({_listed(self.arm, joints)})", joints=joints)
        if not self.why:
            return False
        if assume is None and not self.port.simulated:
            raise PositionLostError(
                f"the arm's position is lost: {self.why}",
                robot_file=self.arm.path,
                port=self.port.name,
                homing=all(self.arm.homing),
            )
        self.vouch(np.asarray(pulses(self.arm, self.arm.home if assume is None else assume), dtype=np.int64))
        return True

    def vouch(self, counts: Any) -> None:
        """Take somebody's word that the motors stand at these counts."""
        self._place.vouch(np.asarray(counts, dtype=np.int64))

    # Moving

    def lay(self, trajectory: Trajectory, start: NDArray[np.int64]) -> Job:
        """A trajectory that starts at counts (motors,)."""
        return gcode.job(trajectory, start)

    def run(self, plans: Iterable[Job | None], progress: Progress = lambda done, total: None) -> None:
        """Carry out jobs and compare the position at each end. Raises LinkError, StoppedError."""
        total = done = 0.0
        seen = False  # where the arm stands was read just now
        for job in from_counts(plans, self.counts):
            if job is None:
                if self._stop():
                    self.hold()
                    raise StoppedError
                self.port.read(0.01)
                seen = False
                continue
            self._begin(job, seen=seen)
            total += job.duration
            began = self.port.now()
            watch = Watch(job, self.axes, self._place.offset)

            def tick(done: float = done, total: float = total, began: float = began, watch: Watch = watch) -> bool:
                progress(min(done + self.port.now() - began, total), total)
                watch.heed(self.session.fresh(), self.port.now() - began)
                return self._stop()

            try:
                # the dwell is answered when all before it has been carried out
                whole = self.session.stream(chain(gcode.lines(job, self.axes, self._place.offset), ["G4P0.01"]), tick)
            except LinkError as error:
                raise self._explain(error) from None
            if not whole:
                self.hold()
                raise StoppedError
            self._compare(job)
            done, seen = total, True
            progress(done, total)

    def _begin(self, job: Job, *, seen: bool) -> None:
        """Make sure that the arm stands where a job starts, at its own feed; record the motion."""
        if not seen:
            self.session.realtime(replies.PLAIN_FEED)
            self._read()
        if self.why:
            raise LinkError(self.standing())
        if self.counts() != tuple(job.start.tolist()):
            raise LinkError(f"another program has moved the arm since this motion was planned\n{self.standing()}")
        if self.session.feed != 100:
            raise LinkError(f"GRBL overrides feeds by {self.session.feed} %, and does not take that back")
        self._place.record.moves(job, gcode.PIECE)

    def hold(self) -> None:
        """Stop along the path and clear what is queued; the position stays known."""
        self.session.realtime(replies.HOLD)
        end = self.port.now() + _REST
        while (status := self.session.status()).state not in ("Idle", "Alarm") and (
            status.state != "Hold" or status.detail
        ):
            if self.port.now() > end:
                raise LinkError(f"GRBL does not come to rest: it says {status.state}; cut the motors' power")
            self.port.read(0.02)
        alarm = self.session.sure_status().state == "Alarm"
        counts = self.counts()
        self._reset()
        self._place.after_reset(counts, "GRBL is in an alarm" if alarm else self.why)

    def grip(self, gripper: Gripper, value: float) -> float:
        """Set the M3 output that the gripper hangs on, and return the S word: GRBL measures nothing."""
        try:
            return self._spindle.grip(gripper, value, self.settings)
        except GrblError as error:
            raise self._explain(error) from None

    def _reset(self) -> None:
        self.session.reset()
        self._spindle.again()

    def _compare(self, job: Job) -> None:
        """Make sure that a job has ended where it should, and record that. Raises LinkError."""
        if self.session.status().state in ("Run", "Jog"):
            raise self._explain(LinkError("the arm moves on after its plan: another program drives it"))
        self._read()
        if self.why or self.counts() != tuple(job.end.tolist()):
            raise LinkError(
                f"the arm stands at {list(self.counts())} steps, the plan ends at {job.end.tolist()}: a line was "
                f"damaged on its way, or another program has moved the arm\n{self.standing()}"
            )
        self._place.arrived()

    def _explain(self, error: LinkError) -> LinkError:
        if not isinstance(error, GrblError) or error.error:  # what is queued must not go on by itself
            try:
                self.hold()
            except LinkError:
                return error
            return LinkError(f"{error}; the arm was stopped\n{self.standing()}")
        if error.alarm == 0 or error.alarm in replies.LOSES_POSITION:
            self._place.forget(str(error))
        return LinkError(f"{error}\n{self.standing()}")

    def home(self, at: Sequence[float]) -> None:
        """Run GRBL's homing cycle; at: counts where each motor's switch closes.

        Raises LinkError, before anything moves, if GRBL's settings have it look at the other end.
        """
        wrong = [one for one in self.wrong() if one.number in settings.HOMING and one.found is not None]
        if wrong:
            raise LinkError(f"GRBL would not home as {self.arm.name} needs: {wrong[0]}; armkin setup writes it")
        self._place.forget("its homing was interrupted")
        try:
            self.session.ask("$H", patience=180.0)
        except GrblError as error:
            raise self._explain(error) from None
        pull = self.settings.get(27, 0.0)
        away = [pull * axis.steps * (1 if axis.upward else -1) for axis in self.axes]
        self.vouch(np.rint(np.asarray(at) - away))

    def _read(self) -> None:
        self._place.read()


def _serious(machine: GrblMachine) -> list[settings.Difference]:
    """Serious differences of the settings, read again after a reset or a while: others may have changed them.

    $$ has no checksum: two readings must find them.
    """
    session, now = machine.session, machine.port.now()
    for _ in range(2 if session.was_reset or now > machine.told + _FRESH else 0):
        machine.settings, machine.told = session.settings(), now
        if not any(difference.serious for difference in machine.wrong()):
            break
    return [difference for difference in machine.wrong() if difference.serious]


def _listed(arm: Arm, joints: list[float]) -> str:
    """Joint values in words: ``q1 = 0, q2 = 90, q3 = -90``."""
    return ", ".join(f"{name} = {round(value, 3) + 0.0:g}" for name, value in zip(arm.joint_names, joints, strict=True))
