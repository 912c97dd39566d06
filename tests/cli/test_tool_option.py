"""`--tool`: answers are those of the robot file with that tool, say so, and `send` wants the same one."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from command_line import ROOT, run

TOOL = {"xyz": [5.0, -6.0, 40.0], "rpy": [10.0, -20.0, 30.0]}
GIVEN = "--tool=5,-6,40,10,-20,30"
MADE_WITH = ("robot_file", "robot_sha256", "tool", "seconds")


@pytest.fixture
def robot_with_tool(tmp_path: Path) -> Path:
    """puma560 with that tool in its file."""
    document = yaml.safe_load((ROOT / "robots" / "puma560.yaml").read_text())
    path = tmp_path / "puma560.yaml"
    path.write_text(yaml.safe_dump({**document, "tool": TOOL}))
    return path


def _without_tool_keys(answer: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in answer.items() if key not in MADE_WITH}


@pytest.mark.parametrize(
    "words",
    [
        ("fk", "10", "20", "30", "40", "50", "60", "--frames"),
        ("ik", "390", "80", "300", "0", "90", "0", "--all-branches"),
        ("workspace", "--samples", "50"),
        ("path", "--via", "390,80,300,0,90,0", "--via", "390,90,300,0,90,0"),
        ("send", "--target", "390,80,300,0,90,0", "--port", "sim"),
    ],
    ids=lambda words: words[0],
)
def test_answers_are_those_of_a_file_with_that_tool(words: tuple[str, ...], robot_with_tool: Path) -> None:
    command, *arguments = words
    completed = run(command, "puma560", *arguments, GIVEN, "--json")
    want = run(command, robot_with_tool, *arguments, "--json")
    assert completed.code == want.code == 0, completed.err + want.err
    assert completed.json["tool"] == TOOL
    assert "tool" not in want.json
    assert _without_tool_keys(completed.json) == _without_tool_keys(want.json)


def test_three_numbers_turn_nothing() -> None:
    assert run("fk", "three_dof", 0, 0, 0, "--tool", "10,20,30", "--json").json["tool"]["rpy"] == [0, 0, 0]


def test_send_wants_the_tool_that_the_answer_was_made_with() -> None:
    made = run("ik", "three_dof", 390, 80, 300, "--tool", "0,0,20.5", "--json").out.encode()
    refused = run("send", "--port", "sim", "--json", stdin=made)
    assert refused.code == 1
    assert "another tool; give --tool 0.0,0.0,20.5,0.0,0.0,0.0" in refused.err
    assert run("send", "--port", "sim", "--tool", "0,0,21", stdin=made).code == 1
    sent = run("send", "--port", "sim", "--tool", "0,0,20.5", "--json", stdin=made)
    assert sent.code == 0, sent.err
    assert sent.json["position_mm"] == pytest.approx([390, 80, 300], abs=0.1)


@pytest.mark.parametrize("tool", ["1,2", "1,2,3,4", "1,2,x", "1,2,1e9", "1,2,nan", ""])
def test_what_is_no_tool_is_refused(tool: str) -> None:
    refused = run("fk", "three_dof", 0, 0, 0, "--tool", tool, "--json")
    assert (refused.code, refused.out) == (2, "")
    assert "tool" in refused.err


def test_a_batch_is_made_with_it() -> None:
    rows = b"q1,q2,q3\n0,0,0\n10,20,30\n"
    answers = run("fk", "three_dof", "--batch", "-", "--tool", "0,0,9", "--json", stdin=rows).lines
    want = [run("fk", "three_dof", *q, "--tool", "0,0,9", "--json").json for q in ((0, 0, 0), (10, 20, 30))]
    for row, expected_row in zip(answers, want, strict=True):
        assert row["position_mm"] == pytest.approx(expected_row["position_mm"], abs=1e-9)
