"""How tests are shared out among workers: tests of a file that share what is dear to make stay with one.

Not by xdist's marks: with pytest 9.2 its workers do not name a test's group any more, so that each test was its own.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest
from xdist.scheduler import LoadScopeScheduling

_ROOT = Path(__file__).parents[1]
# helpers that start a browser, or compile the firmware or an exported arm; syntax trees of the whole package
_SHARED = re.compile(r"^(?:from|import) (?:browsing|emulator|measure|bare_host|exported|ast)\b", re.MULTILINE)


@cache
def together(path: Path) -> bool:
    """Whether one worker has all tests of a file."""
    return "firmware" in path.parts or bool(_SHARED.search(path.read_text("utf-8")))


class Distribution(LoadScopeScheduling):  # type: ignore[misc]  # xdist has no types
    """To a worker that is free goes the next test, or the next file whose tests stay together."""

    def _split_scope(self, nodeid: str) -> str:
        path = nodeid.split("::", 1)[0]
        return path if together(_ROOT / path) else nodeid


def mixed(slow: list[pytest.Item], quick: list[pytest.Item]) -> list[pytest.Item]:
    """The order in which tests are given away: long ones first, so that all workers end together.

    Between tests that compute stand, evenly, the files whose tests stay together: most of these wait for a board that
    keeps real time, and while one worker waits the others compute.
    """
    files: dict[Path, list[pytest.Item]] = {}
    for item in slow + quick:
        if together(item.path):
            files.setdefault(item.path, []).append(item)
    alone = [item for item in slow if item.path not in files]
    order: list[pytest.Item] = []
    for number, file in enumerate(files.values()):
        order += file + alone[number :: len(files)]
    return (order if files else alone) + [item for item in quick if item.path not in files]
