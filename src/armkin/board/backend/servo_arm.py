"""An arm of bus servos, whose absolute encoders always know the position.

The host streams positions along the trajectory to all servos at once, each a little ahead of its time, and the servos'
own controllers follow them. A lost packet does no harm, since the next one carries a newer position.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from armkin.board.backend import Backend, Position, Progress, StoppedError
from armkin.board.backend.motion_start import from_counts
from armkin.board.backend.sent_positions import Job, braking_time
from armkin.board.backend.servo_travel import first_beyond
from armkin.errors import LinkError, NoSolutionError, PositionKnownError, UsageError
from armkin.model.units import joints_out
from armkin.motors import motor_names, pulses

if TYPE_CHECKING:
    from armkin.board.ports import Port
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm
    from armkin.motion.timing.trajectory import Trajectory

SEND_PERIOD = 0.02  # time [s] between two positions that are sent
MAX_OVERRUN = 0.05  # longest time step [s]: after a delay the arm must not cut across its path
WATCH_PERIOD = 0.1  # time [s] between two readings of positions and errors during motion
MAX_LAG = 400  # lag [counts], 35 degrees, at which a servo counts as blocked
SETTLED_DISTANCE = 12  # distance [counts] from the goal, 1 degree, that counts as arrived
START_DISTANCE = 2 * SETTLED_DISTANCE  # distance [counts] allowed at a start, as servos sag under load
SETTLING_TIME = 1.0  # longest time [s] from the end of a move to its arrival


def job(trajectory: Trajectory, start: NDArray[np.int64]) -> Job:
    """The job of a trajectory from counts `start` (motors,) on."""
    return Job(trajectory, start, int(np.ceil(trajectory.duration / SEND_PERIOD)))


def servo_ids(arm: Arm) -> list[int]:
    """The bus ids of the arm's servos, in the motors' order. Raises UsageError for other motors."""
    robot_file = arm.path or arm.name
    motors = arm.motors
    if not motors:
        raise UsageError(f"{robot_file}: no joint has a drive")
    for motor, name in zip(motors, motor_names(arm), strict=True):
        if motor.kind != "bus" or motor.id is None:
            raise UsageError(
                f"{robot_file}: motor {name} is a {motor.kind}; a servo bus needs drive: {{kind: bus, id: ...}}"
            )
    ids = [motor.id for motor in motors if motor.id is not None]
    for number in ids:
        if ids.count(number) > 1:
            raise UsageError(f"{robot_file}: two servos have id {number}; every servo of a bus has its own")
    return ids


class ServoArm(Backend):
    """An arm of bus servos behind an open port, of any make."""

    firmware: str  # the firmware field of `armkin status`
    limits_at: str  # where the servos keep their own limits
    differences: tuple[str, ...]

    def __init__(self, port: Port, arm: Arm, stop: Callable[[], bool] = lambda: False) -> None:
        self.arm, self.port, self._stop = arm, port, stop
        self.ids = servo_ids(arm)
        self.bus = self._bus(port)
        silent_servos = [str(number) for number in self.ids if not self.bus.ping(number)]
        if silent_servos:
            raise LinkError(
                f"no answer from servo{'s' * (len(silent_servos) > 1)} {', '.join(silent_servos)} on {port.name}: "
                "is the bus powered, is every cable plugged in, has every servo its own id?"
            )
        self._counts = np.zeros(len(self.ids), dtype=np.int64)
        self._states: dict[int, bytes] = {}
        self._limits = self._own_limits()
        self._read()

    # Position

    def position(self) -> Position:
        """Return "known", as the servos' encoders are absolute."""
        return "known"

    @property
    def loss_reason(self) -> str:
        """Return an empty text, as the position is never lost."""
        return ""

    def counts(self) -> tuple[int, ...]:
        """Counts of the arm's motors, as last read."""
        return tuple(int(count) for count in self._counts)

    def _measured_counts(self) -> tuple[int, ...]:
        """Counts of the arm's motors, read now."""
        self._read()
        return self.counts()

    def refresh(self) -> None:
        """Read again where the arm stands."""
        self._read()

    def standing_text(self) -> str:
        """Where the arm has come to rest, and what that means for the next command."""
        return f"the arm stands at {list(self.counts())} counts: the next command starts there"

    def report(self) -> dict[str, Any]:
        """What `armkin status` tells besides the position."""
        self._read()
        servos = []
        for number, name in zip(self.ids, motor_names(self.arm), strict=True):
            torque = bool(self.bus.read(number, self.bus.TORQUE))
            fields = {"name": name, "id": number, "torque": torque, **self._servo_report(number)}
            servos.append({**fields, "errors": self._faults(number)})
        return {"firmware": self.firmware, "servos": servos}

    # Getting ready

    def prepare(self, *, assume: Array | None = None) -> bool:
        """Switch the motors on at their present positions; returns False, as the position is never lost."""
        if assume is not None:
            joints = joints_out(self.arm, self.joints()).tolist()
            raise PositionKnownError("bus servos know their position: there is nothing to assume", joints=joints)
        self._read()
        self._check()
        self._send(self._counts, np.zeros(len(self.ids)))  # the present position, so that no servo jumps to an old goal
        for number, count in zip(self.ids, self._counts, strict=True):
            self.bus.write(number, self.bus.GOAL_POSITION, int(count))
        self.bus.torque(self.ids, on=True)
        return False

    def relax(self) -> None:
        """Switch the motors off: the arm can be moved by hand, and falls if nobody holds it."""
        self.bus.torque(self.ids, on=False)

    def read(self) -> Array:
        """Joint values where the arm stands now: (n,) [rad | mm]."""
        self._read()
        return self.joints()

    def wait(self, until: float) -> bool:
        """Wait for a moment of the port's clock; False if a stop was asked for before."""
        while self.port.now() < until:
            if self._stop():
                return False
            self.port.read(0.01)
        return not self._stop()

    # Moving

    def plan_trajectory(self, trajectory: Trajectory, start: NDArray[np.int64]) -> Job:
        """A trajectory that starts at counts (motors,). Raises NoSolutionError as `_check_limits` does."""
        servo_job = job(trajectory, start)
        self._check_limits(servo_job)
        return servo_job

    def run(self, plans: Iterable[Any], progress: Progress = lambda elapsed, total: None) -> None:
        """Carry out jobs; at each end wait until the servos have arrived. Raises LinkError, StoppedError."""
        total = elapsed = 0.0
        for queued_job in filter(None, plans if isinstance(plans, list) else ()):
            self._check_limits(queued_job)  # check all jobs before the arm moves
        for job in from_counts(plans, self._measured_counts, tolerance=START_DISTANCE):
            if job is None:
                self._raise_if_stopped()
                self.port.read(SEND_PERIOD)
                continue
            self._check_limits(job)
            total += job.duration
            self._follow(job.trajectory, partial(_report_progress, progress, elapsed, total))
            self._arrive(job.end)
            elapsed = total
            progress(elapsed, total)

    def hold(self) -> None:
        """Stay at the present position."""
        self._read()
        for number, count in zip(self.ids, self._counts, strict=True):
            self.bus.write(number, self.bus.GOAL_POSITION, int(count))

    def _check_limits(self, job: Job) -> None:
        """Raise NoSolutionError if a job takes a servo outside its own limits, or farther out if it starts outside."""
        if (found := first_beyond(job.trajectory, job.start, self._limits)) is not None:
            k, count = found
            lower, upper = self._limits[k].tolist()
            raise NoSolutionError(
                f"servo {self.ids[k]} ({motor_names(self.arm)[k]}): {count} counts is outside its own "
                f"limits {lower} to {upper} ({self.limits_at}): nothing was moved"
            )

    def _follow(self, trajectory: Trajectory, report: Callable[[float], None]) -> None:
        """Stream a trajectory in real time; a stop slows the plan's time down, so that the arm stays on its path."""
        last = last_check = self.port.now()
        t, pace, is_stopping = 0.0, 1.0, False
        ramp = max(braking_time(trajectory), SEND_PERIOD)
        while t < trajectory.duration and pace > 0.0:
            time = self.port.now()
            if time - last < SEND_PERIOD - 1e-4:
                self.port.read(SEND_PERIOD - (time - last))
                continue
            is_stopping = is_stopping or self._stop()
            step, last = min(time - last, MAX_OVERRUN), time
            if is_stopping:
                pace = max(0.0, pace - step / ramp)
            t = min(trajectory.duration, t + step * pace)
            t_sent = min(trajectory.duration, t + SEND_PERIOD * pace)
            self._send(pulses(self.arm, trajectory.q(t_sent)), np.abs(self.arm.motor_gain @ trajectory.qd(t_sent)))
            report(t)
            if time - last_check > WATCH_PERIOD:
                last_check = time
                self._watch(pulses(self.arm, trajectory.q(t)))
        if is_stopping:
            self.hold()
            raise StoppedError

    def _arrive(self, end: NDArray[np.int64]) -> None:
        """Send the goal until all servos have arrived. Raises LinkError for a servo that does not arrive in time."""
        deadline = self.port.now() + SETTLING_TIME
        while True:
            self._send(end, np.zeros(len(self.ids)))
            self.port.read(SEND_PERIOD)
            self._read()
            self._check()
            distance = np.abs(self._counts - end)
            if distance.max() <= SETTLED_DISTANCE:
                return
            if self.port.now() > deadline:
                k = int(distance.argmax())
                self.hold()
                raise LinkError(
                    f"servo {self.ids[k]} ({motor_names(self.arm)[k]}) stands {distance[k]} counts from its goal: is "
                    f"it blocked or overloaded?\n{self.standing_text()}"
                )
            self._raise_if_stopped()

    def _watch(self, expected: NDArray[np.int64]) -> None:
        """Hold the arm if a servo reports an error or falls far behind."""
        self._read()
        lag = np.abs(self._counts - expected)
        if lag.max() > MAX_LAG:
            k = int(lag.argmax())
            self.hold()
            raise LinkError(
                f"servo {self.ids[k]} ({motor_names(self.arm)[k]}) is {lag[k]} counts behind: blocked or overloaded?\n"
                f"{self.standing_text()}"
            )
        self._check()

    def _check(self) -> None:
        """Raise LinkError for a servo that reports an error."""
        for number, name in zip(self.ids, motor_names(self.arm), strict=True):
            if faults := self._faults(number):
                raise LinkError(
                    f"servo {number} ({name}) reports {', '.join(faults)}: switch the power off, find the cause\n"
                    f"{self.standing_text()}"
                )

    def _raise_if_stopped(self) -> None:
        if self._stop():
            self.hold()
            raise StoppedError

    # What depends on the servos' make

    @abstractmethod
    def _bus(self, port: Port) -> Any:
        """The servos behind an open port: ping, read, write, torque, and the registers TORQUE and GOAL_POSITION."""

    @abstractmethod
    def _own_limits(self) -> NDArray[np.int64]:
        """The limits that are stored in the servos: (motors, 2) [counts]."""

    @abstractmethod
    def _read(self) -> None:
        """Read the servos' positions into `_counts` and their other values into `_states`."""

    @abstractmethod
    def _send(self, counts: NDArray[np.int64], rates: Array) -> None:
        """Send goal positions to all servos at once, with the rates [counts/s] to go there; 0: full speed."""

    @abstractmethod
    def _faults(self, number: int) -> list[str]:
        """The faults in a servo's last answer."""

    @abstractmethod
    def _servo_report(self, number: int) -> dict[str, Any]:
        """The fields of a servo's last state: load_percent, voltage, temperature."""


def _report_progress(progress: Progress, elapsed: float, total: float, t: float) -> None:
    progress(elapsed + t, total)
