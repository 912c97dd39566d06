"""The examples run, anywhere, and print what they promise."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "examples"
# Number -> words of its output.
PROMISED = {
    1: ["[ 398.3923 -218.4649  187.1697]"],
    2: ["left, elbow up", "outside limits", "complete: True  best: left, elbow up"],
    3: ["[ -1067 -10144   5667]", "rounded 0.074974 mm off"],
    4: ["(100, 200, 4, 4) (100, 200, 8, 6)", "of their targets"],
    5: ["reach [", "volume 0.24"],
    6: ["8 branches of 7 joints; J3 is 20 degrees in each"],
    7: ["[1067, -5370, 3000] after"],
    8: ["308.1 mm in", "left, elbow up"],
    9: ["right, elbow down", "<- chosen"],
    10: ["cells are reached", "places reach all 6 targets"],
    11: ["1198 points, 3.91 m", "0.05 allowed", "15 words are of the printer"],
    12: ["23 strokes, 1046 mm", "0.05 allowed"],
    13: ["MB: three_dof, ", "s of motion"],
}


@pytest.mark.parametrize("number", PROMISED)
def test_an_example_runs_from_any_folder(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    [path] = FOLDER.glob(f"{number:02}_*.py")
    monkeypatch.setattr("sys.argv", [str(path)])
    runpy.run_path(str(path), run_name="__main__")
    shown = capsys.readouterr().out
    assert not [words for words in PROMISED[number] if words not in shown], shown


def test_every_example_is_numbered_short_and_listed() -> None:
    files = sorted(FOLDER.glob("*.py"))
    assert [int(path.name[:2]) for path in files] == list(PROMISED)
    assert max(len(path.read_text().splitlines()) for path in files) <= 25
    page = (FOLDER / "README.md").read_text()
    assert not [path.name for path in files if path.name not in page]


def test_the_layer_is_what_its_script_writes() -> None:
    script = runpy.run_path(str(FOLDER.parent / "scripts" / "first_layer.py"))
    assert (FOLDER / "first_layer.gcode").read_text() == "".join(line + "\n" for line in script["program"](1))
