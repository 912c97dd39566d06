"""A simulated board that is taken for a real one: it outlives each command, and its time is not the clock's."""

from __future__ import annotations

import pytest

from armkin.board.sim.sim_board import SimBoard
from armkin.board.sim.sim_port import SimPort


class Wire(SimPort):
    """A port that is not said to be simulated."""

    simulated = False


def plug_in(board: SimBoard, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever port is asked for, the board is behind it."""
    monkeypatch.setattr("armkin.board.kinds.firmware.open_port", lambda name, **_: Wire(board, name))
