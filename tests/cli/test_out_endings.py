"""The ending of `--out` says what is written, or the name is refused before any work."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from command_line import run

POSES = b"1,2,3\n4,5,6\n"
DATA = ".npz, .parquet, .jsonl or .csv"
BATCHES = ("fk", "ik", "pulses")
TEXT = ".txt or .json"
ROBOT = ".yaml or .yml"
ASKED: dict[str, tuple[list[Any], str]] = {
    "fk": (["fk", "three_dof", 1, 2, 3], TEXT),
    "ik": (["ik", "three_dof", 390, 80, 300], TEXT),
    "pulses": (["pulses", "three_dof", 1, 2, 3], TEXT),
    "info": (["info", "three_dof"], TEXT),
    "robots": (["robots"], TEXT),
    "schema": (["schema"], ".json"),
    "workspace": (["workspace", "three_dof", "--samples", 1000], ".csv, .npz or .ply"),
    "reach": (["reach", "three_dof", "--grid", 100], ".npz, .parquet or .csv"),
    "place": (["place", "three_dof", "POSES"], DATA),
    "plot": (["plot", "three_dof", "home"], ".png or .svg"),
    "path": (["path", "three_dof", "POSES"], ".csv"),
    "new": (["new", "arm", "--dh", "90,0,170", "--convention", "standard"], ROBOT),
    "import": (["import", "-"], ROBOT),
    "calibrate": (["calibrate", "three_dof", "POSES"], ROBOT),
    "calibrate, poses to measure": (["calibrate", "three_dof", "--suggest", 5], ".csv"),
    "relax": (["relax", "so101", "--port", "sim"], ".csv"),
    "zero": (["zero", "so101", "--port", "sim"], ROBOT),
    "begin": (["begin", "three_dof", "--port", "sim"], ROBOT),
    "send": (["send", "three_dof", "home", "--dry-run", "--trace", "FILE"], ".csv"),
    "export as URDF": (["export", "three_dof", "--urdf"], ".urdf or .xml"),
    "export as DH": (["export", "three_dof", "--dh"], ROBOT),
    "export as JSON": (["export", "three_dof", "--json"], ".json"),
    "export as JavaScript": (["export", "three_dof", "--js"], ".js or .mjs"),
    "export as HTML": (["export", "three_dof", "--html"], ".html or .htm"),
}


@pytest.mark.parametrize("name", ["x.parquet.gz", "x.xlsx"])
@pytest.mark.parametrize("command", ASKED)
def test_an_unknown_ending_is_refused_with_those_allowed(tmp_path: Path, command: str, name: str) -> None:
    words, allowed = ASKED[command]
    (tmp_path / "poses.csv").write_bytes(POSES)
    path_of = {"POSES": tmp_path / "poses.csv", "FILE": tmp_path / name}
    words = [path_of.get(word, word) for word in words]
    completed = run(*words, *(() if "--trace" in words else ("--out", tmp_path / name)), stdin=POSES)
    assert (completed.code, completed.out) == (2, "")
    assert f"written as {allowed}; end the file's name with" in completed.err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["poses.csv"]


@pytest.mark.parametrize("name", ["x.csv.npz", "x.parquet.CSV", "x.csv.csv"])
@pytest.mark.parametrize("command", ["workspace", "reach", "place"])
def test_two_endings_are_refused(tmp_path: Path, command: str, name: str) -> None:
    words, _ = ASKED[command]
    (tmp_path / "poses.csv").write_bytes(POSES)
    words = [tmp_path / "poses.csv" if word == "POSES" else word for word in words]
    completed = run(*words, "--out", tmp_path / name, stdin=POSES)
    assert completed.code == 2
    assert "its name has two endings" in completed.err or "written as" in completed.err
    assert not (tmp_path / name).exists()


@pytest.mark.parametrize("name", ["x.txt", "x.parquet.gz", "x.dat", "x.npz.csv"])
@pytest.mark.parametrize("command", BATCHES)
def test_a_batch_with_any_other_ending_is_csv_and_says_so(tmp_path: Path, command: str, name: str) -> None:
    printed = run(command, "three_dof", "--batch", "-", stdin=b"250,20,150\n")
    completed = run(command, "three_dof", "--batch", "-", "--out", tmp_path / name, stdin=b"250,20,150\n")
    assert (completed.code, completed.out) == (printed.code, "")
    assert ("rows are written as CSV" in completed.err) is not name.endswith(".csv")
    assert (tmp_path / name).read_text() == printed.out


@pytest.mark.parametrize("command", BATCHES)
def test_json_of_a_batch_is_text_whatever_its_ending(tmp_path: Path, command: str) -> None:
    words = (command, "three_dof", "--batch", "-", "--json")
    printed = run(*words, stdin=b"250,20,150\n")
    for name in ("x.jsonl", "x", "x.csv", "x.json"):
        assert run(*words, "--out", tmp_path / name, stdin=b"250,20,150\n").code == printed.code
        assert (tmp_path / name).read_text() == printed.out
    for name in ("x.npz", "x.parquet"):
        assert run(*words, "--out", tmp_path / name, stdin=b"250,20,150\n").code == 2
        assert not (tmp_path / name).exists()


def test_names_with_dots_and_without_an_ending_are_taken(tmp_path: Path) -> None:
    for name in ("x", "run.3.csv", "arm.v2.jsonl", "X.CSV"):
        assert run("fk", "three_dof", "--batch", "-", "--out", tmp_path / name, stdin=POSES) == (0, "", ""), name
    assert run("fk", "three_dof", 1, 2, 3, "--out", tmp_path / "x.txt").code == 0
    assert run("export", "three_dof", "--dh", "-o", tmp_path / "arm.urdf.yaml").code == 0
