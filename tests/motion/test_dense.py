"""Dense points: one smooth curve that keeps to every point and chord, as fast as where they came from."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from closed_curves import CENTRE, executed_tips, on_path

import armkin
from armkin.errors import UsageError
from armkin.model.arm import Arm
from armkin.motion.branches import branch_path
from armkin.motion.plan import playback_times
from armkin.motion.timing.curved_stretch import Curve
from armkin.motion.tool_path import fit_points
from armkin.motion.tool_path.b_spline import solve_banded
from armkin.plot import path_picture as picture

CORNER = np.deg2rad(20)


@pytest.fixture(scope="module")
def three_dof() -> Arm:
    return armkin.load("robots/three_dof.yaml")


def circle_points(count: int, radius: float = 50.0) -> np.ndarray:
    a = np.linspace(0, 2 * np.pi, count + 1)
    return np.asarray(CENTRE + radius * np.stack([np.cos(a), np.sin(a), 0 * a], axis=1))


def spiral_points(count: int) -> np.ndarray:
    a = np.linspace(0, 10 * np.pi, count)
    return np.asarray(CENTRE + (10 + a)[:, None] * np.stack([np.cos(a), np.sin(a), 0 * a], axis=1))


def lissajous_points(count: int) -> np.ndarray:
    a = np.linspace(0, 2 * np.pi, count)
    return np.asarray(CENTRE + 60 * np.stack([np.sin(3 * a), np.sin(2 * a + 0.9), 0 * a], axis=1))


def square_points() -> np.ndarray:
    return np.asarray(CENTRE + 40 * np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 0]]))


def stadium_points() -> np.ndarray:
    a = np.linspace(-np.pi / 2, np.pi / 2, 40)
    bend = np.stack([30 + 20 * np.cos(a), 20 * np.sin(a), 0 * a], axis=1)
    return np.asarray(CENTRE + np.concatenate([[[-50, -20, 0]], bend, [[-50, 20, 0]]]))


def to_segment(p: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    f = np.clip((p - a) @ (b - a) / max(float((b - a) @ (b - a)), 1e-300), 0, 1)
    return np.asarray(np.linalg.norm(p - a - f[:, None] * (b - a), axis=1))


def chord_sagitta(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
    """Of the chord a b, by the circle through it and c."""
    area = float(np.linalg.norm(np.cross(b - a, c - a))) / 2
    L, M, N = (float(np.linalg.norm(x)) for x in (b - a, c - b, c - a))
    if area < 1e-12:
        return 0.0
    radius = L * M * N / (4 * area)
    return radius - float(np.sqrt(max(radius**2 - L**2 / 4, 0.0)))


def worst_miss(points: np.ndarray, way: np.ndarray, tolerance: float) -> tuple[float, float]:
    """The measure: farthest given point from the way, in order; farthest excess of the way beside its chord."""
    step = np.diff(points, axis=0)
    unit = step / np.linalg.norm(step, axis=1)[:, None]
    turned = np.append(0.0, np.arccos(np.clip((unit[1:] * unit[:-1]).sum(axis=1), -1, 1)))
    size = np.linalg.norm(step, axis=1)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    u = np.concatenate([[0.0], np.cumsum(size)])
    far, excess, passed = 0.0, 0.0, [0]
    for k, p in enumerate(points):
        near = np.flatnonzero(np.abs(along - u[k] * along[-1] / u[-1]) < max(2.0, 0.01 * u[-1]))
        near = near[near >= passed[-1]] if len(near) else near
        d = np.linalg.norm(way[near] - p, axis=1)
        i = int(near[d.argmin()])
        distances = [to_segment(p[None], way[j], way[j + 1])[0] for j in (i - 1, i) if 0 <= j < len(way) - 1]
        far = max(far, float(min(distances)))
        passed.append(i)
    for k in range(len(step)):
        allowed = 0.0
        for neighbour, corner in ((k - 1, k), (k + 1, k + 1)):
            if 0 <= neighbour < len(step) and turned[corner] <= CORNER and size[neighbour] >= size[k] / 3:
                c = points[k - 1] if neighbour < k else points[k + 2]
                allowed = max(allowed, chord_sagitta(points[k], points[k + 1], c))
        beside = way[passed[k + 1] : passed[k + 2] + 1]
        excess = max(excess, float(to_segment(beside, points[k], points[k + 1]).max() - allowed))
    return far, excess


@pytest.mark.parametrize(
    ("points", "smooth", "share"),
    [
        (circle_points(100), circle_points(2000), 1.02),
        (circle_points(60, 1.0), circle_points(2000, 1.0), 1.02),
        (spiral_points(1500), spiral_points(15_000), 1.02),
        (lissajous_points(400), lissajous_points(15_000), 1.02),
        (spiral_points(1500) + np.random.default_rng(1).uniform(-0.02, 0.02, (1500, 3)), spiral_points(15_000), 1.05),
        (square_points(), square_points(), 1.0001),
        (stadium_points(), stadium_points(), 1.0001),
    ],
    ids=["circle", "small circle", "spiral", "lissajous", "noise", "square", "stadium"],
)
def test_dense_points_are_one_curve_within_the_measure(
    three_dof: Arm, points: np.ndarray, smooth: np.ndarray, share: float
) -> None:
    plan = armkin.path(three_dof, points, corners="tolerance")
    way = executed_tips(plan)
    far, excess = worst_miss(points, way, plan.tolerance)
    assert far <= plan.tolerance + 1e-3  # the way is looked at in steps
    assert excess <= plan.tolerance + 1e-3
    assert plan.deviation <= plan.tolerance
    assert far == pytest.approx(plan.deviation, abs=1e-3)
    assert len(plan.on_path) == 1  # no stop
    assert on_path(plan) <= share * on_path(armkin.path(three_dof, smooth, corners="tolerance"))


def test_the_circle_s_points_take_no_longer_than_the_circle(three_dof: Arm) -> None:
    exact = {"moves": [{"point": [390, 80, 300]}, {"circle": {"centre": [340, 80, 300]}}]}
    plan = armkin.path(three_dof, circle_points(100), corners="tolerance")
    assert on_path(plan) <= 1.002 * on_path(armkin.path(three_dof, exact))


def test_poses_turn_along(tmp_path: Path) -> None:
    arm = armkin.load("ar4")
    rows = [[400 + 20 * np.cos(a), 100 + 20 * np.sin(a), 300, 180, 10 * np.sin(a), 0] for a in np.linspace(0, 4, 60)]
    file = tmp_path / "poses.csv"
    file.write_text("x,y,z,roll,pitch,yaw\n" + "\n".join(",".join(map(str, row)) for row in rows))
    plan = armkin.path(arm, file)
    assert len(plan.on_path) == 1
    assert plan.deviation <= plan.tolerance
    T = armkin.fk(arm, plan.q(plan.duration))
    assert T[:3, 3] == pytest.approx(rows[-1][:3], abs=1e-3)
    assert np.rad2deg(np.arcsin(-T[2, 0])) == pytest.approx(rows[-1][4], abs=1e-3)


def test_the_order_of_what_says_how_corners_are_passed(three_dof: Arm) -> None:
    moves = [{"point": [390, 80, 300]}, {"line": [390, 100, 300]}, {"line": [370, 100, 300], "blend": 0}]
    moves.append({"line": [370, 80, 300]})

    def stops(**options: object) -> int:
        head = {key: options.pop(key) for key in ("head_corners", "head_blend") if key in options}
        file = {"moves": moves, **{key[5:]: value for key, value in head.items()}}
        return len(armkin.path(three_dof, file, **options).on_path) - 1  # type: ignore[arg-type]

    assert stops() == 2
    assert stops(corners="tolerance") == 1  # a corner's own blend comes first
    assert stops(head_corners="tolerance") == 1
    assert stops(head_corners="tolerance", corners="stop") == 2
    assert stops(head_blend=2.0) == 1
    assert stops(head_blend=2.0, head_corners="stop") == 2
    assert stops(head_blend=2.0, corners="blend") == 1
    with pytest.raises(UsageError, match="give one of them"):
        stops(corners="stop", blend=2.0)
    with pytest.raises(UsageError, match="corners: blend needs a radius"):
        stops(corners="blend")
    with pytest.raises(UsageError, match="corners 'round' is none of stop, blend, tolerance"):
        stops(corners="round")


def test_csv_of_targets_is_dense_unless_it_has_blends(three_dof: Arm, tmp_path: Path) -> None:
    file = tmp_path / "corners.csv"
    file.write_text("x,y,z\n390,80,300\n390,100,300\n370,100,300\n")
    assert len(armkin.path(three_dof, file).on_path) == 1
    assert len(armkin.path(three_dof, file, corners="stop").on_path) == 2
    file.write_text("x,y,z,blend\n390,80,300,0\n390,100,300,0\n370,100,300,0\n")
    assert len(armkin.path(three_dof, file).on_path) == 2


def test_a_blend_that_does_not_fit_is_made_smaller(three_dof: Arm) -> None:
    moves = [{"point": [390, 80, 300]}, {"line": [390, 81.5, 300]}, {"line": [370, 81.5, 300]}]
    plan = armkin.path(three_dof, {"moves": moves, "blend": 5})
    assert (plan.reduced.count, plan.reduced.wished_radius) == (1, 5.0)
    assert plan.reduced.reduced_radius == pytest.approx(0.75)
    assert len(plan.on_path) == 1


def test_a_spline_takes_many_points(three_dof: Arm) -> None:
    points = spiral_points(5000).tolist()
    plan = armkin.path(three_dof, {"moves": [{"point": points[0]}, {"spline": points[1:]}]})
    assert plan.deviation <= plan.tolerance


def test_a_banded_system_is_solved() -> None:
    rng = np.random.default_rng(3)
    for n in (1, 2, 3, 4, 17, 64):
        bands = rng.normal(size=(4, n)) * 0.3
        bands[0] += 3
        A = sum(np.diag(bands[k, : n - k], k) + (np.diag(bands[k, : n - k], -k) if k else 0) for k in range(min(4, n)))
        b = rng.normal(size=(n, 2))
        np.testing.assert_allclose(solve_banded(bands, b), np.linalg.solve(A, b), atol=1e-12)


@pytest.mark.parametrize("jerk", [None, 60.0])
def test_many_rests_are_planned_at_once_as_each_alone(
    three_dof: Arm, monkeypatch: pytest.MonkeyPatch, jerk: float | None
) -> None:
    saw = CENTRE + np.array([[25.0 * (-1) ** k, 0.5 * k, 0.1 * k] for k in range(14)])
    plan = armkin.path(three_dof, saw, corners="tolerance", jerk=jerk)
    monkeypatch.setattr(branch_path, "_MANY_RESTS", 1000)
    alone = armkin.path(three_dof, saw, corners="tolerance", jerk=jerk)
    assert len(plan.motion.stretches) == len(alone.motion.stretches) == 14  # one leads to the start
    assert plan.duration == pytest.approx(alone.duration, rel=4e-3)
    for share in ("speed", "accel"):
        assert plan.limits[share].max() <= 1.001
    for together, by_itself in zip(plan.motion.stretches, alone.motion.stretches, strict=True):
        np.testing.assert_allclose(together.end, by_itself.end, atol=1e-9)
        assert np.abs(together.evaluate(np.array([0.0, together.duration]), 1)).max() <= 1e-9
    tip = armkin.fk(three_dof, plan.q(plan.motion.begins[1:]))[:, :3, 3]
    np.testing.assert_allclose(tip, saw, atol=1e-6)


def ragged_chords(seed: int) -> np.ndarray:
    """Chords of 0.1 to 30 mm one after another, as slicers mix them, with small turns and corners."""
    rng = np.random.default_rng(seed)
    length = np.exp(rng.uniform(np.log(0.1), np.log(30), 40))
    small = rng.normal(0, 0.08, 40)
    turned = np.cumsum((small, np.where(rng.random(40) < 0.3, rng.uniform(-2.5, 2.5, 40), small))[seed % 2])
    step = length[:, None] * np.stack([np.cos(turned), np.sin(turned), 0 * turned], axis=1)
    return np.concatenate([np.zeros((1, 3)), np.cumsum(step, axis=0)])


@pytest.mark.parametrize("seed", range(12))
def test_long_chords_beside_short_ones_are_kept_to(seed: int) -> None:
    """A spline with a knot at each place that it is held to swung 9 mm out between them."""
    points = ragged_chords(seed)
    curve = fit_points.fit_curves(points, 0.05)
    u = np.unique(np.concatenate([curve.parameters, np.linspace(curve.begin[0], curve.begin[-1], 20_000)]))
    far, excess = worst_miss(points, curve.values(u)[0], 0.05)
    assert far <= 0.051
    assert excess <= 0.051


def test_blends_that_share_a_side_s_middle_are_planned(three_dof: Arm) -> None:
    """A slicer's infill: lines 0.2 mm apart, so that the two blends of each turn take half of the short side each."""
    corners = [[(30.0 if (k + 1) // 2 % 2 else -30.0), 0.2 * (k // 2) / np.sqrt(3), 0.0] for k in range(60)]
    points = CENTRE + np.array(corners)
    plan = armkin.path(three_dof, {"moves": [{"point": points[0].tolist()}, {"polyline": points[1:].tolist()}]})
    assert plan.deviation <= 0.05
    assert np.isfinite(plan.duration)
    assert (plan.limits["accel"] <= 1.002).all()
    assert worst_miss(points, executed_tips(plan), 0.05)[0] <= 0.05


def test_lines_between_tight_bends_are_as_fast_as_on_a_far_finer_grid(
    three_dof: Arm, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Slopes told by neighbours within a bend missed by percents, and a line's first interval was a millimetre long."""
    corners = [[(12.0 if (k + 1) // 2 % 2 else -12.0), 0.45 * (k // 2), 0.0] for k in range(400)]
    points = CENTRE - [0.0, 60.0, 0.0] + np.array(corners)
    plan = armkin.path(three_dof, points, corners="tolerance", tool_speed=20.0)
    for stretch, _ in plan.on_path.values():
        assert isinstance(stretch, Curve)
        pace = armkin.jacobian(three_dof, stretch.path.q)[:, :3] @ stretch.path.d[..., None]
        np.testing.assert_allclose(np.linalg.norm(pace, axis=1), 1.0, atol=1e-4)
    defaults = branch_path.run_stretches.__kwdefaults__
    assert defaults is not None
    monkeypatch.setitem(defaults, "grid", 8000)
    fine = armkin.path(three_dof, points, corners="tolerance", tool_speed=20.0)
    assert on_path(plan) <= 1.004 * on_path(fine)
    assert plan.limits["accel"].max() <= 1.002


def test_dense_points_through_a_wrist_singularity_keep_tolerance_and_limits() -> None:
    """Beside it joints need not follow what the Jacobian says: neighbours tell the slopes."""
    arm = armkin.load("puma560")
    arm = replace(arm, max_speed=np.full(6, 1.6), max_accel=np.full(6, 4.8))
    q = np.deg2rad([20.0, -60.0, 60.0, 0.0, 0.0, 10.0])
    across = np.linspace(-20, 20, 41)
    way = np.tile(armkin.fk(arm, q), (41, 1, 1))
    way[:, :2, 3] += np.stack([2e-3 * across**2, across], axis=1)
    plan = armkin.path(arm, way, corners="tolerance", near=q)
    assert plan.nearest_singularity is not None
    assert plan.nearest_singularity[1] > 1e4
    assert plan.deviation <= 0.05
    assert plan.limits["accel"].max() <= 1.002


def test_an_empty_cell_of_blend_or_speed_leaves_it_to_what_is_said_of_all(three_dof: Arm, tmp_path: Path) -> None:
    file = tmp_path / "corners.csv"
    file.write_text("x,y,z,blend,tool_speed\n390,80,300,,\n390,100,300,2,\n370,100,300,,50\n370,80,300,,\n")
    assert len(armkin.path(three_dof, file).on_path) == 2
    assert len(armkin.path(three_dof, file, blend=1.0).on_path) == 1
    file.write_text("x,y,z,blend\n390,80,,\n390,100,300,2\n")
    with pytest.raises(UsageError, match=r"corners\.csv:2: '' is no number"):
        armkin.path(three_dof, file)


def test_a_way_shown_with_too_few_samples_is_shown_best_where_it_bends_most(three_dof: Arm) -> None:
    plan = armkin.path(
        three_dof, np.concatenate([[CENTRE - [0, 240, 0]], circle_points(60, 20.0)]), corners="tolerance"
    )
    begins = plan.motion.begins.tolist()
    all_times, deviation = playback_times.sample_times(three_dof, plan, begins, 0.02, 10_000)
    assert deviation <= 0.02
    half_times, worse = playback_times.sample_times(three_dof, plan, begins, 0.02, len(all_times) // 2)
    assert len(half_times) == len(all_times) // 2
    assert worse <= 6 * deviation  # halves are off by a quarter as much


@pytest.mark.parametrize("seed", [6, 51, 54, 93])
def test_tangles_of_tiny_chords_are_planned_within_the_tolerance(three_dof: Arm, seed: int) -> None:
    """Chords of 0.03 to some tenths of a millimetre with turns of up to 150 degrees."""
    rng = np.random.default_rng(seed)
    length = np.exp(rng.uniform(np.log(0.03), np.log(rng.choice([0.2, 0.5, 5])), 60))
    turned = np.cumsum(rng.uniform(-2.6, 2.6, 60) * (rng.random(60) < (0.5, 0.2, 1.0)[seed % 3]))
    step = length[:, None] * np.stack([np.cos(turned), np.sin(turned), 0 * turned], axis=1)
    points = CENTRE + np.concatenate([np.zeros((1, 3)), np.cumsum(step, axis=0)])
    plan = armkin.path(three_dof, points, corners="tolerance")
    assert plan.deviation <= 0.05
    assert plan.limits["accel"].max() <= 1.002


def test_a_picture_draws_every_corner_of_very_many_points(three_dof: Arm, monkeypatch: pytest.MonkeyPatch) -> None:
    """With 40,000 corners of a slicer the way drawn was up to 19 mm off."""
    k = np.arange(100)
    zigzag = CENTRE - [15, 15, 0] + np.stack([30.0 * ((k + 1) // 2 % 2), 0.3 * k, 0 * k], axis=1)
    plan = armkin.path(three_dof, zigzag, corners="tolerance")
    way = picture._tool_way(plan)
    monkeypatch.setattr(picture, "_MANY_POINTS", 0)
    thin = picture._thin_out(way, 0.1)
    assert len(thin) < len(way)
    for drawn, most in ((way, 0.1), (thin, 0.2)):
        assert np.linalg.norm(zigzag[:, None] - drawn, axis=2).min(axis=1).max() < most
