"""The kinds of boards, one file a kind, found by its name: what stands behind `board: {kind: ...}`.

A module has KIND, its data (`board_catalogue.ForeignBoard`), and BOARD, its class (`armkin.board.backend.board`);
boards with armkin's own firmware are rows of `board_catalogue.BOARDS`, and `firmware.py` serves them all. How to add
a kind, here or in a package of its own: CONTRIBUTING.md, "Add a board"; `klipper.py` is a good one to begin from.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from armkin import board_catalogue
from armkin.board_catalogue import BOARDS

if TYPE_CHECKING:
    from armkin.board.backend.board import Board
    from armkin.model.arm import Arm

__all__ = ["board_of"]


def board_of(arm: Arm, *, rehearsal: bool = False) -> Board:
    """The arm's board; rehearsal: for a plan or a simulated board.

    Raises UsageError, naming what is missing, if the arm cannot be driven.
    """
    kind = "firmware" if arm.board is None or arm.board.kind in BOARDS else arm.board.kind
    board: Board = board_catalogue.kind_module(kind).BOARD(arm, rehearsal=rehearsal)
    return board
