"""The arm follows the page only where a person drags or types, and only for the page that asked for it."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest
from browser_page import hold_jog, open_page, standing_text, wait_for_answers, wait_for_board, wait_until
from playwright.sync_api import Browser
from served_page import Page, serve_robot

from armkin.cli.commands import teach as command
from armkin.errors import LinkError

HOME = [0, 90, -90]
NEAR = [6, 90, -90]


@pytest.fixture
def following_page(sim: Page) -> Page:
    """A page that the arm follows: it has done so, and stands."""
    assert sim.act("follow", on=True) == (200, {"on": True})
    assert sim.act("look", q=NEAR, goal=True)[0] == 200
    assert sim.idle()["joints"] == pytest.approx(NEAR, abs=0.02)
    assert sim.state()["follows"]
    return sim


def is_at_rest(page: Page) -> bool:
    """Whether nothing moves the arm: the board has been looked at twice since."""
    before = page.idle()["pulses"]
    time.sleep(0.6)
    return bool(page.idle()["pulses"] == before)


ENDS: dict[str, dict[str, Any]] = {
    "send": {"q": NEAR, "speed": 100},
    "run": {"speed": 100},
    "jog": {"press": 1, "joint": 0, "percent": 50},
    "grip": {"value": "closed"},
    "assume_home": {"consent": True},
    "home": {},  # this arm has no switches: what is refused ends it, too
    "connect": {},
}


@pytest.mark.parametrize("name", ENDS)
def test_what_else_the_board_is_told_ends_following(following_page: Page, name: str) -> None:
    following_page.act(name, **ENDS[name])
    following_page.idle()
    assert not following_page.state()["follows"]
    following_page.act("look", q=[0, 80, -80], goal=True)
    assert is_at_rest(following_page)


def test_a_jog_that_ends_leaves_the_arm_there(following_page: Page) -> None:
    following_page.jog(lambda now: now["joints"][0] >= 12, joint=0, percent=50)
    following_page.let_go()
    following_page.idle()
    following_page.act("look", q=NEAR)  # as the page asks for its numbers when a job has ended
    assert is_at_rest(following_page)
    assert following_page.state()["joints"][0] > 12


def test_only_what_is_dragged_or_typed_is_a_goal(following_page: Page) -> None:
    following_page.act("look", q=NEAR, best=True)  # a setting
    following_page.act("plan")
    assert is_at_rest(following_page)
    assert following_page.state()["follows"]
    following_page.act("look", q=[40, 60, -60])  # the page shows another posture: a preview, a branch, a named pose
    assert is_at_rest(following_page)
    assert not following_page.state()["follows"]  # a drag from there would take the whole arm along


def test_a_take_over_ends_following(following_page: Page) -> None:
    watcher = Page(following_page.server)
    assert watcher.opened["board"]["follows"]
    assert watcher.act("take")[0] == 200
    assert watcher.hear("board", lambda state: not state["follows"])
    assert watcher.act("look", q=HOME, goal=True)[0] == 200
    assert is_at_rest(watcher)
    watcher.close()


def test_it_follows_the_page_that_switched_it_on_alone(following_page: Page) -> None:
    """A drag that is still being solved for while another page takes over and follows moves nothing."""
    board = following_page.server.actions.board
    assert board is not None
    watcher = Page(following_page.server)
    late = following_page.server.actions.tabs.find(following_page.id)
    assert watcher.act("take")[0] == 200
    assert watcher.act("follow", on=True) == (200, {"on": True})
    board.follow_pose(late, following_page.server.actions.arm.home)
    assert is_at_rest(watcher)
    watcher.close()


def test_a_line_that_breaks_ends_following(following_page: Page, monkeypatch: pytest.MonkeyPatch) -> None:
    board = following_page.server.actions.board
    assert board is not None

    def break_line() -> None:
        raise LinkError("unplugged")

    monkeypatch.setattr(board.thread.machine, "refresh", break_line)
    assert following_page.hear("board", lambda state: "unplugged" in state["error"])["follows"] is False
    following_page.act("look", q=HOME, goal=True)
    assert following_page.idle()["connected"] is False  # nothing has opened the port again, either


def test_a_lost_position_is_not_followed_from(sim: Page, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sim.server.actions, "standing_pulses", lambda: None)
    board = sim.server.actions.board
    assert board is not None
    monkeypatch.setattr(board.thread, "standing_pulses", lambda: None)
    status, answer = sim.act("follow", on=True)
    assert (status, "position" in answer["error"]) == (502, True)
    assert not sim.state()["follows"]


def test_the_page_s_follow(browser: Browser) -> None:
    with serve_robot(board="sim") as server, open_page(browser, server.address) as page:
        second_page = Page(server)
        stands = "document.querySelector('#position').textContent.includes(argument)"

        def follow() -> None:
            page.click("#follow")
            wait_until(
                page, "document.querySelector('#follow').checked && document.documentElement.dataset.asking === 'no'"
            )
            assert second_page.hear("board", lambda state: state["follows"])

        def drag(slider: int, value: float) -> None:
            page.locator("#sliders input[type=range]").nth(slider).fill(str(value))
            wait_for_answers(page)

        def wait_until_unfollowed() -> None:
            wait_until(page, "!document.querySelector('#follow').checked")

        def still(counts: object) -> bool:
            page.wait_for_timeout(500)
            return bool(server.actions.standing_pulses() == counts)

        # A drag is followed; what has been shown before it is not.
        page.fill("#box-1", "60")
        page.keyboard.press("Tab")
        wait_for_answers(page)
        follow()
        assert page.input_value("#box-1") == "90.0000"  # where the arm stands
        assert still((0, 0, 0))
        drag(0, 6)
        wait_until(page, stands, "q1 5.99")
        page.fill("#box-0", "3")
        page.keyboard.press("Tab")
        wait_until(page, stands, "q1 3.01")
        # A setting is no goal; a branch, a named pose, a preview and its pause end it.
        page.check("#best")
        wait_for_answers(page)
        assert page.is_checked("#follow")
        at = server.actions.standing_pulses()
        for button in ("#branch-0", "#branch-1"):
            page.click(button)
            wait_for_answers(page)
        wait_until_unfollowed()
        follow()
        page.get_by_role("button", name="home", exact=True).click()
        wait_for_answers(page)
        wait_until_unfollowed()
        drag(0, 110)  # so far that it plays for seconds
        page.click("#record")
        page.wait_for_selector("#player:not([hidden])")
        follow()
        page.click("#play")
        wait_until(page, "document.querySelector('#play').textContent === 'Pause'")
        wait_until_unfollowed()
        page.click("#play")
        wait_for_answers(page)
        assert still(at)
        # A jog ends it, and leaves the arm where the button was let go.
        follow()
        page.hover("#jog-up")
        hold_jog(page, page.mouse.down, page.mouse.up, lambda: standing_text(page).startswith("jog"))
        page.mouse.up()
        wait_for_board(page, "jog: done")
        wait_for_answers(page)
        wait_until_unfollowed()
        assert still(server.actions.standing_pulses())
        # A page that takes over has it off, and its own drag moves nothing.
        follow()
        assert second_page.act("take")[0] == 200
        wait_until_unfollowed()
        second_page.close()
        page.click("#take")
        wait_until(page, "!document.querySelector('#panels').inert")
        at = server.actions.standing_pulses()
        drag(0, 37.5)
        assert still(at)


def test_the_key_is_on_no_command_line(browser: Browser) -> None:
    """Every user of a machine sees the words that a program was started with, and a browser is one."""
    with serve_robot() as server:
        with command.redirection(server.address) as file:
            assert server.guard.key not in file
            path = Path(file.removeprefix("file://"))
            assert path.stat().st_mode & 0o077 == path.parent.stat().st_mode & 0o077 == 0
            assert server.guard.key in path.read_text()
            page = browser.new_page()
            page.goto(file)
            page.wait_for_selector("html[data-ready]")
            assert page.url == server.address
            page.close()
        assert not path.parent.exists()
