"""Its being here puts this folder on the import path: helpers such as `command_line` are modules in it."""

import sys
from pathlib import Path

import pytest

if sys.platform == "win32":  # no pseudo-terminals there, and no emulator
    _NEEDS = ("pty_board", "pty_port", "import pty", "import fcntl", "emulator")
    _FILES = Path(__file__).parent.rglob("test_*.py")
    collect_ignore = [str(path) for path in _FILES if any(word in path.read_text("utf-8") for word in _NEEDS)]


@pytest.fixture(autouse=True)
def _no_port_of_this_computer(monkeypatch: pytest.MonkeyPatch) -> None:
    """ARMKIN_PORT is somebody's arm."""
    monkeypatch.delenv("ARMKIN_PORT", raising=False)
