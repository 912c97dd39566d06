"""The jog of the tip, a gamepad and the live chart in a real browser."""

from __future__ import annotations

import re

from browsing import opened, until
from playwright.sync_api import Browser
from served import served

# A gamepad that the test holds: Chromium has none without a hand.
_PAD = """
window.pad = {id: 'Pad <b>1</b>', connected: true, mapping: 'standard', axes: [0, 0, 0, 0],
              buttons: Array.from({length: 17}, () => ({pressed: false}))};
navigator.getGamepads = () => [window.pad, null];
"""
# Answers to a jog that are late: the arm stops for want of signs of life before the page can say that it shall.
_LATE = """
const ask = window.fetch;
window.fetch = async (what, how) => {
  const answer = await ask(what, how);
  if (String(what).endsWith('/api/jog')) await new Promise((done) => setTimeout(done, 1000));
  return answer;
};
"""
_AT = "document.querySelector('#position').textContent"


def test_the_tip_is_jogged_by_a_button_and_by_a_gamepad_and_its_joints_are_charted(browser: Browser) -> None:
    with served(board="sim") as server, opened(browser, server.address, script=_PAD) as page:
        until(page, f"{_AT}.startsWith('It stands')")

        def joints() -> list[float]:
            return [float(x) for x in re.findall(r" (-?[\d.]+)(?:,|\.$)", page.text_content("#position") or "")]

        def jogs(*, ends: bool = False) -> None:
            sign = "!" if ends else ""
            until(page, f"{sign}document.querySelector('#standing').textContent.startsWith('jog')")

        page.fill("#jog-speed", "10")
        groups = page.locator("#jog-joint optgroup").all()
        assert [group.get_attribute("label") for group in groups] == ["Joints", "Tip, base axes", "Tip, tool axes"]
        page.select_option("#jog-joint", "base x")
        page.locator("#jog-down").focus()
        page.keyboard.down("Space")
        jogs()
        until(page, "document.querySelectorAll('#live polyline').length === 6")
        until(page, "document.querySelector('#live-keys').textContent.includes('apart')")
        until(page, f"!{_AT}.includes('q2 90.00')")
        page.keyboard.up("Space")
        jogs(ends=True)
        assert page.text_content("#trouble") == ""
        stands, stood = joints(), page.text_content("#position")
        assert stands[0] == 0  # along x, the first joint rests
        assert stands[1] > 90
        assert page.get_attribute("#live", "aria-label")

        # The gamepad is off until it is switched on, and moves nothing without a held shoulder button.
        page.evaluate("() => { pad.axes[1] = -1; pad.buttons[5].pressed = true; }")
        page.wait_for_timeout(300)
        assert joints() == stands
        page.evaluate("() => { pad.buttons[5].pressed = false; }")
        page.check("#gamepad")
        until(page, "document.querySelector('#pad').textContent.includes('hold a shoulder')")
        assert page.locator("#pad b").count() == 0  # its name is text
        page.wait_for_timeout(300)
        assert joints() == stands
        page.evaluate("() => { pad.buttons[5].pressed = true; }")
        jogs()
        until(page, f"{_AT} !== argument", stood)
        page.evaluate("() => { pad.buttons[5].pressed = false; }")
        jogs(ends=True)
        assert joints()[1] < stands[1]  # forwards again
        # STOP with the shoulder button still held: the jog does not begin again. On a busy computer the jog may end by
        # itself, for want of signs of life, before the request arrives.
        for _ in range(20):
            page.evaluate("() => { pad.buttons[1].pressed = false; pad.buttons[5].pressed = true; }")
            jogs()
            page.evaluate("() => { pad.buttons[1].pressed = true; }")
            jogs(ends=True)
            until(page, "document.querySelector('#arrived').textContent !== ''")
            if (page.text_content("#arrived") or "").startswith("stopped"):
                break
        stood = page.text_content("#position")
        page.wait_for_timeout(300)
        assert (page.text_content("#arrived") or "").startswith("stopped")
        assert page.text_content("#position") == stood


def test_a_jog_that_ended_before_the_page_could_end_it_stays_told(browser: Browser) -> None:
    with served(board="sim") as server, opened(browser, server.address, script=_LATE) as page:
        until(page, f"{_AT}.startsWith('It stands')")
        page.locator("#jog-up").focus()
        with page.expect_response("**/api/jog_end") as ending:
            page.keyboard.down("Space")
            until(page, "document.querySelector('#standing').textContent.startsWith('jog')")
            page.keyboard.up("Space")
            until(page, "document.querySelector('#arrived').textContent === 'jog: done'")
        assert ending.value.ok
        assert page.text_content("#arrived") == "jog: done"
