"""An arm whose steppers Klipper drives.

Klipper plans on its host and tells what it has commanded; between host and boards it counts and checks every byte.
Where the arm stands is kept by Klipper itself: the axes are registered, and given their place, when somebody has
vouched for it, and a restart forgets both. Klipper obeys every program: a place is believed while it is the one that
armkin left, by a record beside the port's lock.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from armkin.board.backend.motion_start import why_impossible
from armkin.board.backend.position_record import Record
from armkin.board.backend.sent_positions import Job, braking_time
from armkin.board.backend.stepper_arm import StepperArm
from armkin.board.klipper import trajectory_to_g1_lines
from armkin.board.klipper.api import Api
from armkin.board.klipper.extra_axes import PIECE_TIME, Axis, OptionDifference, axes_of, differences
from armkin.errors import LinkError

if TYPE_CHECKING:
    from armkin.board.ports import Port
    from armkin.model.arm import Arm
    from armkin.motion.timing.trajectory import Trajectory

_CHUNK_LINES = 10  # lines in one request
_MAX_PENDING = 8  # requests, at most, that wait: Klipper answers when it has taken them
_SPARE_TIME = 0.75  # motion [s] sent ahead of what braking takes: Klipper drains a queue of less than 0.25 s
_MAX_COORDINATE = 1e9  # coordinate [units], at most, of a place that can be
_REST_TIMEOUT = 30.0  # time [s] until what was sent must be done


def job(trajectory: Trajectory, start: NDArray[np.int64]) -> Job:
    """A trajectory from counts `start` (motors,) on, for Klipper."""
    return Job(trajectory, start, trajectory_to_g1_lines.line_count(trajectory))


class KlipperMachine(StepperArm):
    """An arm behind the socket of Klipper's API server."""

    piece = PIECE_TIME
    differences = (
        "Klipper tells the position that it was commanded; a restart, a shutdown and motors switched off lose it",
        "a stop takes effect when Klipper has carried out what it holds, about a second later; M112 stops at once, "
        "and loses the position",
    )

    def __init__(self, port: Port, arm: Arm, stop: Callable[[], bool] = lambda: False) -> None:
        self.arm, self.port, self._stop = arm, port, stop
        self.axes = axes_of(arm)
        self.api = Api(port)
        info = self.api.ask("info")
        self.version, self.state = str(info.get("software_version", "")), str(info.get("state", ""))
        self._message = str(info.get("state_message", "")).partition("\n")[0]
        self._loss_reason, self._counts = "it was not read", np.zeros(len(self.axes), dtype=np.int64)
        self._record, self._marks = Record(port, arm), dict[str, str]()
        self.settings: dict[str, Any] = {}
        self._read()

    # Where it stands

    @property
    def loss_reason(self) -> str:
        """Why the position is lost, in words; empty while it is known."""
        return self._loss_reason

    def counts(self) -> tuple[int, ...]:
        """Counts of the arm's motors, as last read."""
        return tuple(int(count) for count in self._counts)

    def report(self) -> dict[str, Any]:
        """What `armkin status` tells besides the position."""
        return {"firmware": f"Klipper {self.version}", "state": self.state, "inputs": "", **super().report()}

    def setting_differences(self) -> list[OptionDifference]:
        """Options of printer.cfg that are not as the robot file wants them."""
        return differences(self.axes, self.settings)

    # Getting ready

    def _ready(self) -> None:
        """Read where the arm stands. Raises LinkError if printer.cfg or Klipper's state forbid a motion."""
        self._read()
        if self.state != "ready":
            raise LinkError(f"Klipper is not ready, it says {self.state}: {self._message}")
        if differences := self.setting_differences():
            count_text = f", and {len(differences) - 1} more" if len(differences) > 1 else ""
            raise LinkError(
                f"printer.cfg does not fit {self.arm.name}: {differences[0]}{count_text}; armkin setup prints it"
            )
        self._settle()

    def vouch(self, counts: Sequence[int]) -> None:
        """Take somebody's word that the motors stand at these counts: register the axes there, motors on."""
        self._record.forget()
        for axis, count in zip(self.axes, counts, strict=True):
            begin = f"MANUAL_STEPPER STEPPER={axis.section}"
            place = f"{begin} ENABLE=1 SET_POSITION={axis.at_home + count / axis.steps:.9f}"
            limits = f"LIMIT_VELOCITY={axis.max_speed * 1.001:.6f} LIMIT_ACCEL={axis.max_accel:.6f}"
            corner = f"INSTANTANEOUS_CORNER_VELOCITY={axis.corner:.6f}"
            self.api.run(f"{begin} GCODE_AXIS=\n{place}\n{begin} GCODE_AXIS={axis.letter} {limits} {corner}")
        if self._read_state() or self.counts() != tuple(counts):
            raise LinkError("Klipper did not take the arm's position: is it older than November 2025? Update it")
        self._record.write_position(self._marks, counts, [0] * len(counts))
        self._read()

    # Moving

    def plan_trajectory(self, trajectory: Trajectory, start: NDArray[np.int64]) -> Job:
        """A trajectory that starts at counts (motors,)."""
        return job(trajectory, start)

    def _carry_out(self, job: Job, report: Callable[[float], None]) -> bool:
        """Send a job's lines in their time, to the end of all that Klipper holds."""
        is_complete = self._follow(job, report)
        self._settle()
        if not self.loss_reason:
            self._record.write_position(self._marks, self.counts(), [0] * len(self.axes))
        return is_complete and not self._stop()

    def hold(self) -> None:
        """Wait until what was sent is done: Klipper takes nothing of it back."""
        self._settle()

    def _follow(self, job: Job, report: Callable[[float], None]) -> bool:
        """Send a job's lines a little ahead of their time; False if a stop was asked for and the arm brakes."""
        ramp = braking_time(job.trajectory)
        lines = trajectory_to_g1_lines.Lines(job, self.axes)
        source = iter(lines)
        self.api.run(trajectory_to_g1_lines.HEAD)
        start_time, is_stopping = self.port.now(), False
        while chunk := [line for _, line in zip(range(_CHUNK_LINES), source, strict=False)]:
            self.api.send("gcode/script", {"script": "\n".join(chunk)})
            send_time = start_time + lines.sent - _SPARE_TIME - ramp
            while self.api.count_waiting() > _MAX_PENDING or (not is_stopping and self.port.now() < send_time):
                if not is_stopping and self._stop():
                    is_stopping = True
                    lines.brake(ramp)
                self.api.pump(0.01)
                report(min(self.port.now() - start_time, job.duration))
                if self.port.now() - start_time > lines.sent + _REST_TIMEOUT:
                    raise LinkError(
                        f"Klipper on {self.port.name} has left {self.api.count_waiting()} requests unanswered"
                    )
        return not is_stopping

    def _settle(self) -> None:
        """Wait until all that Klipper holds is done, and read where the arm stands."""
        self.api.run("M400", _REST_TIMEOUT)
        self.api.count_waiting()
        self._read()

    def _explain(self, error: LinkError) -> LinkError:
        """The error, with where the arm has come to rest if Klipper still tells."""
        try:
            self._settle()
        except LinkError:
            try:
                self._read()
            except LinkError:
                return error
        shut = f"Klipper went into state {self.state} in the motion: {self._message}"
        return LinkError(f"{error if self.state == 'ready' else shut}\n{self.standing_text()}")

    def _read(self) -> None:
        """Read where the arm stands: known while that is where armkin left it."""
        reason = self._read_state() or self._record.differs(self._marks)
        self._loss_reason = (
            reason or self._record.moved_text(self.counts()) or why_impossible(self.arm, self.counts()) or ""
        )

    def _read_state(self) -> str:
        """Read Klipper's state, its configuration and its places; returns why these mean nothing, in words."""
        objects = self.api.query(
            webhooks=["state", "state_message"],
            configfile=["settings"],
            toolhead=["position"],
            gcode_move=["axis_map"],
            stepper_enable=["steppers"],
        )
        self.state = str(objects["webhooks"].get("state", self.state))
        self._message = str(objects["webhooks"].get("state_message", self._message)).partition("\n")[0]
        self.settings = _as_dict(objects["configfile"].get("settings"))
        letters = _as_dict(objects["gcode_move"].get("axis_map"))
        values = _axis_places(objects["toolhead"].get("position"), letters, self.axes)
        enable_states = _as_dict(objects["stepper_enable"].get("steppers"))
        disabled_axes = [
            axis.section for axis in self.axes if enable_states.get(f"manual_stepper {axis.section}") is not True
        ]
        if self.state != "ready":
            return f"Klipper is in state {self.state}: {self._message}"
        if values is None:
            return "Klipper does not tell the axes' places: it was restarted, or nobody has said where the arm stands"
        if disabled_axes:
            return f"motors are off: {', '.join(disabled_axes)}"
        self._marks = {f"axis {axis.letter}": f"number {letters[axis.letter]}" for axis in self.axes}
        steps = [(value - axis.at_home) * axis.steps for value, axis in zip(values, self.axes, strict=True)]
        self._counts = np.rint(steps).astype(np.int64)
        return ""


def _as_dict(value: object) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}


def _axis_places(position: object, places: dict[str, Any], axes: Sequence[Axis]) -> list[float] | None:
    """Where the axes stand in a coordinate, by the places of their letters in it; None if it does not tell all."""
    values = []
    for axis in axes:
        k = places.get(axis.letter)
        if not isinstance(position, list) or not isinstance(k, int) or not 0 <= k < len(position):
            return None
        value = position[k]
        if not isinstance(value, int | float) or not abs(value) < _MAX_COORDINATE:
            return None
        values.append(float(value))
    return values
