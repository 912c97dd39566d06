"""What people ran into on the page, each in a real browser."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from browser_page import open_page, type_target, wait_for_answers, wait_for_repaint, wait_until
from playwright.sync_api import Browser, Page, Route
from served_page import run_teach, serve_robot

import armkin


def test_keys_and_what_was_refused(browser: Browser, tmp_path: Path) -> None:
    with serve_robot(board="sim") as server, open_page(browser, server.address) as page:
        chosen = page.locator("#branches [aria-checked=true]")
        type_target(page, 390, 80, 300)
        # Keys after a slider and a checkbox were touched; a slider keeps its own.
        for touched in ("#sliders input[type=range]", "#best"):
            page.locator(touched).first.focus()
            for key, name in (("3", "left, elbow down"), ("4", "left, elbow up")):
                page.keyboard.press(key)
                wait_for_answers(page)
                assert name in chosen.inner_text()
        page.locator("#sliders input[type=range]").first.focus()
        z = page.input_value("#target label:nth-child(3) input")
        page.keyboard.press("PageUp")
        wait_for_answers(page)
        assert page.input_value("#target label:nth-child(3) input") == z
        page.keyboard.press("r")
        page.wait_for_selector("#name-0")
        page.fill("#name-0", "")
        page.keyboard.type("pr3")
        page.keyboard.press("Tab")
        wait_until(page, "document.querySelector('#name-0').value === 'pr3' && !document.querySelector('#name-1')")
        # What was refused is over when something else is begun.
        page.wait_for_selector("#player:not([hidden])")
        assert "mm" not in page.inner_text("#planned")  # a joint move has no way that was asked for
        for button, then in (("#record", "#name-1"), ("#save", ""), ("#show-0", "")):
            page.click("#home")  # it has no switches
            wait_until(page, "document.querySelector('#trouble').textContent.includes('homing')")
            page.click(button)
            wait_until(page, "document.querySelector('#trouble').textContent === ''")
            if then:
                page.wait_for_selector(then)
        # A file with too few numbers is refused, and the program stays.
        file = tmp_path / "short.yaml"
        file.write_text("moves:\n  - joint: [0, 0]\n")
        page.set_input_files("#load", str(file))
        wait_until(page, "document.querySelector('#trouble').textContent.includes('3 joints')")
        assert page.locator("#moves li").count() == 2
        # A program that starts elsewhere than the arm stands says, before it is sent, by which move it is reached.
        file.write_text("start: {joints: [30, 60, -60]}\nmoves:\n  - joint: [0, 90, -90]\n")
        page.set_input_files("#load", str(file))
        summary = "first a joint move to its start, 1.000 s; then 1.000 s"
        wait_until(page, f"document.querySelector('#planned').textContent.startsWith('{summary}')")
        # While a long program is planned, none that it has been edited from can be played.
        page.route("**/api/plan", lambda route: None)
        page.click("#undo")
        wait_until(page, "document.querySelector('#planned').textContent === 'planning ...'")
        assert page.is_hidden("#player")
        page.unroute("**/api/plan")  # which lets those that were held go on
        page.wait_for_selector("#player:not([hidden])")


def test_hostile_words_of_a_path_file_are_shown_and_run_nothing(tab: Page, tmp_path: Path) -> None:
    words = ("<img src=x onerror=bad=1>", "</li><script>bad=2</script>", '"><svg/onload=bad=3>', "${bad=4}`'+(bad=5)+'")
    file = tmp_path / "path.yaml"
    file.write_text("moves:\n" + "".join(f"  - joint: [{k}, 60, -60]  # {word}\n" for k, word in enumerate(words)))
    bad = tmp_path / f"{words[0].replace('/', '')}.yaml"
    bad.write_text(f"{words[3]}: {words[0]}\nmoves: {words[2]}\n")
    tab.set_input_files("#load", str(file))
    wait_until(tab, "document.querySelectorAll('#moves li').length === 4")
    assert [tab.input_value(f"#name-{k}") for k in range(4)] == list(words)
    tab.set_input_files("#load", str(bad))
    wait_until(tab, "document.querySelector('#trouble').textContent !== ''")
    assert tab.evaluate("window.bad") is None
    assert tab.locator("img:not(#printed), svg[onload], li script").count() == 0


def test_a_long_list_keeps_the_rows_that_stay(tab: Page, tmp_path: Path) -> None:
    file = tmp_path / "long.yaml"
    file.write_text("moves:\n" + "".join(f"  - joint: [{k % 100}, 60, -60]\n" for k in range(300)))
    tab.set_input_files("#load", str(file))
    wait_until(tab, "document.querySelectorAll('#moves li').length === 300")
    tab.evaluate("document.querySelectorAll('#moves li').forEach((row, k) => (row.mark = k))")
    marks = "[...document.querySelectorAll('#moves li')].map((row) => row.mark)"
    tab.click("#delete-5")
    wait_until(tab, "document.querySelectorAll('#moves li').length === 299")
    assert tab.evaluate(marks) == [k for k in range(300) if k != 5]
    assert tab.inner_text("#show-5") == "6 joint"
    assert tab.get_attribute("#show-5", "aria-label") == "show move 6, joint"
    tab.click("#undo")
    wait_until(tab, "document.querySelectorAll('#moves li').length === 300")
    assert [mark for mark in tab.evaluate(marks) if mark is not None] == [k for k in range(300) if k != 5]
    tab.click("#move-down-0")
    wait_until(tab, "document.querySelector('#moves li').title.includes('1.0')")
    assert tab.evaluate("document.activeElement.id") == "move-down-0"


def test_a_server_that_is_gone_is_not_said_to_know_the_arm(browser: Browser) -> None:
    with ExitStack() as running:
        url = running.enter_context(run_teach("three_dof", "--port", "sim"))
        with open_page(browser, url, quiet=False) as page:
            wait_until(page, "document.querySelector('#standing').textContent.startsWith('position known')")
            assert page.is_enabled("#send")
            running.close()
            wait_until(page, "document.querySelector('#standing').textContent.includes('is gone')")
            assert page.is_disabled("#send")
            assert page.inner_text("#position") == ""
            assert "does not answer" in page.inner_text("#trouble")


def test_what_one_needs_is_in_sight_and_stays_there(browser: Browser) -> None:
    wide = {"width": 1280, "height": 800}
    with serve_robot(board="sim") as server, open_page(browser, server.address, viewport=wide) as page:
        for size in ((1280, 800), (390, 800)):
            page.set_viewport_size({"width": size[0], "height": size[1]})
            wait_for_repaint(page)
            send = page.locator("#send").bounding_box()
            assert send is not None
            assert send["y"] + send["height"] <= size[1]
            place = page.locator("#target").bounding_box()
            page.evaluate("document.querySelector('#home').click()")  # it has no switches
            wait_until(page, "document.querySelector('#trouble').textContent.includes('homing')")
            assert page.locator("#target").bounding_box() == place  # the error has pushed nothing away
            slider = page.locator("#sliders input[type=range]").first
            assert slider.evaluate("slider => getComputedStyle(slider).touchAction") == "pan-y"
            assert float(slider.get_attribute("step") or "") == pytest.approx(360 / 12800)  # a pulse
            slider.dispatch_event("input")  # something else is begun: the error is over
            wait_until(page, "document.querySelector('#trouble').textContent === ''")
        assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
        low = "[...document.querySelectorAll('button')].filter((one) => one.offsetHeight && one.offsetHeight < 44)"
        assert page.evaluate(f"{low}.map((one) => one.id || one.textContent)") == []


def test_the_first_picture_has_the_whole_handle_and_sliders_their_values(
    browser: Browser, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", "/nowhere/cc")  # machine code of an elimination has tests of its own
    for robot in ("ur5e", "jaco_j2n6s300"):  # stretched upwards; joints without limits at 275 and 241 degrees
        with (
            serve_robot(robot) as server,
            open_page(browser, server.address, viewport={"width": 390, "height": 844}) as page,
        ):
            handle = "+document.querySelector('#canvas').dataset.handle.split(' ')[1]"
            low = "document.querySelector('#views').getBoundingClientRect().bottom"
            top = "document.querySelector('#canvas').getBoundingClientRect().top"
            wait_until(page, f"{handle} + {top} - {low} > 40")  # its arrow is below the buttons
            for slider, box in zip(
                page.locator("#sliders input[type=range]").all(),
                page.locator("#sliders input[type=number]").all(),
                strict=True,
            ):
                assert float(slider.input_value()) == pytest.approx(float(box.input_value()), abs=0.1)


def test_the_branch_that_is_pointed_at_is_solid_and_f_fits_the_arm_in(browser: Browser) -> None:
    with serve_robot("ur5e") as server, open_page(browser, server.address) as page:
        for k, angle in enumerate((20, -70, 80, -60, 70, 10)):
            page.fill(f"#box-{k}", str(angle))
        page.keyboard.press("Tab")
        wait_for_answers(page)
        page.hover("#branch-3")
        wait_until(page, "document.querySelector('#canvas').dataset.solid === '1'")
        page.mouse.move(10, 300)
        wait_until(page, "document.querySelector('#canvas').dataset.solid === '0'")
        # in the picture, too: the line under the pointer is solid and named, and a click chooses it
        page.click("#names")
        names = page.locator("#labels span").all_inner_texts()
        assert sorted(names) == sorted(page.locator("#branches button[aria-checked=false] .name").all_inner_texts())
        places = [span.get_attribute("data-at") for span in page.locator("#labels span").all()]
        frame = page.locator("#canvas").bounding_box()
        page.click("#names")
        assert page.locator("#labels span").count() == 0
        assert frame is not None
        for place in places:  # under one of them stands no handle
            x, y = (float(number) for number in (place or "").split())
            x, y = x + frame["x"], y + frame["y"]
            page.mouse.move(x, y)
            if page.get_attribute("#canvas", "data-solid") == "1":
                break
        [name] = page.locator("#labels span").all_inner_texts()
        assert name in names
        page.mouse.click(x, y)
        wait_until(page, "document.querySelector('#branches [aria-checked=true] .name').textContent === argument", name)
        wait_for_answers(page)
        assert page.get_attribute("#target label:nth-child(4)", "title") is not None
        page.mouse.wheel(0, -3000)  # closer
        handle = "document.querySelector('#canvas').dataset.handle.split(' ').map(Number)"
        x, y = page.evaluate(handle)
        page.keyboard.press("f")
        wait_until(page, f"Math.abs({handle}[0] - argument) > 1", x)
        x, y = page.evaluate(handle)
        box = page.locator("#canvas").bounding_box()
        assert box is not None
        assert 0 < x < box["width"]
        assert 0 < y < box["height"]


def test_a_drag_does_not_wait_for_the_server(browser: Browser) -> None:
    """The page's own module answers first, the server confirms: to the last digit that is shown."""
    with serve_robot("three_dof", board="sim") as server, open_page(browser, server.address) as page:
        wait_until(page, "document.documentElement.dataset.own === 'yes'")
        held: list[Route] = []
        late = [True]
        page.route("**/api/look", lambda route: held.append(route) if late else route.continue_())
        slider = page.locator("#sliders input[type=range]").nth(1)
        before = page.inner_text("#motors tbody")
        slider.evaluate("bar => { bar.value = 70; bar.dispatchEvent(new Event('input')); }")
        numbers = "[...document.querySelectorAll('#target input, #sliders input[type=number]')].map((box) => box.value)"
        first, motors = page.evaluate(numbers), page.inner_text("#motors tbody")
        names = page.locator("#branches .name").all_inner_texts()
        assert motors != before
        assert page.evaluate("document.documentElement.dataset.asking") == "yes"
        T = armkin.fk(armkin.load("three_dof"), np.deg2rad([float(number) for number in first[3:]]))
        assert [float(number) for number in first[:3]] == pytest.approx(T[:3, 3], abs=0.01)
        late.clear()
        for route in held:
            route.continue_()
        wait_for_answers(page)
        assert (page.evaluate(numbers), page.inner_text("#motors tbody")) == (first, motors)
        assert page.locator("#branches .name").all_inner_texts() == names


def test_a_joint_to_spare_swings_the_arm_about_its_tip(browser: Browser) -> None:
    with serve_robot("panda") as server, open_page(browser, server.address) as page:
        target = page.locator("#target input").evaluate_all("boxes => boxes.map((box) => box.value)")
        joints = page.locator("#sliders input[type=number]").evaluate_all("boxes => boxes.map((box) => +box.value)")
        page.locator("#sliders input[type=range]").nth(6).evaluate(
            "bar => { bar.value = 20; bar.dispatchEvent(new Event('input')); }"
        )
        wait_for_answers(page)
        turned = page.locator("#sliders input[type=number]").evaluate_all("boxes => boxes.map((box) => +box.value)")
        assert page.locator("#target input").evaluate_all("boxes => boxes.map((box) => box.value)") == target
        assert turned[6] == pytest.approx(20, abs=0.06)
        arm = armkin.load("panda")
        assert np.abs(armkin.fk(arm, np.deg2rad(turned)) - armkin.fk(arm, np.deg2rad(joints))).max() < 1e-2
        assert np.abs(np.array(turned) - joints).max() > 5
