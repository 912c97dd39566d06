"""The examples run, anywhere, and print what they promise."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "examples"
# Name -> words of its output: the last column of the folder's page.
ROW = re.compile(r"^\| `(\d\d_\w+\.py)` \|.*\| ([^|]+) \|$", re.M)
PROMISED = {
    name: re.findall(r"`([^`]+)`", last) for name, last in ROW.findall((FOLDER / "README.md").read_text("utf-8"))
}


@pytest.mark.parametrize("name", PROMISED)
def test_an_example_runs_from_any_folder(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", [str(FOLDER / name)])
    runpy.run_path(str(FOLDER / name), run_name="__main__")
    shown = capsys.readouterr().out
    assert PROMISED[name]
    assert not [words for words in PROMISED[name] if words not in shown], shown


def test_every_example_is_numbered_short_and_listed() -> None:
    files = sorted(FOLDER.glob("*.py"))
    assert [path.name for path in files] == list(PROMISED)
    assert [int(name[:2]) for name in PROMISED] == list(range(1, len(files) + 1))
    assert max(len(path.read_text().splitlines()) for path in files) <= 25


def test_the_layer_is_what_its_script_writes() -> None:
    script = runpy.run_path(str(FOLDER.parent / "scripts" / "first_layer.py"))
    assert (FOLDER / "first_layer.gcode").read_text() == "".join(line + "\n" for line in script["program"](1))
