"""No output replaces a robot file or what the command reads, however spelled or linked."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from command_line import ROOT, THREE_DOF, run

ROW = "0,90,-90\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "r").mkdir()
    shutil.copy(ROOT / THREE_DOF, tmp_path / "r" / "three_dof.yaml")
    (tmp_path / "rows.csv").write_text(ROW)
    (tmp_path / "hard.yaml").hardlink_to(tmp_path / "r" / "three_dof.yaml")
    (tmp_path / "soft.yaml").symlink_to(tmp_path / "r" / "three_dof.yaml")
    shutil.copy(ROOT / "robots/ur5e.yaml", tmp_path / "other.yaml")
    return tmp_path


@pytest.mark.parametrize("out", ["r/three_dof.yaml", "./r/../r/three_dof.yaml", "hard.yaml", "soft.yaml", "other.yaml"])
@pytest.mark.parametrize(
    "words",
    [
        ("info", "./r/three_dof.yaml", "--out"),
        ("schema", "--out"),
        ("fk", "r/three_dof.yaml", "--batch", "rows.csv", "--out"),
        ("send", "r/three_dof.yaml", "0", "80", "-80", "--dry-run", "--trace"),
        ("workspace", "r/three_dof.yaml", "--samples", "10", "--out"),
        ("export", "r/three_dof.yaml", "--urdf", "--out"),
    ],
)
def test_a_robot_file_stays(words: tuple[str, ...], out: str, folder: Path) -> None:
    before = {path: (folder / path).read_bytes() for path in ("r/three_dof.yaml", "other.yaml")}
    full = [str(folder / word) if (folder / word).exists() else word for word in (*words, out)]
    completed = run(*full)
    assert completed.code == 2, completed
    assert completed.out == ""
    assert "give" in completed.err or "end the file's name" in completed.err
    assert {path: (folder / path).read_bytes() for path in before} == before
    assert sorted(path.name for path in folder.iterdir()) == ["hard.yaml", "other.yaml", "r", "rows.csv", "soft.yaml"]


def test_an_input_stays(folder: Path) -> None:
    (folder / "same.csv").hardlink_to(folder / "rows.csv")
    for target in ("rows.csv", "same.csv"):
        completed = run("fk", folder / "r/three_dof.yaml", "--batch", folder / "rows.csv", "--out", folder / target)
        assert (completed.code, completed.out) == (2, "")
        assert "is what this command reads; give the output another name" in completed.err
    assert (folder / "rows.csv").read_text() == ROW


def test_a_read_only_file_stays(folder: Path) -> None:
    read_only = folder / "kept.csv"
    read_only.write_text("mine\n")
    read_only.chmod(0o444)
    completed = run("fk", THREE_DOF, "--batch", folder / "rows.csv", "--out", read_only)
    assert (completed.code, completed.out) == (1, "")
    assert "it is read-only; give another name" in completed.err
    assert read_only.read_text() == "mine\n"


def test_a_log_that_stdout_is_added_to_grows(folder: Path) -> None:
    log = folder / "log"
    log.write_text("before\n")
    command = [sys.executable, "-m", "armkin", "fk", str(ROOT / THREE_DOF), "--batch", str(folder / "rows.csv")]
    with log.open("a") as file:
        subprocess.run([*command, "--out", "/dev/stdout"], stdout=file, check=True)
    lines = log.read_text().splitlines()
    assert lines[0] == "before"
    assert len(lines) > 1


def test_an_ordinary_file_is_replaced_and_a_pipe_written(folder: Path) -> None:
    out = folder / "out.csv"
    out.write_text("old\n")
    assert run("fk", THREE_DOF, "--batch", folder / "rows.csv", "--out", out).code == 0
    assert "old" not in out.read_text()
    pipe = folder / "pipe"
    os.mkfifo(pipe)
    reader = subprocess.Popen(["cat", str(pipe)], stdout=subprocess.PIPE)
    assert run("fk", THREE_DOF, "--batch", folder / "rows.csv", "--out", pipe).code == 0
    assert reader.communicate()[0].decode() == out.read_text()
