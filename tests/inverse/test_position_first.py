"""Position first: arms of four and five joints asked for a pose, against a search by brute force."""

import itertools
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from position_first_targets import ARMS, random_targets

import armkin
from armkin import Status
from armkin.forward import fk
from armkin.inverse import choose_branch
from command_line import run


def by_brute_force(arm: armkin.Arm, T: np.ndarray, grid: int) -> np.ndarray:
    """The least angle (N,) [rad] over a grid of all joints but three, these by their own closed form."""
    names = arm.joint_names[3:]
    joints = [arm.joint_names.index(name) for name in names]
    low, high = np.maximum(arm.lower, -np.pi)[joints], np.minimum(arm.upper, np.pi)[joints]
    least = np.full(len(T), np.inf)
    count = grid if len(names) == 2 else grid * grid
    for values in itertools.product(*(np.linspace(a, b, count) for a, b in zip(low, high, strict=True))):
        held = {name: float(value) for name, value in zip(names, values, strict=True)}
        s = armkin.ik(armkin.lock(arm, held), T[:, :3, 3], "xyz", examine=False)
        R = fk(arm, np.nan_to_num(armkin.unlock(arm, held, s.q)))[..., :3, :3]
        cosine = (np.einsum("nbij,nij->nb", R, T[:, :3, :3]) - 1) / 2
        angle = np.where(s.within_limits, np.arccos(np.clip(cosine, -1, 1)), np.inf)
        least = np.minimum(least, angle.min(axis=1))
    return least


@pytest.mark.parametrize("name", ARMS)
def test_no_posture_of_a_grid_is_nearer(name: str, sample: Callable[[int, int], int]) -> None:
    arm = armkin.load(name)
    T = random_targets(arm, 24, 4)
    s = armkin.ik(arm, T, "pose", position_first=True)
    assert s.angle is not None
    best = s.q[:, 0]
    assert (s.status != Status.UNREACHABLE).all()
    assert np.abs(armkin.fk(arm, best)[:, :3, 3] - T[:, :3, 3]).max() <= 1e-9 * arm.reach
    assert ((best >= arm.lower - 1e-9) & (best <= arm.upper + 1e-9)).all()
    assert (s.angle[:, 0] <= by_brute_force(arm, T, sample(8, 5)) + 1e-8).all()
    is_own_pose = np.arange(24) % 3 == 2
    assert (s.status[is_own_pose] == Status.EXACT).all()
    assert (
        s.status[~is_own_pose] == Status.POSITION
    ).sum() >= 14  # a turn about an axis may be one that the arm can make


def test_small_basins_on_limits_are_found() -> None:
    """Two of 250 targets of an SO-101 were answered 4 and 10 degrees worse than a grid does."""
    arm = armkin.load("so101")
    s = armkin.ik(arm, random_targets(arm, 250, 7)[[57, 93]], "pose", position_first=True)
    assert s.angle is not None
    assert np.rad2deg(s.angle[:, 0]) == pytest.approx([87.788808, 98.651210], abs=1e-5)


@pytest.mark.parametrize("name", ARMS)
def test_rows_are_minima_each_once_by_angle(name: str) -> None:
    arm = armkin.load(name)
    T = random_targets(arm, 3, 5)
    s = armkin.ik(arm, T, "pose", position_first=True)
    assert s.angle is not None
    for k in range(len(T)):
        angle, q = s.angle[k, s.valid[k]], s.q[k, s.valid[k]]
        assert (np.diff(angle) >= -2e-6).all()
        for a, b in itertools.combinations(q, 2):
            assert np.abs(np.remainder(a - b + np.pi, 2 * np.pi) - np.pi).max() > 1e-6
        for row, least in zip(
            q, angle, strict=True
        ):  # steps along the family, within limits, turn the tool farther off
            J = armkin.jacobian(arm, row)[:3]
            for _ in range(6):
                step = np.random.default_rng(k).normal(size=arm.n) * 3e-3
                step -= np.linalg.pinv(J) @ (J @ step)
                beside = np.clip(row + step, arm.lower, arm.upper)
                for _ in range(4):
                    miss = T[k, :3, 3] - armkin.fk(arm, beside)[:3, 3]
                    beside = np.clip(
                        beside + np.linalg.pinv(armkin.jacobian(arm, beside)[:3]) @ miss, arm.lower, arm.upper
                    )
                F = armkin.fk(arm, beside)
                if np.abs(F[:3, 3] - T[k, :3, 3]).max() < 1e-9:
                    cosine = (np.trace(F[:3, :3].T @ T[k, :3, :3]) - 1) / 2
                    assert cosine <= np.cos(least) + 1e-9


