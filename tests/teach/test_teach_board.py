"""What the page may have a board do, and what stops it: the simulated board, and the firmware in the emulator."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from emulator import EmulatedBoard
from served import Page, served

import armkin
from armkin.board.firmware.session import Session
from armkin.model import units
from command_line import ROOT, run

POSE = [-30, 5, -5]
COUNTS = [-1067, -10144, 5667]
HOME = [0, 90, -90]


@pytest.fixture
def sim() -> Iterator[Page]:
    with served(board="sim") as server:
        page = Page(server)
        page.hear("control", lambda news: news["holder"] == "yours")
        page.idle()
        yield page
        page.close()


@pytest.fixture
def emulated() -> Iterator[tuple[Page, EmulatedBoard]]:
    with EmulatedBoard() as board, served(board=board.port) as server:
        page = Page(server)
        page.hear("control", lambda news: news["holder"] == "yours")
        page.idle()
        yield page, board
        page.close()


def net(board: EmulatedBoard) -> list[int]:
    return [board.net()[axis] for axis in "XYZ"]


def rests_within(board: EmulatedBoard, seconds: float) -> None:
    """Simulated time until the pins are still."""
    clock = 16_000_000
    begin = board.control("cycles")["cycle"]
    before, since = net(board), begin
    while True:
        now, at = board.control("cycles")["cycle"], net(board)
        if at != before:
            before, since = at, now
        if now - since > 0.2 * clock:
            break
    assert (since - begin) / clock < seconds


def begin_move(page: Page, board: EmulatedBoard) -> None:
    """A move to the pose that has come a good way."""
    assert page.act("assume_home", consent=True)[0] == 200
    assert page.idle()["position"] == "known"
    assert page.act("send", q=POSE, speed=50)[0] == 200
    end = time.monotonic() + 20
    while net(board)[1] > -2000:
        assert time.monotonic() < end, page.idle()
        time.sleep(0.01)


# ---- the simulated board


def test_a_pose_is_sent_as_by_the_command_line(sim: Page) -> None:
    assert sim.act("send", q=POSE, speed=100) == (200, {})
    seen = sim.hear("board", lambda state: state["doing"] == "send" and state["joints"][1] < 80)
    assert 5 < seen["joints"][1] < 80  # where the pins are, on the way
    state = sim.idle()
    said = run("send", "robots/three_dof.yaml", *POSE, "--port", "sim", "--json").json
    assert state["pulses"] == said["pulses"] == COUNTS
    assert state["joints"] == said["joints"]
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
    assert sim.act("send", q=POSE, speed=100)[0] == 200
    time.sleep(0.5)
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
    with served(path, "sim") as server:
        page = Page(server)
        page.idle()
        path.write_text(path.read_text().replace("a: 258", "a: 200"))
        for name, fields in (("send", {"q": POSE, "speed": 100}), ("jog", {"joint": 0, "percent": 10})):
            status, answer = page.act(name, **fields)
            assert status == 422
            assert "has changed" in answer["error"]
        assert page.idle()["pulses"] == [0, 0, 0]
        page.close()


def test_a_jog_lasts_as_long_as_it_is_asked_for(sim: Page) -> None:
    for _ in range(6):
        assert sim.act("jog", joint=0, percent=50)[0] == 200
        time.sleep(0.1)
    began = time.monotonic()  # the page falls silent
    state = sim.idle()
    assert time.monotonic() - began < 1.0
    assert 10 < state["joints"][0] < 80  # 30 deg/s for about a second; 60 s would have taken it to its limit
    assert sim.act("jog", joint=0, percent=-50)[0] == 200
    assert sim.act("jog_end")[0] == 200
    began = time.monotonic()
    sim.idle()
    assert time.monotonic() - began < 0.5


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
    sim.act("look", q=[20, 80, -80])
    time.sleep(0.4)
    assert sim.idle()["pulses"] == [0, 0, 0]
    assert sim.act("follow", on=True)[1] == {"on": True}
    sim.act("look", q=[6, 90, -90])
    time.sleep(0.2)
    state = sim.idle()
    assert state["joints"] == pytest.approx([6, 90, -90], abs=0.02)
    sim.act("look", q=[6, 130, -90])  # outside: not followed
    time.sleep(0.4)
    assert sim.idle()["joints"] == pytest.approx([6, 90, -90], abs=0.02)
    sim.act("look", q=[60, 90, -90])
    time.sleep(0.5)
    sim.act("stop")
    stopped = sim.idle()["pulses"]
    sim.act("look", q=[0, 90, -90])
    time.sleep(0.4)
    assert sim.idle()["pulses"] == stopped  # STOP has switched it off


def test_homing_without_switches_is_refused(sim: Page) -> None:
    status, answer = sim.act("home")
    assert status == 422
    assert "homing" in answer["error"]


def test_a_port_that_is_none(tmp_path: Path) -> None:
    with served(board=str(tmp_path / "no_such_port")) as server:
        page = Page(server)
        state = page.idle()
        assert not state["connected"]
        assert "no port" in state["error"]
        assert page.act("look", q=HOME)[0] == 200
        page.close()


@pytest.mark.parametrize(("robot", "differs"), [("three_dof_grbl", "GRBL has no checksum"), ("bus_arm", "degree")])
def test_boards_of_others_as_far_as_they_can(robot: str, differs: str) -> None:
    arm = armkin.load(str(ROOT / f"tests/robots/{robot}.yaml"))
    goal = units.home_out(arm)
    goal[0] += 10
    with served(ROOT / f"tests/robots/{robot}.yaml", "sim") as server:
        page = Page(server)
        page.hear("control", lambda news: news["holder"] == "yours")
        state = page.idle()
        assert (state["position"], state["error"]) == ("known", "")
        assert any(differs in text for text in state["differences"])
        assert page.act("send", q=goal, speed=100)[0] == 200
        assert page.idle()["error"] == ""
        assert page.idle()["joints"] == pytest.approx(goal, abs=1)
        assert page.act("jog", joint=0, percent=-20)[0] == 200
        state = page.idle()
        assert state["error"] == ""
        assert state["joints"][0] < goal[0] - 1
        assert page.act("stop")[0] == 200
        assert page.idle()["position"] == "known"
        assert page.act("home")[0] in (200, 422)
        page.idle()
        page.close()


# ---- the firmware


def test_a_lost_position_is_not_sent_from_and_home_is_assumed_with_consent(
    emulated: tuple[Page, EmulatedBoard],
) -> None:
    page, board = emulated
    assert page.idle()["position"] == "lost"
    page.act("send", q=POSE, speed=100)
    assert "position is lost" in page.idle()["error"]
    assert page.act("assume_home")[0] == 422  # without the consent
    assert net(board) == [0, 0, 0]
    page.act("assume_home", consent=True)
    state = page.idle()
    assert (state["position"], state["pulses"]) == ("known", [0, 0, 0])
    page.act("send", q=POSE, speed=100)
    assert page.idle()["pulses"] == COUNTS
    assert net(board) == COUNTS


def test_stop_is_on_the_line_within_a_tenth_of_a_second_while_requests_are_under_way(
    emulated: tuple[Page, EmulatedBoard], monkeypatch: pytest.MonkeyPatch
) -> None:
    page, board = emulated
    held: list[float] = []
    before = Session.hold

    def hold(session: Session) -> Any:
        held.append(time.monotonic())
        return before(session)

    monkeypatch.setattr(Session, "hold", hold)
    begin_move(page, board)
    # The page asks for poses that take long (the nearest of an unreachable target), one after another.
    end = threading.Event()

    def ask() -> None:
        while not end.is_set():
            page.act("look", q=HOME, target=[2000, 500, 300], nearest=True)

    busy = threading.Thread(target=ask)
    busy.start()
    try:
        time.sleep(0.1)
        began = time.monotonic()
        assert page.act("stop")[0] == 200
        state = page.idle()
    finally:
        end.set()
        busy.join()
    assert held[0] - began < 0.1
    assert state["error"] == "stopped"
    assert state["position"] == "known"
    assert state["pulses"] == net(board)


def test_a_closed_page_holds_the_arm(emulated: tuple[Page, EmulatedBoard]) -> None:
    page, board = emulated
    begin_move(page, board)
    page.close()
    rests_within(board, 1.0)
    state = page.idle()
    assert state["position"] == "known"
    assert state["pulses"] == net(board) != COUNTS


def test_a_watching_page_that_is_closed_holds_nothing(emulated: tuple[Page, EmulatedBoard]) -> None:
    page, board = emulated
    watcher = Page(page.server)
    begin_move(page, board)
    watcher.close()
    assert page.idle()["pulses"] == COUNTS


def test_a_paused_server_holds_the_arm(tmp_path: Path) -> None:
    with EmulatedBoard() as board:
        command = [sys.executable, "-m", "armkin", "teach", "robots/three_dof.yaml", "--no-open", "--port", board.port]
        process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        try:
            assert process.stdout is not None
            page = _Elsewhere(process.stdout.readline().strip())
            page.act("assume_home", consent=True)
            page.act("send", q=POSE, speed=50)
            end = time.monotonic() + 20
            while net(board)[1] > -2000:
                assert time.monotonic() < end
                time.sleep(0.01)
            process.send_signal(signal.SIGSTOP)
            rests_within(board, 1.0)
            process.send_signal(signal.SIGCONT)
            time.sleep(0.5)
            status = page.act("open")["board"]
            assert "half a second" in status["error"]
            assert status["position"] == "known"
            assert status["pulses"] == net(board)
            process.send_signal(signal.SIGTERM)
            assert process.wait(10) == 143
            assert process.stderr is not None
            assert process.stderr.read() == ""
        finally:
            process.kill()
            process.communicate()


class _Elsewhere:
    """The page of a server in another process."""

    def __init__(self, address: str) -> None:
        self.base, _, self.key = address.partition("/#")
        self.tab = ""
        self.tab = self.act("open")["tab"]
        self.events = urllib.request.urlopen(f"{self.base}/events?tab={self.tab}")
        for _ in range(200):
            if not self.act("open")["board"]["doing"]:
                break
            time.sleep(0.05)

    def act(self, name: str, **fields: Any) -> Any:
        headers = {"Origin": self.base, "Content-Type": "application/json", "X-Armkin-Key": self.key}
        request = urllib.request.Request(
            f"{self.base}/api/{name}", json.dumps(fields).encode(), {**headers, "X-Armkin-Tab": self.tab}
        )
        for _ in range(100):
            try:
                return json.load(urllib.request.urlopen(request))
            except urllib.error.HTTPError as error:
                if error.code != 409:
                    raise
                time.sleep(0.05)  # busy still
        raise AssertionError(f"{name}: busy all the time")


def test_a_server_that_ends_stops_the_arm_first() -> None:
    with EmulatedBoard() as board:
        with served(board=board.port) as server:
            page = Page(server)
            page.hear("control", lambda news: news["holder"] == "yours")
            page.idle()
            begin_move(page, board)
        rests_within(board, 0.2)
        status = run("status", "robots/three_dof.yaml", "--port", board.port, "--json").json
        assert status["position"] == "retained"  # opening the port has reset the board, which stood still
        page.close()
