"""`armkin jog` on the simulated board."""

from __future__ import annotations

from pathlib import Path

import pytest

from command_line import ROOT, THREE_DOF, run
from pty_board import PtyBoard


def test_jog() -> None:
    completed = run("jog", THREE_DOF, "q1", -30, "--port", "sim", "--seconds", "0.5", "--json")
    assert completed.code == 0, completed.err
    assert -20 < completed.json["joints"][0] < -13
    assert completed.json["joints"][1:] == pytest.approx([90, -90])
    assert run("jog", THREE_DOF, "q9", 5, "--port", "sim").code == 2
    assert run("jog", THREE_DOF, "q1", 61, "--port", "sim").code == 2


def test_a_board_of_another_file_is_told_by_send_where_the_arm_stands(tmp_path: Path) -> None:
    """The command that is advised is one that can be typed, and jog works after it."""
    other = tmp_path / "other.yaml"
    other.write_text((ROOT / THREE_DOF).read_text().replace("max_accel: 120", "max_accel: 110"))
    with PtyBoard() as board:
        assert run("send", THREE_DOF, "home", "--port", board.port, "--assume-home").code == 0
        jog = ("jog", other, "q1", 5, "--port", board.port, "--seconds", 0.1)
        refused = run(*jog)
        assert (refused.code, refused.out) == (5, "")
        advised = f"armkin send {other} home --port {board.port} --assume-home"
        assert f"\n  put the arm in its home pose, then {advised}\n" in refused.err
        assert run(*advised.split()[1:]).code == 0
        assert run(*jog).code == 0


def test_the_help_says_which_boards_jog_while_the_position_is_lost() -> None:
    text = " ".join(run("jog", "--help").out.split())
    assert "boards with armkin's firmware move while the position is lost, too, at an eighth of max_speed" in text
