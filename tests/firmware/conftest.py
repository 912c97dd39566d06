"""The emulated board in real time; and what is compiled once for all tests of that board itself."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from emulator import EmulatedBoard, compile_program
from probing import PROBE


@pytest.fixture
def board() -> Iterator[EmulatedBoard]:
    with EmulatedBoard() as emulated:
        yield emulated


@pytest.fixture(scope="session")
def programs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("probe")


@pytest.fixture(scope="session")
def probe(programs: Path) -> Path:
    return compile_program(PROBE, "uno_cnc_shield", programs)
