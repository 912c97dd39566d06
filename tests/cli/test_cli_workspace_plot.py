"""`armkin workspace` and `armkin plot` through the command line."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import armkin
from armkin.reachability import workspace
from command_line import ROOT, THREE_DOF, run

PNG = b"\x89PNG\r\n\x1a\n"


def test_workspace_json_is_the_survey() -> None:
    completed = run("workspace", THREE_DOF, "--samples", 5000, "--seed", 7, "--measure", "step_error", "--json")
    assert (completed.code, completed.err) == (0, "")
    answer = completed.json
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
    text = run("workspace", THREE_DOF, "--samples", "1e4").out
    assert text.startswith("three_dof: 10,000 samples\n")
    for word in ("reach", "mm from the base", "volume 2.45412e+08 mm3 +- 0.85 %"):
        assert word in text


def test_the_homeworks_sweep_is_one_command(tmp_path: Path) -> None:
    cloud, picture = tmp_path / "sweep.csv", tmp_path / "sweep.png"
    words = ["workspace", "robots/pan_tilt.yaml", "--grid", "50,200", "--out", cloud, "--plot", picture]
    completed = run(*words, "--color", "z", "--json")
    assert (completed.code, completed.err) == (0, "")
    assert completed.json["samples"] == 10_000
    assert completed.json["volume_mm3"] == 0.0
    lines = cloud.read_text().splitlines()
    assert lines[:2] == ["q1,q2,x,y,z", "-180,-180,1500,-1000,0"]
    assert len(lines) == 10_001
    assert picture.read_bytes().startswith(PNG)


def test_a_picture_has_the_measure_that_colours_it(tmp_path: Path) -> None:
    completed = run("workspace", THREE_DOF, "--samples", 500, "--plot", tmp_path / "a.svg", "--json")
    assert completed.code == 0
    assert list(completed.json["measures"]) == ["manipulability"]
    assert b"<svg" in (tmp_path / "a.svg").read_bytes()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--samples", "0"], "--samples: '0' must be a whole number from 1 to"),
        (["--grid", "5,x,5"], "--grid: 'x' is not a number"),
        (["--grid", "5,5"], "a grid needs 3 numbers of points, or one for all; got 2"),
        (["--samples", "5", "--grid", "5"], "samples (random) and a grid: give one of the two"),
        (["--measure", "speed"], "there is no measure 'speed'"),
        (["--out", "cloud.xyz"], "a cloud is written as .csv, .npz or .ply"),
        (["--plot", "cloud.jpg"], "a picture is written as .png or .svg"),
        (["--color", "z"], "--color is for the picture; add --plot FILE"),
        (["--plot", "cloud.png", "--color", "red"], "there is no colour 'red'"),
        (["--seed", "-1"], "--seed: '-1' must be a whole number from 0 to"),
    ],
)
def test_workspace_usage(words: list[str], message: str) -> None:
    completed = run("workspace", THREE_DOF, *words)
    assert (completed.code, completed.out) == (2, "")
    assert message in completed.err


def test_plot_one_pose(tmp_path: Path) -> None:
    picture = tmp_path / "arm.png"
    assert run("plot", THREE_DOF, -30, 5, -5, "--out", picture, "--view", "-10,-60") == (0, "", "")
    first = picture.read_bytes()
    assert first.startswith(PNG)
    assert run("plot", THREE_DOF, -30, 5, -5, "--out", picture, "--no-frames") == (0, "", "")
    assert picture.read_bytes() != first


def test_plot_warns_of_a_pose_outside_the_limits(tmp_path: Path) -> None:
    completed = run("plot", THREE_DOF, 200, 0, 0, "--view", "top", "--out", tmp_path / "arm.png")
    assert (completed.code, completed.out) == (0, "")
    assert completed.err == "warning: q1 = 200 deg is outside -120 to 120 deg\n"


def test_plot_all_branches(tmp_path: Path) -> None:
    picture = tmp_path / "branches.svg"
    assert run("plot", THREE_DOF, "--target", "390,80,300", "--out", picture) == (0, "", "")
    assert b"<svg" in picture.read_bytes()


def test_plot_the_homeworks_path(tmp_path: Path) -> None:
    """A circle of radius 400 about the shoulder, in a plane tilted by -45 degrees, in 11 points."""
    arm = armkin.load(ROOT / "robots/yaw_two_link.yaml")
    t = np.linspace(0, 2 * np.pi, 11)
    x, y = 400 * np.cos(t), 400 * np.sin(t)
    s = armkin.ik(arm, np.stack([np.cos(-np.pi / 4) * x, y, 660 - np.sin(-np.pi / 4) * x], axis=1))
    rows = np.rad2deg(s.q[:, s.names.index("left, elbow up")])
    path, picture = tmp_path / "path.csv", tmp_path / "path.png"
    np.savetxt(path, rows, delimiter=",", header="q1,q2,q3", comments="")
    assert run("plot", "robots/yaw_two_link.yaml", "--path", path, "--out", picture) == (0, "", "")
    assert picture.read_bytes().startswith(PNG)


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["1", "2", "3"], 2, "there is no display to open a window on; name a file for the picture"),
        (["--out", "a.png"], 2, "nothing to draw: give joint values (q1 q2 q3), a pose's name, --target or --batch"),
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
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    completed = run("plot", THREE_DOF, *words)
    assert (completed.code, completed.out) == (code, "")
    assert message in completed.err
    assert not (ROOT / "a.png").exists()


def test_too_long_a_path(tmp_path: Path) -> None:
    path = tmp_path / "path.csv"
    path.write_text("1,2,3\n" * 20_001)
    completed = run("plot", THREE_DOF, "--path", path, "--out", tmp_path / "a.png")
    assert completed.code == 2
    assert "more than 20000 poses are too many for one picture" in completed.err


def test_plot_takes_what_other_commands_print(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[dict[str, Any]] = []

    def plot_poses(arm: Any, q: Any, out: str, **style: Any) -> None:
        drawn.append({"poses": np.atleast_2d(q).shape[0], "names": style.get("names"), "out": out})

    monkeypatch.setattr("armkin.plot.plot_poses", plot_poses)
    targets = b"390,80,300\n9000,0,0\n0,400,200\n"
    completed = run("ik", THREE_DOF, 390, 80, 300, "--json")
    every = run("ik", THREE_DOF, 390, 80, 300, "--json", "--all-branches")
    rows = run("ik", THREE_DOF, "--batch", "-", stdin=targets)
    lines = run("ik", THREE_DOF, "--batch", "-", "--json", stdin=targets)
    trace = run("send", THREE_DOF, -30, 5, -5, "--dry-run", "--trace", "-")
    for source, words in [
        (completed, []),
        (every, []),
        (rows, [THREE_DOF, "--batch", "-"]),
        (rows, [THREE_DOF, "--path", "-"]),
        (lines, ["three_dof"]),
        (trace, [THREE_DOF, "--batch", "-"]),
    ]:
        assert run("plot", *words, "-o", "a.png", stdin=source.out.encode()).code == 0
    assert [picture["poses"] for picture in drawn][:5] == [1, 4, 2, 2, 2]
    assert drawn[5]["poses"] > 100
    assert drawn[1]["names"][0] == "left, elbow up"


def test_plot_without_out_opens_a_window(monkeypatch: pytest.MonkeyPatch) -> None:
    """With a stand-in for the toolkit: this machine may have neither a display nor a toolkit."""
    from matplotlib.figure import Figure

    shown: list[Figure] = []

    class Windows:
        def figure(self, **options: Any) -> Figure:
            shown.append(Figure(**options))
            return shown[-1]

        def show(self) -> None:
            assert shown[-1].axes

    monkeypatch.setattr("armkin.plot.canvas.window_pyplot", Windows)
    assert run("plot", THREE_DOF, "home").code == 0
    assert len(shown) == 1


@pytest.mark.parametrize("words", [["plot", "0", "0", "0", "--out"], ["workspace", "--plot"]])
def test_without_matplotlib(tmp_path: Path, words: list[str]) -> None:
    """One line that says what to install, exit code 1, at once, and no file."""
    code = "import sys; sys.modules['matplotlib'] = None; from armkin.cli import main; main()"
    picture = str(tmp_path / "a.png")
    command = [sys.executable, "-c", code, words[0], THREE_DOF, *words[1:], picture]
    completed = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)
    assert (completed.returncode, completed.stdout) == (1, "")
    assert completed.stderr.startswith("error: pictures need matplotlib, which cannot be imported (")
    assert completed.stderr.endswith("pip install matplotlib (armkin's extra: plot)\n")
    assert completed.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
