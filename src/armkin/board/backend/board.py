"""The base class of all kinds of boards, our own firmware's among them.

A kind is one class. Some methods need no port: they check whether the arm fits, convert a trajectory, or list ports
that may have such a board. The others drive the board once `connect` has been called. A method that only some kinds
have is a capability: callers ask for it by name (`can`, `require`) and never by the kind.

    board = board_of(arm)                    # UsageError if the arm cannot be driven
    machine = board.connect(board.open(name), stop)
    machine.prepare(); machine.run([machine.plan(machine.counts(), q)])     # Backend
    board.require("home"); board.home()                                        # capabilities: CAPABILITIES
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.board.backend.motion_start import check_jog, jog_motion
from armkin.board.backend.sent_positions import plan_targets
from armkin.board.ports import BAUD, SIM, SerialPort, list_ports
from armkin.errors import LinkError, UsageError
from armkin.motion.joint_moves import rate_lines
from armkin.motion.timing.trajectory import Trajectory

if TYPE_CHECKING:
    from armkin.board.backend import Backend, Planned, StoppedError
    from armkin.board.ports import Port
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm
    from armkin.robot_file.robot_keys import Gripper

StopRequested = Callable[[], bool]
JOG_PIECE = 0.3  # length [s] of one piece of a jog on a board that cannot extend a motion

CAPABILITIES = {
    "home": "find the limit switches",
    "grip": "move a gripper",
    "relax": "switch the motors off and read where the arm is moved by hand",
    "zero": "tell the counts that a drive's zero is made of",
    "calibration": "read LeRobot's calibration files",
    "settings": "compare its settings with the robot file",
    "write_settings": "write those that differ",
    "recall": "tell where a motion was held: only boards with armkin's firmware can go on with one",
}


class LostSteps(NamedTuple):
    """The error of the counts, as measured at a limit switch that was found again."""

    joint: str
    steps: int | None  # motor steps by which the counts were ahead of the arm; None: its position was unknown
    difference: float | None  # the same as joint travel [rad | mm]


class Gripped(NamedTuple):
    """The target of a gripper and the position where it came to rest, both in its drive's units."""

    position: float
    target: float
    unit: str  # deg, mm, or S of a spindle's output
    counts: int | None = None  # counts, on boards that count
    count_unit: str = ""
    measured: bool = False  # whether the position was measured, and may differ from the target


