"""`armkin status`: what it says of the position and of the motors' power."""

from __future__ import annotations

import io
import os
import signal
import sys
from pathlib import Path

import pytest

from armkin.board.firmware.firmware_machine import FirmwareMachine
from armkin.board.sim.sim_board import SimBoard
from armkin.board_catalogue import BOARDS
from armkin.cli.commands import status
from command_line import ROOT, THREE_DOF, run
from sim_wire import plug_in


def test_status_says_that_a_power_cut_cannot_be_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """A position that is lost anyway cannot be made wrong by a cut."""
    plug_in(SimBoard(BOARDS["uno_cnc_shield"]), monkeypatch)
    lost = run("status", THREE_DOF, "--port", "COM3").out
    assert "motor power  not sensed\n" in lost
    assert "--power-cut" not in lost
    assert run("send", THREE_DOF, 10, 80, -80, "--port", "COM3", "--assume-home").code == 0
    text = run("status", THREE_DOF, "--port", "COM3").out
    assert "motor power  not sensed: after a cut the position above is wrong; armkin stop --power-cut" in text
    assert run("status", THREE_DOF, "--port", "COM3", "--json").json["motor_power"] is None


def test_status_tells_the_power_that_an_input_senses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = (ROOT / THREE_DOF).read_text()
    assert "driver: A4988" in text
    path = tmp_path / "sensed.yaml"
    path.write_text(text.replace("driver: A4988", "driver: A4988, power: A1"))
    board = SimBoard(BOARDS["uno_cnc_shield"])
    plug_in(board, monkeypatch)
    assert run("send", path, 10, 80, -80, "--port", "COM3", "--assume-home").code == 0
    assert run("status", path, "--port", "COM3", "--json").json["motor_power"] is True
    board.inputs.power_level = False
    cut = run("status", path, "--port", "COM3")
    assert "off: the position is lost" in cut.out
    assert "position lost" in cut.out or "position is lost" in cut.out


def test_status_of_a_board_that_knows_nothing() -> None:
    answer = run("status", THREE_DOF, "--port", "sim", "--json").json
    assert (answer["position"], answer["joints"], answer["configured"]) == ("lost", None, False)
    assert answer["state"] == "idle"
    assert "its position is lost" in run("status", THREE_DOF, "--port", "sim").out


def test_watch_tells_each_change_once_and_ends_with_ctrl_c(monkeypatch: pytest.MonkeyPatch) -> None:
    board = SimBoard(BOARDS["uno_cnc_shield"])
    plug_in(board, monkeypatch)
    assert run("send", THREE_DOF, 10, 80, -80, "--port", "COM3", "--assume-home").code == 0
    monkeypatch.setattr("armkin.cli.commands.status._READ_PERIOD", 0.001)
    count = 0

    def refresh(machine: FirmwareMachine) -> None:
        nonlocal count
        count += 1
        machine.status = machine.session.status()
        if count == 5:
            os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(FirmwareMachine, "refresh", refresh)
    watched = run("status", THREE_DOF, "--port", "COM3", "--watch", "--json")
    assert (watched.code, watched.err, count) == (0, "", 5)
    assert [line["position"] for line in watched.lines] == ["known"]


def test_a_watched_terminal_is_drawn_where_something_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = io.StringIO()
    monkeypatch.setattr(screen, "isatty", lambda: True)
    monkeypatch.setattr(sys, "stdout", screen)
    status._print_changes(iter(["at 1\n"] * 50 + ["at 2\n"]))
    assert screen.getvalue().count("at 1") == 1
    assert screen.getvalue().count("at 2") <= 2  # and once more at the end


def test_a_table_wider_than_a_terminal_stands_upright() -> None:
    completed = run("send", "so101", 20, 10, -30, 40, 0, "--port", "sim")
    assert max(map(len, completed.out.splitlines())) <= 80
    assert "  shoulder_pan/deg    20.0391\n" in completed.out
