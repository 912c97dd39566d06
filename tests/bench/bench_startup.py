"""Measure start-up: `python tests/bench/bench_startup.py [pairs]`, from the project's folder.

Each command runs in alternation with `python -c pass` of the same environment; what counts is the ratio,
as the machine's other work slows both. The bars: `armkin --help` within 8, `armkin fk` within 22.
"""

import statistics
import subprocess
import sys
import time
from pathlib import Path

ARMKIN = str(Path(sys.executable).parent / "armkin")
COMMANDS = {
    "armkin --help": ([ARMKIN, "--help"], 8),
    "armkin fk": ([ARMKIN, "fk", "robots/three_dof.yaml", "-30", "5", "-5"], 22),
    "import armkin": ([sys.executable, "-c", "import armkin"], 2),
}


def run_seconds(command: list[str]) -> float:
    began = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - began


def main(pairs: int) -> None:
    nothing = [sys.executable, "-c", "pass"]
    print(f"{'':16}  {'pass/ms':>8}  {'ms':>7}  {'ratio':>6}  {'of best':>7}  bar")
    for name, (command, bar) in COMMANDS.items():
        run_seconds(command)  # compiled files and the disk's cache
        times = [(run_seconds(nothing), run_seconds(command)) for _ in range(pairs)]
        bare, full = (statistics.median(column) * 1e3 for column in zip(*times, strict=True))
        ratio = statistics.median(b / a for a, b in times)
        best = min(b for _, b in times) / min(a for a, _ in times)
        print(f"{name:16}  {bare:8.1f}  {full:7.1f}  {ratio:6.2f}  {best:7.2f}  {bar}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 21)
