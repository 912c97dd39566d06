"""A page that is gone while the arm moves, in a real browser on the emulated board."""

from __future__ import annotations

import os
import signal
import time
import uuid
from contextlib import suppress
from pathlib import Path

import pytest
from browser_page import COUNTS, NO_PIXELS, launch_browser, type_target, wait_for_board, wait_until
from emulator import EmulatedBoard
from pins import net_steps, rests_within
from playwright.sync_api import Browser
from served_page import Elsewhere, run_teach


@pytest.mark.parametrize("how", ["its tab is closed", "its browser is killed"])
def test_a_page_that_is_gone_holds_the_arm(browser: Browser, how: str) -> None:
    """The board is asked by another page afterwards: the arm's position is known, and is that of the pins."""
    mark = f"--armkin-test={uuid.uuid4()}"
    # at 0.2 of real time: a busy computer notices the page's end late, and that is no time of the arm's
    with EmulatedBoard(speed=0.2) as board, run_teach("three_dof", "--port", board.port) as url:
        with launch_browser(browser.browser_type, NO_PIXELS, mark) as another:
            page = another.new_page()
            page.set_default_timeout(120_000)
            page.goto(url)
            page.wait_for_selector("html[data-ready]")
            wait_until(page, "document.querySelector('#standing').textContent.includes('position lost')")
            page.check("#consent")
            page.click("#assume")
            wait_for_board(page, "assume home: done")
            type_target(page, 390, 80, 300)
            page.fill("#speed", "5")
            page.click("#send")
            end = time.monotonic() + 60
            while net_steps(board)[1] > -500:
                assert time.monotonic() < end, page.inner_text("#standing") + page.inner_text("#trouble")
                time.sleep(0.01)
            if how == "its tab is closed":
                page.close()
            else:
                os.kill(process_with(mark), signal.SIGKILL)
            rests_within(board, 1.0)
        stopped = net_steps(board)
        assert COUNTS[1] + 500 < stopped[1] < -500  # far from where it was going
        state = Elsewhere(url).listen()
        assert (state["position"], state["pulses"]) == ("known", stopped)


def process_with(word: str) -> int:
    """Number of the process that was started with a word; of a child that is just being made it has the words, too."""
    parent_of = {}
    for folder in Path("/proc").iterdir():
        with suppress(OSError):  # it has ended meanwhile
            if folder.name.isdigit() and word.encode() in (folder / "cmdline").read_bytes().split(b"\0"):
                parent_of[folder.name] = (folder / "stat").read_text().rpartition(")")[2].split()[1]
    first = [number for number, parent in parent_of.items() if parent not in parent_of]
    assert len(first) == 1, parent_of
    return int(first[0])
