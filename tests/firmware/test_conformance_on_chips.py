"""Our firmware on the emulated chips passes the suite of every kind of board.

Samples: all of it is `tests/bench/bench_conformance.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import emulated_chips
import pytest
from emulator import PICO, EmulatedBoard

from armkin.board import conformance


@pytest.fixture(scope="module", params=["uno_cnc_shield", PICO])
def chip(request: pytest.FixtureRequest) -> Iterator[EmulatedBoard]:
    with EmulatedBoard(request.param, speed="step") as board:
        yield board


@pytest.mark.parametrize("case", conformance.CASES, ids=lambda case: case.__name__)
def test_the_firmware_conforms(chip: EmulatedBoard, case: Callable[..., None]) -> None:
    case(emulated_chips.starter_of(chip), 1 if chip.board == PICO else 2)
