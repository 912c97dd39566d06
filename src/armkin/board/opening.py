"""A port by its name: a serial port, or a board in this process."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armkin.board.ports import BAUD, SIM, Port, SerialPort

if TYPE_CHECKING:
    from armkin.hardware import Board


def open_port(name: str, *, board: Board, baud: int = BAUD) -> Port:
    """Open a port by name: /dev/ttyACM0, COM3, socket://host:4000, sim.

    board: what `sim` pretends to be. Raises LinkError with what to do.
    """
    if name == SIM:
        from armkin.board.sim.board import SimBoard
        from armkin.board.sim.port import SimPort

        return SimPort(SimBoard(board))
    return SerialPort(name, baud)
