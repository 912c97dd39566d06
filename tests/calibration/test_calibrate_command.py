"""`armkin calibrate`: measured rows from a file, a robot file that every command takes, poses to measure next."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from built_arms import build_real_arm, measure_tips, random_commands

import armkin
from command_line import run


def test_the_command_writes_a_file_that_the_others_take(tmp_path: Path) -> None:
    arm = armkin.load("three_dof")
    rng = np.random.default_rng(13)
    c = random_commands(arm, 40, rng)
    csv, corrected = tmp_path / "rows.csv", tmp_path / "mine.yaml"
    rows = np.concatenate([np.degrees(c), measure_tips(build_real_arm(arm, 13), c, rng)], axis=1)
    np.savetxt(csv, rows, delimiter=",", header="q1,q2,q3,x,y,z", comments="")
    completed = run("calibrate", "three_dof", csv, "--out", corrected, "--json")
    assert completed.code == 0, completed.err
    answer = completed.json
    assert answer["after"]["rms_mm"] < 0.05 * answer["before"]["rms_mm"]
    assert answer["out"] == str(corrected)
    assert {row["row"] for row in answer["flagged"]} <= set(range(2, 42))
    assert len(answer["flagged"]) == 2
    assert "three_dof, calibrated from 40 measured poses" in corrected.read_text()
    for words in (
        ["fk", corrected, 10, 20, 30],
        ["ik", corrected, 300, 100, 250],
        ["pulses", corrected, 10, 20, 30],
        ["info", corrected],
    ):
        assert run(*words).code == 0
    shown = run("calibrate", "three_dof", csv)
    assert "on rows not used" in shown.out
    assert "--out NEW.yaml writes the corrected robot file" in shown.err
    zeros = run("calibrate", "three_dof", csv, "--fix", "base,tool,ratios,lengths,twists", "--json").json
    assert zeros["corrected"] in (["zeros"], [])
    assert run("calibrate", "three_dof", csv, "--out", csv.parent / "nowhere" / "x.yaml").code == 1
    missing = run("calibrate", "three_dof")
    assert missing.code == 2
    assert "--suggest 30 says which poses to measure" in missing.err


def test_the_command_suggests_poses(tmp_path: Path) -> None:
    lines = run("calibrate", "three_dof", "--suggest", 3).out.splitlines()
    assert lines[0] == "q1,q2,q3"
    assert len(lines) == 4
    assert len(run("calibrate", "three_dof", "--suggest", 2, "--json").json["poses"]) == 2
    csv = tmp_path / "rows.csv"
    csv.write_text("10,20,30,1,2,3\n")
    assert len(run("calibrate", "three_dof", csv, "--suggest", 3).out.splitlines()) == 4


def test_poses_with_orientations_from_a_file(tmp_path: Path) -> None:
    from armkin.model.rotation import rpy

    arm = armkin.load("ur5e")
    rng = np.random.default_rng(14)
    c = random_commands(arm, 30, rng)
    T = build_real_arm(arm, 14).poses(c)
    rows = np.concatenate([np.degrees(c), T[:, :3, 3], np.degrees(rpy(T[:, :3, :3]))], axis=1)
    csv = tmp_path / "rows.csv"
    np.savetxt(csv, rows, delimiter=",")
    answer = run("calibrate", "ur5e", csv, "--poses", "--json").json
    assert answer["after"]["rms_mm"] < 0.3
    assert any(entry["name"] == "tool yaw" for entry in answer["corrections"])
