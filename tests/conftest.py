"""Its being here puts this folder on the import path: helpers such as `command_line` are modules in it."""

import pytest


@pytest.fixture(autouse=True)
def _no_port_of_this_computer(monkeypatch: pytest.MonkeyPatch) -> None:
    """ARMKIN_PORT is somebody's arm."""
    monkeypatch.delenv("ARMKIN_PORT", raising=False)
