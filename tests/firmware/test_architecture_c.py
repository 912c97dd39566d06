"""The layers of the firmware's core: no module reaches itself, errors return upward, no chip is named."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from emulator import FIRMWARE

INCLUDE = re.compile(r'^\s*#include "([^"]+)"', re.M)


def modules(folder: Path) -> dict[str, set[str]]:
    """What each module (X.h and X.c together) of a folder includes of the same folder."""
    out: dict[str, set[str]] = {}
    for file in sorted(folder.glob("*.[ch]")):
        names = {Path(name).stem for name in INCLUDE.findall(file.read_text())}
        out.setdefault(file.stem, set()).update(names)
    return {name: (uses & set(out)) - {name} for name, uses in out.items()}


def circle(uses: dict[str, set[str]]) -> list[str]:
    """Modules that reach themselves; empty if there are none."""
    left = dict(uses)
    while left:
        ready = [name for name, needs in left.items() if not needs & set(left)]
        if not ready:
            return sorted(left)
        for name in ready:
            del left[name]
    return []


@pytest.mark.parametrize("folder", ["src/core"])
def test_no_module_reaches_itself(folder: str) -> None:
    assert circle(modules(FIRMWARE / folder)) == []


def test_only_the_protocol_ends_sessions() -> None:
    for file in sorted((FIRMWARE / "src" / "core").glob("*.[ch]")):
        if file.stem != "protocol":
            assert "session" not in re.sub(r"//.*", "", file.read_text()), file.name


def test_the_core_knows_no_chip() -> None:
    for file in sorted((FIRMWARE / "src" / "core").glob("*.[ch]")):
        text = file.read_text()
        assert "__AVR__" not in text, file.name
        assert "avr/" not in text, file.name
        assert "16000000" not in text, file.name
