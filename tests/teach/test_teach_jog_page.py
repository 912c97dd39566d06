"""The jog of the tip, a gamepad and the live chart in a real browser."""

from __future__ import annotations

import re
from functools import partial

from browser_page import hold_jog, open_page, standing_text, wait_until
from playwright.sync_api import Browser
from served_page import serve_robot

# A gamepad that the test holds: Chromium has none without a hand.
_PAD = """
window.pad = {id: 'Pad <b>1</b>', connected: true, mapping: 'standard', axes: [0, 0, 0, 0],
              buttons: Array.from({length: 17}, () => ({pressed: false}))};
window.looked = 0;
navigator.getGamepads = () => {
  window.looked++;
  return [window.pad, null];
};
"""
# Signs of life that are a second late, counted.
_LATE = """
const ask = window.fetch;
[window.begun, window.answered] = [0, 0];
window.fetch = async (what, how) => {
  const late = String(what).endsWith('/api/jog_on');
  if (late) {
    window.begun++;
    await new Promise((done) => setTimeout(done, 1000));
  }
  const answer = await ask(what, how);
  if (late && answer.ok) window.answered++;
  return answer;
};
"""
_AT = "document.querySelector('#position').textContent"


def test_the_tip_is_jogged_by_a_button_and_by_a_gamepad_and_its_joints_are_charted(browser: Browser) -> None:
    with serve_robot(board="sim") as server, open_page(browser, server.address, script=_PAD) as page:
        wait_until(page, f"{_AT}.startsWith('It stands')")

        def joints() -> list[float]:
            return [float(x) for x in re.findall(r" (-?[\d.]+)(?:,|\.$)", page.text_content("#position") or "")]

        def jogs(*, ends: bool = False) -> None:
            sign = "!" if ends else ""
            wait_until(page, f"{sign}document.querySelector('#standing').textContent.startsWith('jog')")

        def wait_for_looks(times: int) -> None:
            """Until the page has looked at the gamepad: a busy one does so late."""
            wait_until(page, "looked >= argument", page.evaluate("looked") + times)

        page.fill("#jog-speed", "10")
        groups = page.locator("#jog-joint optgroup").all()
        assert [group.get_attribute("label") for group in groups] == ["Joints", "Tip, base axes", "Tip, tool axes"]
        page.select_option("#jog-joint", "base x")
        page.locator("#jog-down").focus()
        charted = (
            "document.querySelectorAll('#live polyline').length === 6 && "
            f"document.querySelector('#live-keys').textContent.includes('apart') && !{_AT}.includes('q2 90.00')"
        )
        down, up = partial(page.keyboard.down, "Space"), partial(page.keyboard.up, "Space")
        hold_jog(page, down, up, lambda: page.evaluate(charted))
        up()
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
        wait_until(page, "document.querySelector('#pad').textContent.includes('hold a shoulder')")
        assert page.locator("#pad b").count() == 0  # its name is text
        wait_for_looks(6)
        assert joints() == stands
        pull, let_go = (f"() => {{ pad.buttons[5].pressed = {pressed}; }}" for pressed in ("true", "false"))

        def release() -> None:
            page.evaluate(let_go)
            wait_for_looks(2)

        hold_jog(page, partial(page.evaluate, pull), release, lambda: page.text_content("#position") != stood)
        release()
        jogs(ends=True)
        assert joints()[1] < stands[1]  # forwards again
        # STOP, by the pad or the page, with the shoulder button still held: what is held on begins no other jog.
        for stop in ("pad.buttons[1].pressed = true", "document.querySelector('#stop').click()"):
            for _ in range(20):  # on a busy computer the jog may end by itself before the request arrives
                hold_jog(page, partial(page.evaluate, pull), release, lambda: standing_text(page).startswith("jog"))
                page.evaluate(f"() => {{ {stop}; }}")
                jogs(ends=True)
                wait_until(page, "document.querySelector('#arrived').textContent !== ''")
                page.evaluate("() => { pad.buttons[1].pressed = false; }")
                if (page.text_content("#arrived") or "").startswith("stopped"):
                    break
                release()
            stood = page.text_content("#position")
            page.wait_for_timeout(300)
            assert (page.text_content("#arrived") or "").startswith("stopped")
            assert page.text_content("#position") == stood
            release()


def test_a_jog_whose_signs_of_life_came_late_begins_no_other(browser: Browser) -> None:
    with serve_robot(board="sim") as server, open_page(browser, server.address, script=_LATE) as page:
        wait_until(page, f"{_AT}.startsWith('It stands')")
        page.locator("#jog-up").focus()
        for _ in range(20):  # on a busy computer the jog may end before the page's clock gave a sign of life
            page.evaluate("() => { document.querySelector('#arrived').textContent = ''; }")
            page.keyboard.down("Space")
            wait_until(page, "document.querySelector('#arrived').textContent.startsWith('jog: done: let go')")
            stood = page.text_content("#position")
            if page.evaluate("begun > 0"):
                break
            page.keyboard.up("Space")
        wait_until(page, "begun > 0 && answered === begun")
        page.keyboard.down("Space")  # as a key that is held repeats itself
        page.wait_for_timeout(300)
        page.keyboard.up("Space")
        page.wait_for_timeout(300)
        assert page.text_content("#position") == stood
        assert page.text_content("#trouble") == ""
        page.keyboard.down("Space")
        wait_until(page, f"{_AT} !== argument", stood)
        page.keyboard.up("Space")
