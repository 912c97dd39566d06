"""What grows without bound is refused with its count, and what is long takes linear time."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import armkin
from armkin.board.kinds import board_of
from armkin.board.planner import Planner
from command_line import ROOT, run
from least_time import least_seconds

LONG = ["1" * 9_990, "0" * 9_990, "1" + "_" * 9_990, "1_" * 4_990]


@pytest.mark.parametrize("text", [*(word + "x" for word in LONG), "1" * 9_990 + "deg", "1:" * 4_990])
def test_long_words_take_no_long_time(text: str, tmp_path: Path) -> None:
    robot = tmp_path / "arm.yaml"
    robot.write_text((ROOT / "robots/three_dof.yaml").read_text().replace("d: 170", f"d: {text}"))

    def run_both() -> None:
        assert run("fk", "three_dof", text, 0, 0).code == 2
        assert run("info", robot).code == 4
        assert run("fk", "three_dof", "--batch", "-", stdin=f"{text},0,0\n".encode()).code == 2

    assert least_seconds(run_both, 1.5) < 1.5


def test_copies_of_a_branch_are_counted_before_they_are_made(tmp_path: Path) -> None:
    robot = tmp_path / "wide.yaml"
    lines = (ROOT / "robots/ur5e.yaml").read_text().splitlines()
    wide = [line.split("limits:")[0] + "limits: [-3600, 3600]" if "limits:" in line else line for line in lines]
    robot.write_text("\n".join(wide) + "\n")
    completed = run("ik", robot, 300, -200, 400, 180, 0, 0, "--turns")
    assert (completed.code, completed.out) == (2, "")
    assert "64,000,000 copies of one branch are within the limits; at most 50,000 are listed" in completed.err


def test_counts_beyond_a_boards_registers_are_refused(tmp_path: Path) -> None:
    robot = tmp_path / "free.yaml"
    text = (
        (ROOT / "robots/three_dof.yaml").read_text().partition("gripper:")[0].replace("max_speed: 60", "max_speed: 400")
    )
    robot.write_text("\n".join(line for line in text.splitlines() if "limits:" not in line) + "\n")
    completed = run("send", robot, "3.1e7", 0, 0, "--dry-run")
    assert (completed.code, completed.out) == (2, "")
    assert "motor q1 would stand at 1,102,222,222 counts; a board counts to 1,073,741,824" in completed.err


def test_standard_input_without_end_is_refused() -> None:
    completed = run("send", "--port", "sim", stdin=b"{}\n" * 11_000_000)
    assert (completed.code, completed.out) == (2, "")
    assert "more than 32 MB on standard input" in completed.err


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="a POSIX device")
@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("path three_dof /dev/zero", "larger than 32 MB"),
        ("send three_dof --dry-run --path /dev/zero", "larger than 32 MB"),
        ("info /dev/zero", "larger than 256 kB"),
        ("import /dev/zero", "larger than 8 MB"),
        ("calibrate three_dof /dev/zero", "no CSV"),
        ("fk three_dof --batch /dev/zero", "no CSV"),
        ("new x --convention standard --batch /dev/zero", "no CSV"),
    ],
)
def test_a_file_without_end_is_refused(words: str, message: str) -> None:
    completed = run(*words.split())
    assert completed.code in (1, 2, 4)
    assert completed.out == ""
    assert message in completed.err


def test_plans_that_were_sent_are_not_kept() -> None:
    """Rows on standard input may come for hours."""
    arm = armkin.load("three_dof")
    planner = Planner(board_of(arm), 1.0)
    sent: list[weakref.ref[Any]] = []

    def plans() -> Iterator[Any]:
        counts = planner.counts(arm.home)
        for goal in np.deg2rad([[0, 85, -85], [5, 80, -80], [0, 85, -85]]):
            made = planner.plan(counts, goal[None])
            counts = made.end.tolist()
            sent.append(weakref.ref(made))
            yield made

    for made in planner.sum_up(plans()):
        del made
    gc.collect()
    assert [reference() for reference in sent] == [None, None, None]
    assert planner.total_sent.waypoints == 3
    assert planner.total_sent.summary()["pulses"] == planner.counts(np.deg2rad([0, 85, -85]))
