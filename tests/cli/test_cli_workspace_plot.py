"""`armkin workspace` and `armkin plot` through the command line."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import armkin
from armkin.reach import workspace
from command_line import ROOT, THREE_DOF, run

PNG = b"\x89PNG\r\n\x1a\n"


def test_workspace_json_is_the_survey() -> None:
    result = run("workspace", THREE_DOF, "--samples", 5000, "--seed", 7, "--measure", "step_error", "--json")
    assert (result.code, result.err) == (0, "")
    answer = result.json
    arm = armkin.load(ROOT / THREE_DOF)
    w = workspace(arm, 5000, seed=7, measures=["step_error"])
    assert answer["samples"] == 5000
    assert [answer[f"{axis}_mm"] for axis in "xyz"] == np.stack([w.low, w.high], axis=1).tolist()
    assert answer["reach_mm"] == list(w.reach)
    assert w.extent is not None
    assert answer["volume_mm3"] == w.extent.value == pytest.approx(2.454e8, rel=0.01)
    assert answer["volume_error_mm3"] == w.extent.error < 0.01 * w.extent.value
    assert answer["measures"] == {"step_error": list(w.measures["step_error"])}
    assert answer["robot_sha256"] == arm.sha256
    assert answer["seconds"] > 0
    assert "area_mm2" not in answer


def test_workspace_of_a_planar_arm_has_an_area() -> None:
    answer = run("workspace", "robots/planar_2dof.yaml", "--samples", 100, "--json").json
    assert answer["area_mm2"] == pytest.approx(np.pi * (500**2 - 100**2), rel=5e-4)
    assert "volume_mm3" not in answer


def test_workspace_for_people() -> None:
    out = run("workspace", THREE_DOF, "--samples", "1e4").out
    assert out.startswith("three_dof: 10,000 samples\n")
    for word in ("reach", "mm from the base", "volume 2.45412e+08 mm3 +- 0.85 %"):
        assert word in out


def test_the_homeworks_sweep_is_one_command(tmp_path: Path) -> None:
    out, picture = tmp_path / "sweep.csv", tmp_path / "sweep.png"
    words = ["workspace", "robots/pan_tilt.yaml", "--grid", "50,200", "--out", out, "--plot", picture]
    result = run(*words, "--color", "z", "--json")
    assert (result.code, result.err) == (0, "")
    assert result.json["samples"] == 10_000
    assert result.json["volume_mm3"] == 0.0
    lines = out.read_text().splitlines()
    assert lines[:2] == ["q1,q2,x,y,z", "-180,-180,1500,-1000,0"]
    assert len(lines) == 10_001
    assert picture.read_bytes().startswith(PNG)


def test_a_picture_has_the_measure_that_colours_it(tmp_path: Path) -> None:
    result = run("workspace", THREE_DOF, "--samples", 500, "--plot", tmp_path / "a.svg", "--json")
    assert result.code == 0
    assert list(result.json["measures"]) == ["manipulability"]
    assert b"<svg" in (tmp_path / "a.svg").read_bytes()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--samples", "0"], "--samples: '0' must be a whole number from 1 to"),
        (["--grid", "5,x,5"], "--grid: 'x' is not a number"),
        (["--grid", "5,5"], "a grid needs 3 numbers of points, or one for all; got 2"),
        (["--samples", "5", "--grid", "5"], "samples (random) and a grid: give one of the two"),
        (["--measure", "speed"], "there is no measure 'speed'"),
        (["--out", "cloud.xyz"], "a cloud is written as .csv, .npz, .ply"),
        (["--plot", "cloud.jpg"], "a picture is written as .png or .svg"),
        (["--color", "z"], "--color is for the picture; add --plot FILE"),
        (["--plot", "cloud.png", "--color", "red"], "there is no colour 'red'"),
        (["--seed", "-1"], "--seed: '-1' must be a whole number from 0 to"),
    ],
)
def test_workspace_usage(words: list[str], message: str) -> None:
    result = run("workspace", THREE_DOF, *words)
    assert (result.code, result.out) == (2, "")
    assert message in result.err


def test_plot_one_pose(tmp_path: Path) -> None:
    out = tmp_path / "arm.png"
    assert run("plot", THREE_DOF, -30, 5, -5, "--out", out, "--view", "-10,-60") == (0, "", "")
    first = out.read_bytes()
    assert first.startswith(PNG)
    assert run("plot", THREE_DOF, -30, 5, -5, "--out", out, "--no-frames") == (0, "", "")
    assert out.read_bytes() != first


def test_plot_warns_of_a_pose_outside_the_limits(tmp_path: Path) -> None:
    result = run("plot", THREE_DOF, 200, 0, 0, "--view", "top", "--out", tmp_path / "arm.png")
    assert (result.code, result.out) == (0, "")
    assert result.err == "warning: q1 = 200 deg is outside -120 to 120 deg\n"


def test_plot_all_branches(tmp_path: Path) -> None:
    out = tmp_path / "branches.svg"
    assert run("plot", THREE_DOF, "--target", "390,80,300", "--out", out) == (0, "", "")
    assert b"<svg" in out.read_bytes()


def test_plot_the_homeworks_path(tmp_path: Path) -> None:
    """A circle of radius 400 about the shoulder, in a plane tilted by -45 degrees, in 11 points."""
    arm = armkin.load(ROOT / "robots/yaw_two_link.yaml")
    t = np.linspace(0, 2 * np.pi, 11)
    x, y = 400 * np.cos(t), 400 * np.sin(t)
    s = armkin.ik(arm, np.stack([np.cos(-np.pi / 4) * x, y, 660 - np.sin(-np.pi / 4) * x], axis=1))
    rows = np.rad2deg(s.q[:, s.names.index("left, elbow up")])
    path, out = tmp_path / "path.csv", tmp_path / "path.png"
    np.savetxt(path, rows, delimiter=",", header="q1,q2,q3", comments="")
    assert run("plot", "robots/yaw_two_link.yaml", "--path", path, "--out", out) == (0, "", "")
    assert out.read_bytes().startswith(PNG)


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["1", "2", "3"], 2, "plot needs --out FILE, a .png or .svg"),
        (["--out", "a.png"], 2, "nothing to draw: give joint values (q1 q2 q3), --target or --path"),
        (["1", "2", "--out", "a.png"], 2, "three_dof takes 3 numbers (q1 q2 q3), got 2"),
        (["1", "2", "3", "--out", "a.gif"], 2, "a.gif: a picture is written as .png or .svg"),
        (["1", "2", "3", "--out", "a.png", "--view", "up"], 2, "--view up: there are front, side, top, iso"),
        (["1", "2", "3", "--out", "a.png", "--target", "1,2,3"], 2, "give one of the three"),
        (["1", "2", "3", "--out", "a.png", "--lock", "q1=3"], 2, "--task and --lock belong to --target"),
        (["--out", "a.png", "--path", "/no/such.csv"], 1, "cannot read"),
        (["--out", "a.png", "--target", "3900,80,300"], 3, "three_dof cannot reach x = 3900"),
        (["1", "2", "3", "--out", "/no/such/a.png"], 1, "/no/such/a.png: cannot write"),
    ],
)
def test_plot_errors(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], code: int, message: str
) -> None:
    result = run("plot", THREE_DOF, *words)
    assert (result.code, result.out) == (code, "")
    assert message in result.err
    assert not (ROOT / "a.png").exists()


def test_too_long_a_path(tmp_path: Path) -> None:
    path = tmp_path / "path.csv"
    path.write_text("1,2,3\n" * 501)
    result = run("plot", THREE_DOF, "--path", path, "--out", tmp_path / "a.png")
    assert result.code == 2
    assert "more than 500 poses cannot be told apart" in result.err


@pytest.mark.parametrize("words", [["plot", "0", "0", "0", "--out"], ["workspace", "--plot"]])
def test_without_matplotlib(tmp_path: Path, words: list[str]) -> None:
    """One line that says what to install, exit code 1, at once, and no file."""
    code = "import sys; sys.modules['matplotlib'] = None; from armkin.cli import main; main()"
    out = str(tmp_path / "a.png")
    command = [sys.executable, "-c", code, words[0], THREE_DOF, *words[1:], out]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("error: pictures need matplotlib, which cannot be imported (")
    assert done.stderr.endswith("pip install 'armkin[plot]'\n")
    assert done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
