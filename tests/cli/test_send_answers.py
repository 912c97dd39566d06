"""What other commands answer is piped into `armkin send`."""

from __future__ import annotations

import json
import os
import pty
import shutil
from collections.abc import Sequence
from pathlib import Path

import pytest

from command_line import POSE, ROOT, THREE_DOF, run, run_process


@pytest.mark.parametrize("words", [("fk", *POSE), ("pulses", *POSE), ("ik", 390, 80, 300)])
def test_answers_can_be_piped_in(words: Sequence[object]) -> None:
    command, *numbers = words
    answer = run(command, THREE_DOF, *numbers, "--json")
    completed = run("send", "--port", "sim", "--json", stdin=answer.out.encode())
    assert completed.code == 0, completed.err
    sent = answer.json if command != "ik" else answer.json["branches"][answer.json["best"]]
    assert completed.json["joints"] == pytest.approx(sent["joints"], abs=0.02)


def test_many_answers_can_be_piped_in(tmp_path: Path) -> None:
    rows = tmp_path / "targets.csv"
    rows.write_text("390,80,300\n380,60,280\n")
    answers = run("ik", THREE_DOF, "--batch", rows, "--json")
    completed = run("send", "--port", "sim", "--json", stdin=answers.out.encode())
    assert completed.json["waypoints"] == 2
    assert completed.json["position_mm"] == pytest.approx([380, 60, 280], abs=0.06)


def test_a_malformed_row_ends_a_stream_and_the_error_tells_what_was_sent() -> None:
    words = ("send", THREE_DOF, "--batch", "-", "--port", "sim")
    rows = b"10,80,-70\n12,78,-70\n1,x,3\n"
    for stdin, waypoints in ((rows, 2), (b"1,x,3\n", 0)):
        completed = run(*words, "--json", stdin=stdin)
        assert (completed.code, completed.out) == (2, "")
        answer = json.loads(completed.err)
        assert "x" in answer["error"]
        assert ("sent" in answer) == (waypoints > 0)
        if waypoints:
            assert answer["sent"]["waypoints"] == waypoints
            assert answer["sent"]["joints"] == pytest.approx([12, 78, -70], abs=0.02)
    people = run(*words, stdin=rows)
    assert people.code == 2
    assert "read back: as planned" in people.out


def test_an_answer_without_a_best_branch_is_refused() -> None:
    answer = run("ik", THREE_DOF, 3900, 80, 300, "--json")
    completed = run("send", "--port", "sim", stdin=answer.out.encode())
    assert (completed.code, completed.out) == (3, "")
    assert "no branch within limits" in completed.err


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("best", False, "damaged"),
        ("branches", [1], "no joints to send"),
        ("branches", [None], "no joints to send"),
        ("pulses", [1, 2, 3.5], "damaged"),
        ("pulses", ["1", "2", "3"], "damaged"),
        ("pulses", [True, False, True], "damaged"),
        ("joints", ["1", 2, 3], "lists of numbers"),
        ("joints", [10**400, 0, 0], "finite"),
        ("joints", [float("nan"), 0, 0], "finite"),
    ],
)
def test_a_damaged_answer_is_refused(key: str, value: object, message: str) -> None:
    words = ("ik", THREE_DOF, 390, 80, 300) if key in ("best", "branches") else ("pulses", THREE_DOF, *POSE)
    answer = {**run(*words, "--json").json, key: value}
    if key == "joints":
        del answer["pulses"]
    completed = run("send", "--port", "sim", stdin=json.dumps(answer).encode())
    assert (completed.code, completed.out) == (2, "")
    assert message in completed.err


def test_an_answer_may_begin_with_a_byte_order_mark() -> None:
    answer = run("fk", THREE_DOF, *POSE, "--json")
    assert run("send", "--dry-run", stdin=b"\xef\xbb\xbf" + answer.out.encode()).code == 0


def test_a_changed_robot_file_is_noticed(tmp_path: Path) -> None:
    mine = tmp_path / "mine.yaml"
    shutil.copy(ROOT / THREE_DOF, mine)
    answer = run("fk", mine, *POSE, "--json")
    mine.write_text(mine.read_text() + "# a comment\n")
    completed = run("send", "--port", "sim", stdin=answer.out.encode())
    assert (completed.code, completed.out) == (1, "")
    assert "has changed" in completed.err


@pytest.mark.parametrize(
    ("stdin", "message"),
    [
        (b"", "standard input is empty"),
        (b"q1 = 5\n", "no JSON"),
        (b"[1, 2]", "it has no robot_file"),
        (b'{"robot_file": "robots/three_dof.yaml", "robot_sha256": 5, "joints": [1, 2, 3]}', "it has no robot_sha256"),
        (b"\xff\xfe{\x00}\x00", "no JSON"),
    ],
)
def test_what_is_no_answer_is_refused(stdin: bytes, message: str) -> None:
    completed = run("send", "--port", "sim", stdin=stdin)
    assert (completed.code, completed.out) == (2, "")
    assert message in completed.err


def test_nothing_to_send_and_a_terminal_as_input() -> None:
    master, slave = pty.openpty()
    try:
        completed = run_process("send", "--port", "sim", stdin=slave)
    finally:
        os.close(master)
        os.close(slave)
    assert completed.code == 2
    assert "nothing to send" in completed.err
