"""Position first against brute force: 1,000 targets of four arms.

python tests/bench/bench_position_first.py [targets] [grid]

Every joint but the first three on a grid, these by their own closed form; no posture of the grid may be nearer to
the target's rotation than the best row, and what is listed is within limits and at the position.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

import armkin

sys.path[:0] = [str(Path(__file__).parents[1] / "inverse"), str(Path(__file__).parents[1])]
from test_position_first import ARMS, by_brute_force, targets  # noqa: E402


def main() -> None:
    count, grid = (int(word) for word in (sys.argv[1:] + ["250", "32"][len(sys.argv) - 1 :]))
    print("arm            targets  ms each  worse than the grid  grid nearest by, deg")
    for name in ARMS:
        arm = armkin.load(name)
        T = targets(arm, count, 7)
        start = time.process_time()
        s = armkin.ik(arm, T, "pose", position_first=True)
        spent = (time.process_time() - start) / count
        assert s.angle is not None
        best = s.angle[:, 0]
        least = by_brute_force(arm, T, grid)
        off = np.abs(armkin.fk(arm, s.q[:, 0])[:, :3, 3] - T[:, :3, 3]).max()
        worse = (best > least + np.deg2rad(1e-6)).sum()
        gap = np.rad2deg(np.median(least - best))
        print(f"{name:14s} {count:7d} {1e3 * spent:8.1f} {worse:20d} {gap:21.4f}   position off by {off:.1e} mm")


if __name__ == "__main__":
    main()