def test_the_command_lists_minima_by_angle_and_exits_0() -> None:
    words = ["ik", "so101", "250", "50", "150", "180", "0", "0", "--task", "pose", "--position-first", "--all-branches"]
    completed = run(*words, "--json")
    assert completed.code == 0
    answer = completed.json
    assert (answer["status"], answer["best"]) == ("position", 0)
    angles = [row["residual_deg"] for row in answer["branches"]]
    assert angles == sorted(angles)
    assert angles[0] == pytest.approx(21.70820803811849, abs=1e-6)
    assert all(row["within_limits"] and row["residual_mm"] < 1e-6 for row in answer["branches"])
    assert "turned by 21.7082 deg" in run(*words).out


def test_a_position_out_of_reach_exits_3_with_the_closest_posture() -> None:
    completed = run(
        *["ik", "so101", "950", "50", "150", "180", "0", "0", "--task", "pose", "--position-first", "--json"]
    )
    assert completed.code == 3
    assert (completed.json["status"], completed.json["best"]) == ("unreachable", None)
    assert completed.json["closest"]["distance_mm"] == pytest.approx(472.3562, abs=1e-3)


def test_free_comes_before_near_in_rotation() -> None:
    request: Any = SimpleNamespace(position_first=True)

    def row(hits: tuple[str, ...], residual_deg: float, motion: float, within_limits: bool = True) -> Any:
        return SimpleNamespace(within_limits=within_limits, hits=hits, residual_deg=residual_deg, motion=motion)

    rows = [row((), 5.0, 90.0), row((), 9.0, 10.0), row(("floor",), 0.0, 1.0), row((), 0.0, 0.0, within_limits=False)]
    ranks = [choose_branch._rank(request, item) for item in rows]
    assert ranks == sorted(set(ranks))


def test_an_exact_answer_that_hits_something_comes_after_a_free_one(tmp_path: Path) -> None:
    arm = armkin.load("so101")
    q = np.deg2rad([-105, 35, 81, 62, 126])
    T = armkin.fk(arm, q)
    roll, pitch = np.arctan2(T[2, 1], T[2, 2]), np.arctan2(-T[2, 0], np.hypot(T[2, 1], T[2, 2]))
    angles = np.rad2deg([roll, pitch, np.arctan2(T[1, 0], T[0, 0])])
    words = ["ik", "so101", *T[:3, 3].tolist(), *angles.tolist(), "--task", "pose", "--position-first", "--json"]
    assert run(*words).json["status"] == "exact"
    x, y, z = (armkin.frames(arm, q)[4, :3, 3]).tolist()
    scene = tmp_path / "ball.yaml"
    scene.write_text(f"keep_out:\n  - capsule: {{from: [{x}, {y}, {z}], to: [{x}, {y}, {z + 1}], radius: 2}}\n")
    answer = run(*words, "--all-branches", "--scene", scene).json
    best = answer["branches"][answer["best"]]
    assert not best["hits"]
    assert answer["status"] == "position"
    assert best["residual_deg"] > min(row["residual_deg"] for row in answer["branches"])


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("ik so101 250 50 150 180 0 --position-first", "for task pose, not xyz_pitch_roll"),
        ("ik ur5e 400 0 400 0 0 0 --position-first", "4 or 5 joints; ur5e has 6"),
        ("ik so101 250 50 150 180 0 0 --task pose --position-first --compiled", "no compiled solver"),
    ],
)
def test_what_position_first_is_not_for_is_a_usage_error(words: str, message: str) -> None:
    completed = run(*words.split())
    assert completed.code == 2
    assert message in completed.err


def test_a_batch_gives_what_each_row_alone_gives(tmp_path: Path) -> None:
    rows = ["250,50,150,180,0,0", "950,50,150,180,0,0", "200,-80,100,170,10,20"]
    (tmp_path / "t.csv").write_text("\n".join(rows) + "\n")
    words = "--task", "pose", "--position-first", "--json"
    completed = run("ik", "so101", *words, "--batch", tmp_path / "t.csv")
    assert (completed.code, len(completed.lines)) == (3, 3)
    for row, line in zip(rows, completed.lines, strict=True):
        alone = run("ik", "so101", *row.split(","), *words).json
        assert alone["status"] == line["status"]
        assert alone["best"] == line["best"]
        if alone["best"] is not None:
            assert alone["branches"][0]["joints"] == pytest.approx(line["branches"][0]["joints"], abs=1e-6)
    table = run("ik", "so101", *words[:-1], "--batch", tmp_path / "t.csv").out
    assert table.splitlines()[1].startswith("1,position,minimum 1,")


def test_joints_may_be_held_until_four_or_five_are_left() -> None:
    arm = armkin.lock(armkin.load("ur5e"), {armkin.load("ur5e").joint_names[5]: 0.3})
    T = armkin.fk(arm, np.array([0.3, -1.0, 1.2, -0.7, 0.9]))
    s = armkin.ik(arm, T, "pose", position_first=True)
    assert s.status == Status.EXACT
    T[:3, :3] = np.eye(3)
    assert armkin.ik(arm, T, "pose", position_first=True).status == Status.POSITION
