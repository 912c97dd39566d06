"""`ik --batch --continuous`: each row is compared with the row before."""

import numpy as np
import pytest

import armkin
from armkin.model import rotation, units
from command_line import THREE_DOF, run


def targets_of(q: np.ndarray) -> bytes:
    """Poses of a UR5e's joint values (N, 6) [deg], as rows of a CSV file."""
    T = armkin.fk(armkin.load("ur5e"), np.deg2rad(q))
    rows = np.hstack([T[:, :3, 3], units.angles_out(rotation.rpy(T[:, :3, :3]))])
    return ("x,y,z,roll,pitch,yaw\n" + "\n".join(",".join(map(repr, row)) for row in rows.tolist())).encode()


@pytest.fixture(scope="module")
def winding_path() -> np.ndarray:
    """A path on which the last joint turns through 340 degrees, far from home."""
    share = np.linspace(0, 1, 60)[:, None]
    begin = np.array([40.0, -70.0, 80.0, -100.0, -80.0, 5.0])
    return np.asarray(begin + share * np.array([60.0, 20.0, -30.0, 15.0, 20.0, 340.0]))


def test_rows_follow_each_other_where_a_fixed_pose_makes_them_jump(winding_path: np.ndarray) -> None:
    start = ",".join(map(str, winding_path[0]))
    rows = targets_of(winding_path)
    follows = run("ik", "ur5e", "--batch", "-", "--continuous", "--near", start, "--json", stdin=rows).lines
    joints = np.array([line["branches"][line["best"]]["joints"] for line in follows])
    assert np.allclose(joints, winding_path, atol=1e-6)
    assert follows[0]["near"] == winding_path[0].tolist()
    assert follows[7]["near"] == joints[6].tolist()
    assert follows[7]["branches"][0]["motion"] == pytest.approx(np.abs(joints[7] - joints[6]).sum())
    fixed = run("ik", "ur5e", "--batch", "-", "--near", start, "--json", stdin=rows).lines
    jumps = np.diff([line["branches"][line["best"]]["joints"] for line in fixed], axis=0)
    assert np.abs(jumps).max() > 90


def test_the_same_across_chunks_and_unreachable_rows(winding_path: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> None:
    start = ",".join(map(str, winding_path[0]))
    lines = targets_of(winding_path).splitlines()
    lines.insert(30, b"9000,0,0,0,0,0")
    words = ("ik", "ur5e", "--batch", "-", "--continuous", "--near", start)
    in_one_chunk = run(*words, "--json", stdin=b"\n".join(lines))
    monkeypatch.setattr("armkin.cli.parsing.csv_to_numbers.CHUNK_ROWS", 7)
    parts = run(*words, "--json", stdin=b"\n".join(lines))
    assert in_one_chunk.code == parts.code == 3
    assert [line["best"] for line in parts.lines] == [line["best"] for line in in_one_chunk.lines]
    joints = [line["branches"][0]["joints"] for line in parts.lines if line["best"] is not None]
    assert np.allclose(joints, winding_path, atol=1e-6)


def test_all_branches_lock_and_branch_go_with_it() -> None:
    rows = b"390,80,300\n390,100,300\n390,120,300\n"
    completed = run("ik", THREE_DOF, "--batch", "-", "--continuous", "--all-branches", "--json", stdin=rows)
    assert [len(line["branches"]) for line in completed.lines] == [4, 4, 4]
    for line in completed.lines:
        legal = [branch["motion"] for branch in line["branches"] if branch["within_limits"]]
        assert legal == sorted(legal)
    down = run("ik", THREE_DOF, "--batch", "-", "--continuous", "--branch", "elbow down", "--json", stdin=rows)
    assert {line["branches"][0]["name"] for line in down.lines} == {"left, elbow down"}
    pose = b"400,0,400,180,0,0\n400,50,400,180,0,0\n"
    held = run("ik", "panda", "--batch", "-", "--continuous", "--lock", "J3=20", "--json", stdin=pose)
    assert [line["branches"][0]["joints"][2] for line in held.lines] == [20, 20]


def test_it_belongs_to_a_batch() -> None:
    completed = run("ik", THREE_DOF, 390, 80, 300, "--continuous")
    assert (completed.code, completed.out) == (2, "")
    assert "--continuous belongs to --batch" in completed.err
