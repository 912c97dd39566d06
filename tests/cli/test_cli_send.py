"""`armkin send` on the simulated board in this process: targets, branches, waypoints, refusals."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from command_line import COUNTS, POSE, THREE_DOF, run


def test_the_first_command_just_works() -> None:
    completed = run("send", THREE_DOF, *POSE, "--port", "sim")
    assert completed.code == 0, completed.err
    assert "-1067" in completed.out
    assert "-10144" in completed.out
    assert "5667" in completed.out
    assert "starts with the arm in its home pose" in completed.err
    assert completed.out.endswith("read back: as planned, 1.917 s\n")


def test_json_tells_plan_and_arrival() -> None:
    answer = run("send", THREE_DOF, *POSE, "--port", "sim", "--json").json
    assert answer["robot_file"] == THREE_DOF
    assert len(answer["robot_sha256"]) == 64
    assert answer["pulses"] == COUNTS
    assert answer["moves"] == COUNTS
    assert answer["start_joints"] == pytest.approx([0, 90, -90])
    assert answer["joints"] == pytest.approx([-30.009375, 4.998371, -4.995], abs=1e-6)
    assert answer["position"] == "known"
    assert answer["duration_s"] == pytest.approx(1.917, abs=0.002)
    assert answer["top_speed"] == pytest.approx([21.18, 60, 60], abs=0.01)


def test_a_target_goes_through_ik() -> None:
    completed = run("send", THREE_DOF, "--target", "390,80,300", "--port", "sim", "--json")
    assert completed.json["position_mm"] == pytest.approx([390, 80, 300], abs=0.06)


def test_a_named_branch_is_taken() -> None:
    branches = run("ik", THREE_DOF, 390, 80, 300, "--all-branches", "--json").json["branches"]
    legal = [branch for branch in branches if branch["within_limits"]]
    assert len(legal) >= 2
    for branch in legal[:2]:
        completed = run(
            "send", THREE_DOF, "--target", "390,80,300", "--branch", branch["name"], "--port", "sim", "--json"
        )
        assert completed.json["joints"] == pytest.approx(branch["joints"], abs=0.02)


def test_a_target_out_of_reach_is_exit_3_and_moves_nothing() -> None:
    completed = run("send", THREE_DOF, "--target", "3900,80,300", "--port", "sim", "--json")
    assert (completed.code, completed.out) == (3, "")
    assert "cannot reach" in completed.err


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        ((THREE_DOF, 0, 130, 0, "--port", "sim"), 3, "q2 = 130 deg is outside -20 to 120 deg"),
        ((THREE_DOF, 0, 90, "--port", "sim"), 2, "takes 3 numbers"),
        ((THREE_DOF, *POSE), 2, "--port is missing"),
        ((THREE_DOF, *POSE, "--port", "socket://127.0.0.1:1"), 5, "nobody listens there"),
        ((THREE_DOF, *POSE, "--port", "sim", "--speed", "0"), 2, "from 0.01 to 100"),
        ((THREE_DOF, *POSE, "--port", "sim", "--speed", "fast"), 2, "--speed: 'fast' is not a number"),
        ((THREE_DOF, *POSE, "--port", "sim", "--target", "1,2,3"), 2, "give one of them"),
        ((THREE_DOF, *POSE, "--port", "sim", "--branch", "left"), 2, "belong to --target"),
        ((THREE_DOF, *POSE, "--port", "sim", "--from", "0,0,0"), 2, "belongs to --dry-run"),
        (("robots/planar_2dof.yaml", 10, 10, "--port", "/dev/null"), 2, "its joints have no max_speed"),
        (("robots/planar_2dof.yaml", 10, 10, "--dry-run"), 2, "its joints have no max_speed"),
        (("robots/puma560.yaml", 0, 0, 0, 0, 0, 0, "--port", "/dev/null"), 2, "have no drive"),
    ],
)
def test_refusals(words: Sequence[object], code: int, message: str) -> None:
    completed = run("send", *words)
    assert (completed.code, completed.out) == (code, "")
    assert message in completed.err


@pytest.mark.skipif(sys.platform == "win32", reason="names of devices")
@pytest.mark.parametrize(
    ("port", "message"),
    [
        ("/dev/ttyNOWHERE", "there is no port /dev/ttyNOWHERE"),
        ("/dev/null", "/dev/null is no serial port; armkin ports lists them"),
        ("robots", "robots is no serial port"),
    ],
)
def test_a_port_that_is_none(port: str, message: str) -> None:
    completed = run("send", THREE_DOF, *POSE, "--port", port)
    assert (completed.code, completed.out) == (5, "")
    assert message in completed.err


def test_a_file_of_waypoints(tmp_path: Path) -> None:
    path = tmp_path / "path.csv"
    path.write_text("q1,q2,q3\n10,80,-80\n# a comment\n-20,60,-60\n-30,5,-5\n")
    completed = run("send", THREE_DOF, "--batch", path, "--port", "sim", "--json")
    assert completed.code == 0, completed.err
    assert completed.json["waypoints"] == 3
    assert completed.json["pulses"] == COUNTS


def test_a_file_with_one_row_outside_moves_nothing(tmp_path: Path) -> None:
    path = tmp_path / "path.csv"
    path.write_text("10,80,-80\n0,130,0\n")
    completed = run("send", THREE_DOF, "--batch", path, "--port", "sim")
    assert (completed.code, completed.out) == (3, "")
    assert "row 2: q2 = 130" in completed.err


@pytest.mark.parametrize(
    ("last", "code", "message"), [(b"x,5,-5\n", 2, "row 3"), (b"0,130,0\n", 3, "row 3: q2 = 130"), (b"", 0, "")]
)
def test_streamed_waypoints_stand_up_to_the_first_wrong_one(last: bytes, code: int, message: str) -> None:
    completed = run("send", THREE_DOF, "--batch", "-", "--port", "sim", "--json", stdin=b"10,80,-80\n-30,5,-5\n" + last)
    assert completed.code == code, completed.err
    answer = json.loads(completed.err)["sent"] if code == 2 else completed.json
    assert answer["pulses"] == COUNTS
    assert (completed.out == "") == (code == 2)
    assert message in completed.err


def test_a_ramp_of_many_segments_does_not_run_dry(tmp_path: Path) -> None:
    """27 segments of a ramp and frames of 6 left 26 in a queue of 32: DRY where the ramp began."""
    path = tmp_path / "path.csv"
    path.write_text("q1,q2,q3\n0.0258,24.2795,-38.6976\n43.2443,77.0574,-19.3756\n42.6755,76.9006,-18.9291\n")
    completed = run("send", THREE_DOF, "--batch", path, "--port", "sim", "--speed", "70", "--json")
    assert completed.code == 0, completed.err
