"""Words of commands for newcomers: all that is missing at once, nothing cut, a port that is none refused."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys

import pytest

from armkin.cli.printing import output
from command_line import ROOT, run, run_process


def test_new_says_all_that_is_missing_at_once() -> None:
    completed = run("new", "mine")
    assert completed.code == 2
    assert "no table: give --dh" in completed.err
    assert "--convention is missing" in completed.err
    assert "--convention" not in run("new", "mine", "--convention", "standard").err
    assert "no table" not in run("new", "mine", "--dh", "0,0,0").err


def test_fk_is_piped_into_ik() -> None:
    pose = run("fk", "three_dof", 10, 80, -80, "--json").out
    one = run("ik", "--json", stdin=pose.encode())
    assert one.code == 0, one.err
    assert one.json["branches"][0]["joints"] == pytest.approx([10, 80, -80])
    two = run("ik", "three_dof", "--json", stdin=(pose + run("fk", "three_dof", 5, 70, -90, "--json").out).encode())
    assert two.lines[0]["target"] == pytest.approx(json.loads(pose)["position_mm"])
    assert [row["branches"][0]["joints"][1] for row in two.lines] == pytest.approx([80, 70])
    turned = run("fk", "ur5e", 10, -80, -80, 30, 40, 20, "--json").out
    back = run("ik", "--all-branches", "--json", stdin=turned.encode()).json
    assert any(one["joints"] == pytest.approx([10, -80, -80, 30, 40, 20]) for one in back["branches"])


def test_ik_without_a_target_and_without_an_answer_says_what_it_takes() -> None:
    assert "task xyz takes 3 numbers (x y z), got 0" in run("ik", "three_dof").err
    assert "missing argument 'ROBOT'" in run("ik").err
    assert run("ik", "ur5e", stdin=run("fk", "three_dof", "home", "--json").out.encode()).code == 1


def test_notes_are_not_cut_in_the_middle(capsys: pytest.CaptureFixture[str]) -> None:
    output.note("word " * 150)
    output.error("word " * 150, "usage", 2)
    note, error = capsys.readouterr().err.splitlines()
    assert note == "note: " + "word " * 150
    assert " ... " in error
    assert len(run("fk", "x" * 100_000, "home").err) < 4000


@pytest.mark.parametrize(
    ("port", "message"),
    [
        ("nonsense", "there is no port nonsense"),
        ("nonsense://x", "port nonsense://x cannot be opened"),
        ("hwgrep://(", "port hwgrep://( cannot be opened"),
        (str(ROOT / "README.md"), "is no serial port"),
        ("/dev/null", "/dev/null is no serial port"),
    ],
)
@pytest.mark.skipif(sys.platform == "win32", reason="names of devices")
def test_teach_refuses_a_port_that_is_none(port: str, message: str) -> None:
    completed = run_process("teach", "three_dof", "--no-open", "--port", port)
    assert (completed.code, completed.out) == (5, "")
    assert message in completed.err


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals")
def test_teach_says_how_it_ends() -> None:
    command = [sys.executable, "-m", "armkin", "teach", "three_dof", "--no-open"]
    page = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert page.stdout is not None
    assert page.stderr is not None
    assert "http://127.0.0.1" in page.stdout.readline()
    assert page.stderr.readline() == "note: Ctrl-C ends it\n"
    os.kill(page.pid, signal.SIGINT)
    assert page.wait(timeout=60) == 130
    assert page.communicate() == ("", "")


def test_a_target_of_another_length_names_what_phi_is_and_the_task_that_fits() -> None:
    error = run("ik", "ra02", 100, 0, 200).err
    assert "task xyz_pitch takes 4 numbers (x y z phi), got 3" in error
    assert "phi is the tool's pitch" in error
    assert "--task xyz takes x y z" in error
