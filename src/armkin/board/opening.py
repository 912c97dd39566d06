"""The arm on a board of any kind, by the port's name."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from armkin.board.backend import StoppedError

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
    """The arm on the board behind a port, given back at the end; baud: by default the kind's own.

    stop: asked all the time; when it says yes, the arm is held and StoppedError raised.
    """
    link = board.open(port, baud, reset=reset)
    try:
        yield board.connect(link, stop)
    except StoppedError as error:
        board.stopped(error)
        raise
    finally:
        link.close()
