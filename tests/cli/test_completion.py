"""What Tab offers, asked as bash asks it: in this process, and once in a bash of its own."""

import os
import shutil
import subprocess

import pytest

from armkin.cli.commands import COMMANDS
from armkin.robot_file import catalogue
from command_line import ROOT, run, run_process


def offered_words(monkeypatch: pytest.MonkeyPatch, line: str) -> list[str]:
    """What Tab offers at the end of a line."""
    words = line.split()
    index = len(words) if line.endswith(" ") else len(words) - 1
    for name, value in (("COMP_WORDS", line), ("COMP_CWORD", str(index)), ("_ARMKIN_COMPLETE", "complete_bash")):
        monkeypatch.setenv(name, value)
    completed = run()
    assert completed.err == ""
    return completed.out.split()


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("armkin ", list(COMMANDS)),
        ("armkin pu", ["pulses"]),
        ("armkin fk ", list(catalogue.robot_names())),
        ("armkin fk pum", ["puma560"]),
        ("armkin fk three_dof ho", ["home"]),
        ("armkin send cobra", ["cobra600"]),
        ("armkin jog three_dof ", ["q1", "q2", "q3"]),
        ("armkin home three_dof q", ["q1", "q2", "q3"]),
        ("armkin ik panda 1 2 3 --lock J7", ["J7="]),
        ("armkin ik panda --sweep J7", ["J7="]),
        ("armkin ik three_dof --branch left", ["left/elbow-up", "left/elbow-down"]),
        ("armkin ik three_dof --task xyz_p", ["xyz_pitch", "xyz_pitch_roll"]),
        ("armkin ik three_dof --all", ["--all-branches"]),
        ("armkin send three_dof -p si", ["sim"]),
        ("armkin fk no_such_robot ", []),
        ("armkin nonsense --", []),
    ],
)
def test_tab(line: str, expected: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    words_offered = offered_words(monkeypatch, line)
    assert (
        sorted(words_offered) == sorted(expected)
        if expected
        else not set(words_offered) - {"--help", "--version"} - _GROUP
    )


_GROUP = {"--install-completion", "--show-completion"}


def test_an_offered_branch_is_understood() -> None:
    named = run("ik", "three_dof", 390, 80, 300, "--branch", "left/elbow-up", "--json").json
    assert named["branches"][0]["name"] == "left, elbow up"


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
def test_bash_takes_the_script() -> None:
    script = run_process(
        "--show-completion", "bash", env={**os.environ, "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}
    )
    assert script.code == 0
    completed = subprocess.run(
        ["bash", "--norc", "-c", f"{script.out}\ncomplete -p armkin"], capture_output=True, text=True
    )
    assert "armkin" in completed.stdout, ROOT
