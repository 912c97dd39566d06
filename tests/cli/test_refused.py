"""What has no sensible meaning is refused at once: in a line or two, with what is allowed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import armkin
from armkin.errors import PathFileError, UsageError
from command_line import THREE_DOF, run

DOF = THREE_DOF
LINE = "start: {point: [390, 80, 300]}\nmoves: [{line: [390, -80, 300]}]\n"


@pytest.mark.parametrize(
    ("key", "says"),
    [
        ("tool_speed: 1.0e-300", "path.yaml:1: tool_speed: must be at least 0.001, not 1e-300"),
        ("tool_speed: 1.0e-6", "tool_speed: must be at least 0.001"),
        ("tolerance: 1.0e-300", "tolerance: must be at least 1e-06"),
        ("speed: 1.0e-300", "speed: must be at least 0.01"),
        ("tool_speed: 0.001", "the motion takes 160326 s; one plan lasts a day (86400 s) at most: go faster"),
    ],
)
def test_a_path_has_least_speeds_and_a_least_tolerance(key: str, says: str, tmp_path: Path) -> None:
    file = tmp_path / "path.yaml"
    file.write_text(f"{key}\n{LINE}")
    done = run("path", DOF, file)
    assert (done.code, done.out) == (2, "")
    assert says in done.err
    assert done.err.count("\n") == 1


def test_a_table_of_corners_has_the_same_least_speed(tmp_path: Path) -> None:
    file = tmp_path / "path.csv"
    file.write_text("x,y,z,tool_speed\n390,80,300,1\n390,-80,300,1e-300\n")
    done = run("path", DOF, file)
    assert (done.code, done.out) == (2, "")
    assert "path.csv:3: blend is at least 0, tool_speed at least 0.001 mm/s" in done.err


@pytest.mark.parametrize(
    ("line", "says"),
    [
        (f"send {DOF} 0 80 -90 --port sim --speed 1e-300", "--speed: '1e-300' must be from 0.01 to 100 percent"),
        (f"send {DOF} 0 80 -90 --port sim --speed 1e-5", "from 0.01 to 100 percent"),
        (f"send {DOF} 0 80 -90 --dry-run --speed 0", "from 0.01 to 100 percent"),
        (f"path {DOF} --via 390,80,300 --via 390,-80,300 --speed 0.001", "--speed: '0.001' must be from 0.01"),
        (f"path {DOF} --via 390,80,300 --via 390,-80,300 --accel 101", "--accel: '101' must be from 0.01"),
        (f"path {DOF} --via 390,80,300 --via 390,-80,300 --tool-speed 1e-6", "must be at least 0.001"),
        (f"path {DOF} --via 390,80,300 --via 390,-80,300 --tolerance 1e-300", "must be at least 1e-06"),
        (f"workspace {DOF} --samples 99999999999999", "must be a whole number from 1 to 10000000000"),
        (f"workspace {DOF} --grid 99999,99999,99999", "999,970,000,299,999 points; 10,000,000,000 at most"),
        ("ik iiwa7 500 0 500 180 0 0 --sweep J3", "--sweep J3: write JOINT=LOW:HIGH:COUNT, for example J3=-90:90:16"),
        (f"ik {DOF} 390 80 300 --sweep q1=0:10:99999999999", "'99999999999' must be a whole number from 1 to 10000"),
        (f"ik {DOF} 390 80 300 --sweep q1=0:10:1e999", "'1e999' must be a whole number from 1 to 10000"),
    ],
)
def test_a_number_without_sense_is_refused_with_what_is_allowed(line: str, says: str) -> None:
    done = run(*line.split())
    assert (done.code, done.out) == (2, "")
    assert says in done.err
    assert done.err.count("\n") == 1


def test_programs_are_refused_the_same() -> None:
    arm = armkin.load(DOF)
    corners = [[390, 80, 300], [390, -80, 300]]
    several: list[dict[str, Any]] = [
        {"speed": 1e-300},
        {"accel": 1e-300},
        {"tool_speed": 1e-300},
        {"tolerance": 1e-300},
    ]
    for bad in several:
        with pytest.raises(UsageError, match="is not possible"):
            armkin.path(arm, corners, **bad)
    with pytest.raises(PathFileError, match=r"tool_speed: must be at least 0\.001"):
        armkin.path(arm, {"moves": [{"point": corners[0]}, {"line": corners[1], "tool_speed": 1e-9}]})


def test_a_speed_below_one_percent_is_noted_and_taken() -> None:
    done = run("send", DOF, 0, 89, -90, "--dry-run", "--speed", 0.5)
    assert done.code == 0
    assert "note: --speed 0.5: 0.5 percent; half is --speed 50" in done.err
    assert run("send", DOF, 0, 89, -90, "--dry-run", "--speed", 1).err == ""
