"""Curved paths on the simulated board, which checks speeds and accelerations of every segment as the firmware does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import armkin
from armkin.board.backend.sent_positions import braking_time
from armkin.board.firmware.segments import curve_segments
from armkin.board.firmware.segments.counts_to_segments import cycles_of
from armkin.board.firmware.segments.trajectory_to_counts import cut_trajectory
from armkin.board.kinds import board_of
from armkin.board.path_run import follow_plan, plan_parts
from armkin.board.sim.segment_queue import intervals
from armkin.formula.arrays import Array
from armkin.motion.timing.curved_stretch import Curve

_SOLVED = 1e-9  # of a target [mm]: what `ik` leaves of it


def some_path(seed: int) -> dict[str, object]:
    """Lines, a spline and an arc through points at random, some with rounded corners."""
    rng = np.random.default_rng(seed)
    points = rng.uniform([270, -120, 200], [390, 120, 360], (6, 3)).tolist()
    moves = [
        {"point": points[0]},
        {"line": points[1]},
        {"spline": points[2:4]},
        {"arc": {"via": points[4], "to": points[5]}},
        {"line": points[0]},
    ]
    return {"moves": moves, "blend": float(rng.choice([0, 3, 8]))}


@pytest.mark.parametrize("seed", range(5))
def test_a_path_at_random_arrives_at_exact_counts(seed: int) -> None:
    arm = armkin.load("three_dof")
    board = board_of(arm)
    plan = armkin.path(arm, some_path(seed), jerk=np.deg2rad(3000) if seed % 2 else None)
    machine = board.connect(board.simulated())
    machine.prepare()
    laid = plan_parts(plan, machine.counts(), machine.plan_trajectory)
    follow_plan(board, plan, laid, lambda done, total: None)
    assert machine.counts() == tuple(laid[-1].end.tolist())
    assert sum(part.segments for part in laid) < 100 * plan.duration + 50


@pytest.mark.parametrize("jerk", [100, 200])  # [deg/s3]
def test_a_line_of_so_little_jerk_that_every_chord_may_be_long_is_carried_out(jerk: float) -> None:
    """No sample's chord needed a look: `evaluate` was asked for no time at all, and could not tell rows of none."""
    arm = armkin.load("three_dof")
    board = board_of(arm)
    begin, end = np.array([390.0, 80, 300]), np.array([390.0, -80, 200])
    path = {"start": {"point": begin.tolist()}, "moves": [{"line": end.tolist()}]}
    plan = armkin.path(arm, path, jerk=np.deg2rad(jerk))
    t = np.linspace(0.0, plan.duration, 20_001)
    third = np.diff(plan.qd(t), n=2, axis=0) / (plan.duration / 20_000) ** 2
    assert np.abs(third).max() <= 1.001 * np.deg2rad(jerk)
    offset, way = armkin.fk(arm, plan.q(t))[:, :3, 3] - begin, (end - begin) / np.linalg.norm(end - begin)
    assert np.linalg.norm(offset - (offset @ way)[:, None] * way, axis=1).max() <= plan.tolerance
    assert offset[[0, -1]] == pytest.approx(np.array([begin, end]) - begin, abs=_SOLVED)
    machine = board.connect(board.simulated())
    machine.prepare()
    laid = plan_parts(plan, machine.counts(), machine.plan_trajectory)
    follow_plan(board, plan, laid, lambda done, total: None)
    assert machine.counts() == tuple(laid[-1].end.tolist())
    assert machine.counts() == tuple(armkin.pulses(arm, plan.q(plan.duration)).tolist())


