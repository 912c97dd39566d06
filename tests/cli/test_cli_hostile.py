"""Hostile command lines: the right exit code, one or two clear lines, no traceback, quickly, nothing left.

The messages are snapshots (tests/snapshots/cli_errors.txt), reviewed by eye;
ARMKIN_UPDATE_SNAPSHOTS=1 writes them anew.
"""

from __future__ import annotations

import json
import os
import shutil
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from command_line import ROOT, THREE_DOF, Result, run
from least_time import least_seconds

SNAPSHOT = ROOT / "tests/snapshots/cli_errors.txt"
DOF = THREE_DOF
PAN = "robots/pan_tilt.yaml"
PANDA = "robots/panda.yaml"
DIGITS = "9" * 400

# name: exit code, words ("@" is a fresh folder), standard input
CASES: dict[str, tuple[int, list[str], bytes]] = {
    # the shell
    "unknown command": (2, ["fq"], b""),
    "mistyped command": (2, ["puls", DOF], b""),
    "command in capitals": (2, ["FK", DOF, "1", "2", "3"], b""),
    "empty command": (2, [""], b""),
    "option before the command": (2, ["--json", "fk", DOF], b""),
    "number for a command": (2, ["-5"], b""),
    # the robot file
    "no robot": (2, ["fk"], b""),
    "robot is missing": (1, ["fk", "nope.yaml", "1", "2", "3"], b""),
    "robot is a folder": (1, ["fk", "robots", "1", "2", "3"], b""),
    "robot is empty text": (2, ["fk", "", "1", "2", "3"], b""),
    "robot below a file": (1, ["fk", f"{DOF}/x", "1", "2", "3"], b""),
    "robot's name is too long": (1, ["fk", "r" * 5000, "1"], b""),
    "robot is a dash": (1, ["fk", "-", "1", "2", "3"], b""),
    "robot is a socket": (1, ["info", "@/socket"], b""),
    "robot is endless": (4, ["info", "/dev/zero"], b""),
    "robot is nothing": (4, ["info", "/dev/null"], b""),
    "robot is empty": (4, ["info", "@/empty.yaml"], b""),
    "robot is binary": (4, ["info", "@/binary.yaml"], b""),
    "robot is a link to itself": (1, ["info", "@/loop"], b""),
    "robot has an unknown key": (4, ["fk", "@/unknown.yaml", "1"], b""),
    "robot has joint limits reversed": (4, ["fk", "@/reversed.yaml", "1"], b""),
    "robot holds nan": (4, ["fk", "@/nan.yaml", "1"], b""),
    "robot before its numbers": (2, ["fk", "1", "2", "3", DOF], b""),
    # joint values
    "no joint values": (2, ["fk", DOF], b""),
    "one joint value too few": (2, ["fk", DOF, "1", "2"], b""),
    "one joint value too many": (2, ["fk", DOF, "1", "2", "3", "4"], b""),
    "a thousand joint values": (2, ["fk", DOF, *["1"] * 1000], b""),
    "joint values with commas": (2, ["fk", DOF, "1,2,3"], b""),
    "joint values as a list": (2, ["fk", DOF, "[1, 2, 3]"], b""),
    "joint value with a comma": (2, ["fk", DOF, "1,", "2,", "3"], b""),
    "decimal comma": (2, ["fk", DOF, "1,5", "2", "3"], b""),
    "nan": (2, ["fk", DOF, "nan", "2", "3"], b""),
    "negative nan": (2, ["fk", DOF, "-nan", "2", "3"], b""),
    "infinity": (2, ["fk", DOF, "1", "inf", "3"], b""),
    "negative infinity": (2, ["fk", DOF, "1", "-inf", "3"], b""),
    "overflow": (2, ["fk", DOF, "1e999", "2", "3"], b""),
    "400 digits": (2, ["fk", DOF, DIGITS, "2", "3"], b""),
    "-400 digits": (2, ["fk", DOF, f"-{DIGITS}", "2", "3"], b""),
    "beyond any arm": (2, ["fk", DOF, "1e10", "2", "3"], b""),
    "empty number": (2, ["fk", DOF, "", "2", "3"], b""),
    "number and letter": (2, ["fk", DOF, "-5x", "2", "3"], b""),
    "unit": (2, ["fk", DOF, "30deg", "2", "3"], b""),
    "unit after a negative number": (2, ["fk", DOF, "-30\u00b0", "2", "3"], b""),
    "hexadecimal": (2, ["fk", DOF, "0x10", "2", "3"], b""),
    "underscore": (2, ["fk", DOF, "1_000", "2", "3"], b""),
    "expression": (2, ["fk", DOF, "pi/2", "2", "3"], b""),
    "double minus": (2, ["fk", DOF, "--5", "2", "3"], b""),
    "letters for numbers": (2, ["fk", DOF, "a", "b", "c"], b""),
    "control characters": (2, ["fk", DOF, "\x1b[31m1", "2", "3"], b""),
    # options
    "unknown option": (2, ["fk", DOF, "1", "2", "3", "--jsn"], b""),
    "unknown short option": (2, ["fk", DOF, "1", "2", "3", "-q"], b""),
    "option of another command": (2, ["fk", DOF, "1", "2", "3", "--all-branches"], b""),
    "flag with a value": (2, ["fk", DOF, "1", "2", "3", "--json=yes"], b""),
    "option without its value": (2, ["ik", DOF, "390", "80", "300", "--near"], b""),
    # ik
    "no target": (2, ["ik", DOF], b""),
    "target too short": (2, ["ik", DOF, "390", "80"], b""),
    "target too long": (2, ["ik", DOF, "390", "80", "300", "1"], b""),
    "no task fits": (2, ["ik", PAN, "1", "2", "3"], b""),
    "unknown task": (2, ["ik", DOF, "1", "2", "3", "--task", "xyzzy"], b""),
    "task of another arm": (2, ["ik", DOF, "1", "2", "3", "4", "--task", "xyz_yaw"], b""),
    "too many joints for the task": (2, ["ik", PANDA, "400", "0", "400", "--task", "xyz"], b""),
    "unreachable": (3, ["ik", DOF, "900", "0", "0"], b""),
    "far beyond reach": (3, ["ik", DOF, "1e9", "-1e9", "1e9"], b""),
    "branch outside limits": (3, ["ik", DOF, "390", "80", "300", "--branch", "right"], b""),
    "all branches outside limits": (3, ["ik", DOF, "-300", "-1", "170"], b""),
    "unknown branch": (2, ["ik", DOF, "390", "80", "300", "--branch", "middle"], b""),
    "empty branch": (2, ["ik", DOF, "390", "80", "300", "--branch", ""], b""),
    "near too short": (2, ["ik", DOF, "390", "80", "300", "--near", "1,2"], b""),
    "near with spaces": (2, ["ik", DOF, "390", "80", "300", "--near", "1 2 3"], b""),
    "near is nan": (2, ["ik", DOF, "390", "80", "300", "--near", "1,nan,3"], b""),
    "near is empty": (2, ["ik", DOF, "390", "80", "300", "--near", ""], b""),
    "axis of no length": (2, ["ik", "robots/moveo.yaml", "300", "0", "300", "0", "0", "0"], b""),
    "lock of an unknown joint": (2, f"ik {PANDA} 400 0 400 180 0 0 --lock J9=0".split(), b""),
    "lock without a value": (2, f"ik {PANDA} 400 0 400 180 0 0 --lock J3".split(), b""),
    "lock of text": (2, f"ik {PANDA} 400 0 400 180 0 0 --lock J3=abc".split(), b""),
    "lock twice": (2, f"ik {PANDA} 400 0 400 180 0 0 --lock J3=0 --lock J3=1".split(), b""),
    "lock of all joints": (2, f"ik {DOF} 1 2 3 --lock q1=0 --lock q2=0 --lock q3=0".split(), b""),
    "sweep without a count": (2, f"ik {PANDA} 400 0 400 180 0 0 --sweep J3=-90:90".split(), b""),
    "sweep of nothing": (2, f"ik {PANDA} 400 0 400 180 0 0 --sweep J3=-90:90:0".split(), b""),
    "sweep with half a step": (2, f"ik {PANDA} 400 0 400 180 0 0 --sweep J3=-90:90:2.5".split(), b""),
    "sweep without end": (2, f"ik {PANDA} 400 0 400 180 0 0 --sweep J3=-90:90:1e9".split(), b""),
    "sweep and lock of one joint": (
        2,
        f"ik {PANDA} 400 0 400 180 0 0 --lock J3=0 --sweep J3=0:1:2".split(),
        b"",
    ),
    # pulses
    "pulses without drives": (2, ["pulses", PAN, "1", "2"], b""),
    "pulses from too few": (2, ["pulses", DOF, "1", "2", "3", "--from", "0,0"], b""),
    "pulses from nan": (2, ["pulses", DOF, "1", "2", "3", "--from", "0,0,nan"], b""),
    # batches
    "batch and numbers": (2, ["fk", DOF, "1", "2", "3", "--batch", "-"], b"1,2,3\n"),
    "batch file is missing": (1, ["fk", DOF, "--batch", "@/nope.csv"], b""),
    "batch file is a folder": (1, ["fk", DOF, "--batch", "@"], b""),
    "batch is empty": (2, ["ik", DOF, "--batch", "-", "--json"], b""),
    "batch is blank": (2, ["ik", DOF, "--batch", "-", "--json"], b"\n\n"),
    "batch is binary": (2, ["fk", DOF, "--batch", "-", "--json"], bytes(range(256)) * 50),
    "batch is JSON": (2, ["fk", DOF, "--batch", "-", "--json"], b'{"joints": [1, 2, 3]}\n'),
    "batch has a short row": (2, ["fk", DOF, "--batch", "-", "--json"], b"1,2\n"),
    "batch has semicolons": (2, ["fk", DOF, "--batch", "-", "--json"], b"1;2;3\n"),
    "batch has one endless line": (2, ["fk", DOF, "--batch", "-", "--json"], b"1," * 500_000),
    "batch has 400 digits": (2, ["fk", DOF, "--batch", "-", "--json"], f"{DIGITS},1,1\n".encode()),
    "batch has nan": (2, ["pulses", DOF, "--batch", "-", "--json"], b"1,nan,3\n"),
    "batch with unreachable rows": (3, ["ik", DOF, "--batch", "-"], b"390,80,300\n900,0,0\n"),
    # output files
    "out in a missing folder": (1, ["fk", DOF, "1", "2", "3", "--out", "@/no/out"], b""),
    "out is a folder": (1, ["fk", DOF, "1", "2", "3", "--out", "@"], b""),
    "out below a file": (1, ["fk", DOF, "1", "2", "3", "--out", "@/empty.yaml/x"], b""),
    "out on a full disk": (1, ["fk", DOF, "1", "2", "3", "--out", "/dev/full"], b""),
    "out is empty": (2, ["fk", DOF, "1", "2", "3", "--out", ""], b""),
    "out has a name too long": (1, ["fk", DOF, "1", "2", "3", "--out", "o" * 300], b""),
    "out of a failed batch": (2, ["fk", DOF, "--batch", "-", "--out", "@/out.csv"], b"1,2,3\nx\n"),
    "out of a failed command": (2, ["fk", DOF, "1", "--out", "@/out.txt"], b""),
    "schema with an argument": (2, ["schema", "x"], b""),
    "path with blended corners and no radius": (
        2,
        ["path", DOF, "--via", "390,80,300", "--via", "390,20,300", "--corners", "blend"],
        b"",
    ),
    "no workers": (2, ["reach", DOF, "--workers", "0"], b""),
    "a drawing's place in two numbers": (2, ["path", DOF, "a.nc", "--at", "300,0"], b""),
    "flash of a simulated board": (2, ["flash", DOF, "--port", "sim"], b""),
}


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    """A folder with bad files in it; afterwards the same ones must be there."""
    valid = (ROOT / "robots/planar_2dof.yaml").read_text()
    (tmp_path / "empty.yaml").write_text("")
    (tmp_path / "binary.yaml").write_bytes(bytes(range(256)))
    (tmp_path / "unknown.yaml").write_text(valid.replace("convention:", "convension:"))
    (tmp_path / "here").mkdir()  # where the commands run; other tests work in the project's folder meanwhile
    (tmp_path / "here/robots").symlink_to(ROOT / "robots")
    head = "name: r\nconvention: standard\njoints:\n"
    (tmp_path / "reversed.yaml").write_text(f"{head}  - {{name: q1, dh: {{alpha: 0, a: 1, d: 0}}, limits: [9, -9]}}\n")
    (tmp_path / "nan.yaml").write_text(f"{head}  - {{name: q1, dh: {{alpha: 0, a: .nan, d: 0}}}}\n")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    with socket.socket(socket.AF_UNIX) as server:
        here = Path.cwd()
        os.chdir(tmp_path)  # a socket's path must be short
        server.bind("socket")
        os.chdir(here)
        before = sorted(tmp_path.iterdir())
        yield tmp_path
        assert sorted(tmp_path.iterdir()) == before


