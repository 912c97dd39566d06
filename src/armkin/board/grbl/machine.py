"""An arm on a GRBL board.

GRBL counts steps from its last reset. Where the arm stands is kept in its volatile offset G92, shifted by `MARK`:
a reset clears it, and a position that was lost is never taken for zero.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from armkin.board.backend import Position, Progress, StoppedError
from armkin.board.backend.job import Job, JobMachine
from armkin.board.backend.starting import from_counts, is_believable
from armkin.board.grbl import gcode, replies, settings
from armkin.board.grbl.axes import axes_of
from armkin.board.grbl.session import GrblError, Session
from armkin.board.grbl.spindle import Spindle
from armkin.board.grbl.watch import Watch
from armkin.errors import LinkError, PositionKnownError, PositionLostError
from armkin.model.units import joints_out
from armkin.motors import pulses

if TYPE_CHECKING:
    from armkin.board.grbl.replies import Report
    from armkin.board.grbl.settings import Axis
    from armkin.board.ports import Port
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm
    from armkin.motion.trajectory import Trajectory
    from armkin.robot_file.model import Gripper

MARK = 1000.0  # [units] added to G92: an offset of 0 means that nobody has said where the arm stands
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
        self._offset: np.ndarray[Any, np.dtype[np.int64]] | None = None  # machine steps less counts
        self.settings, self.told = self.session.settings(), port.now()  # when they were read
        self._spindle = Spindle(self.session)
        self._read()

    # Where it stands

    def position(self) -> Position:
        """Known since somebody said it or the arm was homed, until a reset or an alarm."""
        return "known" if self._offset is not None and is_believable(self.arm, self.counts()) else "lost"

    def counts(self) -> tuple[int, ...]:
        """Counts of the arm's motors, as last read."""
        offset = np.zeros(len(self.axes), dtype=np.int64) if self._offset is None else self._offset
        return tuple(int(steps) for steps in _steps(self.session.report, self.axes) - offset)

    def standing(self) -> str:
        """Where the arm has come to rest, and what that means for the next command."""
        if self._offset is None:
            return "the arm's position is lost: home it, or put it in its home pose and say so"
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
        }

    # Getting ready

    def wrong(self) -> list[settings.Difference]:
        """Settings that are not as the robot file wants them."""
        return settings.differences(self.axes, self.settings)

    def setup(self) -> list[settings.Difference]:
        """Write the settings that differ, read them back, and return what was written.

        The position is lost: its steps may mean something else now. Raises LinkError if a setting did not take.
        """
        before = self.wrong()
        for difference in before:
            self.session.ask(f"${difference.number}={difference.wanted:.3f}")
        self.settings = self.session.settings()
        if before:
            self._forget()
        left = self.wrong()
        if left:
            raise LinkError(f"GRBL did not keep what was written: {left[0]}")
        return before

    def prepare(self, *, assume: Array | None = None) -> bool:
        """Check settings and position; True if the position was lost: the arm stands at `assume` from now on."""
        state = self.session.status().state
        serious = _serious(self)
        if serious:
            more = f", and {len(serious) - 1} more" if len(serious) > 1 else ""
            raise LinkError(f"GRBL's settings do not fit {self.arm.name}: {serious[0]}{more}; armkin setup writes them")
        if state not in ("Idle", "Jog"):
            raise LinkError(f"GRBL is in state {state}, not Idle: home it, or unlock it once you know why")
        self.session.was_reset = False  # what a reset has taken from it is read now
        self._read()
        if assume is not None and self._offset is not None:
            joints = joints_out(self.arm, self.joints()).tolist()
            raise PositionKnownError(f"the position is known ({_listed(self.arm, joints)})", joints=joints)
        if self._offset is not None:
            return False
        if assume is None and not self.port.simulated:
            raise PositionLostError(
                "the arm's position is lost",
                robot_file=self.arm.path,
                port=self.port.name,
                homing=all(self.arm.homing),
            )
        self.vouch(np.asarray(pulses(self.arm, self.arm.home if assume is None else assume), dtype=np.int64))
        return True

    def vouch(self, counts: Any) -> None:
        """Take somebody's word that the motors stand at these counts."""
        self._offset = _steps(self.session.report, self.axes) - np.asarray(counts, dtype=np.int64)
        words = "".join(
            f"{axis.letter}{count / axis.steps - MARK:.5f}" for axis, count in zip(self.axes, counts, strict=True)
        )
        self.session.ask(f"G92{words}")

    # Moving

    def lay(self, trajectory: Trajectory, start: NDArray[np.int64]) -> Job:
        """A trajectory that starts at counts (motors,)."""
        return gcode.job(trajectory, start)

    def run(self, plans: Iterable[Job | None], progress: Progress = lambda done, total: None) -> None:
        """Carry out jobs and compare the position at each end. Raises LinkError, StoppedError."""
        total = done = 0.0
        for job in from_counts(plans, self.counts):
            if job is None:
                if self._stop():
                    self.hold()
                    raise StoppedError
                self.port.read(0.01)
                continue
            assert self._offset is not None
            total += job.duration
            began = self.port.now()
            watch = Watch(job, self.axes, self._offset)

            def tick(done: float = done, total: float = total, began: float = began, watch: Watch = watch) -> bool:
                progress(min(done + self.port.now() - began, total), total)
                watch.heed(self.session.fresh(), self.port.now() - began)
                return self._stop()

            try:
                # the dwell is answered when all before it has been carried out
                whole = self.session.stream(chain(gcode.lines(job, self.axes, self._offset), ["G4P0.01"]), tick)
            except LinkError as error:
                raise self._explain(error) from None
            if not whole:
                self.hold()
                raise StoppedError
            self._compare(job)
            done = total
            progress(done, total)

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
        status = self.session.sure_status()
        counts = None if self._offset is None or status.state == "Alarm" else self.counts()
        self._reset()
        self._read()
        if counts is not None:
            self.vouch(counts)  # the reset has cleared it, at a standstill

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
        self._read()
        if self._offset is None or self.counts() != tuple(job.end.tolist()):
            raise LinkError(
                f"the arm stands at {list(self.counts())} steps, the plan ends at {job.end.tolist()}: a line was "
                f"damaged on its way\n{self.standing()}"
            )

    def _explain(self, error: LinkError) -> LinkError:
        if not isinstance(error, GrblError) or error.error:  # what is queued must not go on by itself
            try:
                self.hold()
            except LinkError:
                return error
            return LinkError(f"{error}; the arm was stopped\n{self.standing()}")
        if error.alarm == 0 or error.alarm in replies.LOSES_POSITION:
            self._forget()
        return LinkError(f"{error}\n{self.standing()}")

    def home(self, at: Sequence[float]) -> None:
        """Run GRBL's homing cycle; at: counts where each motor's switch closes.

        Raises LinkError, before anything moves, if GRBL's settings have it look at the other end.
        """
        wrong = [one for one in self.wrong() if one.number in settings.HOMING and one.found is not None]
        if wrong:
            raise LinkError(f"GRBL would not home as {self.arm.name} needs: {wrong[0]}; armkin setup writes it")
        try:
            self.session.ask("$H", patience=180.0)
        except GrblError as error:
            raise self._explain(error) from None
        pull = self.settings.get(27, 0.0)
        away = [pull * axis.steps * (1 if axis.upward else -1) for axis in self.axes]
        self.vouch(np.rint(np.asarray(at) - away).astype(np.int64))
        self._read()

    # What GRBL says

    def _read(self) -> None:
        """Read position and offset: what stands in G92 since the last reset tells where the arm stands."""
        status = self.session.sure_status()
        if status.position is None:
            raise LinkError("GRBL reports no machine position: armkin setup writes $10, which asks for it")
        if max(axis.index for axis in self.axes) >= len(status.position):
            raise LinkError(f"GRBL has {len(status.position)} axes; {self.arm.name} needs {self.axes[-1].letter}, too")
        found = self.session.offsets()
        g92, g54 = found.get("G92", ()), found.get("G54", ())
        if status.state == "Alarm" or not g92 or all(g92[axis.index] == 0.0 for axis in self.axes):
            self._offset = None
            return
        shift = [(g92[axis.index] + (g54[axis.index] if g54 else 0.0) - MARK) * axis.steps for axis in self.axes]
        self._offset = np.rint(shift).astype(np.int64)

    def _forget(self) -> None:
        self._offset = None
        try:
            self._reset()
        except LinkError:
            return  # in an alarm, or gone: forgotten all the same


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


def _steps(report: Report | None, axes: Sequence[Axis]) -> np.ndarray[Any, np.dtype[np.int64]]:
    """GRBL's machine position in steps, as it was reported."""
    assert report is not None
    assert report.position is not None
    return np.rint([report.position[axis.index] * axis.steps for axis in axes]).astype(np.int64)


def _listed(arm: Arm, joints: list[float]) -> str:
    """Joint values in words: ``q1 = 0, q2 = 90, q3 = -90``."""
    return ", ".join(f"{name} = {round(value, 3) + 0.0:g}" for name, value in zip(arm.joint_names, joints, strict=True))
