"""The whole way through the page by mouse: from a lost position to a program on the pins of the emulated board."""

from __future__ import annotations

import time

from browsing import COUNTS, aim, idle, jogged, opened, settled, until, values
from emulator import EmulatedBoard
from pins import net
from playwright.sync_api import Browser, Page
from served import teaching

from command_line import run


def carried_out(page: Page, button: str, job: str) -> None:
    """Press a button until the board has done what it says.

    A computer that gives armkin no time for half a second has the firmware hold the arm: one presses again.
    """
    for _ in range(3):
        page.click(button)
        has_arrived = "document.querySelector('#arrived').textContent.includes(argument)"
        until(page, f"{has_arrived} || document.querySelector('#trouble').textContent", f"{job}: done")
        if "half a second" not in page.inner_text("#trouble"):
            break
    idle(page, f"{job}: done")


def test_the_whole_flow_by_mouse_on_the_firmware(browser: Browser) -> None:
    with EmulatedBoard() as board, teaching("three_dof", "--port", board.port) as url, opened(browser, url) as page:
        until(page, "document.querySelector('#standing').textContent.includes('position lost')")
        # Choose a branch of a target; the pulses are the command line's.
        aim(page, 390, 80, 300)
        page.get_by_role("radio", name="left, elbow down").click()
        settled(page)
        answer = run("ik", "robots/three_dof.yaml", 390, 80, 300, "--branch", "left, elbow down", "--json").json
        assert values(page, "#sliders input[type=number]") == [round(q, 4) for q in answer["branches"][0]["joints"]]
        page.get_by_role("radio", name="left, elbow up").click()
        settled(page)
        assert page.locator("#motors tbody td:nth-child(2)").all_inner_texts() == list(map(str, COUNTS))
        # A lost position is not sent from; home is assumed only after it was said to be home.
        page.click("#send")
        until(page, "document.querySelector('#trouble').textContent.includes('position is lost')")
        assert page.is_disabled("#assume")
        page.check("#consent")
        page.click("#assume")
        idle(page, "assume home: done")
        assert net(board) == [0, 0, 0]
        carried_out(page, "#send", "send")
        assert net(board) == COUNTS
        assert "q1 10.15, q2 44.66, q3 -46.53" in page.inner_text("#position")
        # STOP on the way home: the position stays known.
        page.get_by_role("button", name="home", exact=True).click()
        page.fill("#speed", "5")
        page.click("#send")
        until(page, "document.querySelector('#standing').textContent.startsWith('send')")
        end = time.monotonic() + 60
        while net(board)[1] < COUNTS[1] + 200:
            assert time.monotonic() < end, page.inner_text("#standing") + page.inner_text("#trouble")
            page.wait_for_timeout(20)
        page.click("#stop")
        idle(page, "stopped")
        counts = net(board)
        assert "position known" in page.inner_text("#standing")
        assert counts != COUNTS
        # Jog as long as the button is held.
        before = net(board)
        page.select_option("#jog-joint", label="q1")

        def press() -> None:
            page.hover("#jog-up")  # anew each time: where a bar goes, it moves up
            page.mouse.down()

        jogged(page, press, page.mouse.up, lambda: net(board)[0] > before[0] + 50)
        page.mouse.up()
        idle(page, "jog: done")
        after = net(board)
        assert after[0] > before[0] + 50
        assert after[1:] == before[1:]
        board.wait(0.3)
        assert net(board) == after
        # A program of two moves, carried out.
        page.get_by_role("button", name="home", exact=True).click()
        page.click("#record")
        page.wait_for_selector("#name-0")
        aim(page, 390, 80, 300)
        page.click("#record")
        page.wait_for_selector("#name-1")
        page.fill("#speed", "100")
        carried_out(page, "#run", "run")
        assert net(board) == COUNTS