def run_case(name: str, folder: Path) -> Result:
    _, words, stdin = CASES[name]
    completed = run(*(word.replace("@", str(folder)) for word in words), stdin=stdin, cwd=folder / "here")
    return completed._replace(err=completed.err.replace(str(folder), "FOLDER"))


def shorten_text(text: str) -> str:
    return text if len(text) <= 60 else f"{text[:57]}..."


def snapshot_block(name: str, completed: Result) -> str:
    quoted = (repr(w) if not w or " " in w or not w.isprintable() else shorten_text(w) for w in CASES[name][1])
    return f"[{name}]\n$ armkin {shorten_text(' '.join(quoted))}\nexit {completed.code}\n{completed.err.strip()}"


def read_snapshots() -> dict[str, str]:
    blocks = SNAPSHOT.read_text().strip().split("\n\n")
    return {text.partition("]")[0].removeprefix("["): text for text in blocks}


@pytest.mark.parametrize("name", CASES)
def test_hostile(name: str, folder: Path) -> None:
    run("info", DOF)  # the imports are not the command line's time
    results: list[Result] = []
    seconds = least_seconds(lambda: results.append(run_case(name, folder)), 2, time.monotonic)
    completed = results[0]
    code = CASES[name][0]
    assert completed.code == code, completed.err
    assert "Traceback" not in completed.err
    assert "internal error" not in completed.err
    if "--json" in CASES[name][1]:  # one object that says the same
        answer = json.loads(completed.err)
        assert (answer["exit_code"], bool(answer["kind"])) == (code, True)
        completed = completed._replace(err="error: " + answer["error"].replace("\n", "\n  ") + "\n")
    assert completed.err.startswith("error: ")
    assert 1 <= completed.err.count("\n") <= 2
    assert all(len(line) < 250 for line in completed.err.splitlines())
    if code != 3:
        assert completed.out == ""
    assert seconds < 2
    assert [path.name for path in (folder / "here").iterdir()] == ["robots"]
    if os.environ.get("ARMKIN_UPDATE_SNAPSHOTS"):
        blocks = {**read_snapshots(), name: snapshot_block(name, completed)}
        SNAPSHOT.write_text("\n\n".join(blocks[key] for key in CASES if key in blocks) + "\n")
    assert snapshot_block(name, completed) == read_snapshots()[name]


