"""Keep-outs on the page: bodies that hit are red, so is the place on a program's way, and Send is refused in words."""

from __future__ import annotations

import pytest
from browser_page import open_page, type_target, wait_for_answers, wait_until
from playwright.sync_api import Browser
from served_page import serve_actions

import armkin
from armkin.teach.actions import Actions
from command_line import ROOT

HIT = [0.0, 0.0, -45.0]  # q3 is in the table


@pytest.fixture
def arm() -> armkin.Arm:
    return armkin.load("three_dof", scene=ROOT / "examples/scenes/three_dof.yaml")


def test_a_hit_is_red_and_send_says_why_not(arm: armkin.Arm, browser: Browser) -> None:
    with serve_actions(Actions(arm, "sim")) as server, open_page(browser, server.address) as page:
        red = "document.getElementById('canvas').dataset.red"
        assert page.evaluate(red) == ""
        for joint, value in enumerate(HIT):
            page.fill(f"#box-{joint}", str(value))
            page.press(f"#box-{joint}", "Enter")
            wait_for_answers(page)
        wait_until(page, f"{red} === '3'")
        assert "it hits table by 47.5 mm (q3)" in page.inner_text("#outside")
        before = server.actions.board.thread.state()["pulses"]  # type: ignore[union-attr]
        page.click("#send")
        wait_until(page, "document.getElementById('trouble').innerText.includes('q3 would hit table')")
        assert server.actions.board.thread.state()["pulses"] == before  # type: ignore[union-attr]
        # A program whose line goes through the table.
        type_target(page, 300, 280, 200)
        page.click("#record")
        type_target(page, 380, 0, 30)
        page.select_option("#kind", "line")
        page.click("#record")
        wait_until(page, "document.getElementById('canvas').dataset.hit")
        assert "table" in page.inner_text("#planned")
        assert page.get_attribute("#planned", "class") == "bad"


def test_a_program_that_hits_something_tells_where(arm: armkin.Arm) -> None:
    actions = Actions(arm)
    program_actions = actions.program_actions
    program_actions.program.edit({"do": "record", "kind": "joint", "q": [80.0, 10.0, -45.0]})
    program_actions.program.edit({"do": "record", "kind": "joint", "q": [-80.0, 10.0, -45.0]})
    answer = program_actions.plan(None, {})  # type: ignore[arg-type]
    assert "would hit table" in answer["refused"]
    assert len(answer["tips"]) > 10  # the way is shown, the place on it
    tip = min(sum((a - b) ** 2 for a, b in zip(answer["hit"], shown_tip, strict=True)) for shown_tip in answer["tips"])
    assert tip**0.5 < 20
    assert actions._open()["scene"]["obstacles"]
