"""G-code and SVG at random against other readers: `python tests/bench/bench_drawings.py [N]`.

N programs and N drawings (100): how many lie within 0.01 mm, and the worst; broken programs: refused with their line.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

import numpy as np

import random_drawings
from armkin.errors import PathFileError
from reader_comparison import drawing_off, program_off, program_read

BROKEN = ("G1 X", "G33 X1", "G1 X1 X2", "G0 G1 X1", "G1 X#1", "G2 X1 Y1", "G1 X1..2", "G5 X1 Y1", "G1 X1 Q2", "G81 X1")


def main(count: int) -> None:
    """Print the figures."""
    for name, distance in (("programs", program_off), ("drawings", drawing_off)):
        distances = np.array([distance(seed) for seed in range(count)])
        print(
            f"{name}: {int((distances <= 0.01).sum())} of {count} within 0.01 mm; worst {distances.max():.5f} mm",
            flush=True,
        )
        print("  beyond:", np.flatnonzero(distances > 0.01).tolist())
    right = 0
    for seed in range(count):
        lines, rng = random_drawings.random_program(seed).splitlines(), np.random.default_rng(seed)
        k = int(rng.integers(2, max(3, len(lines) // 2)))
        lines.insert(k, BROKEN[seed % len(BROKEN)])
        try:
            program_read("\n".join(lines))
        except PathFileError as error:
            right += str(error).startswith(f"t.gcode:{k + 1}: ")
    print(f"broken programs: {right} of {count} refused with their line")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