def test_every_snapshot_belongs_to_a_case() -> None:
    assert list(read_snapshots()) == list(CASES)
    assert len(CASES) >= 80


def test_a_robot_file_that_may_not_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # The superuser may read everything, so the system's refusal is played.
    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    completed = run("fk", DOF, 1, 2, 3)
    assert (completed.code, completed.out) == (1, "")
    assert completed.err == f"error: {DOF}: cannot read the robot file: Permission denied\n"


def test_an_output_file_that_may_not_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(os, "replace", refuse)
    completed = run("fk", DOF, 1, 2, 3, "--out", tmp_path / "out")
    assert completed == (1, "", f"error: {tmp_path / 'out'}: cannot write: Permission denied\n")
    assert list(tmp_path.iterdir()) == []


def test_a_batch_in_a_folder_that_may_not_be_written_has_nothing_to_go_on_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    (tmp_path / "rows.csv").write_text("1,2,3\n" * 200_000)
    monkeypatch.setattr(Path, "mkdir", refuse)
    completed = run("fk", DOF, "--batch", tmp_path / "rows.csv", "--out", tmp_path / "out.csv")
    assert completed == (1, "", f"error: {tmp_path / 'out.csv'}: cannot write: Permission denied\n")


def test_a_bug_is_told_as_one(monkeypatch: pytest.MonkeyPatch) -> None:
    from armkin.cli.parsing import arguments

    def bug(*_: object) -> None:
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr(arguments, "load_arm", bug)
    completed = run("fk", DOF, 1, 2, 3)
    assert (completed.code, completed.out) == (1, "")
    assert "internal error: ZeroDivisionError" in completed.err
    assert "Traceback" not in completed.err
    monkeypatch.setenv("ARMKIN_TRACEBACK", "1")
    assert "Traceback" in run("fk", DOF, 1, 2, 3).err
    monkeypatch.setattr(arguments, "load_arm", lambda *_: (_ for _ in ()).throw(MemoryError))
    assert "not enough memory" in run("fk", DOF, 1, 2, 3).err


def test_a_robot_named_like_an_option(tmp_path: Path) -> None:
    shutil.copy(ROOT / DOF, tmp_path / "--json")
    assert run("fk", tmp_path / "--json", 1, 2, 3).code == 0
    assert run("fk", "--", tmp_path / "--json", -1, -2, -3).code == 0
