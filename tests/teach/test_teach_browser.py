"""The page in a real browser: everything by mouse, everything by keyboard, for eyes and for screen readers."""

from __future__ import annotations

import dataclasses
import os
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from browser_page import (
    COUNTS,
    box_value,
    box_values,
    hold_jog,
    open_page,
    standing_text,
    type_target,
    wait_for_answers,
    wait_for_board,
    wait_for_repaint,
    wait_until,
)
from matplotlib import image
from playwright.sync_api import Browser, Page
from served_page import serve_robot

import armkin
from armkin.model import units
from armkin.teach.arm_description import scene_json
from armkin.teach.server import Server
from command_line import ROOT, run


@pytest.fixture
def server() -> Iterator[Server]:
    """One of its own for each test: a page that has just been closed still holds control for a moment."""
    with serve_robot() as running:
        yield running


# At least so many stops of Tab lie before the next element of a selector.
_STOPS = """(selector) => {
  const all = [...document.querySelectorAll('button, input, select, summary, textarea, [tabindex]')];
  const stops = all.filter((one) => one.tabIndex >= 0 && !one.disabled && one.checkVisibility());
  return stops.findIndex((one) => one.matches(selector)) - stops.indexOf(document.activeElement) - 2;
}"""


def test_everything_by_keyboard_alone(browser: Browser, tmp_path: Path) -> None:
    with serve_robot(board="sim") as server, open_page(browser, server.address) as page:

        def tab_to(selector: str) -> None:
            for _ in range(page.evaluate(_STOPS, selector)):
                page.keyboard.press("Tab")
            for _ in range(120):  # from just before it, or all round
                if page.evaluate("selector => document.activeElement.matches(selector)", selector):
                    return
                page.keyboard.press("Tab")
            raise AssertionError(f"Tab does not reach {selector}")

        def type_target() -> None:
            tab_to("#target input")
            for number in ("390", "80", "300"):
                page.keyboard.press("Control+a")
                page.keyboard.type(number)
                page.keyboard.press("Tab")
            wait_for_answers(page)

        # Joints: a slider by its arrow keys.
        tab_to("#sliders input[type=range]")
        before = box_value(page, "#box-0")
        for _ in range(3):
            page.keyboard.press("ArrowRight")
        wait_for_answers(page)
        assert box_value(page, "#box-0") > before
        # The tip: arrows and page keys where nothing has the focus, numbers in its boxes.
        page.evaluate("document.activeElement.blur()")
        z = box_value(page, "#target label:nth-child(3) input")
        page.keyboard.press("PageDown")
        wait_for_answers(page)
        assert box_value(page, "#target label:nth-child(3) input") == pytest.approx(z - 5)
        type_target()
        page.evaluate("document.activeElement.blur()")
        page.keyboard.press("3")
        wait_for_answers(page)
        chosen = page.locator("#branches [aria-checked=true]")
        assert "left, elbow down" in chosen.inner_text()
        page.keyboard.press("4")
        wait_for_answers(page)
        assert "left, elbow up" in chosen.inner_text()
        # A program: R records, P plays.
        page.keyboard.press("r")
        page.wait_for_selector("#name-0")
        page.keyboard.press("ArrowLeft")
        wait_for_answers(page)
        page.keyboard.press("r")
        page.wait_for_selector("#name-1")
        page.wait_for_selector("#player:not([hidden])")
        tab_to("#rate")
        page.keyboard.press("Home")  # a quarter of its speed: a busy computer sees it play, too
        assert page.input_value("#rate") == "0.25"
        page.evaluate("document.activeElement.blur()")
        page.keyboard.press("p")
        wait_until(page, "document.querySelector('#play').textContent === 'Pause'")
        page.keyboard.press("p")
        wait_until(page, "document.querySelector('#play').textContent === 'Play'")
        # The board: send by Enter, STOP by Esc, jog while the space bar is down.
        type_target()  # far from home, wherever the program was paused
        tab_to("#speed")
        page.keyboard.type("3")
        page.evaluate("document.activeElement.blur()")
        tab_to("#send")
        page.keyboard.press("Enter")
        wait_until(page, "document.querySelector('#standing').textContent.startsWith('send')")
        page.keyboard.press("Escape")
        wait_for_board(page, "stopped")
        tab_to("#jog-up")
        hold_jog(
            page,
            lambda: page.keyboard.down(" "),
            lambda: page.keyboard.up(" "),
            lambda: standing_text(page).startswith("jog"),
        )
        page.keyboard.up(" ")
        wait_for_board(page, "jog: done")
        page.evaluate("document.activeElement.blur()")
        page.keyboard.press("g")
        wait_for_board(page, "grip: done")


