"""`armkin.place`: places against asking each directly, margins, answers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import armkin
from armkin.cli.batches import compiled_ik
from armkin.errors import NoSolutionError, UsageError
from armkin.inverse.tasks.choose_task import task_for
from armkin.inverse.tasks.task import targets_of
from armkin.motion.path_planner import choose_held_value
from armkin.reachability.place import path_from_place, reached_targets, upright_joint
from armkin.reachability.place import place_search as places
from armkin.reachability.place.arm_among_obstacles import Obstacles, arm_at_place
from command_line import ROOT, run
from ctrl_c import interrupt_at


@pytest.mark.parametrize("name", ["ur5e", "puma560", "three_dof", "planar_3dof", "so101", "stanford"])
def test_places_are_what_each_says_when_asked_directly(name: str) -> None:
    arm, rng = armkin.load(name), np.random.default_rng(0)
    low, high = (np.where(np.isfinite(ends), ends, end) for ends, end in ((arm.lower, -3.0), (arm.upper, 3.0)))
    q = rng.uniform(0.4 * low, 0.4 * high, (4, arm.n))
    targets = targets_of(task_for(arm), armkin.fk(arm, q), q)
    yaw = np.radians(60.0)
    [places] = armkin.place(arm, targets, step=arm.reach / 3, yaw=float(yaw))
    question = reached_targets.PlaceQuestion(arm, task_for(arm), targets, len(places.yaw), float(yaw), 0.0)
    assert places.of == 4
    assert places.reached.max() > 0
    for _ in range(60):
        i, j, k = (int(rng.integers(size)) for size in places.reached.shape)
        place = np.array([places.x[i], places.y[j]])
        assert reached_targets.legal_from(question, place, float(places.yaw[k])).sum() == places.reached[i, j, k]


@pytest.mark.parametrize("name", ["so100", "so101", "three_dof", "ra02", "labvolt_5150", "planar_2dof"])
def test_joint_1_beside_the_base_s_axis_is_read_off_by_radius(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every place of a grid, against each asked by itself; where the axis is on the base's, it is moved off."""
    arm, rng = armkin.load(name), np.random.default_rng(8)
    if not arm.link[0][:2, 3].any():
        link = arm.link.copy()
        link[0][:2, 3] = [0.11 * arm.reach, -0.07 * arm.reach]
        link.flags.writeable = False
        arm = replace(arm, link=link)
    q = rng.uniform(-1.2, 1.2, (6, arm.n)) * np.where(arm.prismatic, 0.1 * arm.reach, 1.0)
    targets = targets_of(task_for(arm), armkin.fk(arm, q), q)
    ask: dict[str, Any] = {"step": arm.reach / 7, "yaw": 0.11, "z": -0.03 * arm.reach}
    read: list[int] = []
    by_radius = upright_joint.by_radius

    def count_and_call(*arguments: Any) -> Any:
        places = by_radius(*arguments)
        assert places is not None
        read.append(int(places[0].sum()) - int(places[1].sum()))
        return places

    monkeypatch.setattr(reached_targets, "by_radius", count_and_call)
    [places] = armkin.place(arm, targets, **ask)
    assert sum(read) > 0.5 * places.reached.sum() > 0
    monkeypatch.setattr(reached_targets, "RADII", 10**9)  # not worth it: each place is asked
    [one_by_one] = armkin.place(arm, targets, **ask)
    assert np.array_equal(places.reached, one_by_one.reached)


def test_machine_code_finds_the_same_places(tmp_path: Path) -> None:
    arm, path = armkin.load("three_dof"), tmp_path / "targets.csv"
    path.write_text("x,y,z\n600,0,200\n600,300,200\n500,100,900\n")
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    for yaw in (np.pi / 6, 1.0):  # by arcs, and yaw by yaw
        [places] = armkin.place(arm, table, step=100.0, yaw=yaw)
        [fast] = armkin.place(arm, table, step=100.0, yaw=yaw, solve=compiled_ik.ik)
        assert (fast.reached == places.reached).all()
        assert fast.best == places.best
    assert run("place", "three_dof", path, "--compiled") == run("place", "three_dof", path)


