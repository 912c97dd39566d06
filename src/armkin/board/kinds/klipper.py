"""Klipper, by the socket of its API server."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from armkin.board.backend.board import Board
from armkin.board.klipper.api import Api
from armkin.board.klipper.extra_axes import SOCKETS, axes_of, printer_cfg, settings_of
from armkin.board.klipper.klipper_machine import KlipperMachine, job
from armkin.board.ports import SIM, SocketPort, is_socket
from armkin.board_catalogue import ForeignBoard

if TYPE_CHECKING:
    from armkin.board.backend import Planned
    from armkin.board.ports import Port
    from armkin.motion.timing.trajectory import Trajectory

KIND = ForeignBoard("klipper", "stepper", "none", ("A", "B", "C", "D", "H", "I", "J", "K", "L"))


class KlipperBoard(Board):
    """Klipper, which drives an arm's steppers as extra axes."""

    hint = "it is a socket, as klippy.py -a names it"
    lacks: ClassVar = {
        "home": "armkin homes no joints through Klipper: put the arm in its home pose by hand, or by jog, and say so",
        "write_settings": "Klipper's settings stand in printer.cfg, which armkin does not write: setup prints it",
    }
    machine: KlipperMachine

    def check(self) -> None:
        """Raise UsageError if the arm's motors cannot be Klipper's axes."""
        axes_of(self.arm)

    def plan_trajectory(self, trajectory: Trajectory, start: NDArray[np.int64]) -> Planned:
        """A trajectory that starts at counts (motors,)."""
        return job(trajectory, start)

    def simulated(self) -> Port:
        """Klipper in this process, with the sections that the arm needs."""
        from armkin.board.sim.sim_klipper import Klipper

        return Klipper(settings_of(axes_of(self.arm)))

    def attach(self, port: Port, stop: Callable[[], bool]) -> KlipperMachine:
        """The arm on Klipper behind an open port."""
        return KlipperMachine(port, self.arm, stop)

    def replies(self, link: Port, stop: Callable[[], bool]) -> bool:
        """Whether Klipper tells its state. Raises LinkError if it does not."""
        return "state" in Api(link).ask("info")

    def open(self, name: str, baud: int | None = None, *, reset: bool = True) -> Port:
        """The socket of that name; a URL is a port of pyserial's, `sim` a Klipper in this process."""
        if name == SIM or "://" in name:
            return super().open(name, baud, reset=reset)
        return SocketPort(name)

    def likely(self) -> list[str]:
        """Names of the sockets that Klipper's installations use."""
        return [path for path in map(os.path.expanduser, SOCKETS) if is_socket(path)]

    @property
    def settings_file(self) -> str:
        """The sections that printer.cfg needs."""
        return printer_cfg(axes_of(self.arm))

    def settings(self) -> list[dict[str, Any]]:
        """Options of printer.cfg that are not as the robot file wants them."""
        return [
            {"setting": difference.setting, "found": difference.actual, "wanted": difference.expected}
            for difference in self.machine.setting_differences()
        ]


BOARD = KlipperBoard
