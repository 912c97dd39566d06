"""What a robot file lacks is told as lines: pasted where they say, they make a file that moves."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from command_line import run


def paste_lines(text: str, lines: list[str]) -> str:
    """The file with every line where its comment says: to joints, or at the end."""
    for line in lines:
        if "in place of board:" in line:
            text = re.sub(r"(?m)^board:.*$", line, text)
            continue
        to = re.search(r"to joints? ([\w, ]+)$", line)
        if to is None:
            text = f"{text}\n{line}\n"
            continue
        for name in to[1].split(", "):
            before = f"  - name: {name}\n"
            assert before in text
            text = text.replace(before, f"{before}    {line}\n")
    return text


@pytest.mark.parametrize("robot", ["ur5e", "planar_2dof", "moveo", "cobra600", "stanford", "roarm_m2", "yaw_two_link"])
def test_pasted_lines_make_a_file_that_moves(robot: str, tmp_path: Path) -> None:
    copy = tmp_path / f"my_{robot}.yaml"
    assert run("export", robot, "--dh", "-o", copy).code == 0
    summary = run("info", copy, "--json").json
    lines, lacks = summary["lines_to_add"], summary["lacks"]
    assert lines
    assert lacks["simulate"]
    refused = run("send", copy, "home", "--dry-run", "--json")
    assert refused.code == 2

    rehearsal = tmp_path / "rehearsal.yaml"
    rehearsal.write_text(paste_lines(copy.read_text(), json.loads(refused.err)["lines_to_add"]))
    assert run("send", rehearsal, "home", "--dry-run").code == 0

    complete = tmp_path / "whole.yaml"
    complete.write_text(paste_lines(copy.read_text(), lines))
    assert run("info", complete, "--json").json["lacks"]["send"] == []
    assert run("send", complete, "home", "--port", "sim").code == 0


def test_info_shows_the_lines() -> None:
    shown = run("info", "ur5e").out
    for line in run("info", "ur5e", "--json").json["lines_to_add"]:
        assert f"    {line}\n" in shown
    assert "to add" not in run("info", "three_dof").out


@pytest.mark.parametrize("how", [("--dry-run",), ("--port", "sim")])
def test_an_arm_without_published_accelerations_is_rehearsed_with_one_that_is_given(how: tuple[str, ...]) -> None:
    moveo = ("send", "moveo", 10, 10, 10, 10, 10, *how)
    bare = run(*moveo)
    if how == ("--dry-run",):
        assert (bare.code, bare.out) == (2, "")
        assert "or rehearse with --accel 60, for example" in bare.err
    else:
        assert (bare.code, "max_accel of J1, J2, J3, J4, J5: 60 deg/s2" in bare.err) == (0, True), bare.err
    slow, quick = (run(*moveo, "--accel", accel, "--json").json for accel in (5, 500))
    assert slow["pulses"] == quick["pulses"]
    if "duration_s" in slow:
        assert slow["duration_s"] > quick["duration_s"]
    answer = run("send", "three_dof", -30, 5, -5, *how, "--accel", 1, "--json").json  # its own are not replaced
    assert answer["pulses"] == [-1067, -10144, 5667]
    assert answer.get("duration_s", 1.917) == pytest.approx(1.917, abs=0.01)


def test_an_acceleration_for_a_real_arm_stands_in_its_file() -> None:
    assert "--accel is for --dry-run" in run("send", "moveo", 1, 1, 1, 1, 1, "--accel", 60).err
    assert "must be from" in run("send", "moveo", 1, 1, 1, 1, 1, "--dry-run", "--accel", 0).err
