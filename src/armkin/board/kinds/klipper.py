"""Klipper, by the socket of its API server."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armkin.board.kinds.foreign import Foreign
from armkin.board.klipper.api import Api
from armkin.board.klipper.axes import SOCKETS, axes_of, settings_of
from armkin.board.klipper.machine import KlipperMachine, job
from armkin.board.ports import SIM, SocketPort, is_socket
from armkin.errors import UsageError

if TYPE_CHECKING:
    from armkin.board.backend import Backend, Planned
    from armkin.board.ports import Port
    from armkin.motion.trajectory import Trajectory


class KlipperBoard(Foreign):
    """Klipper, which drives an arm's steppers as extra axes."""

    def check(self) -> None:
        """Raise UsageError if the arm's motors cannot be Klipper's axes."""
        axes_of(self.arm)

    def lay(self, trajectory: Trajectory, counts: NDArray[np.int64]) -> Planned:
        """A trajectory that starts at counts (motors,)."""
        return job(trajectory, counts)

    def simulated(self) -> Port:
        """Klipper in this process, with the sections that the arm needs."""
        from armkin.board.sim.klipper import Klipper

        return Klipper(settings_of(axes_of(self.arm)))

    def machine(self, port: Port, stop: Callable[[], bool]) -> KlipperMachine:
        """The arm on Klipper behind an open port."""
        return KlipperMachine(port, self.arm, stop)

    def replies(self, link: Port, stop: Callable[[], bool]) -> bool:
        """Whether Klipper tells its state. Raises LinkError if it does not."""
        return "state" in Api(link).ask("info")

    def home(self, machine: Backend) -> None:
        """Raise UsageError: extra axes have no homing cycle."""
        raise UsageError(
            "armkin homes no joints through Klipper: put the arm in its home pose by hand, or by jog, and say so"
        )

    def open(self, name: str, baud: int | None = None, *, reset: bool = True) -> Port:
        """The socket of that name; a URL is a port of pyserial's, `sim` a Klipper in this process."""
        if name == SIM or "://" in name:
            return super().open(name, baud, reset=reset)
        return SocketPort(name)

    def likely(self) -> list[str]:
        """Names of the sockets that Klipper's installations use."""
        return [path for path in map(os.path.expanduser, SOCKETS) if is_socket(path)]