def test_a_margin_is_the_distance_to_the_nearest_place_that_does_not_reach_all() -> None:
    targets = [[600, 0, 200], [600, 300, 200]]
    arm = armkin.load("three_dof")
    [places] = armkin.place(arm, targets, step=100.0, yaw=np.pi / 4)
    good = places.reached == places.of
    for i, j, k in np.argwhere(good)[::3]:
        x, y = np.argwhere(~good[:, :, k]).T
        assert places.margin[i, j, k] == pytest.approx(100.0 * np.hypot(x - i, y - j).min())
    assert not places.margin[~good].any()
    best = places.margin[places.best]
    assert best == places.margin[good].max()
    # a small area inside knows what is around it
    i, j, _ = places.best
    best_place = [float(places.x[i]), float(places.y[j])]
    [small] = armkin.place(
        arm, targets, area=[best_place[0], best_place[0], best_place[1], best_place[1]], step=100.0, yaw=np.pi / 4
    )
    assert small.margin.max() == best


def test_the_command_tells_the_best_and_exits_3_where_none_reaches_all(tmp_path: Path) -> None:
    path, far = tmp_path / "targets.csv", tmp_path / "far.csv"
    path.write_text("x,y,z\n600,0,200\n600,300,200\n")
    far.write_text("x,y,z\n0,0,200\n9000,0,200\n")
    more = ("--step", 150, "--yaw", 90)
    completed = run("place", "three_dof", "roarm_m2", path, *more, "--plot", tmp_path / "floor.png", "--json")
    assert completed.code == 0
    assert [robot["robot"] for robot in completed.json["robots"]] == ["three_dof", "roarm_m2"]
    assert {robot["best"]["reached"] for robot in completed.json["robots"]} == {2}
    assert (tmp_path / "floor.png").stat().st_size > 10_000
    none = run("place", "three_dof", far, *more, "--json", "--area", "-300,300,-300,300")
    assert none.code == 3
    assert none.json["robots"][0]["best"]["reached"] == 1
    assert "no place reaches all 2 targets; three_dof reaches 1 at best" in none.err
    wrong_ending = run("place", "three_dof", path, *more, "--out", tmp_path / "places.txt")
    assert wrong_ending.code == 2
    assert "places are written as .npz, .parquet, .jsonl or .csv" in wrong_ending.err
    assert not (tmp_path / "places.txt").exists()


def test_a_scene_stands_with_the_targets(tmp_path: Path) -> None:
    """Each place against the arm whose robot file has that base, in the same scene."""
    scene = ROOT / "examples/scenes/three_dof.yaml"
    targets, rng = [[500.0, 0.0, 200.0], [420.0, 160.0, 90.0]], np.random.default_rng(5)
    settings = {"area": (-200.0, 800.0, -600.0, 600.0), "step": 200.0, "yaw": float(np.radians(90.0))}
    [places] = armkin.place(armkin.load("three_dof"), targets, scene=scene, **settings)  # type: ignore[arg-type]
    [alone] = armkin.place(armkin.load("three_dof"), targets, **settings)  # type: ignore[arg-type]
    [loaded] = armkin.place(armkin.load("three_dof", scene=scene), targets, **settings)  # type: ignore[arg-type]
    assert np.array_equal(places.reached, loaded.reached)
    assert places.reached.sum() < alone.reached.sum()
    text = (ROOT / "robots/three_dof.yaml").read_text()
    assert "\nbase:" not in text
    count = 0
    for i, j, k in rng.permutation(np.argwhere(alone.reached > 0))[:12]:
        x, y, yaw = float(places.x[i]), float(places.y[j]), float(np.degrees(places.yaw[k]))
        if 245 <= x <= 555 and abs(y) <= 305:
            assert places.reached[i, j, k] == 0  # its base would stand in the table
            continue
        moved = tmp_path / "moved.yaml"
        moved.write_text(f"{text}\nbase: {{xyz: [{x}, {y}, 0], rpy: [0, 0, {yaw}]}}\n")
        s = armkin.ik(armkin.load(moved, scene=scene), targets)
        assert (s.within_limits & s.clear).any(axis=1).sum() == places.reached[i, j, k]
        count += 1
    assert count > 4


