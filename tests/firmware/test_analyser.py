"""The analyser's compiled program, with the emulated boards' pins at its own: its table against their traces."""

from __future__ import annotations

import json
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bare_host import WIDE, BareHost, Batch, cut_batches, image_for
from emulator import BUILD, FIRMWARE, PICO, EmulatedBoard, Trace, build_simulator, run_make
from measure import counts_at_home
from measure_pico import ready_host
from numpy.typing import NDArray

from armkin.board.firmware.wire.protocol import Segment, whole_steps

SEEN = "XYZA"
SAMPLES = 125  # a microsecond
FAST = replace(WIDE, max_rate=250_000, max_accel=(1 << 24) - 1)


def there_and_back(axes: tuple[int, ...], slow: int, fast: int, ticks: int) -> list[Batch]:
    """A few ticks at a slow interval, `ticks` at a fast one, and a few back; a step with every tick."""

    def part(n: int, interval: int, way: int) -> Segment:
        return whole_steps(n, interval, 0, tuple(way * (-1) ** k * n for k in range(len(axes))))

    work = [part(8, slow, 1), part(ticks, fast, 1), part(8, slow, 1), part(8, slow, -1)]
    return cut_batches(axes, (0,) * len(axes), work, 4)


def record_uno() -> tuple[Trace, float]:
    with EmulatedBoard("uno_cnc_shield", speed="step", trace=True) as board:
        host = BareHost(board)
        host.run(0.02)
        host.setup(image_for("uno_cnc_shield", FAST), counts_at_home("uno_cnc_shield"))
        host.stream(there_and_back((0, 1, 2, 3), 2000, 640, 150))
        return board.trace(), 125 / 16


def record_pico() -> tuple[Trace, float]:
    with EmulatedBoard(PICO, speed="step", trace=True) as board:
        host = ready_host(board, FAST)
        host.stream(there_and_back((0, 1, 2, 3, 4, 5), 1000, 100, 260))
        return board.trace(), 1.0


def waveform(trace: Trace, scale: float) -> list[list[int]]:
    """[sample, levels of the eight pins] with every change, from the first rise on; what was set before stands at 0."""
    names = [f"{axis}.{what}" for what in ("STEP", "DIR") for axis in SEEN]
    numbers = {trace.names[name]: bit for bit, name in enumerate(names)}
    first = min(trace.rises(f"{axis}.STEP")[0] for axis in SEEN)
    level, samples = 0, [[0, 0]]
    for cycle, signal, value in zip(trace.cycle, trace.signal, trace.value, strict=True):
        if (bit := numbers.get(int(signal))) is not None:
            level = level & ~(1 << bit) | int(value) << bit
            sample = round((int(cycle) - int(first)) * scale) + 50_000
            samples.append([max(sample, 1), level])
    return samples


def edge_samples(wave: list[list[int]], bit: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """When a pin rises and falls."""
    samples, level = np.array(wave).T
    high = level >> bit & 1
    change = np.flatnonzero(np.diff(high))
    return samples[change + 1][high[change + 1] == 1], samples[change + 1][high[change + 1] == 0]


def off_grid(rises: NDArray[np.int64]) -> float:
    """The farthest from an even grid of any 64 rises in a row whose halves are equally fast."""
    worst = 0.0
    for begin in range(0, len(rises) - 63, 64):
        run = rises[begin : begin + 64] - rises[begin]
        grid = np.arange(64) * run[-1] / 63
        if abs(run[32] - grid[32]) <= run[-1] / 64:
            worst = max(worst, float(np.abs(run - grid).max()))
    return worst


def expected_answer(wave: list[list[int]], axis: int) -> dict[str, Any]:
    """What the analyser should say of an axis, from the waveform's edges by sorting."""
    rises, falls = edge_samples(wave, axis)
    turns = np.sort(np.concatenate(edge_samples(wave, axis + 4)))
    turns = turns[turns > 1]  # those before the first sample are not seen
    samples, level = np.array(wave).T
    back = (level[np.searchsorted(samples, rises, side="right") - 1] >> axis + 4) & 1

    def gap(later: NDArray[np.int64], earlier: NDArray[np.int64]) -> float | None:
        """The least time from the last of `earlier` before it to one of `later`."""
        before = np.searchsorted(earlier, later, side="left") - 1
        has_earlier = before >= 0
        return float((later[has_earlier] - earlier[before[has_earlier]]).min() / SAMPLES) if has_earlier.any() else None

    return {
        "positive": int((back == 0).sum()),
        "negative": int((back == 1).sum()),
        "net": int((back == 0).sum() - (back == 1).sum()),
        "high_min_us": gap(falls, rises),
        "low_min_us": gap(rises, falls),
        "dir_setup_min_us": gap(rises, turns),
        "dir_hold_min_us": gap(turns, rises),
        "interval_min_us": float(np.diff(rises).min() / SAMPLES),
        "off_grid_us": off_grid(rises) / SAMPLES,
    }


@pytest.mark.parametrize("board", [record_uno, record_pico])
def test_the_analyser_prints_what_the_emulated_pins_did(board: Any) -> None:
    run_make("-C", str(FIRMWARE / "analyser"))
    build_simulator(PICO)  # the analyser runs in it, whichever board made the waveform
    wave = waveform(*board())
    command = ["node", str(Path(__file__).with_name("analyser_runner.mjs")), str(BUILD / "analyser.uf2")]
    completed = subprocess.run(command, input=json.dumps(wave), capture_output=True, text=True, check=False)
    assert completed.returncode == 0, completed.stderr
    table = json.loads(completed.stdout.splitlines()[-1])
    assert table["lost"] == 0
    for axis, name in enumerate(SEEN):
        printed = table["axes"][name]
        assert printed.pop("steady_runs") >= 1
        assert printed == pytest.approx(expected_answer(wave, axis), abs=0.0081), name