def test_the_handle_is_dragged_and_the_arm_follows_it(tab: Page) -> None:
    type_target(tab, 350, 0, 250)
    tab.click("[data-view=front]")
    wait_for_repaint(tab)
    x, y = map(float, (tab.get_attribute("#canvas", "data-handle") or "").split())
    box = tab.locator("#canvas").bounding_box()
    assert box is not None
    before = box_values(tab, "#target input")
    tab.mouse.move(box["x"] + x, box["y"] + y - 45)  # the arrow of z
    wait_for_repaint(tab)
    tab.mouse.down()
    for step in range(10):
        tab.mouse.move(box["x"] + x, box["y"] + y - 45 - 4 * step)
    tab.mouse.up()
    wait_for_answers(tab)
    after = box_values(tab, "#target input")
    assert after[2] > before[2] + 5
    assert after[:2] == pytest.approx(before[:2], abs=0.01)
    arm = armkin.load(str(ROOT / "robots/three_dof.yaml"))
    q = [number * 3.141592653589793 / 180 for number in box_values(tab, "#sliders input[type=number]")]
    assert armkin.fk(arm, q)[:3, 3] == pytest.approx(after, abs=0.01)


def test_what_cannot_be_reached_is_said(tab: Page) -> None:
    type_target(tab, 2000, 0, 300)
    text = tab.inner_text("#answer")
    answer = run("ik", "robots/three_dof.yaml", 2000, 0, 300, "--json").json
    assert text.startswith("unreachable: 0 branches")
    assert f"{answer['closest']['distance_mm']:.4f} mm away" in text
    tab.click("#nearest")
    wait_for_answers(tab)
    assert box_values(tab, "#sliders input[type=number]") == pytest.approx(answer["closest"]["joints"], abs=1e-4)
    tab.fill("#box-1", "130")
    wait_for_answers(tab)
    assert tab.inner_text("#outside") == "q2 = 130 deg is outside -20 to 120 deg"
    assert tab.get_attribute("#box-1", "aria-invalid") == "true"


def test_what_is_typed_and_is_no_number_is_told_and_not_kept(tab: Page) -> None:
    type_target(tab, 390, 80, 300)
    box = tab.locator("#box-0")
    for typed, stays in (("", "10.1529"), ("-", "10.1529"), ("1e", "1.0000")):
        box.click()
        tab.keyboard.press("Control+a")
        tab.keyboard.press("Delete")
        tab.keyboard.type(typed)
        tab.keyboard.press("Tab")
        assert tab.inner_text("#trouble") == f"q1: that is no number; it stays {stays}"
        assert box.input_value() == stays
    tab.fill("#box-0", "12")
    tab.keyboard.press("Tab")
    wait_for_answers(tab)
    assert tab.inner_text("#trouble") == ""
    assert box.input_value() == "12.0000"


def test_a_branch_s_button_stays_the_same_while_the_tip_moves(tab: Page) -> None:
    """Pressed while answers come in, it is still there when the pointer is let go."""
    type_target(tab, 390, 80, 300)
    tab.hover("#branch-2")
    tab.mouse.down()
    tab.evaluate("document.querySelector('#target input').value = 380")
    tab.dispatch_event("#target input", "input")
    wait_for_answers(tab)
    tab.mouse.up()
    wait_for_answers(tab)
    assert tab.locator("#branches [aria-checked=true]").get_attribute("id") == "branch-2"


