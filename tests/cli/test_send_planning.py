"""`armkin send --dry-run`: planning needs no board."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from command_line import COUNTS, POSE, ROOT, THREE_DOF, run

_STEPS = 0.003  # share of a time that is less or more, since goals of 10 degrees are whole steps


def test_a_dry_run_moves_nothing_and_needs_no_port() -> None:
    completed = run("send", THREE_DOF, *POSE, "--dry-run", "--json")
    assert completed.code == 0
    assert completed.json["dry_run"] is True
    assert completed.json["moves"] == COUNTS
    text = run("send", THREE_DOF, *POSE, "--dry-run")
    assert "nothing moves" in text.out
    assert "-10144" in text.out
    back = run("send", THREE_DOF, 0, 90, -90, "--dry-run", "--from", "-30,5,-5", "--json")
    assert back.json["moves"] == [-count for count in COUNTS]


def test_half_the_speed() -> None:
    slow = run("send", THREE_DOF, *POSE, "--dry-run", "--speed", "50", "--json").json
    assert slow["top_speed"] == pytest.approx([10.59, 30, 30], abs=0.01)
    assert slow["duration_s"] > 3


def _with_max_jerk(tmp_path: Path, jerk: float) -> Path:
    """A copy of three_dof whose joints have a max_jerk [deg/s3]."""
    path = tmp_path / "jerk.yaml"
    text = (ROOT / THREE_DOF).read_text("utf-8")
    path.write_text(text.replace("    max_accel: 120\n", f"    max_accel: 120\n    max_jerk: {jerk:g}\n"), "utf-8")
    return path


def test_a_move_keeps_the_max_jerk_of_the_file(tmp_path: Path) -> None:
    path, least = _with_max_jerk(tmp_path, 100), (32 * 10 / 100) ** (1 / 3)
    planned = run("send", path, 0, 80, -90, "--dry-run", "--json").json
    assert planned["duration_s"] == pytest.approx(least, rel=_STEPS)
    sent = run("send", path, 0, 80, -90, "--port", "sim", "--assume-home", "--json").json
    assert (sent["duration_s"], sent["pulses"]) == (planned["duration_s"], planned["pulses"])
    without = run("send", THREE_DOF, 0, 80, -90, "--dry-run", "--json").json
    assert without["duration_s"] == pytest.approx(2 * (10 / 120) ** 0.5, rel=_STEPS)


@pytest.mark.parametrize("blend", [[], ["--blend", 5]])
def test_rows_keep_the_max_jerk_of_the_file(tmp_path: Path, blend: list[object]) -> None:
    rows = tmp_path / "rows.csv"
    rows.write_text("0,80,-90\n0,70,-90\n10,70,-90\n")
    words = ("--batch", rows, *blend, "--port", "sim", "--assume-home", "--json")
    jerky, gentle = (run("send", robot, *words).json for robot in (THREE_DOF, _with_max_jerk(tmp_path, 100)))
    assert gentle["pulses"] == jerky["pulses"]
    assert gentle["waypoints"] == jerky["waypoints"] == 3
    least = (32 * 10 / 100) ** (1 / 3)  # of 10 degrees, the last move
    assert gentle["duration_s"] > least > jerky["duration_s"] / 3
    if not blend:
        assert gentle["duration_s"] == pytest.approx(3 * least, rel=_STEPS)


def test_a_trace_is_the_path_as_csv(tmp_path: Path) -> None:
    path = tmp_path / "trace.csv"
    assert run("send", THREE_DOF, *POSE, "--dry-run", "--trace", path).code == 0
    rows = list(csv.DictReader(path.read_text().splitlines()))
    assert list(rows[0])[:5] == ["time_s", "q1", "q2", "q3", "q1_x_mm"]
    assert list(rows[0])[-1] == "tool_z_mm"
    times = [float(row["time_s"]) for row in rows]
    assert times == sorted(times)
    assert float(rows[0]["q2"]) == pytest.approx(90)
    assert float(rows[-1]["q2"]) == pytest.approx(4.99837, abs=1e-4)
    assert float(rows[-1]["tool_x_mm"]) == pytest.approx(398.357, abs=1e-3)
    assert float(rows[0]["q1_z_mm"]) == 170


def _movable_robots() -> list[Path]:
    """Shipped and test robots with drives and rates, whatever their board."""
    robots = []
    for path in sorted((ROOT / "robots").glob("*.yaml")) + sorted((ROOT / "tests" / "robots").glob("*.yaml")):
        text = path.read_text("utf-8")
        if "full_steps" in text or "kind: servo" in text:
            robots.append(path)
    return robots


@pytest.mark.parametrize("path", _movable_robots(), ids=lambda path: path.stem)
def test_every_robot_with_drives_is_rehearsed_or_told_all_that_is_missing(path: Path) -> None:
    import armkin
    from armkin.board.backend.missing_keys import missing_for_motion

    arm = armkin.load(path)
    home = ",".join(str(x) for x in armkin.pulses(arm, arm.home))
    assert home
    values = [float(x) for x in (arm.home / [1.0 if slides else 0.0174532925199433 for slides in arm.prismatic])]
    goal = [value + 1 if value < 50 else value - 1 for value in values]
    for words in (("--dry-run",), ("--port", "sim")):
        completed = run("send", path, *goal, "--json", *words)
        lacks = missing_for_motion(arm, board=False)
        if lacks and "sim" not in words:
            assert completed.code == 2
            assert all(lack in completed.err for lack in lacks)
            assert "max_accel: 60 " in completed.err
        else:
            assert not lacks or "max_accel of " in completed.err  # what is assumed is named
            assert completed.code == 0, completed.err
            assert completed.json["joints"] == pytest.approx(goal, abs=0.2)


def test_a_real_port_still_needs_a_board_and_all_is_said_at_once(tmp_path: Path) -> None:
    mine = tmp_path / "mine.yaml"
    text = (ROOT / THREE_DOF).read_text()
    mine.write_text(text[: text.index("board: {kind")].replace("    max_accel: 120\n", "", 1))
    completed = run("send", mine, *POSE, "--port", tmp_path / "none")
    assert completed.code == 2
    for words in (
        "joint q1 has no max_accel",
        "it has no board",
        "max_accel: 60 ",
        "board: {kind: uno_cnc_shield, driver: A4988}",
    ):
        assert words in completed.err


def test_a_redundant_arm_is_sent_to_a_target_with_a_joint_held(tmp_path: Path) -> None:
    lines = []
    for line in (ROOT / "robots/panda.yaml").read_text().splitlines():
        lines.append(line)
        if line.startswith("    max_speed:"):
            lines += ["    max_accel: 100", "    drive: {full_steps: 200, microsteps: 16, gear: 50}"]
    path = tmp_path / "panda.yaml"
    path.write_text("\n".join(lines))
    words = ("send", path, "--target", "400,0,400,180,0,0", "--dry-run", "--json")
    assert run(*words).json["position_mm"] == pytest.approx([400, 0, 400], abs=0.1)
    completed = run(*words, "--lock", "J3=20")
    assert completed.code == 0, completed.err
    assert completed.json["joints"][2] == pytest.approx(20, abs=0.01)
    assert completed.json["position_mm"] == pytest.approx([400, 0, 400], abs=0.1)
    alone = run("send", THREE_DOF, 0, 90, -90, "--lock", "q1=1", "--dry-run")
    assert (alone.code, alone.out) == (2, "")
    assert "--branch, --task, --near and --lock belong to --target" in alone.err


def test_bus_servos_without_a_board_are_told_which(tmp_path: Path) -> None:
    """It was an internal error: no board of ours has an axis for them."""
    path = tmp_path / "arm.yaml"
    path.write_text((ROOT / "robots/so100.yaml").read_text().replace("board: {kind: feetech}\n", ""))
    for words in (("--dry-run",), ("--port", "sim")):
        completed = run("send", path, "home", *words)
        assert (completed.code, completed.out) == (2, "")
        assert "add to" in completed.err
        assert "board: {kind: feetech}" in completed.err


def test_an_export_beyond_what_a_robot_file_takes_prints_nothing(tmp_path: Path) -> None:
    path = tmp_path / "arm.yaml"
    path.write_text((ROOT / "robots/three_dof.yaml").read_text().replace("a: 197, d: -10", "a: 10000000, d: -10", 1))
    assert run("info", path).code == 0
    completed = run("export", path, "--screws")
    assert (completed.code, completed.out) == (4, "")
