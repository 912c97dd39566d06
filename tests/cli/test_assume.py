"""Where an arm whose position is lost stands: `--assume`, in a pose's name or joint values."""

from __future__ import annotations

from pathlib import Path

import pytest

from command_line import ROOT, THREE_DOF, run


@pytest.fixture
def parked_robot(tmp_path: Path) -> Path:
    robot = tmp_path / "parked.yaml"
    robot.write_text((ROOT / THREE_DOF).read_text() + "poses: {park: [10, 70, -60]}\n")
    return robot


@pytest.mark.parametrize(
    ("words", "stands"),
    [
        (("--assume-home",), [0, 90, -90]),
        (("--assume", "home"), [0, 90, -90]),
        (("--assume", "park"), [10, 70, -60]),
        (("--assume", "-5,60,-40"), [-5, 60, -40]),
    ],
)
@pytest.mark.parametrize("command", ["send", "path"])
def test_an_arm_stands_where_it_is_said_to(
    words: tuple[str, ...], stands: list[float], command: str, parked_robot: Path
) -> None:
    goal = ("home",) if command == "send" else ("--via", "390,80,300", "--via", "390,100,300")
    completed = run(command, parked_robot, *goal, "--port", "sim", *words, "--json")
    assert completed.code == 0, completed.err
    began = completed.json["start_joints"] if command == "send" else None
    assert "the board takes the arm to stand" in completed.err
    if began is not None:
        assert began == pytest.approx(stands, abs=0.02)


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("--assume", "prak"), 2, "has no pose 'prak'; did you mean park?"),
        (("--assume", "1,2"), 2, "--assume takes 3 numbers (q1 q2 q3), got 2"),
        (("--assume", "0,300,0"), 3, "--assume: q2 = 300 deg is outside"),
    ],
)
def test_a_place_that_is_none_is_refused(words: tuple[str, ...], code: int, message: str, parked_robot: Path) -> None:
    completed = run("send", parked_robot, "home", "--port", "sim", *words)
    assert (completed.code, completed.out) == (code, "")
    assert message in completed.err


def test_assume_home_is_assume_home() -> None:
    """One option, two spellings: the last one counts, as with any option."""
    completed = run("send", THREE_DOF, "home", "--port", "sim", "--assume", "0,80,-80", "--assume-home", "--json")
    assert completed.json["start_joints"] == [0, 90, -90]
    assert run("fk", THREE_DOF, "home", "--assume-home").code == 2


def test_near_chooses_the_branch_that_is_sent(tmp_path: Path) -> None:
    free = tmp_path / "free.yaml"
    lines = (ROOT / THREE_DOF).read_text().splitlines()
    free.write_text("\n".join(line for line in lines if "limits:" not in line) + "\n")
    target = (300, 40, 100)
    branches = run("ik", free, *target, "--json", "--all-branches").json["branches"]
    assert len(branches) == 4
    for branch in branches:
        near = ",".join(map(str, branch["joints"]))
        completed = run("send", free, "--target", "300,40,100", "--dry-run", "--json", "--near", near)
        assert completed.json["joints"] == pytest.approx(branch["joints"], abs=0.05)
    refused = run("send", THREE_DOF, "home", "--near", "0,90,-90", "--dry-run")
    assert refused.code == 2
    assert "--near and --lock belong to --target" in refused.err
