"""A port, or the arm behind it, by the port's name: a serial port, or a board in this process."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from armkin.board.firmware.machine import Machine
from armkin.board.firmware.session import StoppedError
from armkin.board.ports import BAUD, SIM, Port, SerialPort

if TYPE_CHECKING:
    from armkin.board.firmware.configuration import Configuration
    from armkin.hardware import Board
    from armkin.model.arm import Arm


def open_port(name: str, *, board: Board, baud: int = BAUD, paced: bool = False) -> Port:
    """Open a port by name: /dev/ttyACM0, COM3, socket://host:4000, sim.

    board: what `sim` pretends to be; paced: `sim` takes the time that a real board would. Raises LinkError with
    what to do.
    """
    if name == SIM:
        from armkin.board.sim.board import SimBoard
        from armkin.board.sim.port import PacedSimPort, SimPort

        return (PacedSimPort if paced else SimPort)(SimBoard(board))
    return SerialPort(name, baud)


@contextmanager
def open_machine(
    arm: Arm,
    configuration: Configuration,
    port: str,
    *,
    baud: int = BAUD,
    stop: Callable[[], bool] = lambda: False,
) -> Iterator[Machine]:
    """The arm on the board behind a port, given back at the end.

    stop: asked all the time; when it says yes, the arm is held, StoppedError raised, and the machine's
    `status` is that of the arm at rest.
    """
    link = open_port(port, board=configuration.board, baud=baud)
    try:
        machine = Machine(link, arm, configuration, stop)
        try:
            yield machine
        except StoppedError as error:
            if error.status is not None:
                machine.status = error.status
            raise
    finally:
        link.close()
