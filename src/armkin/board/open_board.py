"""Opens the board of an arm, of any kind, by the name of its port."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from armkin.board.backend import StoppedError
from armkin.board.ports import LOG, with_log
from armkin.errors import ArmkinError

if TYPE_CHECKING:
    from armkin.board.backend import Backend
    from armkin.board.backend.board import Board


@contextmanager
def open_board(
    board: Board,
    port: str,
    *,
    baud: int | None = None,
    stop: Callable[[], bool] = lambda: False,
    reset: bool = True,
) -> Iterator[Backend]:
    """The arm on the board behind a port, which is closed at the end; baud: by default that of the kind.

    stop: called again and again; when it returns True, the arm is held and StoppedError is raised.
    """
    link = with_log(board.open(port, baud, reset=reset))
    try:
        LOG.info("%s opens %s as %s", board.arm.name, port, board.called)
        machine = board.connect(link, stop)
        _log_position("found", machine)
        yield machine
        _log_position("left", machine)
    except StoppedError as error:
        board.on_stopped(error)
        _log_position("stopped", board.machine)
        raise
    except ArmkinError as error:
        LOG.info("%s: %s", type(error).__name__, error.message)
        raise
    finally:
        link.close()


def _log_position(event: str, machine: Backend) -> None:
    LOG.info("%s: position %s, counts %s", event, machine.position(), list(machine.counts()))
