"""No output replaces what the command reads, whether by its name or through standard input."""

from __future__ import annotations

from pathlib import Path

import pytest

from command_line import THREE_DOF, run, run_process

PATH = "moves:\n  - point: [390, 80, 300]\n  - line: [390, 140, 300]\n"
CORNERS = "x,y,z\n390,80,300\n390,140,300\n"
POSES = "q1,q2,q3\n0,90,-90\n10,80,-80\n"


@pytest.mark.parametrize(("name", "text"), [("g.yaml", PATH), ("g.csv", CORNERS)])
def test_a_path_file_is_not_replaced_by_its_own_plan(tmp_path: Path, name: str, text: str) -> None:
    file = tmp_path / name
    file.write_text(text)
    linked = tmp_path / "linked.csv"
    linked.symlink_to(file)
    for words in (
        ("path", THREE_DOF, file, "--out", file),
        ("path", THREE_DOF, file, "--out", linked),
        ("send", THREE_DOF, "--path", file, "--dry-run", "--trace", file),
        ("send", THREE_DOF, "--path", file, "--port", "sim", "--trace", file),
    ):
        completed = run(*words)
        assert completed.code == 2, (words, completed.err)
        assert "is what this command reads" in completed.err
        assert file.read_text() == text


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("fk", THREE_DOF, "--batch", "-"), POSES),
        (("pulses", THREE_DOF, "--batch", "-"), POSES),
        (("ik", THREE_DOF, "--batch", "-"), CORNERS),
        (("path", THREE_DOF, "-"), CORNERS),
    ],
)
def test_what_comes_through_standard_input_is_not_replaced(tmp_path: Path, words: tuple[str, ...], text: str) -> None:
    file = tmp_path / "good.csv"
    file.write_text(text)
    with file.open("rb") as stdin:
        completed = run_process(*words, "--out", file, stdin=stdin)
    assert completed.code == 2, completed.err
    assert "is what this command reads" in completed.err
    assert file.read_text() == text
    with file.open("rb") as stdin:
        assert run_process(*words, "--out", tmp_path / "other.csv", stdin=stdin).code == 0
