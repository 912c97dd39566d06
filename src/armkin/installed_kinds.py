"""Which kinds of boards with other firmware are installed: those of armkin, one file each, and of other packages.

A module of a kind has KIND, its data (`board_kinds.ForeignBoard`), and BOARD, its class (`armkin.board.backend.board`).
Another package offers one as an entry point of the group `armkin.boards`, looked up when a file names a kind that
armkin has not.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from pkgutil import iter_modules
from typing import Any

from armkin.board_kinds import BOARDS, ForeignBoard

GROUP = "armkin.boards"
_KINDS = "armkin.board.kinds"  # above this room: found by name, as other packages are
_FIRMWARE = "firmware"  # the module of all of BOARDS


@cache
def own_kinds() -> tuple[str, ...]:
    """Names of armkin's own kinds, as in a robot file: firmware's boards, then others."""
    folder = import_module(_KINDS).__path__
    return (*BOARDS, *sorted(name for _, name, _ in iter_modules(folder) if name != _FIRMWARE))


@cache
def _offered() -> dict[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=GROUP) if point.name not in own_kinds()}


def names() -> tuple[str, ...]:
    """Names of all kinds that are installed."""
    return (*own_kinds(), *sorted(_offered()))


def exists(kind: str) -> bool:
    """Whether a kind is installed; other packages are asked only for what armkin has not."""
    return kind in own_kinds() or kind in _offered()


def module(kind: str) -> Any:
    """The module of a kind with other firmware; `firmware`: of armkin's own."""
    ours = kind == _FIRMWARE or kind in own_kinds()
    return import_module(f"{_KINDS}.{kind}") if ours else _offered()[kind].load()


def foreign(kind: str) -> ForeignBoard | None:
    """The data of a kind with other firmware; None for armkin's own, and for what is not installed."""
    if kind in BOARDS or not exists(kind):
        return None
    found: ForeignBoard = module(kind).KIND
    return found
