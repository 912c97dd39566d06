"""The law of time with few samples: nearly as fast as with many, and within all limits between them."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

import armkin
from armkin.motion.timing.time_optimal import knots_of_samples


def wave_samples(seed: int, samples: int, n: int) -> tuple[np.ndarray, np.ndarray]:
    """A sum of a few waves: smooth, and known wherever it is asked for."""
    rng = np.random.default_rng(seed)
    size, phase = rng.normal(size=(4, n)) / 3, rng.uniform(0, 2 * np.pi, (4, n))
    s = np.linspace(0.0, 1.0, samples)
    waves = np.sin(np.arange(1, 5)[:, None, None] * 2 * s[:, None] + phase[:, None])
    return s, (size[:, None] * waves).sum(axis=0)


@pytest.mark.parametrize("samples", [50, 60, 100, 200])
@pytest.mark.parametrize("seed", range(3))
def test_few_samples_cost_little_time_and_no_limit(seed: int, samples: int) -> None:
    arm = armkin.load("three_dof")
    s, q = wave_samples(seed, samples, arm.n)
    law = armkin.time_law(arm, q, s)
    s, q = wave_samples(seed, 3000, arm.n)
    assert law.duration <= (1 + 0.36 / samples) * armkin.time_law(arm, q, s).duration
    t = np.linspace(0.0, law.duration, 20_000)
    assert np.abs(law.qd(t) / arm.max_speed).max() <= 1.002
    assert np.abs(law.qdd(t) / arm.max_accel).max() <= 1.002


def test_a_long_way_takes_little_memory_beside_its_own() -> None:
    """What is made of a way of 100,000 samples is kept; what is made on the way there is made in parts."""
    arm = armkin.load("three_dof")
    s, q = wave_samples(0, 100_000, arm.n)
    tracemalloc.start()
    law = armkin.time_law(arm, q, s)
    kept_bytes, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert law.duration > 0
    assert kept_bytes / len(s) <= 100  # bytes a sample: the slopes of three joints, steps, (ds/dt)^2, times
    assert most / len(s) <= 400


def test_slopes_do_not_depend_on_the_parts_of_a_long_way(monkeypatch: pytest.MonkeyPatch) -> None:
    s, q = wave_samples(1, 500, 3)
    knots = knots_of_samples(s, q, (100, 250))
    monkeypatch.setattr("armkin.motion.timing.speed_bounds._CHUNK_INTERVALS", 37)
    np.testing.assert_array_equal(knots_of_samples(s, q, (100, 250)).d, knots.d)


@pytest.mark.parametrize("jerk", [1e9, 1e14, 1e300])
def test_a_jerk_that_no_board_notices_is_none(jerk: float) -> None:
    arm = armkin.load("three_dof")
    q = np.deg2rad(np.linspace([0.0, 90.0, -90.0], [90.0, 60.0, -60.0], 200))
    free, limited = armkin.time_law(arm, q), armkin.time_law(arm, q, jerk=jerk)
    assert limited.duration == pytest.approx(free.duration, abs=1e-5)
    assert np.abs(limited.q([limited.duration])[0] - q[-1]).max() < 1e-9
