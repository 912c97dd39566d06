"""Without --port: ARMKIN_PORT, else the only board that answers as the robot file's kind."""

import pytest

from armkin.board import ports
from command_line import THREE_DOF, run
from pty_board import PtyBoard


def plugged_in(monkeypatch: pytest.MonkeyPatch, *names: str) -> None:
    """What the operating system says is there."""
    found = [ports.Found(name, "a board", "USB", "Arduino Uno") for name in names]
    found.append(ports.Found("/dev/modem", "a modem", "USB", ""))
    for module in ("armkin.board.ports", "armkin.board.firmware.finding"):
        monkeypatch.setattr(f"{module}.list_ports", lambda: found)


def test_the_environment_names_a_port(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ARMKIN_PORT", "sim")
    assert run("send", THREE_DOF, -30, 5, -5, "--json").json["port"] == "sim"
    assert run("status", THREE_DOF, "--json").json["port"] == "sim"
    assert run("jog", THREE_DOF, "q1", 5).code == 0
    assert run("grip", THREE_DOF, "closed").code == 0
    given = run("send", THREE_DOF, 0, 90, -90, "-p", "/dev/ttyNOWHERE")
    assert given.code == 5
    assert "/dev/ttyNOWHERE" in given.err


def test_the_only_board_that_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    with PtyBoard("uno_servos") as other, PtyBoard() as board:
        plugged_in(monkeypatch, other.port, board.port)
        done = run("status", THREE_DOF, "--json")
        assert done.json["port"] == board.port
        assert done.err == f"note: using {board.port}, the only port where an uno_cnc_shield answers\n"
        assert run("send", THREE_DOF, 0, 80, -80, "--assume-home").code == 0
        assert run("stop", "--port", board.port).code == 0


def test_several_boards_or_none(monkeypatch: pytest.MonkeyPatch) -> None:
    plugged_in(monkeypatch)
    none = run("send", THREE_DOF, 0, 90, -90)
    assert (none.code, none.out) == (2, "")
    assert "no port where an uno_cnc_shield answers was found" in none.err
    assert run("stop").code == 2
    with PtyBoard() as one, PtyBoard() as two:
        plugged_in(monkeypatch, one.port, two.port)
        several = run("send", THREE_DOF, 0, 90, -90)
        assert several.code == 2
        assert f"2 boards answer ({one.port}, {two.port})" in several.err


def test_a_dry_run_asks_for_no_port(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ARMKIN_PORT", "/dev/ttyNOWHERE")
    assert run("send", THREE_DOF, -30, 5, -5, "--dry-run").code == 0
