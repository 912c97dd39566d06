"""The emulated board's helpers are modules of `tests/firmware`; tests in a browser need one."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1] / "firmware"))

_NO_BROWSER = "needs chromium: install the packages of the README's apt-get line"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests in a browser run in one worker, which has all of them; without a browser they are skipped, and say why."""
    for item in items:
        used = vars(item.module).values() if isinstance(item, pytest.Function) else ()
        if not any(getattr(one, "__module__", None) == "browsing" for one in used):
            continue
        item.add_marker(pytest.mark.xdist_group("emulator"))
        if shutil.which("chromium") is None and shutil.which("chromium-browser") is None:
            item.add_marker(pytest.mark.skip(reason=_NO_BROWSER))
