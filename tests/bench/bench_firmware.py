"""What the compiled firmware does, in the emulator, beside GRBL 1.1h's figures: `python tests/bench/bench_firmware.py`.

Simulated time: the figures repeat to the cycle, whatever the machine; only `waypoints` runs in real time. `--noise
SEEDS`: noise runs (20); `--curves PLACES`: planned curves, each held and its cable cut at so many places (20); `--only
ROWS`: these alone.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))
sys.path.insert(0, str(Path(__file__).parents[1] / "firmware"))

import curve_on_pins
import measure
import measure_pico as pico
import numpy as np
import waypoints_on_pins
from emulator import BUILD, PICO, build_firmware


def flash_and_ram(board: str) -> tuple[int, int]:
    """Bytes of flash and of variables."""
    built = build_firmware(board)
    size = ["arm-none-eabi-size", str(BUILD / f"{board}.elf")] if board == PICO else ["avr-size", str(built)]
    listing = subprocess.run(size, capture_output=True, text=True, check=True).stdout
    text, data, bss = map(int, listing.splitlines()[1].split()[:3])
    return text + data, data + bss


def print_row(label: str, ours: str, grbl: str = "") -> None:
    print(f"{label:46} {ours:34} {grbl}", flush=True)


SPLINE: dict[str, Any] = {
    "start": {"point": [330, -80, 320]},
    "moves": [{"spline": [[360, -20, 260], [310, 60, 300], [350, 90, 330], [300, 20, 350], [330, -80, 320]]}],
}
ZIGZAG: dict[str, Any] = {
    "start": {"point": [300, -90, 300]},
    "blend": 8,
    "moves": [{"line": [380, -50, 300]}, {"line": [310, 0, 280]}, {"line": [380, 50, 320]}, {"line": [300, 90, 300]}],
}


def print_curves(places: int) -> None:
    """Curves on three_dof: whole, held, and with the cable cut."""
    for name, moves in (("circle", curve_on_pins.CIRCLE), ("spline", SPLINE), ("rounded zigzag", ZIGZAG)):
        laid = curve_on_pins.lay_curve(moves)
        run = curve_on_pins.whole_run(laid)
        faults = "" if run.exact and not (run.overruns or run.violations or run.error) else "  FAULTS"
        figures = f"late {run.late_us:.1f} us, off {run.off_mm:.3f} mm, {run.segments_a_second:.0f} segments/s{faults}"
        print_row(f"{name}, {laid.curve.duration:.2f} s", figures)
        for cable in (False, True):
            rng = np.random.default_rng(3)
            helds = [curve_on_pins.hold_curve(laid, s, cable=cable) for s in rng.uniform(0.05, 0.9, places)]
            known_count, going_on = sum(g.known for g in helds), sum(g.goes_on for g in helds)
            farthest, accel = max(g.off_way_mm for g in helds), max(g.accel for g in helds)
            figures = f"known {known_count}, go on {going_on}, off {farthest:.3f} mm, {accel:.2f} of max_accel"
            print_row(f"{name}: {'cable cut' if cable else 'held'} at {places} places", figures)


def waypoint_rows() -> None:
    """`armkin send --batch ROWS --blend` through 1,000 waypoints, in real time."""
    streamed = waypoints_on_pins.stream_waypoints(1000)
    print_row(
        "waypoints streamed, this far apart, within",
        f"{streamed.waypoints}, {streamed.apart[0]:.1f} to {streamed.apart[1]:.1f} deg, {streamed.seconds:.1f} s",
    )
    print_row("  longest without a step / as planned", f"{streamed.gap_ms:.2f} / {streamed.planned_gap_ms:.2f} ms")
    print_row("  slowest between the ramps at either end", f"{streamed.slowest:.1f} deg/s")
    print_row(
        "  off PROTOCOL.md's arithmetic, segments/s", f"{streamed.late_us:.1f} us, {streamed.segments_a_second:.0f}"
    )
    print_row("  stops, faults", "none" if streamed.good else f"FAULTS {streamed.error}")


def pico_rows() -> None:
    """The Pico's rows; no silicon has been measured."""
    flash, ram = flash_and_ram(PICO)
    print_row("pico6: flash, variables", f"{flash} B, {ram} B")
    for interval, held_off_us in ((pico.CLOCK // 100_000, 0.0), (100, 0.0), (100, 0.48)):
        measured = pico.measure_stepping(interval, held_off_us=held_off_us)
        fault = "" if measured.exact and not (measured.overruns or measured.violations) else "  FAULTS"
        label = f"pico6: {measured.rate / 1000:.0f} kHz on six axes, farthest edge"
        label += f", interrupts {held_off_us} us late" if held_off_us else ""
        print_row(
            label, f"{measured.off_us:.3f} us, {measured.overruns} overruns, {100 * measured.asleep:.0f} % idle{fault}"
        )
    print_row("pico6: first step after the first batch", f"{pico.first_step_ms('uart'):.2f} ms")
    for link, axes, rates, batch in (
        ("USB", pico.SIX, (10_000, 15_000, 20_000), 11),
        ("UART at 250000", (0, 1, 2, 3), (1_400, 1_550), 14),
        ("UART at 250000", pico.SIX, (1_000, 1_100), 11),
    ):
        best = 0.0
        for rate in rates:
            got_rate, exact = pico.segments_per_second("usb" if link == "USB" else "uart", axes, rate, batch)
            if not exact:
                break
            best = got_rate
        print_row(f"pico6: segments a second of {len(axes)} axes, {link}", f"{best:.0f}")


def chip_rows() -> None:
    """What the AVR boards hold."""
    for board, grbl in (("uno_cnc_shield", "29864 B, 1633 B"), ("mega_ramps14", ""), ("uno_servos", "")):
        flash, ram = flash_and_ram(board)
        print_row(f"{board}: flash, variables", f"{flash} B, {ram} B", grbl)
    for board in ("uno_cnc_shield", "mega_ramps14"):
        run = measure.measure_stepping(board, 25_000, seconds=2.0)
        fault = "" if run.exact and not (run.overruns or run.violations or run.error) else "  FAULTS"
        figures = f"{run.jitter_us:.1f} us, {run.overruns} overruns{fault}"
        print_row(f"{board}: 25 kHz on all, jitter p2p", figures, "misses ticks" if board == "uno_cnc_shield" else "")
        print_row(f"{board}: stack never touched", f"{run.stack_free} B")
    top = measure.highest_rate("uno_cnc_shield", range(35_000, 40_001, 500))
    print_row("uno_cnc_shield: clean up to, 4 axes + servo", f"{top / 1000:.1f} kHz", "20 kHz, 3 axes")
    top = measure.highest_rate("mega_ramps14", range(25_000, 28_000, 500))
    print_row("mega_ramps14: clean up to, 5 axes + 4 servos", f"{top / 1000:.1f} kHz", "")
    setup, high, low, _ = measure.measure_reversing("uno_cnc_shield", 400)
    print_row("DIR set-up, STEP high, STEP low, shortest", f"{setup:.1f}, {high:.1f}, {low:.1f} us", "0.375 us set-up")
    print_row("first step after the first batch", f"{measure.first_step_ms():.2f} ms", "2.3 ... 3.6 ms")
    for baud, rates, board, grbl in (
        (115_200, (500, 550, 600, 620), "uno_cnc_shield", "325 ... 372"),
        (250_000, (1_000, 1_100, 1_150, 1_200, 1_250, 1_300), "uno_cnc_shield", ""),
        (250_000, (1_000, 1_100, 1_150, 1_200, 1_250, 1_300), "mega_ramps14", ""),
    ):
        best = 0.0
        for rate in rates:
            got_rate, exact = measure.segments_per_second(baud, rate, board=board)
            if not exact:
                break
            best = got_rate
        print_row(f"{board}: segments/s at {baud}, 25 kHz x 4, `add`", f"{best:.0f}", grbl)
    for cause in ("hold", "abort", "silence"):
        stop = measure.measure_hold(cause=cause)
        figures = f"{stop.milliseconds:.0f} / {stop.ideal:.0f} ms"
        print_row(f"{cause} from full speed / ideal ramp", figures, "173 / 133 ms" if cause == "hold" else "")


def smooth_rows() -> None:
    """Step intervals against the time law's."""
    for speed, grbl in ((1.0, "73 us (X)"), (0.2, "88 us (X)"), (0.05, "354 us (X)"), (0.02, ""), (0.01, "")):
        measured = measure.measure_smoothness(speed)
        figures = " / ".join(f"{axis.peak_to_peak_us:.0f}" for axis in measured)
        print_row(f"step intervals at {speed:.0%}, X / Y / Z, peak to peak", f"{figures} us", grbl)
        worst = max(axis.worst for axis in measured)
        print_row("  worst of all, ramps included, of max(60 us, 2 %)", f"{worst:.0%}")


def noise_rows(seeds: int) -> None:
    """A line that damages 1 % of the bytes and loses another 1 %."""
    runs = [measure.measure_noise(seed) for seed in range(seeds)]
    good = sum(r.exact and r.on_path for r in runs)
    print_row(f"1 % flipped, 1 % dropped, {seeds} x 1000 segments", f"{good} exact, on the path", "runs away at 0.1 %")


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--noise", type=int, default=20, metavar="SEEDS")
    options.add_argument("--curves", type=int, default=20, metavar="PLACES")
    rows: dict[str, Callable[[], None]] = {
        "curves": lambda: print_curves(arguments.curves),
        "waypoints": waypoint_rows,
        "chip": chip_rows,
        "smooth": smooth_rows,
        "pico": pico_rows,
        "noise": lambda: noise_rows(arguments.noise),
    }
    options.add_argument("--only", choices=rows, action="append", metavar="ROWS", help=", ".join(rows))
    arguments = options.parse_args()
    print_row("", "armkin", "GRBL 1.1h")
    for name in arguments.only or rows:
        rows[name]()


if __name__ == "__main__":
    main()
