"""What the compiled firmware does, in the emulator, beside GRBL 1.1h's figures: `python tests/bench/bench_firmware.py`.

Simulated time: the figures repeat to the cycle, whatever the machine. `--noise SEEDS`: noise runs (20).
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "firmware"))

import measure
from emulator import build_firmware


def flash_and_ram(board: str) -> tuple[int, int]:
    """Bytes of flash and of variables."""
    out = subprocess.run(["avr-size", str(build_firmware(board))], capture_output=True, text=True, check=True).stdout
    text, data, bss = map(int, out.splitlines()[1].split()[:3])
    return text + data, data + bss


def row(what: str, ours: str, grbl: str = "") -> None:
    print(f"{what:46} {ours:34} {grbl}", flush=True)


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--noise", type=int, default=20, metavar="SEEDS")
    seeds = options.parse_args().noise

    row("", "armkin", "GRBL 1.1h")
    for board, grbl in (("uno_cnc_shield", "29864 B, 1633 B"), ("mega_ramps14", ""), ("uno_servos", "")):
        flash, ram = flash_and_ram(board)
        row(f"{board}: flash, variables", f"{flash} B, {ram} B", grbl)
    for board in ("uno_cnc_shield", "mega_ramps14"):
        got = measure.stepping(board, 25_000, seconds=2.0)
        fault = "" if got.exact and not (got.overruns or got.violations or got.error) else "  FAULTS"
        figures = f"{got.jitter_us:.1f} us, {got.overruns} overruns{fault}"
        row(f"{board}: 25 kHz on all, jitter p2p", figures, "misses ticks" if board == "uno_cnc_shield" else "")
        row(f"{board}: stack never touched", f"{got.stack_free} B")
    top = measure.ceiling("uno_cnc_shield", range(30_000, 36_000, 500))
    row("uno_cnc_shield: clean up to, 4 axes + servo", f"{top / 1000:.1f} kHz", "20 kHz, 3 axes")
    top = measure.ceiling("mega_ramps14", range(25_000, 28_000, 500))
    row("mega_ramps14: clean up to, 5 axes + 4 servos", f"{top / 1000:.1f} kHz", "")
    setup, high, low, _ = measure.reversing("uno_cnc_shield", 448)
    row("DIR set-up, STEP high, STEP low, shortest", f"{setup:.1f}, {high:.1f}, {low:.1f} us", "0.375 us set-up")
    row("first step after the first batch", f"{measure.first_step_ms():.2f} ms", "2.3 ... 3.6 ms")
    for baud, rates, grbl in (
        (115_200, (500, 550, 600, 650), "325 ... 372"),
        (250_000, (700, 750, 800, 850, 900), ""),
    ):
        best = 0.0
        for rate in rates:
            got_rate, exact = measure.segments_per_second(baud, rate, batch=8)
            if not exact:
                break
            best = got_rate
        row(f"short segments a second at {baud}", f"{best:.0f}", grbl)
    for cause in ("hold", "abort", "silence"):
        stop = measure.hold(cause=cause)
        figures = f"{stop.milliseconds:.0f} / {stop.ideal:.0f} ms"
        row(f"{cause} from full speed / ideal ramp", figures, "173 / 133 ms" if cause == "hold" else "")
    if seeds:
        runs = [measure.noise(seed) for seed in range(seeds)]
        good = sum(r.exact and r.on_path for r in runs)
        row(f"1 % flipped, 1 % dropped, {seeds} x 1000 segments", f"{good} exact, on the path", "runs away at 0.1 %")


if __name__ == "__main__":
    main()
