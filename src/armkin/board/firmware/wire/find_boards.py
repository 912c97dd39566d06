"""Finds the connected boards that answer, for commands without a port name."""

from collections.abc import Callable, Iterable

from armkin.board.firmware.wire.session import Session
from armkin.board.ports import BAUD, SerialPort, list_ports
from armkin.errors import LinkError


def answering_ports(
    number: int | None = None, baud: int = BAUD, stop: Callable[[], bool] = lambda: False, *, reset: bool = True
) -> list[str]:
    """Names of the ports behind which a board with armkin's firmware answers.

    number: the board number in INFO; None: any. Only ports that look like an Arduino and are free are opened. That
    resets most boards, which keep their position while the arm is at rest.
    """
    return [name for name in likely_ports() if _board_answers(name, number, baud, stop, reset)]


def likely_ports() -> Iterable[str]:
    """Names of the ports that look like an Arduino."""
    return [port.device for port in list_ports() if port.board]


def _board_answers(name: str, number: int | None, baud: int, stop: Callable[[], bool], reset: bool) -> bool:
    """Whether a board with armkin's firmware, of a kind's number or any, answers on a port."""
    try:
        link = SerialPort(name, baud, reset=reset)
    except LinkError:
        return False
    try:
        info = Session(link, stop).open()
    except LinkError:
        return False
    finally:
        link.close()
    return number is None or info.board == number
