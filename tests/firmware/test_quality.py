"""The firmware's quality bars, on the compiled program in the emulator; tests/bench/bench_firmware.py prints them."""

from __future__ import annotations

from collections.abc import Callable

import measure
import pytest


@pytest.mark.parametrize("board", ["uno_cnc_shield", "mega_ramps14"])
def test_25_khz_on_every_stepper_with_every_feature_on(board: str) -> None:
    measured = measure.measure_stepping(board, 25_000, seconds=1.0)
    assert measured.exact
    assert (measured.error, measured.overruns, measured.violations) == (0, 0, 0)
    assert abs(measured.rate - 25_000) < 100
    assert measured.jitter_us <= 10
    assert measured.stack_free >= 128


def test_the_shortest_interval_that_the_board_accepts_is_kept() -> None:
    measured = measure.measure_stepping("uno_cnc_shield", 40_000)
    assert measured.exact
    assert (measured.error, measured.overruns, measured.violations) == (0, 0, 0)
    assert measured.jitter_us <= 10.5


@pytest.mark.parametrize(("board", "interval", "ticks"), [("uno_cnc_shield", 400, 100), ("mega_ramps14", 576, 100)])
def test_motors_turn_round_at_the_shortest_interval_that_the_board_tells(board: str, interval: int, ticks: int) -> None:
    measured = measure.measure_turning(board, interval, ticks)
    assert measured.exact
    assert (measured.error, measured.overruns, measured.violations) == (0, 0, 0)
    assert measured.servo_ms < 25
    assert measured.late_servos == 0
    assert measured.stack_free >= 128


def test_40_ticks_a_segment_at_25_khz_do_not_run_dry() -> None:
    measured = measure.measure_turning("uno_cnc_shield", 640, ticks=40)
    assert measured.exact
    assert (measured.error, measured.overruns, measured.violations) == (0, 0, 0)
    assert measured.servo_ms < 25


@pytest.mark.parametrize(("board", "interval"), [("uno_cnc_shield", 400), ("mega_ramps14", 576)])
@pytest.mark.parametrize("high", [19, 80])
def test_driver_times_while_turning_round_at_the_fastest_ticks(board: str, interval: int, high: int) -> None:
    dir_setup, step_high, step_low, violations = measure.measure_reversing(board, interval, high)
    assert violations == 0
    assert dir_setup >= 10.0  # what CONFIG allows at most, far above any driver's
    assert step_high >= high / 10
    assert step_low >= 5.0


def test_first_step_within_3_ms_of_the_first_batch() -> None:
    assert measure.first_step_ms() < 3
    assert measure.first_step_ms(batch=2) < 2


@pytest.mark.parametrize(
    ("baud", "rate", "board"),
    [(115_200, 600, "uno_cnc_shield"), (250_000, 1200, "uno_cnc_shield"), (250_000, 1200, "mega_ramps14")],
)
def test_short_segments_a_second(baud: int, rate: float, board: str) -> None:
    measured, exact = measure.segments_per_second(baud, rate, board=board)
    assert exact
    assert measured > 0.99 * rate


@pytest.mark.parametrize("cause", ["hold", "abort", "silence"])
def test_a_hold_from_full_speed_stays_on_the_path(cause: str) -> None:
    held = measure.measure_hold(cause=cause)
    assert held.exact
    assert held.known
    assert held.off_path <= 1
    assert 0.8 * held.ideal < held.milliseconds < 1.2 * held.ideal


@pytest.mark.parametrize("first", [0, 3])
def test_noise_on_both_lines_moves_nothing_wrong(first: int, sample: Callable[[int, int], int]) -> None:
    """tests/bench/bench_firmware.py counts 20 seeds."""
    for seed in range(first, first + sample(3, 1)):
        measured = measure.measure_noise(seed)
        assert measured.resent > 100  # the noise was there
        assert measured.on_path
        assert measured.exact


@pytest.mark.parametrize("speed", [1.0, 0.2])
def test_steps_come_when_the_time_law_says_ramps_included(speed: float) -> None:
    """Every interval, from the first step to the last, to 60 us or 2 % of its period; the cruise peak to peak."""
    for measured in measure.measure_smoothness(speed):
        assert measured.worst <= 1.2, measured  # the interrupt's own latency comes on top of the arithmetic
        assert measured.peak_to_peak_us <= max(60, 0.02 * measured.period_us) + 8, measured
