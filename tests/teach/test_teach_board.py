"""What the page may have a board do, and what it may not: the simulated boards."""

from __future__ import annotations

import shutil
import time
from pathlib import Path
from typing import Any

import pytest
from served_page import Page, serve_robot

import armkin
from armkin.model import units
from armkin.teach.board_thread import Job
from command_line import COUNTS, POSE, ROOT, run

HOME = [0, 90, -90]


def test_a_pose_is_sent_as_by_the_command_line(sim: Page) -> None:
    assert sim.act("send", q=POSE, speed=100) == (200, {})
    on_the_way = sim.hear("board", lambda state: state["doing"] == "send" and state["joints"][1] < 80)
    assert 5 < on_the_way["joints"][1] < 80  # where the pins are, on the way
    state = sim.idle()
    sent = run("send", "robots/three_dof.yaml", *POSE, "--port", "sim", "--json").json
    assert state["pulses"] == sent["pulses"] == COUNTS
    assert state["joints"] == sent["joints"]
    assert state["error"] == ""
    look = sim.act("look", q=HOME)[1]
    assert look["motors"]["from"] == "arm"
    assert look["motors"]["moves"] == [-n for n in COUNTS]


def test_what_would_leave_the_limits_is_refused_before_the_board_hears_of_it(sim: Page) -> None:
    status, answer = sim.act("send", q=[0, 130, 0], speed=100)
    assert (status, answer["kind"]) == (422, "no_solution")
    assert "q2 = 130 deg is outside -20 to 120 deg" in answer["error"]
    assert sim.idle()["pulses"] == [0, 0, 0]


@pytest.mark.parametrize("speed", [0, 101, -5, "fast", None])
def test_a_speed_that_is_none_is_refused(sim: Page, speed: Any) -> None:
    assert sim.act("send", q=POSE, speed=speed)[0] == 422


def test_one_job_at_a_time_and_stop_passes_it(sim: Page) -> None:
    assert sim.act("send", q=POSE, speed=20)[0] == 200  # 7 s: on a busy machine, too, it is stopped on its way
    sim.hear("board", lambda state: state["doing"] == "send" and state["pulses"][1] < 0)  # it is on the way
    status, answer = sim.act("send", q=HOME, speed=100)
    assert (status, "busy" in answer["error"]) == (409, True)
    assert sim.act("stop")[0] == 200
    state = sim.idle()
    assert state["error"] == "stopped"
    assert state["position"] == "known"
    assert COUNTS[1] < state["pulses"][1] < 0
    assert sim.act("send", q=HOME, speed=100)[0] == 200
    assert sim.idle()["pulses"] == [0, 0, 0]


def test_a_robot_file_that_has_changed_moves_nothing(tmp_path: Path) -> None:
    path = tmp_path / "arm.yaml"
    shutil.copy(ROOT / "robots/three_dof.yaml", path)
    with serve_robot(path, "sim") as server:
        page = Page(server)
        page.idle()
        path.write_text(path.read_text().replace("a: 258", "a: 200"))
        for name, fields in (("send", {"q": POSE, "speed": 100}), ("jog", {"press": 1, "joint": 0, "percent": 10})):
            status, answer = page.act(name, **fields)
            assert status == 422
            assert "has changed" in answer["error"]
        assert page.idle()["pulses"] == [0, 0, 0]
        page.close()


def test_a_jog_lasts_as_long_as_it_is_asked_for(sim: Page) -> None:
    sim.jog(lambda now: now["joints"][0] > 15, joint=0, percent=50)
    began = sim.clock()  # the page falls silent
    state = sim.idle()
    assert sim.clock() - began < 1.0
    assert 15 < state["joints"][0] < 80  # 30 deg/s for about a second; 60 s would have taken it to its limit
    sim.jog(lambda now: now["joints"][0] < state["joints"][0] - 3, joint=0, percent=-50)
    sim.let_go()
    began = sim.clock()
    sim.idle()
    assert sim.clock() - began < 0.5


