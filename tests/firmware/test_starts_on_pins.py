"""Paths that start elsewhere than the arm stands, by the command line, on the compiled firmware in the emulator."""

from __future__ import annotations

from pathlib import Path

import starts_on_pins
from emulator import EmulatedBoard

from simulated_starts import PATHS


def test_a_path_is_driven_where_it_is(tmp_path: Path) -> None:
    """Both reports of a false start: 67 mm off a circle, 36 mm off two lines; all: `tests/bench/bench_starts.py`."""
    with EmulatedBoard(trace=True) as board:
        for moves, place in zip(PATHS[:2], ((0, 90, -90), (8, 84, -80)), strict=True):
            found = starts_on_pins.send_path_from(board, tmp_path, moves, place)
            assert found.off_mm < 0.4
            assert found.begins_mm < 0.4
            assert found.rest == 0