@pytest.mark.parametrize("end", ["npz", "csv"])
def test_places_are_a_file_that_goes_on_after_a_kill(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, end: str) -> None:
    path, undisturbed, resumed = tmp_path / "targets.csv", tmp_path / f"whole.{end}", tmp_path / f"out.{end}"
    path.write_text("x,y,z\n600,0,200\n600,300,200\n")
    monkeypatch.setattr(places, "SOLVES", 40)
    words = ("place", "three_dof", "roarm_m2", path, "--step", 200, "--yaw", 90)
    completed = run(*words, "--out", undisturbed)
    with monkeypatch.context() as patch:
        patch.setattr(places, "count_chunk", interrupt_at(places.count_chunk, 5))
        assert run(*words, "--out", resumed).code == 130
    refused = run("place", "three_dof", path, "--step", 100, "--out", resumed)
    assert refused.code == 2
    assert "belongs to another job" in refused.err
    assert run(*words, "--out", resumed) == completed
    assert resumed.read_bytes() == undisturbed.read_bytes()
    assert {file.name for file in tmp_path.iterdir()} == {path.name, undisturbed.name, resumed.name}
    if end == "csv":
        rows = undisturbed.read_text().splitlines()
        assert rows[0] == "robot,x_mm,y_mm,z_mm,yaw_deg,reached,of,margin_mm"
        assert {row.split(",")[0] for row in rows[1:]} == {"three_dof", "roarm_m2"}


PATH = """
moves:
  - point: [0, 0, 300, 180, 0, 0]
  - line: [400, 0, 300, 180, 0, 0]
  - arc: {via: [300, 300, 300], to: [0, 300, 300, 180, 0, 0]}
"""


@pytest.mark.parametrize("name", ["three_dof", "ur5e"])
def test_a_path_is_carried_from_the_places_that_plan_it(name: str, tmp_path: Path) -> None:
    """Each place against the planner, which proves what is between the targets; with a scene pose by pose."""
    path = ROOT / "examples/pick_and_place.yaml" if name == "three_dof" else tmp_path / "path.yaml"
    if name == "ur5e":
        path.write_text(PATH)
    arm = armkin.load(name)
    arm = replace(arm, max_accel=np.where(np.isfinite(arm.max_accel), arm.max_accel, 5.0))
    [places] = armkin.place(arm, path, step=arm.reach / 3, yaw=np.pi / 2)
    assert places.planned
    assert {candidate.refused for candidate in places.planned} == {""}
    assert places.reached[places.best] == places.of
    rng, file = np.random.default_rng(4), path_from_place.path_of(path)
    assert file is not None
    carries = places.reached == places.of
    for cells in (np.argwhere(carries), np.argwhere(~carries & (places.reached > 0.6 * places.of))):
        assert len(cells)
        for i, j, k in rng.permutation(cells)[:3].tolist():
            place = (float(places.x[i]), float(places.y[j]), 0.0)
            answer = path_from_place.plan_from_place(arm, Obstacles(), (i, j, k), place, float(places.yaw[k]), file)
            assert (answer.plan is not None) == carries[i, j, k], answer.refused


LINE = """
moves:
  - point: [400, -100, 400, 180, 0, 0]
  - line: [400, 100, 400, 180, 0, 0]
"""


@pytest.mark.parametrize(("first_move", "step"), [("", 600.0), ("\n  - joint: {J7: 100}", 400.0)])
def test_a_path_of_seven_joints_is_carried_where_path_plans_it(first_move: str, step: float, tmp_path: Path) -> None:
    """Some places of a coarse grid against `armkin.path` of the arm that stands there."""
    path = tmp_path / "path.yaml"
    path.write_text(LINE.replace("moves:", f"moves:{first_move}"))
    arm = replace(armkin.load("panda"), max_accel=np.ones(7))
    [places] = armkin.place(arm, path, step=step, yaw=np.pi / 2)
    carries = places.reached == places.of
    assert places.reached[places.best] == places.of
    assert {candidate.refused for candidate in places.planned} == {""}
    assert places.held == places.planned[0].plan.held  # type: ignore[union-attr]
    assert places.postures.shape == (places.of, 7)
    assert np.unique(places.postures[:, 6]) == pytest.approx(list(places.held.values()))
    if first_move:
        assert places.held["J7"] == pytest.approx(np.radians(100.0))
    rng = np.random.default_rng(2)
    for cells in (np.argwhere(carries), np.argwhere(~carries & (places.reached > 0))):
        assert len(cells)
        for i, j, k in rng.permutation(cells)[:4].tolist():
            stands = arm_at_place(arm, Obstacles(), (float(places.x[i]), float(places.y[j]), 0.0), float(places.yaw[k]))
            try:
                armkin.path(stands, path)
                planned = True
            except NoSolutionError:
                planned = False
            assert planned == carries[i, j, k]