def test_no_barrier_for_those_who_do_not_see_or_use_a_mouse(browser: Browser) -> None:
    with serve_robot(board="sim") as server, open_page(browser, server.address, color_scheme="dark") as page:
        type_target(page, 390, 80, 300)
        page.click("#record")
        page.wait_for_selector("#name-0")
        page.wait_for_selector("#player:not([hidden])")
        for colours in ("dark", "light"):
            assert page.get_attribute("html", "data-theme") == colours
            violations = Axe().run(page).response["violations"]
            bad = {
                violation["id"]: [node["html"] for node in violation["nodes"]]
                for violation in violations
                if violation["impact"] in ("serious", "critical")
            }
            assert bad == {}
            page.click("#theme")


def test_the_manual_s_picture_is_the_page(drawing_browser: Browser, tmp_path: Path) -> None:
    """ARMKIN_UPDATE_SNAPSHOTS=1 takes it anew."""
    picture, drawn_now = ROOT / "docs/teach.png", tmp_path / "teach.png"
    with (
        serve_robot("ur5e") as server,
        open_page(drawing_browser, server.address, viewport={"width": 1280, "height": 800}) as page,
    ):
        for k, angle in enumerate((20, -70, 80, -60, 70, 10)):
            page.fill(f"#box-{k}", str(angle))
        page.keyboard.press("Tab")
        wait_for_answers(page)
        page.click("[data-view=space]")
        page.evaluate("document.activeElement.blur(); document.querySelector('#panels').scrollTop = 0")
        page.mouse.move(5, 500)
        wait_for_repaint(page)
        wait_until(page, "document.querySelector('#canvas').dataset.coarse === 'false'")
        page.screenshot(path=drawn_now)
    if os.environ.get("ARMKIN_UPDATE_SNAPSHOTS"):
        picture.write_bytes(drawn_now.read_bytes())
    shown, drawn = (image.imread(path)[..., :3] for path in (picture, drawn_now))
    assert shown.shape == drawn.shape
    assert np.abs(shown - drawn).mean() < 0.015  # another machine's fonts; a joint turned by 20 degrees: 0.02
    assert "(teach.png)" in (ROOT / "docs/teach.md").read_text()[:1000]


def test_without_webgl_everything_else_works(browser: Browser) -> None:
    blind = "HTMLCanvasElement.prototype.getContext = () => null"
    with serve_robot(board="sim") as server, open_page(browser, server.address, script=blind, quiet=False) as page:
        assert page.is_visible("#flat")
        type_target(page, 390, 80, 300)
        page.get_by_role("radio", name="left, elbow up").click()
        wait_for_answers(page)
        page.click("#send")
        wait_for_board(page, "send: done")
        assert server.actions.standing_pulses() == tuple(COUNTS)


def test_the_program_is_saved_and_loaded(tab: Page, tmp_path: Path) -> None:
    for target in ((390, 80, 300), (350, -50, 260)):
        type_target(tab, *target)
        tab.click("#record")
        wait_for_answers(tab)
    tab.wait_for_selector("#name-1")
    tab.fill("#name-1", "the other end")
    tab.keyboard.press("Tab")
    wait_until(tab, "document.querySelector('#name-1').value === 'the other end'")
    tab.click("#show-0")
    wait_until(tab, "document.querySelector('#target input').value === '390.0000'")
    with tab.expect_download() as download:
        tab.click("#save")
    file = tmp_path / "path.yaml"
    download.value.save_as(file)
    assert "armkin path robots/three_dof.yaml three_dof_path.yaml" in tab.inner_text("#saved").replace(f"{ROOT}/", "")
    plan = armkin.path(armkin.load(str(ROOT / "robots/three_dof.yaml")), str(file))
    wait_until(tab, f"document.querySelector('#planned').textContent.startsWith('{plan.duration:.3f} s')")
    tab.click("#clear")
    wait_until(tab, "!document.querySelector('#moves li')")
    tab.set_input_files("#load", str(file))
    wait_until(tab, "document.querySelector('#name-1')?.value === 'the other end'")
    tab.click("#undo")
    wait_until(tab, "!document.querySelector('#moves li')")