@pytest.mark.parametrize("seed", range(6))
def test_no_segment_ends_faster_than_the_board_loads_the_next_one(seed: int) -> None:
    """A tick that loads a segment may take more than the shortest interval: the next tick came early, or late."""
    arm = armkin.load("three_dof")
    corners = [[380, -50, 300], [310, 0, 280], [380, 50, 320], [300, 90, 300]]
    zigzag = {"start": {"point": [300, -90, 300]}, "blend": 8, "moves": [{"line": p} for p in corners]}
    plan = armkin.path(arm, some_path(seed) if seed else zigzag)
    laid = cut_trajectory(plan.motion, armkin.pulses(arm, plan.motion.start), min_interval=448)
    for stretch, move in zip(plan.motion.stretches, laid.moves(), strict=True):
        if isinstance(stretch, Curve):
            assert min(min(intervals(s)) for s in move.segments) >= 1.1 * 448


def test_a_board_that_is_sent_positions_slows_down_gently_on_curves() -> None:
    """Time itself goes ever slower: a joint is asked for its plan's acceleration and for its speed by the ramp."""
    arm = armkin.load("three_dof")
    circle = armkin.path(arm, {"start": {"point": [350, 0, 300]}, "moves": [{"circle": {"centre": [300, 0, 300]}}]})
    t = np.linspace(0.0, circle.duration, 500)

    def greatest_share(ramp: float) -> float:
        slower = circle.motion.qdd(t) - circle.motion.qd(t) / ramp
        return float((np.abs(slower) / arm.max_accel).max())

    ramp = braking_time(circle.motion)
    assert greatest_share(ramp) <= 1.63 < greatest_share(0.625 * ramp)
    plan = armkin.path(arm, {"moves": [{"joint": {"q1": 60}}]})
    assert braking_time(plan.motion) == pytest.approx(0.5)  # 60 deg/s at 120 deg/s2


def test_segments_follow_the_plan_in_time_and_place() -> None:
    arm = armkin.load("three_dof")
    plan = armkin.path(arm, {"moves": [{"point": [350, 0, 300]}, {"circle": {"centre": [300, 0, 300], "turns": 2}}]})
    laid = cut_trajectory(plan.motion, armkin.pulses(arm, plan.motion.start), min_interval=576)
    *_, move = laid.moves()
    stretch = plan.motion.stretches[-1]
    assert sum(cycles_of(s) for s in move.segments) / laid.clock == pytest.approx(stretch.duration, rel=1e-4)
    t, place = 0.0, np.array(move.start, dtype=float)
    for segment in move.segments:
        t += cycles_of(segment) / laid.clock
        place += np.array(segment.rates) * segment.ticks / 2**23
        exact = (stretch.evaluate(np.array([t]))[0] - arm.home) @ arm.motor_gain.T
        # What the whole counts at both ends are off is left behind soon; then a segment ends where the motors are.
        assert np.abs(place - exact).max() < (0.15 if 0.3 < t < stretch.duration - 0.3 else 1.0)
    assert np.round(place).tolist() == move.end.tolist() == move.start.tolist()


@pytest.mark.parametrize("seed", range(4))
def test_chords_that_may_be_long_are_told_without_a_look(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """An arm whose joints might move the tip by a kilometre has every sample looked at: the segments are the same."""
    arm = armkin.load("three_dof")
    plan = armkin.path(arm, some_path(seed), tool_speed=20)
    looked: list[int] = []
    counts = armkin.pulses(arm, plan.motion.start)

    def count_and_call(arm: armkin.Arm, q: Array) -> Array:
        looked.append(len(q))
        return armkin.jacobian(arm, q)

    monkeypatch.setattr(curve_segments, "jacobian", count_and_call)

    def bounds(arm: armkin.Arm) -> list[float]:
        ways = [s for s in plan.motion.stretches if isinstance(s, Curve)]
        parts = [curve_segments.CurveSegments(arm, s, counts, counts, 16_000_000, 576, 0.05) for s in ways]
        return [t for part in parts for t in part.bounds().tolist()]

    times, looks = bounds(arm), sum(looked)
    looked.clear()
    assert bounds(replace(arm, reach=1e6)) == times
    assert looks < 0.7 * sum(looked)
