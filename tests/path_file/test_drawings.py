"""`armkin.drawing`: G-code and SVG as a path, in one call."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import armkin
from armkin.errors import FileError, UsageError
from command_line import ROOT, run

SVG = ROOT / "examples" / "drawing.svg"


def test_it_is_what_the_command_plans() -> None:
    arm = armkin.load("three_dof")
    plan = armkin.path(arm, armkin.drawing(arm, SVG, [320, -50, 200], feed=60.0, lift=4.0, scale=0.5))
    words = ("--at", "320,-50,200", "--feed", 60, "--lift", 4, "--scale", 0.5)
    answer = run("path", "three_dof", SVG, *words, "--json").json
    assert plan.length == pytest.approx(answer["length_mm"], abs=1e-9)
    assert plan.duration == pytest.approx(answer["duration_s"], abs=1e-9)


@pytest.mark.parametrize(
    ("name", "place", "error", "says"),
    [
        ("path.yaml", [0, 0, 0], UsageError, "ends in .gcode, .gco, .nc, .ngc or .svg"),
        ("part.nc", [300, 0], UsageError, "at: where the drawing's zero lies is x y z"),
        ("nope.nc", [300, 0, 50], FileError, "cannot read the path file"),
    ],
)
def test_what_it_does_not_take_is_said(name: str, place: list[float], error: Any, says: str, tmp_path: Path) -> None:
    with pytest.raises(error, match=says):
        armkin.drawing(armkin.load("three_dof"), tmp_path / name, place)


def test_a_drawing_without_a_place_names_the_function() -> None:
    with pytest.raises(UsageError, match=r"armkin\.drawing\(arm, file, at\)"):
        armkin.path(armkin.load("three_dof"), SVG)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("d.yaml", "--grip-by", "M3"), "--grip-by belongs to"),
        (("d.csv", "--feed", "3"), "--feed belongs to"),
        (("--via", "390,80,300", "--lift", "4"), "--lift belongs to"),
    ],
)
def test_an_option_of_drawings_is_refused_without_one(words: tuple[str, ...], says: str) -> None:
    """Before the file is read."""
    files = "G-code and SVG: files that end in .gcode, .gco, .nc, .ngc or .svg"
    assert run("path", "three_dof", *words) == (2, "", f"error: {says} {files}\n")


def test_an_option_of_the_other_language_is_noted(tmp_path: Path) -> None:
    drawing, line = tmp_path / "d.nc", tmp_path / "d.svg"
    drawing.write_text("G1 X0 Y0 F600\nG1 X5\n")
    line.write_text('<svg width="10mm" height="10mm"><path d="M 0 0 L 5 0"/></svg>')
    for file, option, says in (
        (drawing, ("--lift", 4), "it belongs to SVG"),
        (line, ("--grip-by", "M3"), "G-code alone"),
    ):
        completed = run("path", "three_dof", file, "--at", "350,0,200", "--feed", 20, *option)
        assert completed.code == 0
        assert f"{option[0]} is ignored: " in completed.err
        assert says in completed.err
