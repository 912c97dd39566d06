"""Step times in the segments' arithmetic: where the time law has them, from the first step to the last."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from armkin.board.firmware.segments import counts_to_segments, straight_lines
from armkin.board.firmware.segments.trajectory_to_counts import plan_moves as plan_moves
from armkin.board.firmware.wire.protocol import BLOCK, HALF, STEP, Segment
from armkin.model import build_arm as arms

CLOCK, MIN_INTERVAL = counts_to_segments.CLOCK_RATE, 448


def ticks(cut: list[Segment]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Seconds and places (motors,) of every tick, as the device adds them up (PROTOCOL.md, section 6)."""
    when, places, cycle, place = [], [], 0, np.full(len(cut[0].rates), HALF, dtype=np.int64)
    for s in cut:
        left = s.ticks - np.arange(1, s.ticks + 1)
        more, block = (128 * s.bend, 1) if s.quick else (4 * s.bend, BLOCK)
        add = s.add * 256 + more * np.concatenate([[0], np.cumsum(left % block == 0)[:-1]])
        intervals = ((s.interval << 16) + np.concatenate([[0], np.cumsum(add >> 8)[:-1]])) >> 16
        assert intervals.min() >= MIN_INTERVAL
        when.append(cycle + np.cumsum(intervals))
        places.append(place + np.outer(np.arange(1, s.ticks + 1), s.rates))
        cycle, place = int(when[-1][-1]), places[-1][-1]
    return np.concatenate(when) / CLOCK, np.concatenate(places)


@pytest.mark.parametrize("speed", [0.01, 0.05, 0.2, 0.5, 1.0])
def test_every_step_interval_is_right_to_60_us_or_2_percent(speed: float) -> None:
    arm = arms.load_arm("robots/three_dof.yaml")
    cut = plan_moves(arm, [0, 0, 0], np.deg2rad([-30, 5, -5]), speed=speed, min_interval=MIN_INTERVAL)
    move = next(cut.moves())
    when, places = ticks(list(move.segments))
    law = cut.trajectory.stretches[0].law  # type: ignore[attr-defined]
    ramp, way = law.peak / law.accel, law.peak**2 / law.accel / 2
    for k, steps in enumerate(np.abs(move.end - move.start).tolist()):
        counts = places[:, k] // STEP
        made = when[np.flatnonzero(np.diff(counts, prepend=0))]
        assert len(made) == steps
        share = (np.arange(steps) + 0.5) / steps  # a step is due half-way between two counts
        exact = np.select(
            [share < way, share <= 1 - way],
            [np.sqrt(2 * share / law.accel), ramp + (share - way) / law.peak],
            law.duration - np.sqrt(2 * np.maximum(1 - share, 0) / law.accel),
        )
        lateness, period = np.diff(made) - np.diff(exact), np.diff(exact)
        assert (np.abs(lateness) / np.maximum(60e-6, 0.02 * period)).max() <= 1
        cruise = (exact[:-1] > ramp) & (exact[1:] < law.duration - ramp)
        assert np.ptp(lateness[cruise]) <= max(60e-6, 0.02 * np.median(period[cruise]))


def test_no_tick_is_faster_than_102_percent_however_short_the_ramp() -> None:
    """400 lines with ramps from half a millisecond on; the board refuses RATE from about 105 % on."""
    rng = np.random.default_rng(2)
    tried = 0
    while tried < 400:
        n, rate = int(10 ** rng.uniform(0.3, 4)), 10 ** rng.uniform(2, np.log10(CLOCK / MIN_INTERVAL))
        accel = rate / 10 ** rng.uniform(-3.3, 0)
        if accel > 400_000:
            continue
        tried += 1
        end = [n, int(n * rng.uniform(-1, 1)), int(n * rng.uniform(-1, 1))]
        move = straight_lines.straight_line([0, 0, 0], end, rate / n, accel / n, min_interval=MIN_INTERVAL)
        peak = min(rate, np.sqrt(accel * n))
        for s in move.segments:
            fastest = max(map(abs, s.rates)) / STEP * CLOCK / min(s.interval, s.last_interval)
            assert fastest <= 1.021 * peak, (n, rate, accel)
