"""`--trace` and the logger `armkin.board`: bytes at DEBUG, states at INFO."""

from __future__ import annotations

import logging

import pytest

import armkin
from armkin.board.kinds import board_of
from armkin.board.open_board import open_board
from command_line import ROOT, THREE_DOF, run

GRBL = ROOT / "tests/robots/three_dof_grbl.yaml"


@pytest.mark.parametrize("robot", [THREE_DOF, GRBL, "so101", ROOT / "tests/robots/three_dof_klipper.yaml"])
def test_trace_tells_bytes_and_states_on_stderr_and_nothing_else_changes(robot: str) -> None:
    plain = run("status", robot, "--port", "sim", "--json")
    traced = run("status", robot, "--port", "sim", "--json", "--trace")
    assert (traced.code, traced.out) == (0, plain.out)
    assert " DEBUG " in traced.err
    assert " sim > b" in traced.err
    assert " sim < b" in traced.err
    assert "found: position " in traced.err
    assert " DEBUG " not in plain.err
    assert " DEBUG " not in run("status", robot, "--port", "sim").err  # it ends with its command
    assert "--trace" not in run("fk", "--help").out


def test_send_s_trace_is_its_plan_and_log_tells_the_line() -> None:
    completed = run("send", THREE_DOF, 1, 89, -89, "--port", "sim", "--log")
    assert (completed.code, " DEBUG " in completed.err) == (0, True)
    assert run("send", THREE_DOF, 1, 89, -89, "--dry-run", "--trace", "-").out.startswith("time")


def test_the_logger_tells_motions_and_states(caplog: pytest.LogCaptureFixture) -> None:
    arm = armkin.load(GRBL)
    with caplog.at_level(logging.INFO, "armkin.board"), open_board(board_of(arm), "sim") as machine:
        machine.prepare()
        machine.run([machine.plan(machine.counts(), arm.home + 0.1)])
    messages = [record.getMessage() for record in caplog.records]
    assert any(text.startswith("motion from [0, 0, 0] to [") for text in messages)
    assert {"GRBL: Idle", "GRBL: Run"} <= set(messages)
    assert messages[-1].startswith("left: position known, counts [")
    assert not any(record.levelno < logging.INFO for record in caplog.records)
