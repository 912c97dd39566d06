"""What is compiled once for all tests of the emulated board itself."""

from __future__ import annotations

from pathlib import Path

import pytest
from emulator import compile_program
from probing import PROBE


@pytest.fixture(scope="session")
def programs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("probe")


@pytest.fixture(scope="session")
def probe(programs: Path) -> Path:
    return compile_program(PROBE, "uno_cnc_shield", programs)