def test_a_jog_that_begins_before_its_request_is_answered_is_one(sim: Page, monkeypatch: pytest.MonkeyPatch) -> None:
    board = sim.server.actions.board
    assert board is not None
    submit = board.thread.submit

    def late(name: str, job: Job) -> None:
        submit(name, job)
        time.sleep(0.2)  # this thread has to wait for its turn

    monkeypatch.setattr(board.thread, "submit", late)
    assert sim.press(joint=0, percent=100)[0] == 200
    assert sim.idle()["pulses"][0] > 0  # its button counts as held from its request on


def test_one_press_begins_one_jog_whatever_comes_late(sim: Page) -> None:
    first = {"press": 1, "joint": 0, "percent": 100}
    assert sim.act("jog", **first)[0] == 200
    stood = sim.idle()["pulses"]  # nothing was heard of its button for 0.3 s
    assert stood[0] > 0
    for late in ("jog_on", "jog", "jog_end", "jog_on", "jog"):
        assert sim.act(late, **first)[0] == 200
        assert sim.idle()["pulses"] == stood
    second = {**first, "press": 2}  # let go before it was heard of
    for late in ("jog_on", "jog_end", "jog", "jog_on"):
        assert sim.act(late, **second)[0] == 200
        assert sim.idle()["pulses"] == stood
    assert sim.act("send", q=HOME, speed=20)[0] == 200
    assert sim.act("jog", **{**first, "press": 3})[0] == 409  # busy: this press begins nothing afterwards, either
    assert sim.idle()["pulses"] == [0, 0, 0]
    assert sim.act("jog_on", press=3)[0] == 200
    assert sim.act("jog", **{**first, "press": 3})[0] == 200
    assert sim.idle()["pulses"] == [0, 0, 0]
    assert sim.act("jog", joint=0, percent=100)[0] == 422  # of no press


def test_the_gripper(sim: Page) -> None:
    assert sim.act("grip", value="closed")[0] == 200
    state = sim.idle()
    assert state["error"] == ""
    assert sim.act("grip", value="ajar")[0] == 422
    assert sim.act("grip", value=500)[0] == 422
    assert sim.act("grip", value=60)[0] == 200
    sim.idle()


def test_a_program_is_carried_out_with_the_gripper_in_between(sim: Page) -> None:
    sim.act("program", do="record", kind="joint", q=POSE)
    sim.act("program", do="record", kind="grip", value="closed")
    sim.act("program", do="record", kind="joint", q=[10, 80, -80])
    assert sim.act("run", speed=100) == (200, {})
    state = sim.idle()
    assert state["error"] == ""
    assert state["joints"] == pytest.approx([10, 80, -80], abs=0.02)
    assert state["done_s"] == pytest.approx(state["total_s"], abs=0.2)
    sim.act("program", do="clear")
    sim.act("program", do="settings", blend=5)
    for q in ([-20, 60, -70], [20, 45, -60]):
        sim.act("program", do="record", kind="line", q=q)
    assert sim.act("run", speed=100) == (200, {})
    state = sim.idle()
    assert state["error"] == ""
    assert state["joints"] == pytest.approx([20, 45, -60], abs=0.02)
    sim.act("program", do="record", kind="joint", q=[10, 130, -80])
    sim.act("run", speed=100)
    after = sim.idle()
    assert "outside" in after["error"]
    assert after["pulses"] == state["pulses"]  # nothing of it was begun


