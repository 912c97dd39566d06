"""Joint waypoints that `armkin send --batch --blend` streams to the compiled firmware in real time, read from the pins.

`tests/bench/bench_firmware.py --only waypoints` prints the figures of 1,000, `test_path_on_pins.py` holds 60 to bars.
"""

from __future__ import annotations

import resource
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from curve_on_pins import counts_of, late_us, predicted_steps
from emulator import EmulatedBoard

import armkin
from armkin.board.firmware.segments.counts_to_segments import CLOCK_RATE
from armkin.board.firmware.segments.trajectory_to_counts import Cut
from armkin.board.kinds import board_of
from armkin.board.planner import Planner
from armkin.formula.arrays import Array
from command_line import THREE_DOF, run_process

BLEND = 1.5  # [deg]
WINDOW = 0.05  # [s] in which a speed is read from counts
RAMP = 0.3  # [s] at either end, where the arm speeds up from rest and slows down to it


@dataclass(frozen=True)
class Streamed:
    """All waypoints sent: what the command says, what the pins did."""

    error: str  # the command's, "" if it ended well: a queue that runs dry and late ticks are errors
    waypoints: int
    apart: tuple[float, float]  # [deg] from a waypoint to the next, least and most
    exact: bool  # counts, pins and plan agree at the end
    violations: int
    late_us: float  # a step's distance from PROTOCOL.md's arithmetic, at most
    gap_ms: float  # longest without a step of any motor, from the first step to the last
    planned_gap_ms: float
    slowest: float  # [deg/s] all joints together, in any WINDOW but in the ramps
    seconds: float  # from the first step to the last
    segments_a_second: float
    processor: float  # [s] of the command, its start included

    @property
    def good(self) -> bool:
        """No stop and no fault. A stop between ramps of 120 deg/s2 is at most 2.6 deg/s in its window."""
        flows = self.gap_ms <= self.planned_gap_ms + 1 and self.slowest >= 6
        return flows and self.exact and not self.error and not self.violations


def waypoint_rows(count: int) -> Array:
    """Joint values [deg] on a wavy ring around the middle of three_dof's limits, some degrees apart and off it."""
    i = 0.1 * np.arange(1, count + 1)
    ring = np.stack([35 * np.sin(i), 75 + 30 * np.cos(i), -70 + 35 * np.sin(0.37 * i)], axis=-1)
    return np.round(ring + np.random.default_rng(7).uniform(-0.3, 0.3, ring.shape), 4)


def stream_waypoints(count: int, *, blend: float = BLEND, patience: float = 0.0) -> Streamed:
    """Send so many waypoints from home, look at every edge; patience: as of the emulated board."""
    arm, q = armkin.load("three_dof"), waypoint_rows(count)
    plan = Planner(board_of(arm), 1.0, blend).plan([0, 0, 0], np.deg2rad(q))
    assert isinstance(plan, Cut)
    segments = [one for move in plan.moves() for one in move.segments]
    wanted = predicted_steps(segments, [0, 0, 0])
    with EmulatedBoard(trace=True, patience=patience) as board, tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "rows.csv"
        file.write_text("".join(f"{a},{b},{c}\n" for a, b, c in q.tolist()))
        words = ["send", THREE_DOF, "--batch", file, "--port", board.port, "--assume-home", "--json"]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        completed = run_process(*words, *(["--blend", blend] if blend else []), timeout=240 + 3 * plan.duration)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        said: dict[str, Any] = completed.json if completed.code == 0 else {"waypoints": 0, "pulses": None}
        trace, axes = board.trace(), board.stats()["axes"]
    cycle, counts = counts_of(trace, [0, 0, 0])
    ends = [counts[-1].tolist(), [axes[name]["net"] for name in "XYZ"], said["pulses"]]
    at = np.arange(cycle[0] + RAMP * CLOCK_RATE, cycle[-1] - RAMP * CLOCK_RATE, WINDOW / 5 * CLOCK_RATE)
    there, here = (
        np.rad2deg(armkin.joints(arm, counts[np.searchsorted(cycle, at + half)]))
        for half in (WINDOW / 2 * CLOCK_RATE, -WINDOW / 2 * CLOCK_RATE)
    )
    apart = np.linalg.norm(np.diff(q, axis=0), axis=1)
    return Streamed(
        "" if completed.code == 0 else completed.err,
        said["waypoints"],
        (float(apart.min()), float(apart.max())),
        all(end == plan.end.tolist() for end in ends),
        sum(sum(axes[name]["violations"].values()) for name in "XYZ"),
        late_us(trace, wanted),
        float(np.diff(cycle).max()) / CLOCK_RATE * 1e3,
        float(np.diff(np.sort(np.concatenate(wanted))).max()) / CLOCK_RATE * 1e3,
        float(np.linalg.norm(there - here, axis=1).min()) / WINDOW,
        float(cycle[-1] - cycle[0]) / CLOCK_RATE,
        len(segments) / plan.duration,
        after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime,
    )