def test_the_command_tells_where_the_redundant_joint_is_held(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    all_values = choose_held_value.values_to_hold
    monkeypatch.setattr(
        choose_held_value, "values_to_hold", lambda *arguments: all_values(*arguments)[:6]
    )  # each is an arm to prepare
    path, scene = tmp_path / "path.yaml", tmp_path / "scene.yaml"
    path.write_text(LINE)
    scene.write_text("keep_out:\n  - box: {min: [-600, 200, 0], max: [-500, 300, 900]}\n    name: post\n")
    words = ("place", "panda", path, "--step", 400, "--yaw", 180, "--area", "-100,0,0,0")
    best = run(*words, "--json").json["robots"][0]["best"]
    assert best["reached"] == best["of"]
    assert abs(best["held"]["J7"]) > 1.0
    completed = run(*words, "--scene", scene)  # which is not in the way
    assert f"panda, held there: J7 at {best['held']['J7']:.4g}\n" in completed.out
    assert "have no max_accel" in completed.err


def test_a_path_in_a_scene_is_asked_yaw_by_yaw_and_planned_in_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(places, "PLANS", 1)
    path, scene = tmp_path / "path.yaml", tmp_path / "scene.yaml"
    scene.write_text("keep_out:\n  - box: {min: [200, -600, 0], max: [230, 600, 900]}\n    name: wall\n")
    path.write_text("moves:\n  - point: [420, -60, 170]\n  - line: [420, 60, 170]\n")
    words = ("place", "three_dof", path, "--step", 150, "--yaw", 180, "--area", "-100,650,-150,150", "--json")
    alone, in_scene = run(*words).json["robots"][0], run(*words, "--scene", scene).json["robots"][0]
    assert 0 < in_scene["reach_all"] < alone["reach_all"]
    assert in_scene["best"]["reached"] == in_scene["best"]["of"]
    assert [candidate["refused"] for candidate in in_scene["planned"]] == [None]


def test_paths_that_say_nothing_of_a_place_are_told(tmp_path: Path) -> None:
    for moves, message in (
        ("- joint: home", "the path has no target of the tool"),
        ("- line: [390, 80, 300]", "put a point before it"),
        ("- point: [390, 80, 300]\n  - offset: {xyz: [0, 0, 9], frame: tool}", "offsets in the frame of targets"),
    ):
        path = tmp_path / "path.yaml"
        path.write_text(f"moves:\n  {moves}\n")
        completed = run("place", "three_dof", path)
        assert completed.code == 2
        assert message in completed.err
    path.write_text(PATH)
    completed = run("place", "ur5e", path, "--step", 500, "--yaw", 90)
    assert completed.code == 0
    assert "the path is not planned from there: joints J1, J2, J3, J4, J5, J6 have no max_accel" in completed.err
    with pytest.raises(UsageError, match="a path to place an arm for"):
        armkin.place(armkin.load("ur5e"), "path.svg")


def test_bad_input_is_told(tmp_path: Path) -> None:
    arm = armkin.load("three_dof")
    for settings in ({"step": 0.0}, {"yaw": -1.0}, {"area": (1, 0, 0, 1)}, {"area": (0, 1)}, {"step": 0.001}):
        with pytest.raises(UsageError):
            armkin.place(arm, [[600, 0, 200]], **settings)
    assert run("place", "three_dof").code == 2
    assert run("place", "three_dof", tmp_path / "none.csv").code == 1
    assert "cannot read the path file" in run("place", "three_dof", tmp_path / "path.yaml").err


@pytest.mark.parametrize("name", ["examples/first_layer.gcode", "none.NC", "none.ngc", "none.gco", "none.svg"])
def test_a_drawing_is_no_table_of_targets(name: str) -> None:
    refused = run("place", "three_dof", name)
    assert (refused.code, refused.out) == (2, "")
    assert refused.err == (
        f"error: {name}: place takes targets (CSV) or a path (YAML); a drawing does not say where its zero lies\n"
    )
