"""The page in a telephone's window: what is in sight, and what a finger does."""

from __future__ import annotations

import io

import numpy as np
import pytest
from browser_page import COUNTS, box_value, open_page, type_target, wait_for_answers, wait_until
from matplotlib import image
from playwright.sync_api import Browser
from served_page import serve_robot

# Firefox names the graphics card itself, and complains in its console of who asks for more.
_NAMED = """
const gl = WebGL2RenderingContext.prototype;
const [parameter, extension] = [gl.getParameter, gl.getExtension];
gl.getParameter = function (what) { return what === gl.RENDERER ? "llvmpipe" : parameter.call(this, what); };
gl.getExtension = function (name) {
  if (name === "WEBGL_debug_renderer_info") console.warn(`${name} is deprecated`);
  return extension.call(this, name);
};
"""
# Its lines take the picture's room.
_NO_LEGEND = (
    "() => Object.assign(document.querySelector('#legend').style, { position: 'absolute', visibility: 'hidden' })"
)
# Resolves when the window has not scrolled for six frames: what a finger leaves behind scrolls on.
_AT_REST = """() => new Promise((resolve) => {
  let [last, still] = [-1, 0];
  const look = () => {
    still = scrollY === last ? still + 1 : 0;
    last = scrollY;
    if (still > 5) resolve(); else requestAnimationFrame(look);
  };
  look();
})"""
# How far down the picture its buttons reach [px].
_BELOW = """() => document.querySelector('#views').getBoundingClientRect().bottom
  - document.querySelector('#canvas').getBoundingClientRect().top + 2"""


def test_a_telephone_s_window(browser: Browser) -> None:
    narrow = {"viewport": {"width": 390, "height": 800}, "has_touch": True}
    with serve_robot() as server, open_page(browser, server.address, script=_NAMED, **narrow) as page:
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        page.locator("#motors").scroll_into_view_if_needed()
        box = page.locator("#stop").bounding_box()
        assert box is not None
        assert 0 <= box["y"] < 100  # STOP stays in sight
        rights = "buttons => buttons.map((one) => one.getBoundingClientRect().right)"
        assert max(page.locator("#views button:visible").evaluate_all(rights)) <= 390  # none of them is cut
        type_target(page, 390, 80, 300)
        assert page.locator("#motors tbody td:nth-child(2)").all_inner_texts() == list(map(str, COUNTS))
        # A finger that swipes over a slider scrolls, and turns no joint; one that goes along it does.
        slider = page.locator("#sliders input[type=range]").nth(1)
        line = page.context.new_cdp_session(page)
        for across, down, turns in ((1, -12, False), (8, 1, True)):
            # A quick swipe throws the page so far that the slider is out of sight, or below what stays in sight.
            slider.evaluate("one => one.scrollIntoView({ block: 'center' })")
            page.evaluate(_AT_REST)
            rect = slider.bounding_box()
            assert rect is not None
            x, y = rect["x"] + 0.3 * rect["width"], rect["y"] + rect["height"] / 2
            before, scrolled = box_value(page, "#box-1"), page.evaluate("scrollY")
            for k in range(10):
                kind, point = ("touchMove" if k else "touchStart"), {"x": x + across * k, "y": y + down * k}
                line.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [point]})
            line.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
            if not turns:
                wait_until(page, "scrollY > argument", scrolled)
            page.evaluate(_AT_REST)
            wait_for_answers(page)
            assert (box_value(page, "#box-1") != before) is turns
            assert slider.evaluate("one => one.valueAsNumber") == pytest.approx(box_value(page, "#box-1"), abs=0.02)


def test_fit_fits_the_slice_of_reach_in(drawing_browser: Browser) -> None:
    """Its voxels change the picture, and nothing at the picture's sides and lower edge."""
    narrow = {"viewport": {"width": 390, "height": 800}, "has_touch": True}
    with serve_robot() as server, open_page(drawing_browser, server.address, **narrow) as page:
        canvas = page.locator("#canvas")

        def picture() -> np.ndarray:
            """What is drawn once it is fine and rests: a busy computer draws late what a click has asked for."""
            drawn = b""
            for _ in range(20):
                page.wait_for_timeout(300)
                wait_until(page, "document.querySelector('#canvas').dataset.coarse === 'false'")
                before, drawn = drawn, canvas.screenshot()
                if drawn == before:
                    break
            return image.imread(io.BytesIO(drawn))[..., :3]

        page.get_by_role("button", name="Slice").click()
        wait_until(page, "document.getElementById('legend').innerText.includes('voxels')")
        page.evaluate(_NO_LEGEND)
        page.get_by_role("button", name="Fit").click()
        shown = picture()
        page.get_by_role("button", name="Slice").click()
        changed = (shown != picture()).any(axis=2)
        changed[: int(page.evaluate(_BELOW))] = False  # the buttons
        assert changed.sum() > 0.05 * changed.size
        assert not changed[:, :4].any()
        assert not changed[:, -4:].any()
        assert not changed[-4:].any()


def test_what_went_wrong_is_seen_wherever_one_has_scrolled_to(browser: Browser) -> None:
    with (
        serve_robot(board="sim") as server,
        open_page(browser, server.address, viewport={"width": 390, "height": 800}, has_touch=True) as page,
    ):
        page.locator("#home").scroll_into_view_if_needed()
        page.click("#home")  # it has no switches
        wait_until(page, "document.querySelector('#trouble').textContent.includes('homing')")
        for part in ("#trouble", "#stop"):
            box = page.locator(part).bounding_box()
            assert box is not None
            assert box["y"] >= 0
            assert box["y"] + box["height"] < 300
