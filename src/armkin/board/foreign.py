"""Boards with somebody else's firmware: what stands where our own has a configuration."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armkin.board_kinds import FOREIGN, ForeignBoard
from armkin.errors import LinkError, UsageError
from armkin.model import units
from armkin.motion.plan import plan as plan_joints
from armkin.motion.plan import rate_lines
from armkin.motors import joints, pulses

if TYPE_CHECKING:
    from armkin.board.backend import Backend, Planned
    from armkin.board.feetech.machine import ServoMachine
    from armkin.board.grbl.machine import GrblMachine
    from armkin.board.klipper.machine import KlipperMachine
    from armkin.board.ports import Port
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm
    from armkin.motion.trajectory import Trajectory
    from armkin.robot_file.model import Gripper


@dataclass(frozen=True)
class Foreign:
    """An arm's board, of a kind that does not run armkin's firmware."""

    arm: Arm
    board: ForeignBoard

    def plan(self, start: Sequence[int], targets: Array, speed: float) -> Planned:
        """Moves from counts through joint targets (w, n) [rad | mm], stopping at each."""
        counts = np.asarray(start, dtype=np.int64)
        return self.lay(plan_joints(self.arm, joints(self.arm, counts), targets, speed=speed), counts)

    def lay(self, trajectory: Trajectory, counts: NDArray[np.int64]) -> Planned:
        """A trajectory that starts at counts (motors,)."""
        if self.board.kind == "grbl":
            from armkin.board.grbl.gcode import job

            return job(trajectory, counts)
        if self.board.kind == "klipper":
            from armkin.board.klipper.machine import job as timed

            return timed(trajectory, counts)
        from armkin.board.feetech.machine import job as positions

        return positions(trajectory, counts)

    def simulated(self) -> Port:
        """A board of this kind in this process, set up for the arm, which stands at home."""
        home = pulses(self.arm, self.arm.home).tolist()
        if self.board.kind == "grbl":
            from armkin.board.grbl.axes import axes_of
            from armkin.board.grbl.settings import wanted
            from armkin.board.sim.grbl import Grbl

            axes = axes_of(self.arm)
            settings = {number: value for number, (_, value) in wanted(axes).items()}
            count = max(axis.index for axis in axes) + 1
            return Grbl(axes=count, settings=settings, ends=dict.fromkeys(range(count), 0))
        if self.board.kind == "klipper":
            from armkin.board.klipper.axes import axes_of as extra
            from armkin.board.klipper.axes import settings_of
            from armkin.board.sim.klipper import Klipper

            return Klipper(settings_of(extra(self.arm)))
        from armkin.board.feetech.machine import servo_ids
        from armkin.board.sim.servo_bus import Servo, ServoBus

        servos = [Servo(number, at) for number, at in zip(servo_ids(self.arm), home, strict=True)]
        gripper = self.arm.gripper
        if gripper is not None and gripper.id is not None:
            servos.append(Servo(gripper.id))
        return ServoBus(servos)

    def home(self, machine: Backend) -> None:
        """Find the limit switches by the board's own cycle.

        Raises UsageError, before anything moves, for a bus, which needs none, for Klipper, and for joints without
        `homing` or whose switch is that of no single motor.
        """
        from armkin.board.grbl.machine import GrblMachine

        arm = self.arm
        if self.board.kind == "klipper":
            raise UsageError(
                "armkin homes no joints through Klipper: put the arm in its home pose by hand, or by jog, and say so"
            )
        if not isinstance(machine, GrblMachine):
            raise UsageError("bus servos know their position: there is nothing to home")
        lacks = [name for name, homing in zip(arm.joint_names, arm.homing, strict=True) if homing is None]
        if lacks:
            raise UsageError(f"joints without homing: {', '.join(lacks)}; GRBL homes all axes or none")
        if np.count_nonzero(arm.motor_gain) != arm.n:
            raise UsageError("GRBL homes motors, not joints: this arm's motors turn several joints at once")
        at = units.joints_in(arm, [homing.at for homing in arm.homing if homing is not None])
        machine.home(pulses(arm, at).tolist())

    def go_home(self, machine: Backend) -> None:
        """Move to the home pose from where the arm stands."""
        machine.prepare()
        machine.run([self.plan(machine.counts(), self.arm.home[None], 1.0)])

    def gripper(self) -> Gripper:
        """The arm's gripper. Raises UsageError if it has none that this kind of board moves."""
        gripper, board = self.arm.gripper, self.board
        if gripper is None or gripper.kind != board.gripper:
            takes = {
                "spindle": "it takes gripper: {kind: spindle, open: 0, closed: 200}, S words of M3",
                "bus": "it takes gripper: {kind: bus, id: 6, ...}",
                "none": "it moves none",
            }
            raise UsageError(
                f"{self.arm.name} has no gripper that a board of kind {board.kind} moves; {takes[board.gripper]}"
            )
        return gripper

    def grip_value(self, value: str | float) -> float:
        """Where the gripper is to go: open, closed, or a value between them. Raises UsageError for others."""
        gripper = self.gripper()
        low, high = sorted((gripper.open, gripper.closed))
        wanted = {"open": gripper.open, "closed": gripper.closed}[value] if isinstance(value, str) else value
        if not low <= wanted <= high:
            raise UsageError(f"grip: {wanted:g} is outside of the gripper's {low:g} to {high:g}")
        return wanted

    def grip(self, machine: Backend, value: float) -> float:
        """Move the gripper, and return where it comes to rest; of GRBL, which measures nothing, what was sent."""
        from armkin.board.feetech.machine import ServoMachine
        from armkin.board.grbl.machine import GrblMachine

        assert isinstance(machine, GrblMachine | ServoMachine)
        return machine.grip(self.gripper(), self.grip_value(value))

    def answers(
        self, name: str, baud: int | None = None, stop: Callable[[], bool] = lambda: False, *, reset: bool = True
    ) -> bool:
        """Whether such a board answers at a port: GRBL and Klipper to a question, every servo of the arm to its id."""
        try:
            link = self.open(name, baud, reset=reset)
        except LinkError:
            return False
        try:
            if self.board.kind == "grbl":
                from armkin.board.grbl.session import Session

                Session(link).open()
                return True
            if self.board.kind == "klipper":
                from armkin.board.klipper.api import Api

                return "state" in Api(link).ask("info")
            from armkin.board.feetech import registers
            from armkin.board.feetech.bus import Bus
            from armkin.board.feetech.machine import servo_ids

            bus = Bus(link)
            for number in servo_ids(self.arm):
                bus.read(number, registers.MODEL)  # asks until it is answered, LinkError if it is not
            return not stop()
        except LinkError:
            return False
        finally:
            link.close()

    def open(self, name: str, baud: int | None = None, *, reset: bool = True) -> Port:
        """The port of that name; `sim`: a board of this kind in this process."""
        from armkin.board.ports import SIM, SerialPort, SocketPort

        if name == SIM:
            return self.simulated()
        if self.board.kind == "klipper" and "://" not in name:
            return SocketPort(name)
        return SerialPort(name, baud or self.board.baud, reset=reset)

    def likely(self) -> list[str]:
        """Names of the ports where such a board may be."""
        if self.board.kind == "klipper":
            from armkin.board.klipper.axes import SOCKETS
            from armkin.board.ports import is_socket

            return [path for path in map(os.path.expanduser, SOCKETS) if is_socket(path)]
        from armkin.board.firmware.find_boards import others

        return list(others())

    def jog(self, machine: Backend, joint: int, rate: float, seconds: float) -> None:
        """Move one joint [rad/s | mm/s] for a time, from where it stands to its limit at most."""
        machine.prepare()
        arm, q = self.arm, machine.joints()
        goal = q.copy()
        goal[joint] += rate * seconds
        goal = np.clip(goal, arm.lower, arm.upper)  # whole steps may stand half a step outside
        share = float(abs(rate) / arm.max_speed[joint])
        machine.run([self.plan(machine.counts(), goal[None], min(share, 1.0))])

    def machine(self, port: Port, stop: Callable[[], bool]) -> GrblMachine | ServoMachine | KlipperMachine:
        """The arm on the board behind an open port."""
        if self.board.kind == "klipper":
            from armkin.board.klipper.machine import KlipperMachine

            return KlipperMachine(port, self.arm, stop)
        if self.board.kind == "grbl":
            from armkin.board.grbl.machine import GrblMachine

            return GrblMachine(port, self.arm, stop)
        from armkin.board.feetech.machine import ServoMachine

        return ServoMachine(port, self.arm, stop)


def foreign(arm: Arm) -> Foreign | None:
    """The arm's board if it is a foreign one.

    Raises UsageError, naming what is missing, if such an arm cannot be planned or driven.
    """
    settings = arm.board
    board = None if settings is None else FOREIGN.get(settings.kind)
    if board is None:
        return None
    lines = rate_lines(arm)
    if lines:
        raise UsageError(
            "".join(
                [f"{arm.name}: motion needs rates; add to {arm.path or 'its file'}:", *(f"\n  {x}" for x in lines)]
            ),
            robot_file=arm.path,
            lines_to_add=lines,
        )
    if board.kind == "grbl":
        from armkin.board.grbl.axes import axes_of

        axes_of(arm)
    elif board.kind == "klipper":
        from armkin.board.klipper.axes import axes_of as extra

        extra(arm)
    else:
        from armkin.board.feetech.machine import servo_ids

        servo_ids(arm)
    return Foreign(arm, board)
