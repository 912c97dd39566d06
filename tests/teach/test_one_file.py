"""The arm in one HTML file: from disk, without a server, in a real browser."""

from __future__ import annotations

import copy
import gzip
import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from browser_page import box_values, open_page, wait_for_answers, wait_for_repaint, wait_until
from playwright.sync_api import Browser, Page, expect

import armkin
from armkin import path_file
from armkin.errors import UsageError
from armkin.motion.path_planner.path import path
from armkin.teach.one_file import arm_html

POSTURE = "#q=20,-70,80,10,20,30"


@pytest.fixture(scope="module")
def ur5e(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """A page of a UR5e, opened at the posture that stands in its address."""
    with open_page(browser, write_page(tmp_path_factory.mktemp("page"), "ur5e") + POSTURE) as page:
        assert box_values(page, "#sliders input[type=number]") == [20, -70, 80, 10, 20, 30]
        yield page


@pytest.fixture
def drawn(drawing_browser: Browser, tmp_path: Path) -> Iterator[Page]:
    """The same, with its picture."""
    with open_page(drawing_browser, write_page(tmp_path, "ur5e") + POSTURE) as page:
        yield page


def write_page(folder: Path, name: str, plan: Any = None) -> str:
    """The address of an arm's file."""
    file = folder / "arm.html"
    file.write_text(arm_html(armkin.load(name), plan=plan), encoding="utf-8")
    return file.as_uri()


def at_posture(page: Page) -> Page:
    """The page at its first posture again."""
    page.evaluate("text => { location.hash = text; }", POSTURE)
    expect(page.locator("#box-1")).to_have_value("-70.0000")
    wait_for_answers(page)
    return page


@pytest.mark.parametrize("name", ["three_dof", "ur5e", "jaco_j2n6s300", "so101"])
def test_a_file_can_be_mailed(name: str) -> None:
    arm = armkin.load(name)
    began = time.process_time()
    text = arm_html(arm)
    assert time.process_time() - began < 2.0
    assert len(text.encode()) <= 1.5e6
    assert len(gzip.compress(text.encode())) <= 450e3


def test_the_branches_are_those_of_python(ur5e: Page) -> None:
    """A slider turns a joint; all branches follow; nothing is asked of anybody."""
    arm = armkin.load("ur5e")
    page = at_posture(ur5e)
    slider = page.locator("#sliders input[type=range]").nth(1)
    slider.focus()
    slider.press("ArrowRight")
    wait_for_answers(page)
    shown = [float(box.input_value()) for box in page.locator("#sliders input[type=number]").all()]
    assert shown[1] > -70.0
    s = armkin.ik(arm, armkin.fk(arm, np.deg2rad(shown)))
    names = {s.names[b] for b in s.branch[s.valid]}
    radios = page.get_by_role("radiogroup", name="Branches").get_by_role("radio")
    assert {radio.locator(".name").inner_text() for radio in radios.all()} == names
    assert page.evaluate("location.hash").startswith("#q=20,")
    answer = page.evaluate("T => window.armkin.ik(T)", armkin.fk(arm, np.deg2rad(shown)).tolist())
    assert len(answer["branches"]) == int(s.valid.sum())
    radios.nth(3).click()
    wait_for_answers(page)
    chosen = [float(box.input_value()) for box in page.locator("#sliders input[type=number]").all()]
    assert np.abs(armkin.fk(arm, np.deg2rad(chosen)) - armkin.fk(arm, np.deg2rad(shown))).max() < 1e-2
    for absent in ("#send", "#board", "#record", "#save", "#stop", "#follow", "#take"):
        assert page.locator(absent).count() == 0, absent
    at_once = """() => {
      const bar = document.querySelectorAll('#sliders input[type=range]')[2];
      const seen = new Set();
      for (let k = 0; k < 300; k++) {
        bar.value = 20 + k / 10;
        bar.dispatchEvent(new Event('input'));
        seen.add(document.querySelector('#target input').value);
      }
      return seen.size;
    }"""
    assert page.evaluate(at_once) > 200  # numbers follow before a picture is drawn
    wait_until(page, "location.hash.includes(',49.')")  # and the address, not too often for the browser
    page.evaluate("location.hash = '#q=0,-90,90,0,90,0'")
    expect(page.locator("#box-1")).to_have_value("-90.0000")


def test_the_reach_is_shown_and_branches_are_pointed_at_by_keyboard(drawn: Page) -> None:
    page = drawn
    before = page.locator("#canvas").screenshot()
    page.get_by_role("button", name="Reach").press("Enter")
    expect(page.locator("#legend")).to_contain_text("8000 poses")
    wait_for_repaint(page)
    assert page.locator("#canvas").screenshot() != before
    tips = page.evaluate(
        "import('armkin/js/workspace_cloud.js')"
        ".then(({tips}) => import('armkin/data.js').then((d) => [...tips(d.arm)]))"
    )
    place = np.array(tips).reshape(-1, 3)
    arm = armkin.load("ur5e")
    assert np.linalg.norm(place, axis=1).max() < arm.reach * 1.3
    assert np.ptp(place, axis=0).min() > arm.reach
    page.get_by_role("button", name="Reach").press("Enter")
    page.get_by_role("button", name="Slice").press("Enter")  # rides along, as voxels
    expect(page.locator("#legend")).to_contain_text("share of 12 orientations")
    page.get_by_role("button", name="Slice").press("Enter")
    expect(page.locator("#legend")).not_to_contain_text("voxels")
    radios = page.get_by_role("radiogroup", name="Branches").get_by_role("radio")
    radios.nth(0).focus()
    posture = page.evaluate("location.hash")
    page.keyboard.press("Control+ArrowDown")
    assert page.locator("#canvas").get_attribute("data-solid") == "1"
    assert page.evaluate("location.hash") == posture  # pointed at, not chosen
    page.keyboard.press("Space")
    page.wait_for_function("(before) => location.hash !== before", arg=posture)


def test_it_is_printed_on_one_page_with_its_picture(drawn: Page) -> None:
    page = drawn
    paper = page.pdf(format="A4")  # as by hand, it says beforeprint
    assert len(re.findall(rb"/Type\s*/Page\b", paper)) == 1
    assert len(re.findall(rb"/Subtype\s*/Image\b", paper)) >= 1
    page.emulate_media(media="print")
    assert page.locator("#printed").is_visible()
    picture = page.locator("#printed").get_attribute("src") or ""
    assert len(picture) > 10_000  # an empty one has a tenth of that
    for shown in ("#box-1", "#target input", "#answer", "#branch-7"):
        assert page.locator(shown).first.is_visible(), shown
    for gone in ("#canvas", "#sliders input[type=range]", "#views", "#share", "#poses"):
        assert not page.locator(gone).first.is_visible(), gone


def test_no_barrier_for_those_who_do_not_see_or_use_a_mouse(browser: Browser, tmp_path: Path) -> None:
    for name, colours in (("panda", "light"), ("three_dof", "dark")):
        arm = armkin.load(name)
        ends = {"moves": [{"joint": arm.home.tolist()}, {"joint": (arm.home + 0.1).tolist()}]}
        plan = path(arm, path_file.validate_path(ends)) if name == "three_dof" else None
        with open_page(browser, write_page(tmp_path, name, plan), color_scheme=colours) as page:
            page.get_by_role("button", name="Copy as Python").click()
            violations = Axe().run(page).response["violations"]
            bad = [
                (violation["id"], violation["nodes"][0]["html"])
                for violation in violations
                if violation["impact"] in ("serious", "critical")
            ]
            assert bad == []


def test_hostile_words_are_shown_and_run_nothing(browser: Browser, tmp_path: Path) -> None:
    """Names of the arm, its file and its joints, and what stands behind the address's #."""
    words = (
        "</script><script>bad=1</script>",
        "<svg/onload=bad=2>",
        "'\"><img src=x onerror=bad=3>",
        "</style><script>bad=4//",
        "</title><iframe srcdoc='<script>parent.bad=5</script>'>",
        "\u2028bad=6//",
        "${bad=7}`+(bad=8)+`",
        "-->]]><script>bad=9",
        "&lt;img src=x onerror=bad=10&gt;",
        "\\u003cimg src=x onerror=bad=11\\u003e",
        "javascript:bad=12",
        "{{nonce}}*/bad=13/*",
        "%3Cscript%3Ebad=14%3C/script%3E#'+bad+'",
        "<a href=javascript:bad=15 autofocus onfocus=bad=16>",
        "__proto__",
        "\x00\x07\\",
    )
    for eight in (words[:8], words[8:]):
        arm = copy.copy(armkin.load("ur5e"))
        for field, value in (("name", eight[6]), ("path", f"/tmp/{eight[7]}.yaml"), ("joint_names", eight[:6])):
            object.__setattr__(arm, field, value)  # what no robot file may say
        file = tmp_path / "arm.html"
        file.write_text(arm_html(arm), encoding="utf-8")
        with open_page(browser, file.as_uri()) as page:
            assert page.locator("#robot").inner_text() == eight[6]
            for fragment in (
                *words,
                "q=" + ",".join(words[:6]),
                "q=1;2;3;4;5;6",
                "q=0x10,1,1,1,1,1e400",
                "q=" + "9," * 9999,
            ):
                page.evaluate("text => { location.hash = text; }", fragment)
            for button in ("Copy link", "Copy as command", "Copy as Python"):
                page.get_by_role("button", name=button).click()
            assert page.evaluate("window.bad") is None
            assert page.locator("img:not(#printed), iframe, svg, a").count() == 0
            assert page.locator("#sliders input[type=number]").count() == 6


def test_a_fragment_that_is_no_posture_is_home(browser: Browser, tmp_path: Path) -> None:
    """Of a page that opens, and of one that is open."""
    home, named_posture = ["0.0000", "90.0000", "-90.0000"], ["10.0000", "60.0000", "-60.0000"]
    numbers = "[...document.querySelectorAll('#sliders input[type=number]')].map((box) => box.value)"
    bad = ("#q=<img src=x onerror=bad=1>", "#q=1,2", "#q=1e999,0,0", "#q=,,", "#%00")
    with open_page(browser, write_page(tmp_path, "three_dof") + bad[0]) as page:
        assert page.evaluate(numbers) == home
        wait_until(page, "location.hash === '#q=0,90,-90'")
        for fragment in bad:
            for named, shown in (("#q=10,60,-60", named_posture), (fragment, home)):
                page.evaluate("text => { location.hash = text; }", named)
                wait_until(page, f"{numbers}.join() === argument", ",".join(shown))
            wait_until(page, "location.hash === '#q=0,90,-90'")  # the address says so, too, 0.1 s later at most
        # the page writes what it showed before into the address, just before it hears of another one
        page.evaluate("location.hash = '#q=10,60,-60'; history.replaceState(null, '', '#q=0,90,-90');")
        wait_until(page, f"{numbers}.join() === argument", ",".join(named_posture), seconds=10.0)
        assert page.evaluate("window.bad") is None
        assert page.locator("img:not(#printed)").count() == 0


def test_a_path_is_played(browser: Browser, tmp_path: Path) -> None:
    arm = armkin.load("three_dof")
    file = path_file.validate_path({"moves": [{"joint": [0, 90, -90]}, {"line": [258, 110, 367]}, {"wait": 0.2}]})
    plan = path(arm, file)
    with open_page(browser, write_page(tmp_path, "three_dof", plan)) as page:
        page.locator("#when").evaluate("(bar) => { bar.value = bar.max; bar.dispatchEvent(new Event('input')); }")
        ends = np.rad2deg(plan.q(plan.duration))
        shown = [float(box.input_value()) for box in page.locator("#sliders input[type=number]").all()]
        assert np.abs(np.array(shown) - ends).max() < 1e-3
        page.locator("#play").click()
        expect(page.locator("#clock")).not_to_have_text(re.compile(r"^0\.00 "))
        assert page.locator("#save").count() == 0


def test_the_redundant_joint_turns_within_its_interval_while_the_tip_stays(browser: Browser, tmp_path: Path) -> None:
    arm = armkin.load("panda")
    start = np.deg2rad([20, -30, 10, -110, 20, 90, 40])
    with open_page(browser, write_page(tmp_path, "panda") + "#q=20,-30,10,-110,20,90,40") as page:
        slider = page.get_by_role("slider", name="J7, the tip stays")
        expect(page.locator("#held-range")).to_contain_text("within limits")
        low, high = map(float, re.findall(r"-?[\d.]+", page.inner_text("#held-range")))
        s = armkin.ik(arm, armkin.fk(arm, start), near=start)
        assert s.interval is not None
        assert [low, high] == pytest.approx(np.rad2deg(s.interval[s.best]), abs=0.01)
        for value, turned in ((0.5 * (low + high), 0.5 * (low + high)), (low - 30, low), (high + 20, high)):
            slider.evaluate("(bar, v) => { bar.value = v; bar.dispatchEvent(new Event('input')); }", value)
            wait_for_answers(page)
            q = np.deg2rad([float(box.input_value()) for box in page.locator("#sliders input[type=number]").all()])
            assert np.rad2deg(q[6]) == pytest.approx(turned, abs=0.02)
            assert np.abs(armkin.fk(arm, q) - armkin.fk(arm, start)).max() < 5e-3
            assert np.clip(q, arm.lower, arm.upper) == pytest.approx(q, abs=1e-4)
            expect(page.locator("#answer")).to_contain_text("exact: ")


def test_an_arm_without_a_module_has_no_page() -> None:
    with pytest.raises(UsageError):
        arm_html(armkin.load("pan_tilt"))
