"""The emulated board's helpers are modules of `tests/firmware`; tests in a browser need one."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from types import ModuleType

import pytest
from browser_page import NO_PIXELS, chromium, launch_browser, open_page
from playwright.sync_api import Browser
from playwright.sync_api import Page as Tab
from served_page import Page, serve_robot

sys.path.append(str(Path(__file__).parents[1] / "firmware"))

_running = ExitStack()
_browsers: list[Browser] = []  # at most one


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests in a browser. Without one they fail, and say what to install."""
    for item in items:
        if isinstance(item, pytest.Function) and _needs_browser(item.module):
            item.add_marker(pytest.mark.browser)


@cache
def _needs_browser(module: ModuleType) -> bool:
    return any(getattr(value, "__module__", None) == "browser_page" for value in vars(module).values())


@pytest.fixture(scope="module")
def browser() -> Browser:
    """One for all tests in a row that need one, each page with a profile of its own. It draws no 3-D view."""
    if not _browsers:
        _browsers.append(_running.enter_context(chromium(NO_PIXELS)))
    return _browsers[0]


@pytest.fixture
def drawing_browser(browser: Browser) -> Iterator[Browser]:
    """For tests that look at the picture."""
    with launch_browser(browser.browser_type) as fresh_browser:
        yield fresh_browser


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(nextitem: pytest.Item | None) -> Iterator[None]:
    """The browser ends before a test that needs none: its event loop would meet others'."""
    try:
        yield
    finally:
        if nextitem is None or nextitem.get_closest_marker("browser") is None:
            _browsers.clear()
            _running.close()


@pytest.fixture(scope="module")
def tab(browser: Browser) -> Iterator[Tab]:
    """A page of three_dof without a board, for the tests of a file that begin at a target or a program of their own."""
    with serve_robot() as server, open_page(browser, server.address) as page:
        yield page


@pytest.fixture
def sim() -> Iterator[Page]:
    """A page in control of a simulated board at rest."""
    with serve_robot(board="sim") as server:
        page = Page(server)
        page.hear("control", lambda news: news["holder"] == "yours")
        page.idle()
        yield page
        page.close()