def test_nothing_follows_unless_it_is_told_to(sim: Page) -> None:
    sim.act("look", q=[20, 80, -80], goal=True)
    time.sleep(0.4)
    assert sim.idle()["pulses"] == [0, 0, 0]
    assert sim.act("follow", on=True)[1] == {"on": True}
    sim.act("look", q=[6, 90, -90], goal=True)
    state = sim.idle()
    assert state["joints"] == pytest.approx([6, 90, -90], abs=0.02)
    sim.act("look", q=[6, 130, -90], goal=True)  # outside: not followed
    time.sleep(0.4)
    assert sim.idle()["joints"] == pytest.approx([6, 90, -90], abs=0.02)
    sim.act("look", q=[60, 90, -90], goal=True)
    sim.hear("board", lambda state: state["doing"] == "follow" and state["joints"][0] > 8)
    sim.act("stop")
    stopped = sim.idle()["pulses"]
    assert stopped[0] < 60 * 12800 / 360 - 100
    sim.act("look", q=[0, 90, -90], goal=True)
    time.sleep(0.4)
    assert sim.idle()["pulses"] == stopped  # STOP has switched it off


def test_homing_without_switches_is_refused(sim: Page) -> None:
    status, answer = sim.act("home")
    assert status == 422
    assert "homing" in answer["error"]


def test_a_port_that_is_none(tmp_path: Path) -> None:
    with serve_robot(board=str(tmp_path / "no_such_port")) as server:
        page = Page(server)
        state = page.idle()
        assert not state["connected"]
        assert "no port" in state["error"]
        assert page.act("look", q=HOME)[0] == 200
        page.close()


@pytest.mark.parametrize(
    ("robot", "differs"),
    [("three_dof_grbl", "GRBL has no checksum"), ("bus_arm", "degree"), ("three_dof_klipper", "M112 stops at once")],
)
def test_boards_of_others_as_far_as_they_can(robot: str, differs: str) -> None:
    arm = armkin.load(str(ROOT / f"tests/robots/{robot}.yaml"))
    goal = units.home_out(arm)
    goal[0] += 10
    with serve_robot(ROOT / f"tests/robots/{robot}.yaml", "sim") as server:
        page = Page(server)
        page.hear("control", lambda news: news["holder"] == "yours")
        state = page.idle()
        assert (state["position"], state["error"]) == ("known", "")
        assert any(differs in text for text in state["differences"])
        assert page.act("send", q=goal, speed=100)[0] == 200
        assert page.idle()["error"] == ""
        assert page.idle()["joints"] == pytest.approx(goal, abs=1)
        for _ in range(20):  # a page that is not heard of for 0.3 s, on a busy machine, has let the button go
            assert page.press(joint=0, percent=-20)[0] == 200
            state = page.idle()
            assert state["error"] == ""
            if state["joints"][0] < goal[0] - 1:
                break
        assert state["joints"][0] < goal[0] - 1
        began = page.clock()
        assert page.act("send", q=units.home_out(arm), speed=2)[0] == 200  # 3 s or more
        page.hear("board", lambda news: bool(news["doing"]))
        assert page.act("stop")[0] == 200  # in the clock's time: there is something to stop
        state = page.idle()
        assert state["position"] == "known"
        assert state["joints"][0] > units.home_out(arm)[0] + 1
        assert page.clock() - began < 5
        assert page.act("home")[0] in (200, 422)
        page.idle()
        page.close()


def test_the_gripper_of_a_board_of_others_as_by_the_command_line(tmp_path: Path) -> None:
    text = (ROOT / "tests/robots/three_dof_grbl.yaml").read_text()
    begin, end = text.index("gripper:"), text.index("# The paper has no limit switches")
    path = tmp_path / "spindle.yaml"
    path.write_text(text[:begin] + "gripper: {kind: spindle, open: 40, closed: 200}\n" + text[end:])
    with serve_robot(path, "sim") as server:
        page = Page(server)
        page.hear("control", lambda news: news["holder"] == "yours")
        page.idle()
        status, answer = page.act("grip", value=201)
        assert (status, "outside of the gripper's 40 to 200" in answer["error"]) == (422, True)
        assert page.act("grip", value="closed")[0] == 200
        assert page.idle()["error"] == ""
        link = server.actions.board.thread.link  # type: ignore[union-attr]
        assert link.port.spindle == 200  # type: ignore[union-attr]
        page.close()
