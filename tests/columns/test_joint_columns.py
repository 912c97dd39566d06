"""Joints that are named like other columns of a table: no column is lost, and the table is read again."""

from __future__ import annotations

from pathlib import Path

import pytest

from command_line import run

# A gantry's slides, and a turn named like the tool's, are the natural names.
NAMES = [("x", "y", "z"), ("yaw", "Pitch", "X"), ("row", "status", "motion"), ("time_s", "x_mm", "s_mm")]


@pytest.fixture
def plain_file(tmp_path: Path) -> Path:
    """The same arm, whose joints are q1, q2 and q3."""
    file = tmp_path / "plain.yaml"
    file.write_text(run("export", "three_dof", "--dh").out)
    return file


@pytest.fixture(params=NAMES, ids=" ".join)
def named_file(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A copy of three_dof whose joints have these names."""
    text = run("export", "three_dof", "--dh").out
    for old, new in zip(("q1", "q2", "q3"), request.param, strict=True):
        text = text.replace(f"name: {old}\n", f"name: {new}\n")
    file = tmp_path / "named.yaml"
    file.write_text(text)
    return file


@pytest.mark.parametrize("end", ["csv", "npz", "jsonl", "parquet"])
@pytest.mark.parametrize("command", ["fk", "pulses"])
def test_joints_and_the_tool_have_columns_of_their_own(
    named_file: Path, plain_file: Path, command: str, end: str, tmp_path: Path
) -> None:
    rows = b"10,20,30\n-30,5,-5\n"
    plain = run(command, plain_file, "--batch", "-", stdin=rows).out.splitlines()
    table = run(command, named_file, "--batch", "-", stdin=rows).out.splitlines()
    assert table[1:] == plain[1:]
    assert len({name.lower() for name in table[0].split(",")}) == len(plain[0].split(","))

    out = tmp_path / f"table.{end}"
    assert run(command, named_file, "--batch", "-", "--out", out, stdin=rows).code == 0
    again = run(command, named_file, "--batch", out)
    assert (again.code, again.out.splitlines()) == (0, table)


def test_the_columns_of_ik_workspace_path_and_send(named_file: Path, plain_file: Path, tmp_path: Path) -> None:
    target = b"250,20,150\n"
    plain = run("ik", plain_file, "--batch", "-", "--all-branches", stdin=target).out.splitlines()
    table = run("ik", named_file, "--batch", "-", "--all-branches", stdin=target)
    assert table.out.splitlines()[1:] == plain[1:]
    values = run("fk", named_file, "--batch", "-", stdin=table.out.encode()).out.splitlines()
    assert [line.split(",")[:3] for line in values[1:]] == [line.split(",")[3:6] for line in plain[1:]]

    path = tmp_path / "path.yaml"
    path.write_text("moves: [{joint: [10, 80, -80]}]\n")
    cloud, plan, trace = tmp_path / "cloud.csv", tmp_path / "plan.csv", tmp_path / "trace.csv"
    assert run("workspace", named_file, "--samples", 5, "--out", cloud).code == 0
    assert run("path", named_file, path, "--out", plan).code == 0
    assert run("send", named_file, 10, 80, -80, "--dry-run", "--trace", trace).code == 0
    for text in (cloud, plan, trace):
        heading = text.read_text().splitlines()[0].lower().split(",")
        assert len(set(heading)) == len(heading)
        assert run("fk", named_file, "--batch", text).code == 0


def test_a_joint_may_share_its_name_with_a_measured_coordinate(tmp_path: Path) -> None:
    text = run("export", "three_dof", "--dh").out.replace("name: q1\n", "name: x\n")
    file, measured = tmp_path / "named.yaml", tmp_path / "measured.csv"
    file.write_text(text)
    poses = run("calibrate", file, "--suggest", 12).out
    tips = run("fk", file, "--batch", "-", stdin=poses.encode()).out
    assert tips.startswith("joint_x,q2,q3,x,y,z,")
    measured.write_text(tips)
    assert run("calibrate", file, measured).code == 0


@pytest.mark.parametrize(
    ("names", "columns"),
    [
        (("joint_x", "x", "b"), "joint_x,joint_joint_x,b"),
        (("x", "X", "b"), "joint_x,joint_joint_X,b"),
        (("q1", "q2", "q3"), "q1,q2,q3"),
    ],
)
def test_every_joint_has_a_column_of_its_own(names: tuple[str, ...], columns: str, tmp_path: Path) -> None:
    text = run("export", "three_dof", "--dh").out
    for old, new in zip(("q1", "q2", "q3"), names, strict=True):
        text = text.replace(f"name: {old}\n", f"name: {new}\n")
    file = tmp_path / "named.yaml"
    file.write_text(text)
    table = run("fk", file, "--batch", "-", stdin=b"10,20,30\n").out
    assert table.startswith(f"{columns},x,y,z,")
    assert run("fk", file, "--batch", "-", stdin=table.encode()).out == table


def test_a_column_that_no_table_has_is_not_taken_for_a_joint_s() -> None:
    rows = b"joint_q1,q1,q2,q3\n99,10,20,30\n"
    assert run("fk", "three_dof", "--batch", "-", stdin=rows).out.splitlines()[1].startswith("10.0,20.0,30.0,")


def test_a_joint_s_column_may_have_its_unit(tmp_path: Path) -> None:
    file = tmp_path / "named.yaml"
    file.write_text(run("export", "three_dof", "--dh").out.replace("name: q1\n", "name: x\n"))
    rows = b"joint_x_deg,q2,q3,x_mm,y_mm,z_mm\n10,20,30,280,49,283\n"
    assert run("fk", file, "--batch", "-", stdin=rows).out.splitlines()[1].startswith("10.0,20.0,30.0,")
    trace = tmp_path / "trace.csv"
    assert run("send", file, 10, 20, 30, "--dry-run", "--trace", trace).code == 0
    lines = run("ik", file, "--batch", trace).out.splitlines()
    assert lines[-1].split(",")[1:2] == ["exact"]
    assert float(lines[-1].split(",")[3]) == pytest.approx(10.0, abs=0.05)  # of either elbow
