"""The whole way through the page by mouse: from a lost position to a program on the pins of the emulated board."""

from __future__ import annotations

import time

from browser_page import (
    COUNTS,
    box_values,
    hold_jog,
    open_page,
    type_target,
    wait_for_answers,
    wait_for_board,
    wait_until,
)
from emulator import EmulatedBoard
from pins import net_steps
from playwright.sync_api import Browser, Page
from served_page import run_teach

from command_line import run


def carried_out(page: Page, button: str, job: str) -> None:
    """Press a button until the board has done what it says.

    A computer that gives armkin no time for half a second has the firmware hold the arm: one presses again.
    """
    for _ in range(3):
        page.click(button)
        has_arrived = "document.querySelector('#arrived').textContent.includes(argument)"
        wait_until(page, f"{has_arrived} || document.querySelector('#trouble').textContent", f"{job}: done")
        if "half a second" not in page.inner_text("#trouble"):
            break
    wait_for_board(page, f"{job}: done")


def test_the_whole_flow_by_mouse_on_the_firmware(browser: Browser) -> None:
    with EmulatedBoard() as board, run_teach("three_dof", "--port", board.port) as url, open_page(browser, url) as page:
        wait_until(page, "document.querySelector('#standing').textContent.includes('position lost')")
        # Choose a branch of a target; the pulses are the command line's.
        type_target(page, 390, 80, 300)
        page.get_by_role("radio", name="left, elbow down").click()
        wait_for_answers(page)
        answer = run("ik", "robots/three_dof.yaml", 390, 80, 300, "--branch", "left, elbow down", "--json").json
        assert box_values(page, "#sliders input[type=number]") == [round(q, 4) for q in answer["branches"][0]["joints"]]
        page.get_by_role("radio", name="left, elbow up").click()
        wait_for_answers(page)
        assert page.locator("#motors tbody td:nth-child(2)").all_inner_texts() == list(map(str, COUNTS))
        # A lost position is not sent from; home is assumed only after it was said to be home.
        page.click("#send")
        wait_until(page, "document.querySelector('#trouble').textContent.includes('position is lost')")
        assert page.is_disabled("#assume")
        page.check("#consent")
        page.click("#assume")
        wait_for_board(page, "assume home: done")
        assert net_steps(board) == [0, 0, 0]
        carried_out(page, "#send", "send")
        assert net_steps(board) == COUNTS
        assert "q1 10.15, q2 44.66, q3 -46.53" in page.inner_text("#position")
        # STOP on the way home: the position stays known.
        page.get_by_role("button", name="home", exact=True).click()
        page.fill("#speed", "5")
        page.click("#send")
        wait_until(page, "document.querySelector('#standing').textContent.startsWith('send')")
        end = time.monotonic() + 60
        while net_steps(board)[1] < COUNTS[1] + 200:
            assert time.monotonic() < end, page.inner_text("#standing") + page.inner_text("#trouble")
            page.wait_for_timeout(20)
        page.click("#stop")
        wait_for_board(page, "stopped")
        counts = net_steps(board)
        assert "position known" in page.inner_text("#standing")
        assert counts != COUNTS
        # Jog as long as the button is held.
        before = net_steps(board)
        page.select_option("#jog-joint", label="q1")

        def press() -> None:
            page.hover("#jog-up")  # anew each time: where a bar goes, it moves up
            page.mouse.down()

        hold_jog(page, press, page.mouse.up, lambda: net_steps(board)[0] > before[0] + 50)
        page.mouse.up()
        wait_for_board(page, "jog: done")
        after = net_steps(board)
        assert after[0] > before[0] + 50
        assert after[1:] == before[1:]
        board.wait(0.3)
        assert net_steps(board) == after
        # A program of two moves, carried out.
        page.get_by_role("button", name="home", exact=True).click()
        page.click("#record")
        page.wait_for_selector("#name-0")
        type_target(page, 390, 80, 300)
        page.click("#record")
        page.wait_for_selector("#name-1")
        page.fill("#speed", "100")
        carried_out(page, "#run", "run")
        assert net_steps(board) == COUNTS
