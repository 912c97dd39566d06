"""Joint waypoints without a stop: near every corner, within all limits, and faster than stopping."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

import armkin
from armkin.board.firmware.segments.trajectory_to_counts import cut_trajectory
from armkin.errors import NoSolutionError, UsageError
from armkin.model.arm import Arm
from armkin.motion.joint_moves import plan_joint_moves
from armkin.motion.remaining_stretch import remainder
from armkin.motion.rounded_waypoints import round_waypoints
from armkin.motors import joints, pulses

_BETWEEN_POINTS = 0.002  # share of a rate that is more between two grid points
_ROUNDED = 1e-9  # [rad] of a joint value


@pytest.fixture(scope="module")
def three_dof() -> Arm:
    return armkin.load("robots/three_dof.yaml")


def random_waypoints(arm: Arm, count: int, step: float) -> np.ndarray:
    """Waypoints at random, each joint up to `step` degrees from the one before, within limits."""
    rng = np.random.default_rng(5)
    rows = [arm.home]
    while len(rows) < count + 1:
        row = rows[-1] + np.deg2rad(rng.uniform(-step, step, arm.n))
        if np.all((row >= arm.lower) & (row <= arm.upper)):
            rows.append(row)
    return np.array(rows)


@pytest.mark.parametrize("hold", [None, 1.5])
def test_corners_are_rounded_within_their_blend_and_all_limits(three_dof: Arm, hold: float | None) -> None:
    rows = random_waypoints(three_dof, 200, 15.0)
    trajectory = round_waypoints(three_dof, rows[0], rows[1:], 10.0, hold=hold)
    t = np.arange(0, trajectory.duration, 0.001)
    q = trajectory.q(t)
    v, a = np.diff(q, axis=0) / 0.001, np.diff(q, n=2, axis=0) / 1e-6
    assert np.abs(v / three_dof.max_speed).max() <= 1.002
    assert np.abs(a / three_dof.max_accel).max() <= 1.002
    assert np.all((q >= three_dof.lower - 1e-9) & (q <= three_dof.upper + 1e-9))
    for row in rows:
        assert np.rad2deg(np.linalg.norm(q - row, axis=1).min()) < 10.0 / np.sqrt(2) + 0.1
    assert trajectory.q(trajectory.duration) == pytest.approx(rows[-1])
    stopping = plan_joint_moves(three_dof, rows[0], rows[1:]).duration
    assert stopping / trajectory.duration > 1.4


@pytest.mark.parametrize(("jerk", "blend"), [(10, 10), (100, 1.5), (100, 10), (2000, 0.5)])  # [deg/s3], [deg]
def test_corners_keep_the_jerk_too_within_their_blend(three_dof: Arm, jerk: float, blend: float) -> None:
    arm = replace(three_dof, max_jerk=np.deg2rad([jerk, jerk, 2.0 * jerk]))
    rows = random_waypoints(arm, 40, 15.0)
    trajectory = round_waypoints(arm, rows[0], rows[1:], blend, hold=1.5)
    t = np.linspace(0, trajectory.duration, 40_001)
    q = trajectory.q(t)
    changes = np.diff(trajectory.qd(t), n=2, axis=0) / t[1] ** 2
    assert np.abs(changes / arm.max_jerk).max() == pytest.approx(1.0, abs=0.01)
    assert np.abs(trajectory.qd(t) / arm.max_speed).max() <= 1 + _BETWEEN_POINTS
    assert np.abs(trajectory.qdd(t) / arm.max_accel).max() <= 1 + _BETWEEN_POINTS
    assert np.all((q >= arm.lower - _ROUNDED) & (q <= arm.upper + _ROUNDED))
    assert max(np.rad2deg(np.linalg.norm(q - row, axis=1).min()) for row in rows) <= blend
    assert q[[0, -1]] == pytest.approx(rows[[0, -1]])
    assert trajectory.duration < plan_joint_moves(arm, rows[0], rows[1:]).duration


def test_there_and_back_again_turns_round_within_the_limits(three_dof: Arm) -> None:
    rows = np.deg2rad([[0, 90, -90], [40, 90, -90], [0, 90, -90]])
    trajectory = round_waypoints(three_dof, rows[0], rows[1:], 10.0)
    t = np.arange(0, trajectory.duration, 0.001)
    a = np.diff(trajectory.q(t), n=2, axis=0) / 1e-6
    assert np.abs(a / three_dof.max_accel).max() <= 1.002
    assert np.rad2deg(trajectory.q(t)[:, 0].max()) == pytest.approx(35.0, abs=0.01)


def test_what_makes_no_sense_is_refused(three_dof: Arm) -> None:
    with pytest.raises(UsageError, match="above 0"):
        round_waypoints(three_dof, three_dof.home, three_dof.home, 0.0)
    with pytest.raises(NoSolutionError, match="q2 = 130 deg"):
        round_waypoints(three_dof, three_dof.home, np.deg2rad([[0, 130, 0]]), 5.0)
    assert round_waypoints(three_dof, three_dof.home, three_dof.home, 5.0).duration == 0


def test_a_long_way_is_planned_in_parts_with_the_same_result(three_dof: Arm, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = random_waypoints(three_dof, 60, 20.0)
    at_once = cut_trajectory(
        round_waypoints(three_dof, rows[0], rows[1:], 5.0, hold=1.5), armkin.pulses(three_dof, rows[0])
    )
    monkeypatch.setattr("armkin.motion.timing.speed_bounds._CHUNK_INTERVALS", 50)
    monkeypatch.setattr("armkin.board.firmware.segments.curve_segments._CHUNK_SAMPLES", 700)
    parts = cut_trajectory(
        round_waypoints(three_dof, rows[0], rows[1:], 5.0, hold=1.5), armkin.pulses(three_dof, rows[0])
    )
    assert parts.duration == pytest.approx(at_once.duration, rel=1e-12)
    [[segments], [segments_in_parts]] = (
        [*map(list, (move.segments for move in laid.moves()))] for laid in (at_once, parts)
    )
    assert len(segments) == len(segments_in_parts) > 500
    assert [s.ticks for s in segments] == [s.ticks for s in segments_in_parts]


def test_waypoints_cost_little_memory_beyond_the_way_itself(three_dof: Arm, monkeypatch: pytest.MonkeyPatch) -> None:
    """The way has 24 points of 7 numbers a waypoint: 1.3 kB. All rows of all points at once took 22."""
    monkeypatch.setattr("armkin.motion.timing.speed_bounds._CHUNK_INTERVALS", 1000)

    def peak(count: int) -> int:
        rows = random_waypoints(three_dof, count, 20.0)
        tracemalloc.start()
        round_waypoints(three_dof, rows[0], rows[1:], 2.0, hold=1.5)
        _, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return most

    assert peak(300) - peak(100) < 200 * 6000


@pytest.mark.parametrize("blend", [0.01, 0.1, 1.0, 5.0])
def test_rounded_waypoints_with_jerk_are_never_slower_than_stops(three_dof: Arm, blend: float) -> None:
    arm = replace(three_dof, max_jerk=np.deg2rad([300.0] * 3))
    rows = np.deg2rad([[10, 80, -80], [12, 60, -82], [-3, 70, -60], [-20, 70, -85], [0, 90, -90]])
    stops = plan_joint_moves(arm, arm.home, rows)
    assert round_waypoints(arm, arm.home, rows, blend=blend).duration <= stops.duration


@pytest.mark.parametrize("blend", [0.1, 0.5, 1.0])
def test_what_is_left_of_a_closed_way_goes_on_round_it(three_dof: Arm, blend: float) -> None:
    """Its end is where it began, to the bit, and it is no pause: the arm went straight there, past all waypoints."""
    rows = np.deg2rad([[10, 80, -80], [12, 60, -82], [-3, 70, -60], [-20, 70, -85], [0, 90, -90]])
    [way] = round_waypoints(three_dof, three_dof.home, rows, blend=blend).stretches
    dense = way.evaluate(np.linspace(0.0, way.duration, 20_001))
    for begin in np.linspace(0.05, way.duration - 0.1, 5).tolist():
        present = joints(three_dof, pulses(three_dof, way.evaluate(np.array([begin]))[0]))
        rest = remainder(three_dof, way, begin, present)
        left = rest.evaluate(np.linspace(0.0, rest.duration, 200))
        assert np.rad2deg([np.linalg.norm(dense - q, axis=1).min() for q in left]).max() < 0.05
