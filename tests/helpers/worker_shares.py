"""How tests are shared out among workers: tests of a file that share what is dear to make stay with one.

Not by xdist's marks: with pytest 9.2 its workers do not name a test's group any more, so that each test was its own.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest
from xdist.scheduler import LoadScopeScheduling

_ROOT = Path(__file__).parents[2]
_BROWSER = re.compile(r"^(?:from|import) browser_page\b", re.MULTILINE)
# helpers that compile the firmware, or an exported arm; a cluster; an installed kind; syntax trees of the whole package
_HELPERS = "emulator|measure|bare_host|exported_c|cluster_kills|emulated_kinds|ast"
_SHARED = re.compile(rf"^(?:from|import) (?:{_HELPERS})\b", re.MULTILINE)


@cache
def sharing_group(path: Path) -> str | None:
    """The name of those tests, this file's among them, that one worker has all of: all in a browser, or a file's."""
    text = path.read_text("utf-8")
    if _BROWSER.search(text):
        return "browser"
    return str(path) if "firmware" in path.parts or _SHARED.search(text) else None


class Distribution(LoadScopeScheduling):  # type: ignore[misc]  # xdist has no types
    """To a worker that is free goes the next test, or the next tests that stay together."""

    def _split_scope(self, nodeid: str) -> str:
        return sharing_group(_ROOT / nodeid.split("::", 1)[0]) or nodeid


def mix_order(slow: list[pytest.Item], quick: list[pytest.Item]) -> list[pytest.Item]:
    """The order in which tests are given away: long ones first, so that all workers end together.

    Those in a browser begin: they take longest. Between tests that compute stand, evenly, the files whose tests stay
    together: most of these wait for a board that keeps real time, and while one worker waits the others compute.
    """
    groups: dict[str, list[pytest.Item]] = {"browser": []}
    for item in slow + quick:
        if name := sharing_group(item.path):
            groups.setdefault(name, []).append(item)
    alone = [item for item in slow if not sharing_group(item.path)]
    order: list[pytest.Item] = []
    for number, group in enumerate(groups.values()):
        order += group + alone[number :: len(groups)]
    return order + [item for item in quick if not sharing_group(item.path)]
