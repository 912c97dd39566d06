"""A board with armkin's own firmware."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armkin.board.backend.board import Board, Gripped, LostSteps
from armkin.board.firmware import gripping, homing, jogging, resume_after_hold
from armkin.board.firmware.configuration import configure
from armkin.board.firmware.firmware_machine import FirmwareMachine
from armkin.board.firmware.segments.trajectory_to_counts import Cut, cut_trajectory, plan_moves
from armkin.board.firmware.wire import find_boards
from armkin.board.firmware.wire.session import Session
from armkin.board.ports import BAUD, SIM, SerialPort
from armkin.errors import HomingIncompleteError
from armkin.model import units

if TYPE_CHECKING:
    from armkin import board_catalogue
    from armkin.board.backend import Planned, StoppedError
    from armkin.board.firmware.gripper_counts import Grip
    from armkin.board.ports import Port
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm
    from armkin.motion.timing.trajectory import Trajectory

Switches = Callable[[int, Sequence[int]], bool]  # number of an input, net steps of all axes -> level


def open_port(
    name: str,
    *,
    board: board_catalogue.Board,
    baud: int = BAUD,
    switches: Switches | None = None,
    reset: bool = True,
) -> Port:
    """Open a port by name: /dev/ttyACM0, COM3, socket://host:4000, sim.

    board: what `sim` pretends to be; switches: the levels of its limit inputs; reset: see `SerialPort`. Raises
    LinkError with what to do.
    """
    if name == SIM:
        from armkin.board.sim.sim_board import SimBoard
        from armkin.board.sim.sim_port import SimPort

        return SimPort(SimBoard(board, switches))
    return SerialPort(name, baud, reset=reset)


class FirmwareBoard(Board):
    """A board with armkin's firmware: `configuration` is what it must know of the arm."""

    home_speed = 0.25
    machine: FirmwareMachine

    def __init__(self, arm: Arm, *, rehearsal: bool = False) -> None:
        """Raises UsageError, naming all that is missing at once; rehearsal: see `configure`."""
        self.arm, self.configuration = arm, configure(arm, rehearsal=rehearsal)
        figures = self.configuration.board
        self._figures = {"clock": figures.clock, "min_interval": figures.min_interval}

    def check(self) -> None:
        """Nothing: `configure` has said all."""

    @property
    def kind(self) -> str:
        """The kind's name; in a rehearsal without a board that of one that could drive the arm."""
        return self.configuration.board.kind

    @property
    def called(self) -> str:
        """The kind in words."""
        return f"{'an' if self.kind[0] in 'aeiou' else 'a'} {self.kind}"

    def plan_trajectory(self, trajectory: Trajectory, start: NDArray[np.int64]) -> Planned:
        """A trajectory that starts at counts (motors,), refused if the board is too slow for it."""
        return cut_trajectory(trajectory, start, **self._figures)

    def plan(self, start: Sequence[int], targets: Array, speed: float = 1.0) -> Planned:
        """Moves from counts through joint targets (w, n) [rad | mm], stopping at each."""
        return plan_moves(self.arm, start, targets, speed=speed, **self._figures)

    def simulated(self) -> Port:
        """A board in this process; its switches are where the robot file says."""
        return self.open(SIM)

    def open(self, name: str, baud: int | None = None, *, reset: bool = True) -> Port:
        """The port of that name; `sim`: a board of this kind in this process."""
        levels = homing.switch_levels(self.arm, self.configuration)
        return open_port(name, board=self.configuration.board, baud=baud or self.baud, switches=levels, reset=reset)

    def attach(self, port: Port, stop: Callable[[], bool]) -> FirmwareMachine:
        """The arm on the board behind an open port."""
        machine = FirmwareMachine(port, self.arm, self.configuration, stop)
        self._figures = {"clock": machine.info.clock, "min_interval": machine.info.min_interval}
        return machine

    def likely(self) -> list[str]:
        """Names of the ports that look like an Arduino: most are reset by that, an arm that stands keeps its place."""
        return list(find_boards.likely_ports())

    def replies(self, link: Port, stop: Callable[[], bool]) -> bool:
        """Whether a board of this kind replies. Raises LinkError if none does."""
        return Session(link, stop).open().board == self.configuration.board.number

    # Connected

    def begin_job(self) -> None:
        """Begin a new session: what ended the last one is over."""
        self.connect(self.machine.port, self.stop)

    def on_report(self) -> None:
        """Take the newest status that has come while the arm moves."""
        self.machine.take_report()

    def adopt_robot_file(self) -> None:
        """Write the configuration if the board has another one: all positions are lost with it."""
        if not self.machine.configured:
            self.machine.configure()

    def on_stopped(self, error: StoppedError) -> None:
        """Take the status of the arm at rest."""
        if error.status is not None:
            self.machine.status = error.status

    @contextmanager
    def under_way(
        self, parts: Sequence[Planned], note: resume_after_hold.MotionNote | None
    ) -> Iterator[tuple[Sequence[Planned], int, Callable[[float], None]]]:
        """The parts to be carried out or, of a resumed motion, what is left of them."""
        with resume_after_hold.under_way(
            self.machine, [part for part in parts if isinstance(part, Cut)], note
        ) as what_is_left:
            yield what_is_left

    def recall(self) -> resume_after_hold.MotionNote:
        """The note of the motion that was held on this board."""
        return resume_after_hold.recall_note(self.machine)

    def ready_to_jog(self, joint: int, rate: float) -> float:
        """Have the motors on; while the position is lost a joint moves at an eighth of its max_speed at most."""
        jogging.prepare_jog(self.machine)
        top = float(self.arm.max_speed[joint]) / jogging.SLOW_DIVISOR
        allowed = float(np.clip(rate, -top, top)) if self.machine.position() == "lost" else rate
        jogging.count_rates(self.machine, joint, self._in_shown_units(joint, allowed))
        return allowed

    def jog(self, joint: int, rate: float, seconds: float, goes_on: Callable[[], bool] | None = None) -> None:
        """Move one joint [rad/s | mm/s] for a time; the board stops it at its limits, if it knows where it stands."""
        rates = jogging.count_rates(self.machine, joint, self._in_shown_units(joint, rate))
        free = jogging.free_seconds(self.machine, joint, rates)
        jogging.jog_motors(self.machine, rates, min(seconds, free), goes_on or (lambda: True))

    def _in_shown_units(self, joint: int, rate: float) -> float:
        return rate if self.arm.prismatic[joint] else rate / units.DEGREE

    # Homing

    def check_home(self, joints: Sequence[str] = (), *, rest_at_home: bool = False) -> None:
        """Raise UsageError that names the joint which has no homing."""
        homing.searches(self.arm, self.configuration, joints, rest_at_home=rest_at_home)

    def home(
        self,
        joints: Sequence[str] = (),
        announce: Callable[[str], None] = lambda name: None,
        *,
        rest_at_home: bool = False,
    ) -> list[LostSteps]:
        """Home joints, one after another. Raises HomingIncompleteError if others are still lost."""
        arm = self.arm
        steps = homing.home_joints(self.machine, joints, announce, rest_at_home=rest_at_home)
        if lost_joints := homing.lost_joints(self.machine):
            homed = [name for name in arm.joint_names if name not in lost_joints]
            raise HomingIncompleteError(
                f"homed {', '.join(homed) or 'nothing'}; the position of {', '.join(lost_joints)} is still lost",
                advice="home these joints, too, or home(..., rest_at_home=True) if they stand in their home pose",
                joints=lost_joints,
                homing=all(arm.homing[arm.joint_names.index(name)] for name in lost_joints),
                robot_file=arm.path,
            )
        return steps

    # The gripper

    def _gripper_counts(self) -> Grip:
        return gripping.gripper_of(self.arm.name, self.configuration)

    def grip_value(self, value: str | float) -> float:
        """Where the gripper is to go, in its drive's units. Raises UsageError for what it cannot reach."""
        grip = self._gripper_counts()
        return grip.value(gripping.count_of(grip, value))

    def grip_known(self) -> bool:
        """Whether the board knows where the gripper stands; a simulated one begins open."""
        return self.machine.port.simulated or gripping.gripper_known(self.machine, self._gripper_counts())

    def grip(self, value: str | float, assume: str | float | None = None) -> Gripped:
        """Move the gripper; assume: where a lost one stands, a servo jumps there first."""
        grip = self._gripper_counts()
        target = gripping.count_of(grip, value)
        gripping.prepare_gripper(self.machine, grip, None if assume is None else gripping.count_of(grip, assume))
        position = gripping.move_gripper(self.machine, grip, target)
        units_of = "deg" if grip.drive.lead is None else "mm", "us" if grip.drive.kind == "servo" else "steps"
        return Gripped(grip.value(position), grip.value(target), units_of[0], position, units_of[1])


BOARD = FirmwareBoard
