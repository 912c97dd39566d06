"""What stops an arm that a page has set in motion: the firmware in the emulator."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from emulator import EmulatedBoard
from pins import net_steps, rests_within
from served_page import MOVES, Elsewhere, Page, serve_robot
from switches import assert_found, fit_switches, with_switches

from armkin.board.firmware.wire.session import Session
from command_line import COUNTS, POSE, ROOT, run

HOME = [0, 90, -90]


@pytest.fixture
def page_and_board() -> Iterator[tuple[Page, EmulatedBoard]]:
    with EmulatedBoard() as board, serve_robot(board=board.port) as server:
        page = Page(server)
        page.hear("control", lambda news: news["holder"] == "yours")
        page.idle()
        yield page, board
        page.close()


def state_after(page: Page) -> Any:
    """The board's state once it has done what it was asked for."""
    state = page.idle()
    assert state["error"] == ""
    return state


def begin_move(page: Page, board: EmulatedBoard) -> None:
    """A move to the pose that has come a good way, and has 5 s to go."""
    if page.idle()["position"] != "known":
        assert page.act("assume_home", consent=True)[0] == 200
        assert page.idle()["position"] == "known"
    assert page.act("send", q=POSE, speed=20)[0] == 200
    end = time.monotonic() + 60
    while net_steps(board)[1] > -2000:
        assert time.monotonic() < end, page.state()
        time.sleep(0.01)


def test_a_lost_position_is_not_sent_from_and_home_is_assumed_with_consent(
    page_and_board: tuple[Page, EmulatedBoard],
) -> None:
    page, board = page_and_board
    assert page.idle()["position"] == "lost"
    page.act("send", q=POSE, speed=100)
    assert "position is lost" in page.idle()["error"]
    assert page.act("assume_home")[0] == 422  # without the consent
    assert net_steps(board) == [0, 0, 0]
    page.act("assume_home", consent=True)
    state = page.idle()
    assert (state["position"], state["pulses"]) == ("known", [0, 0, 0])
    page.act("send", q=POSE, speed=100)
    assert state_after(page)["pulses"] == COUNTS
    assert net_steps(board) == COUNTS


def test_stop_is_on_the_line_within_a_tenth_of_a_second_while_requests_are_under_way(
    page_and_board: tuple[Page, EmulatedBoard], monkeypatch: pytest.MonkeyPatch
) -> None:
    page, board = page_and_board
    held: list[float] = []
    before = Session.hold

    def hold(session: Session) -> Any:
        held.append(time.monotonic())
        return before(session)

    monkeypatch.setattr(Session, "hold", hold)
    # The page asks for poses that take long (the nearest of an unreachable target), one after another.
    end, is_asked = threading.Event(), threading.Event()

    def ask() -> None:
        while not end.is_set():
            page.act("look", q=HOME, target=[2000, 500, 300], nearest=True)
            is_asked.set()

    took: list[float] = []
    while not took or (min(took) >= 0.1 and len(took) < 8):  # a machine that is busy itself is late now and then
        begin_move(page, board)
        end.clear()
        busy = threading.Thread(target=ask)
        busy.start()
        try:
            is_asked.clear()
            assert is_asked.wait(60)
            held.clear()
            began = time.monotonic()
            assert page.act("stop")[0] == 200
            state = page.idle()
        finally:
            end.set()
            busy.join()
        took.append(held[0] - began)
        assert state["error"] == "stopped"
        assert state["position"] == "known"
        assert state["pulses"] == net_steps(board)
        page.act("send", q=HOME, speed=100)
        page.idle()
    assert min(took) < 0.1


def test_a_closed_page_holds_the_arm(page_and_board: tuple[Page, EmulatedBoard]) -> None:
    page, board = page_and_board
    begin_move(page, board)
    page.close()
    rests_within(board, 1.0)
    state = page.idle()
    assert state["position"] == "known"
    assert state["pulses"] == net_steps(board) != COUNTS


def test_a_watching_page_that_is_closed_holds_nothing(page_and_board: tuple[Page, EmulatedBoard]) -> None:
    page, board = page_and_board
    watcher = Page(page.server)
    begin_move(page, board)
    watcher.close()
    assert state_after(page)["pulses"] == COUNTS


def test_a_paused_server_holds_the_arm(tmp_path: Path) -> None:
    with EmulatedBoard() as board:
        command = [sys.executable, "-m", "armkin", "teach", "robots/three_dof.yaml", "--no-open", "--port", board.port]
        process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        try:
            assert process.stdout is not None
            page = Elsewhere(process.stdout.readline().strip())
            page.listen()
            page.act("assume_home", consent=True)
            page.act("send", q=POSE, speed=20)
            end = time.monotonic() + 60
            while net_steps(board)[1] > -2000:
                assert time.monotonic() < end
                time.sleep(0.01)
            board.control("patience off")
            process.send_signal(signal.SIGSTOP)
            rests_within(board, 1.0)
            process.send_signal(signal.SIGCONT)
            status = page.hear(lambda state: bool(state["error"]))
            assert "half a second" in status["error"]
            assert status["position"] == "known"
            assert status["pulses"] == net_steps(board)
            process.send_signal(signal.SIGTERM)
            assert process.wait(60) == 143
            assert process.stderr is not None
            assert process.stderr.read() == MOVES
        finally:
            process.kill()
            process.communicate()


def test_a_server_that_ends_stops_the_arm_first() -> None:
    with EmulatedBoard() as board:
        with serve_robot(board=board.port) as server:
            page = Page(server)
            page.hear("control", lambda news: news["holder"] == "yours")
            page.idle()
            begin_move(page, board)
        rests_within(board, 0.2)
        status = run("status", "robots/three_dof.yaml", "--port", board.port, "--json").json
        assert status["position"] == "retained"  # opening the port has reset the board, which stood still
        page.close()


def test_switches_are_found_from_the_page(tmp_path: Path) -> None:
    robot = with_switches(tmp_path / "homing.yaml")
    with EmulatedBoard() as board, serve_robot(robot, board.port) as server:
        page = Page(server)
        page.hear("control", lambda news: news["holder"] == "yours")
        assert page.idle()["position"] == "lost"
        fit_switches(board)
        assert page.act("home") == (200, {})
        state = page.idle()
        assert (state["position"], state["error"]) == ("known", "")
        assert_found(state["pulses"], net_steps(board))
        page.act("send", q=POSE, speed=100)
        assert state_after(page)["pulses"] == COUNTS
        page.close()


def test_switches_are_found_in_simulation(tmp_path: Path) -> None:
    robot = with_switches(tmp_path / "homing.yaml")
    robot.write_text(robot.read_text().replace("speed: 20", "speed: 60"))  # it takes its time there, too
    with serve_robot(robot, "sim") as server:
        page = Page(server)
        page.hear("control", lambda news: news["holder"] == "yours")
        page.idle()
        assert page.act("home") == (200, {})
        state = page.idle()
        assert (state["position"], state["error"]) == ("known", "")
        assert state["joints"] == pytest.approx([-121, 121, -125], abs=4)  # beside the switches
        page.close()
