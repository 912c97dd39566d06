"""Boards with somebody else's firmware, one file a kind: what stands where our own has a configuration.

foreign.py  what all of them do: plan, find a port, jog, home, grip
grbl.py     GRBL, grblHAL, FluidNC
feetech.py  bus servos
klipper.py  Klipper
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from armkin.board.kinds.foreign import Foreign
from armkin.board_kinds import FOREIGN
from armkin.errors import UsageError
from armkin.motion.plan import rate_lines

if TYPE_CHECKING:
    from armkin.board.firmware.configuration import Configuration
    from armkin.model.arm import Arm

__all__ = ["Foreign", "board_of", "foreign"]


def board_of(arm: Arm, *, rehearsal: bool = False) -> Configuration | Foreign:
    """The arm's board: a foreign one, or one with armkin's firmware; rehearsal: see `configure`.

    Raises UsageError, naming what is missing, if the arm cannot be driven.
    """
    from armkin.board.firmware.configuration import configure

    return foreign(arm) or configure(arm, rehearsal=rehearsal)


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
    found = _class(board.kind)(arm, board)
    found.check()
    return found


def _class(kind: str) -> type[Foreign]:
    """The class of a kind of board; only the one that is asked for is imported."""
    if kind == "grbl":
        from armkin.board.kinds.grbl import GrblBoard

        return GrblBoard
    if kind == "klipper":
        from armkin.board.kinds.klipper import KlipperBoard

        return KlipperBoard
    if kind == "feetech":
        from armkin.board.kinds.feetech import ServoBusBoard

        return ServoBusBoard
    raise KeyError(kind)
