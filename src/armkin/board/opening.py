"""A port, or the arm behind it, by the port's name: a serial port, or a board in this process."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from armkin.board.backend import Backend, StoppedError
from armkin.board.firmware.machine import Machine
from armkin.board.kinds import Foreign
from armkin.board.ports import BAUD, SIM, Port, SerialPort

if TYPE_CHECKING:
    from armkin.board.firmware.configuration import Configuration
    from armkin.board_kinds import Board
    from armkin.model.arm import Arm


def open_port(
    name: str,
    *,
    board: Board,
    baud: int = BAUD,
    paced: bool = False,
    switches: Switches | None = None,
    reset: bool = True,
) -> Port:
    """Open a port by name: /dev/ttyACM0, COM3, socket://host:4000, sim.

    board: what `sim` pretends to be; paced: `sim` takes the time that a real board would; switches: the levels
    of its limit inputs; reset: see `SerialPort`. Raises LinkError with what to do.
    """
    if name == SIM:
        from armkin.board.sim.board import SimBoard
        from armkin.board.sim.port import Paced, SimPort

        port = SimPort(SimBoard(board, switches))
        return Paced(port) if paced else port
    return SerialPort(name, baud, reset=reset)


Switches = Callable[[int, Sequence[int]], bool]  # number of an input, net steps of all axes -> level


@contextmanager
def open_backend(
    arm: Arm,
    board: Configuration | Foreign,
    port: str,
    *,
    baud: int | None = None,
    stop: Callable[[], bool] = lambda: False,
    reset: bool = True,
) -> Iterator[Backend]:
    """The arm on a board of any kind behind a port, given back at the end; baud: by default the kind's own."""
    if not isinstance(board, Foreign):
        with open_machine(arm, board, port, baud=baud or BAUD, stop=stop, reset=reset) as machine:
            yield machine
        return
    link = board.open(port, baud, reset=reset)
    try:
        yield board.machine(link, stop)
    finally:
        link.close()


@contextmanager
def open_machine(
    arm: Arm,
    configuration: Configuration,
    port: str,
    *,
    baud: int = BAUD,
    stop: Callable[[], bool] = lambda: False,
    reset: bool = True,
) -> Iterator[Machine]:
    """The arm on the board behind a port, given back at the end.

    stop: asked all the time; when it says yes, the arm is held, StoppedError raised, and the machine's
    `status` is that of the arm at rest.
    """
    from armkin.board.firmware.homing import switches

    link = open_port(port, board=configuration.board, baud=baud, switches=switches(arm, configuration), reset=reset)
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