# Heights of joint 1's drum.
_FIRST_DRUM = """async ([arm, q]) => {
  const [{ Shapes }, { frames }] = [await import('/js/bodies.js'), await import('/js/chain.js')];
  const [T, at] = [frames(arm, q).after[0], []];
  for (const { geometry } of new Shapes(arm).bodies[1].filter(({ drum }) => drum)) {
    const p = geometry.attributes.position.array;
    for (let k = 0; k < p.length; k += 3) at.push(T[8] * p[k] + T[9] * p[k + 1] + T[10] * p[k + 2] + T[11]);
  }
  return at;
}"""


# Of two branches outside limits, drawn as lines: each [red, green, blue, whether it is seen through].
_PALE = """async (arm) => {
  const [{ Shapes }, { Ghosts }] = [await import('/js/bodies.js'), await import('/js/ghosts.js')];
  const ghosts = new Ghosts(new Shapes(arm));
  ghosts.paper.set(0xf3f5f7);
  const q = arm.joints.map((joint) => joint.home);
  ghosts.show(['#d62728', '#1f77b4'].map((colour) => ({ joints: q, colour, faint: true, solid: false })));
  const [body] = ghosts.bodies[0].filter(({ count }) => count);
  const paint = [...body.instanceColor.array].slice(0, 6);
  return [paint.slice(0, 3), paint.slice(3)].map((colour) => [...colour, body.material.transparent]);
}"""


def test_branches_outside_limits_are_paler_and_mix_nowhere(browser: Browser, server: Server) -> None:
    """Lines that were seen through mixed to grey where seven of a Panda's crossed."""
    context = browser.new_context(bypass_csp=True)
    page = context.new_page()
    page.goto(server.address)
    red, blue = page.evaluate(_PALE, scene_json(armkin.load("three_dof")))
    assert red[0] > 1.3 * red[1]
    assert blue[2] > 1.3 * blue[0]
    assert min(red[:3] + blue[:3]) > 0.4  # of light, as the paper has 0.9; their own least is 0.02
    assert red[3] is blue[3] is False
    context.close()


def test_the_page_draws_the_arm_where_it_is(browser: Browser, server: Server) -> None:
    """Its ten lines of forward kinematics against ours, for every robot, calibrated ones, too."""
    context = browser.new_context(bypass_csp=True)
    page = context.new_page()
    page.goto(server.address)
    rng = np.random.default_rng(5)
    for path in sorted((ROOT / "robots").glob("*.yaml")):
        arm = armkin.load(str(path))
        arm = dataclasses.replace(arm, ratio=rng.uniform(0.9, 1.1, arm.n))
        q = rng.uniform(-2, 2, arm.n) * np.where(arm.prismatic, 100.0, 1.0)
        tool = page.evaluate(
            "async ([arm, q]) => (await import('/js/chain.js')).frames(arm, q).tool",
            [scene_json(arm), units.joints_out(arm, q).tolist()],
        )
        assert np.reshape(tool, (4, 4)) == pytest.approx(armkin.fk(arm, q), abs=1e-8), arm.name
        if arm.prismatic[0] or abs(arm.link[0][2, 2]) < 0.99:
            continue
        corners = page.evaluate(_FIRST_DRUM, [scene_json(arm), units.joints_out(arm, q).tolist()])
        assert min(corners) > min(arm.base[2, 3], 0) - 1e-6 * arm.reach, arm.name  # it stands on the floor
    context.close()


@pytest.mark.parametrize("robot", ["ur5e", "cobra600", "moveo", "panda", "pan_tilt"])
def test_other_arms_have_their_page(browser: Browser, robot: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "/nowhere/cc")  # machine code of an elimination has tests of its own
    with serve_robot(robot) as server, open_page(browser, server.address) as page:
        settled_text = page.inner_text("#answer")
        count = len(page.locator("#branches button").all())
        if robot == "pan_tilt":
            assert "no task fits" in settled_text
            assert count == 0
        else:
            match = re.search(r"(\d+) branch", settled_text)
            assert match is not None
            assert int(match[1]) == count >= 1
        if robot == "panda":
            assert page.get_attribute("button[aria-label^='hold J7']", "aria-pressed") == "true"
            page.click("button[aria-label^='hold J7']")
            wait_until(page, "!document.querySelector('#branches button')")
            page.click("button[aria-label^='hold J1']")
            page.wait_for_selector("#branches button")
