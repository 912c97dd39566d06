"""`armkin robots`, and what `armkin info` says is missing."""

from functools import cache
from pathlib import Path
from typing import Any

import pytest

from armkin.robot_file import catalogue
from command_line import ROOT, run


def test_every_shipped_robot_is_listed_with_what_it_can_do() -> None:
    entry_of = {entry["robot_file"]: entry for entry in run("robots", "--json").json["robots"]}
    assert list(entry_of) == list(catalogue.robot_names())
    assert entry_of["three_dof"]["can"] == {"ik": True, "pulses": True, "simulate": True, "send": True, "home": False}
    assert entry_of["panda"]["can"]["ik"]
    assert entry_of["ur5e"]["target_labels"] == ["x", "y", "z", "roll", "pitch", "yaw"]
    lines = run("robots").out.splitlines()
    can = ["ik", "pulses", "simulate", "send", "home"]
    assert lines[0].split() == ["robot", "joints", "task", "target", *can, "compared"]
    assert [name for name in entry_of if entry_of[name]["compared"].startswith("only its own URDF")] == [
        line.split()[0] for line in lines[1:] if line.endswith("URDF only")
    ]
    assert entry_of["fanuc_crx10ia"]["compared"].startswith("the maker's reach of 1249 mm")
    assert [line.split()[0] for line in lines[1:]] == list(entry_of)


@cache
def listed_robots() -> dict[str, Any]:
    return {entry["robot_file"]: entry for entry in run("robots", "--json").json["robots"]}


@pytest.mark.parametrize("name", catalogue.robot_names())
def test_what_a_robot_can_do_is_what_the_commands_do(name: str) -> None:
    entry = listed_robots()[name]
    can = entry["can"]
    target = run("fk", name, "home", "--json").json["position_mm"] + [0] * 3
    assert (run("ik", name, *target[: len(entry["target_labels"])]).code in (0, 3)) == can["ik"] or name == "moveo"
    assert (run("pulses", name, "home").code == 0) == can["pulses"]
    assert (run("send", name, "home", "--dry-run").code == 0) == can["simulate"]
    simulated = run("send", name, "home", "--port", "sim")
    assert (simulated.code, "assumed for the simulation alone" in simulated.err) == (0, not can["simulate"])
    refused = run("send", name, "home", "--port", "/dev/ttyNOWHERE").code
    assert refused == (5 if can["send"] else 2)


def test_info_says_what_is_missing(tmp_path: Path) -> None:
    out = run("info", "three_dof").out
    assert "  send     ready\n  home     not yet: its joints have no homing\n" in out
    assert "  pulses   not yet: its joints have no drive\n" in run("info", "ur5e").out
    assert run("info", "ar4", "--json").json["lacks"]["send"] == ["it has no board"]
    path = tmp_path / "homing.yaml"
    homing = "homing: {switch: X, direction: -1, at: -100, speed: 10, backoff: 3, normally: open}"
    text = (ROOT / "robots/three_dof.yaml").read_text()
    path.write_text(text.replace("    drive: {axis: X", f"    {homing}\n    drive: {{axis: X"))
    assert "  home     not yet: joints q2, q3 have no homing\n" in run("info", path).out
