"""`armkin.reach`: arcs against asking every pose, engines, going on after a kill, bad input."""

from __future__ import annotations

import hashlib
from pathlib import Path

import monte_carlo
import numpy as np
import pytest

import armkin
from armkin.errors import UsageError
from armkin.model.units import TURN
from armkin.reachability import reach_map as maps
from armkin.reachability import voxels
from armkin.reachability.cell_answers import CellQuestion, cell_columns
from armkin.reachability.reach_cells import Grid
from command_line import ROOT, Result, run
from ctrl_c import interrupt_at

ARMS = (
    "ur5e",
    "puma560",
    "ar4",
    "three_dof",
    "stanford",
    "planar_3dof",
    "so101",
    "wx250s",
    "kuka_kr6_r700",
    "jaco_j2n6s300",
)


def ask_each_pose(grid: Grid, rings: np.ndarray) -> np.ndarray:
    """share, share_any, branches, single of every cell, by asking each pose."""
    N, L = grid.directions_count, grid.rolls_count
    orientation, rows = np.arange(N * L), []
    for ring in rings:
        for k in range(grid.azimuths):
            turn = np.full(N * L, k * TURN / grid.azimuths)
            roll = (orientation % L) * TURN / L
            s = armkin.ik(grid.arm, grid.targets(np.repeat(ring[None], N * L, 0), turn, orientation // L, roll))
            legal = s.within_limits.sum(axis=1)
            mean = legal.sum() / (legal > 0).sum() if legal.any() else np.nan
            rows.append([(legal > 0).mean(), s.valid.any(axis=1).mean(), mean, (legal == 1).mean()])
    return np.array(rows)


@pytest.mark.parametrize("name", ARMS)
def test_arcs_are_what_each_pose_says(name: str) -> None:
    arm = armkin.load(name)
    is_slow = name in ("jaco_j2n6s300",)
    grid = Grid(arm, arm.reach / 9, 3 if is_slow else 7, 4 if is_slow else 9, 2 if is_slow else 5, False)
    question = CellQuestion(grid)
    rings = grid.rings[np.random.default_rng(4).permutation(len(grid.rings))[: 2 if is_slow else 20]]
    values_of = cell_columns(question, rings)
    assert question.by_arcs
    columns = np.stack([values_of[name] for name in ("share", "share_any", "branches", "single")], axis=1)
    assert np.allclose(columns, ask_each_pose(grid, rings), rtol=0, atol=1e-12, equal_nan=True)
    assert columns[:, 1].max() > 0


def test_rings_that_no_branch_reaches_are_counted_as_that() -> None:
    grid = Grid(armkin.load("moveo"), 60.0, 2, 4, 1, False)
    columns = cell_columns(CellQuestion(grid, measures=False), np.array([[11, 11]]))  # 930 mm away, of 761
    assert columns["share"].tolist() == columns["share_any"].tolist() == [0.0, 0.0]
    assert np.isnan(columns["branches"]).all()


@pytest.mark.parametrize("name", ["puma560", "cobra600", "three_dof"])
def test_pose_by_pose_says_the_same_as_arcs(name: str) -> None:
    """A calibrated arm is asked pose by pose; one whose ratios are all but 1 reaches the same."""
    from dataclasses import replace

    arm = armkin.load(name)
    nearly = replace(arm, ratio=np.where(np.arange(arm.n) == 1, 1 + 1e-15, 1.0))
    by_arcs, by_poses = (armkin.reach(a, grid=arm.reach / 4, azimuths=5, directions=7, rolls=4) for a in (arm, nearly))
    assert (by_arcs.method, by_poses.method) == ("arcs", "poses")
    for column in by_arcs.columns:
        assert np.allclose(by_arcs.columns[column], by_poses.columns[column], rtol=1e-6, atol=1e-9, equal_nan=True), (
            column
        )


def test_cells_stand_where_the_contract_puts_them() -> None:
    arm = armkin.load("ur5e")
    reach_map = armkin.reach(arm, grid=300.0, azimuths=4, directions=3, rolls=2)
    rings = reach_map.grid.rings
    assert reach_map.cells == 4 * len(rings)
    assert reach_map.answers == reach_map.cells * 6
    first = reach_map.grid.frame[:3, 3] + reach_map.grid.frame[:3, :3] @ [150.0, 0.0, rings[0, 1] * 300.0]
    assert np.allclose([reach_map.x_mm[0], reach_map.y_mm[0], reach_map.z_mm[0]], first)
    r2 = (rings[:, 0] + 0.5) ** 2 * 9e4 + rings[:, 1] ** 2 * 9e4
    assert r2.max() <= arm.reach**2 * (1 + 1e-9)
    assert np.array_equal(rings, np.unique(rings, axis=0))
    R = reach_map.grid.targets(rings[:3], np.zeros(3), np.arange(3), np.zeros(3))[:, :3, :3]
    assert np.allclose(R @ np.swapaxes(R, 1, 2), np.eye(3))
    z = 1 - (2 * np.arange(3) + 1) / 3
    assert np.allclose((reach_map.grid.frame[:3, :3].T @ R[..., 2].T)[2], z)
    assert reach_map.units["x_mm"] == "mm"


def test_keep_outs_take_orientations_away_and_are_asked_pose_by_pose() -> None:
    free = armkin.reach(armkin.load("three_dof"), grid=120.0, azimuths=8)
    scene = ROOT / "examples/scenes/three_dof.yaml"
    blocked = armkin.reach(armkin.load("three_dof", scene=scene), grid=120.0, azimuths=8)
    assert (free.method, blocked.method) == ("arcs", "poses")
    assert (blocked.share <= free.share + 1e-12).all()
    assert blocked.reached < free.reached
    assert np.allclose(blocked.share_any, free.share_any)


def test_the_share_under_keep_outs_is_what_another_count_finds() -> None:
    """Cells at random, asked again by multi-start Newton on screws and points along the bodies; then the volume."""
    scene = ROOT / "examples/scenes/three_dof.yaml"
    info = run("info", "three_dof", "--scene", scene, "--json").json
    cells = monte_carlo.count_cells(armkin.load("three_dof", scene=scene), scene, info, grid=30.0, count=120, starts=20)
    assert cells.known > 0.97
    assert cells.different == 0
    assert 0.05 < cells.share < 0.6
    volume = monte_carlo.count_volume(
        armkin.load("three_dof", scene=scene), scene, info, grid=30.0, count=250, starts=20
    )
    assert abs(volume.map - volume.counted) < 4 * volume.sigma


def test_an_arm_of_seven_joints_is_asked_pose_by_pose() -> None:
    grid = Grid(armkin.load("iiwa7"), 300.0, 1, 2, 1, False)
    question = CellQuestion(grid)
    assert not question.by_arcs
    ring = np.array([[1, 1]])
    value_of = {name: float(values[0]) for name, values in cell_columns(question, ring).items()}
    T = grid.targets(np.repeat(ring, 2, 0), np.zeros(2), np.arange(2), np.zeros(2))
    legal = armkin.ik(grid.arm, T).within_limits.sum(axis=1)
    assert value_of["share"] == (legal > 0).mean() > 0
    assert value_of["branches"] == legal.sum() / (legal > 0).sum()
    assert value_of["manipulability"] > 0


def test_a_voxel_takes_the_cell_that_its_centre_lies_in() -> None:
    reach_map = armkin.reach(armkin.load("puma560"), grid=150.0, azimuths=7, directions=3, rolls=2, measures=False)
    grid, F = reach_map.grid, reach_map.grid.frame
    centres = np.stack([reach_map.x_mm, reach_map.y_mm, reach_map.z_mm], axis=1)
    local = (centres - F[:3, 3]) @ F[:3, :3]
    rng = np.random.default_rng(5)
    r, z = np.hypot(local[:, 0], local[:, 1]), local[:, 2]
    turn = np.arctan2(local[:, 1], local[:, 0]) + rng.uniform(-0.999, 0.999, len(r)) * np.pi / 7
    r, z = r + rng.uniform(-74.9, 74.9, len(r)), z + rng.uniform(-74.9, 74.9, len(r))
    inside = voxels.rows_at(grid, np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1))
    assert np.array_equal(inside, np.arange(reach_map.cells))
    assert (voxels.rows_at(grid, np.array([[5000.0, 0, 0], [0, 0, -5000.0]])) == -1).all()
    top, low = (float(end(local[:, 2])) for end in (np.max, np.min))  # of the cells, and the next ones beyond
    beyond = voxels.rows_at(grid, np.array([[1.0, 0, top + 150.0], [1.0, 0, low - 150.0]]))
    assert (beyond == -1).all()
    side = voxels.section_layer(grid)
    assert (side.row % 7 == np.where(side.places[:, 0] >= 0, 0, side.row % 7)).all()
    assert side.table(reach_map.share).shape == (np.ptp(side.places[:, 1]) + 1, np.ptp(side.places[:, 0]) + 1)


def run_reach(*more: object) -> Result:
    return run("reach", "puma560", "--grid", 300, "--azimuths", 6, "--directions", 8, "--rolls", 4, *more)


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Chunks of a few rings."""
    monkeypatch.setattr(maps, "CHUNK_SOLVES", 64)


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("end", ["npz", "parquet"])
def test_engines_and_kills_change_no_byte(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, end: str) -> None:
    def digest(path: Path) -> str:
        return hashlib.sha256(path.read_bytes()).hexdigest()

    first, two, three = (tmp_path / f"{name}.{end}" for name in "abc")
    assert run_reach("--out", first).code == 0
    assert run_reach("--out", two, "--workers", 2).code == 0
    with monkeypatch.context() as patch:
        patch.setattr(maps, "answer_chunk", interrupt_at(maps.answer_chunk, 4))
        assert run_reach("--out", three).code == 130
    assert (tmp_path / f"c.{end}.parts" / "00000002").exists()
    completed = run("reach", "puma560", "--grid", 200, "--out", three)
    assert completed.code == 2
    assert "belongs to another job: " in completed.err
    assert run_reach("--out", three).code == 0
    assert digest(first) == digest(two) == digest(three)
    assert {path.name for path in tmp_path.iterdir()} == {f"{name}.{end}" for name in "abc"}


def test_a_picture_of_the_section_and_a_slice(tmp_path: Path) -> None:
    assert run_reach("--plot", tmp_path / "reach.png").code == 0
    assert (tmp_path / "reach.png").stat().st_size > 20_000


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"grid": 0.0}, "a cell needs a size above 0"),
        ({"grid": float("nan")}, "a cell needs a size above 0"),
        ({"grid": 0.01}, "take a coarser grid"),
        ({"grid": 1e6}, "no cell within a reach"),
        ({"azimuths": 0}, "azimuths: 0; at least 1"),
        ({"rolls": -1}, "rolls: -1; at least 1"),
        ({"directions": 10**6, "rolls": 100}, "orientations a cell"),
        ({"out": "map.ply"}, "a map is written as"),
    ],
)
def test_bad_input_is_told(settings: dict[str, float], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        armkin.reach(armkin.load("puma560"), **settings)  # type: ignore[arg-type]


def test_tool_down_is_one_direction() -> None:
    reach_map = armkin.reach(armkin.load("ur5e"), grid=250.0, azimuths=4, rolls=3, tool_down=True)
    assert reach_map.orientations == 3
    T = reach_map.grid.targets(reach_map.grid.rings[:1], np.zeros(1), np.zeros(1, int), np.zeros(1))
    assert np.allclose(T[0, :3, 2], [0, 0, -1])
    pitch = armkin.reach(armkin.load("so101"), grid=100.0, azimuths=4, rolls=1, tool_down=True)
    grid = pitch.grid
    cell = int(np.argmax(pitch.share))
    assert pitch.share[cell] == 1.0
    ring, turn = grid.rings[cell // 4][None], np.full(1, cell % 4 * TURN / 4)
    s = armkin.ik(grid.arm, grid.targets(ring, turn, np.zeros(1, int), np.zeros(1)))
    assert np.allclose(armkin.fk(grid.arm, s.q[0, s.best[0]])[:3, 2], [0, 0, -1], atol=1e-9)
    with pytest.raises(UsageError, match="does not prescribe"):
        armkin.reach(armkin.load("three_dof"), tool_down=True)