class Board(ABC):
    """An arm's board of some kind."""

    baud: ClassVar[int] = BAUD
    gripper_drive: ClassVar[str] = "none"  # kind of gripper drive that it moves
    gripper_taken: ClassVar[str] = "it moves none"  # the gripper that this kind moves, in an error text
    lacks: ClassVar[Mapping[str, str]] = {}  # missing capability: reason, for an error text
    hint: ClassVar[str] = "armkin ports lists them"  # how the user finds the names of its ports
    home_speed: ClassVar[float] = 1.0  # fraction of the joints' speeds on a move to the home pose
    machine: Backend  # set by connect
    stop: StopRequested

    def __init__(self, arm: Arm, *, rehearsal: bool = False) -> None:
        """Raises UsageError, with the missing keys, if the arm cannot be planned or driven.

        rehearsal: for a plan or a simulated board.
        """
        self.arm = arm
        if lines := rate_lines(arm):
            text = "\n  ".join([f"{arm.name}: motion needs rates; add to {arm.path or 'its file'}:", *lines])
            raise UsageError(text, robot_file=arm.path, lines_to_add=lines)
        self.check()

    # Methods that each kind defines

    @abstractmethod
    def check(self) -> None:
        """Raise UsageError if the arm's drives are not for this kind of board."""

    @abstractmethod
    def plan_trajectory(self, trajectory: Trajectory, start: NDArray[np.int64]) -> Planned:
        """A trajectory that starts at counts (motors,)."""

    @abstractmethod
    def simulated(self) -> Port:
        """A board of this kind in this process, set up for the arm, which stands at home."""

    @abstractmethod
    def attach(self, port: Port, stop: StopRequested) -> Backend:
        """The arm on the board behind an open port. Raises LinkError if no such board answers there."""

    @abstractmethod
    def replies(self, link: Port, stop: StopRequested) -> bool:
        """Whether such a board replies behind an open port. Raises LinkError, too, if none does."""

    # Methods that most kinds share

    @property
    def kind(self) -> str:
        """The kind's name, as in a robot file."""
        return self.arm.board.kind if self.arm.board is not None else "none"

    @property
    def called(self) -> str:
        """The kind in words."""
        return f"a {self.kind} board"

    @property
    def settings_file(self) -> str | None:
        """The text for the board's own configuration file, if it has one."""
        return None

    def plan(self, start: Sequence[int], targets: Array, speed: float = 1.0) -> Planned:
        """Moves from counts through joint targets (w, n) [rad | mm], stopping at each."""
        return self.plan_trajectory(*plan_targets(self.arm, start, targets, speed))

    def likely(self) -> list[str]:
        """Names of the ports where such a board may be: Arduinos, and the chips of ESP32s and adapters."""
        return [port.device for port in list_ports() if port.board or port.adapter]

    def open(self, name: str, baud: int | None = None, *, reset: bool = True) -> Port:
        """The port of that name; `sim`: a board of this kind in this process."""
        return self.simulated() if name == SIM else SerialPort(name, baud or self.baud, reset=reset)

    def answers(
        self, name: str, baud: int | None = None, stop: StopRequested = lambda: False, *, reset: bool = True
    ) -> bool:
        """Whether such a board answers at a port. Nothing moves."""
        with suppress(LinkError), closing(self.open(name, baud, reset=reset)) as link:
            return self.replies(link, stop)
        return False

    # Methods of a connected board

    def connect(self, port: Port, stop: StopRequested = lambda: False) -> Backend:
        """Connect the arm to the board behind an open port and set `machine`. Raises as `attach` does.

        stop: called again and again; when it returns True, the arm is held and StoppedError is raised.
        """
        self.stop = stop
        self.machine = self.attach(port, stop)
        return self.machine

    def begin_job(self) -> None:
        """Begin another job after one that ended or failed."""
        self.machine.refresh()

    def wait(self, until: float) -> bool:
        """Wait until a time of the port's clock; False if a stop was asked for before."""
        while self.machine.port.now() < until and not self.stop():
            self.machine.port.read(0.01)
        return not self.stop()

    def on_report(self) -> None:
        """Process the newest position report while the arm moves."""
        return

    def on_stopped(self, error: StoppedError) -> None:
        """Process the report of where the arm came to rest."""
        return

    @contextmanager
    def under_way(
        self, parts: Sequence[Planned], note: Any
    ) -> Iterator[tuple[Sequence[Planned], int, Callable[[float], None]]]:
        """The parts to carry out, the number of the first of them, and a function that takes the seconds done.

        note: the note from `recall` of a motion that is resumed; None: carry out all parts.
        """
        yield parts, 0, lambda seconds: None

    def adopt_robot_file(self) -> None:
        """Make the board accept the present robot file; the position that it had is lost."""
        return

    def go_home(self) -> None:
        """Move to the home pose from where the arm stands."""
        self.machine.prepare()
        self.machine.run([self.plan(self.machine.counts(), self.arm.home[None], self.home_speed)])

    def ready_to_jog(self, joint: int, rate: float) -> float:
        """Get ready to move one joint, and give the rate [rad/s | mm/s] at which it may move.

        Raises NoSolutionError if it would go farther outside its limits.
        """
        self.machine.prepare()
        check_jog(self.arm, self.machine.joints(), joint, rate)
        return rate

    def jog(self, joint: int, rate: float, seconds: float, goes_on: Callable[[], bool] | None = None) -> None:
        """Move one joint at a rate [rad/s | mm/s] for a time, at most to its limit.

        goes_on: called again and again; the motion ends when it returns False. Call `ready_to_jog` first.
        """
        arm, seconds_left = self.arm, seconds
        while seconds_left > 0 and (goes_on is None or goes_on()):
            piece_time = seconds_left if goes_on is None else min(JOG_PIECE, seconds_left)
            counts, present = self.machine.counts(), self.machine.joints()
            motion = jog_motion(arm, present, joint, rate, piece_time, refuse=seconds_left == seconds)
            if not motion.duration:
                return  # the joint stands at its limit, or before a keep-out
            self.machine.run([self.plan_trajectory(motion, np.array(counts))])
            seconds_left -= piece_time

    # Capabilities

    def can(self, capability: str) -> bool:
        """Whether this kind has a capability of CAPABILITIES."""
        return getattr(type(self), capability) is not getattr(Board, capability)

    def require(self, capability: str) -> None:
        """Raise UsageError, saying why, if this kind lacks a capability."""
        if not self.can(capability):
            raise UsageError(self.lacks.get(capability) or f"{self.called} does not {CAPABILITIES[capability]}")

    def check_home(self, joints: Sequence[str] = (), *, rest_at_home: bool = False) -> None:
        """Raise UsageError, before a port is opened, if the board cannot home this arm or these joints alone."""
        self.require("home")
        if unsupported := [*joints, *["rest at home"] * rest_at_home]:
            raise UsageError(f"boards of kind {self.kind} home all joints at once: leave {' '.join(unsupported)} out")

    def home(
        self,
        joints: Sequence[str] = (),
        announce: Callable[[str], None] = lambda name: None,
        *,
        rest_at_home: bool = False,
    ) -> list[LostSteps] | None:
        """Find the limit switches of joints, by default of all; returns the errors of the counts, if measured.

        rest_at_home: the operator states that joints without a switch stand in their home pose.
        """
        self.require("home")
        raise NotImplementedError

    def gripper(self) -> Gripper:
        """The arm's gripper. Raises UsageError if it has none that this kind of board moves."""
        gripper = self.arm.gripper
        if gripper is None or gripper.kind != self.gripper_drive:
            raise UsageError(
                f"{self.arm.name} has no gripper that a board of kind {self.kind} moves; {self.gripper_taken}"
            )
        return gripper

    def grip_value(self, value: str | float) -> float:
        """The target value of the gripper: open, closed, or a value between them. Raises UsageError for others."""
        gripper = self.gripper()
        target = {"open": gripper.open, "closed": gripper.closed}[value] if isinstance(value, str) else value
        gripper.check_value(target)
        return target

    def check_grip(self, value: str | float) -> None:
        """Raise UsageError if the arm has no gripper, or the value is out of its range."""
        self.grip_value(value)

    def grip_known(self) -> bool:
        """Whether the gripper's position is known, so that it may move."""
        return True

    def grip(self, value: str | float, assume: str | float | None = None) -> Gripped:
        """Move the gripper, and return where it comes to rest; assume: the position of a lost gripper."""
        self.gripper()
        self.require("grip")
        raise NotImplementedError

    def relax(self) -> None:
        """Switch the motors off, so that the arm can be moved by hand, and falls if nobody holds it."""
        self.require("relax")

    def zero(self, gripper: float | None) -> tuple[list[int], tuple[int, int] | None]:
        """Counts of the motors, and the gripper's count with its `zero` if it stands at the value `gripper`."""
        self.require("zero")
        raise NotImplementedError

    def calibration(self, path: str, pose: Array | None) -> Any:
        """Read another program's calibration file for the arm; pose: (n,) in the middle of all ranges."""
        self.require("calibration")

    def settings(self) -> list[dict[str, Any]]:
        """Settings that differ from the robot file, as JSON: setting, found, wanted, ..."""
        self.require("settings")
        raise NotImplementedError

    def write_settings(self) -> None:
        """Write the settings that differ, and read them back; the board loses its position."""
        self.require("write_settings")

    def recall(self) -> Any:
        """The note of the motion that was held on this board: `start`, the counts where it began.

        Raises UsageError if there is none, LinkError if the arm has moved since.
        """
        self.require("recall")
