"""Reach: CPU time of 10^9 poses by arcs, and the share under keep-outs against a count of its own.

python tests/bench/bench_reach.py [speed] [keep_outs]
"""

import json
import subprocess
import sys
import time
from pathlib import Path

import armkin

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT / "tests" / folder) for folder in ("inverse", "reachability")]
BAR = 2.0  # [s] of one core for 10^9 poses


def speed() -> bool:
    """10^9 poses: 90 azimuths, 72 rolls, no measures; the grid that gives so many."""
    good = True
    for name in ("ur5e", "puma560", "ar4"):
        arm = armkin.load(name)
        grid = arm.reach / 11.6
        armkin.reach(arm, grid=arm.reach / 2, azimuths=90, directions=3, rolls=72, measures=False)
        best = 1e9
        for _ in range(3):
            began = time.process_time()
            found = armkin.reach(arm, grid=grid, azimuths=90, directions=100 * 15, rolls=72, measures=False)
            best = min(best, time.process_time() - began)
        per = best * 1e9 / found.answers
        good &= per <= BAR
        print(f"{name:10}{found.answers:.3g} poses, {found.solves:,} solves in {best:.2f} s: {per:.2f} s for 10^9")
    return good


def keep_outs() -> bool:
    """Cells and volume under a scene, against multi-start Newton and points along the bodies."""
    import monte_carlo

    good = True
    for name, grid, count, starts in (("three_dof", 20.0, 1000, 30), ("ur5e", 150.0, 300, 150)):
        scene = ROOT / f"examples/scenes/{name}.yaml"
        words = [sys.executable, "-m", "armkin", "info", name, "--scene", str(scene), "--json"]
        said = json.loads(subprocess.run(words, capture_output=True, check=True).stdout)
        arm = armkin.load(name, scene=scene)
        cells = monte_carlo.cells(arm, scene, said, grid=grid, count=count, starts=starts)
        volume = monte_carlo.volume(arm, scene, said, grid=grid / 2, count=count, starts=starts)
        good &= cells.different == 0 and abs(volume.map - volume.counted) < 4 * volume.sigma
        print(f"{name:10}{cells.different} of {count} cells differ, {cells.known:.1%} could be told")
        found = f"{volume.map:.3f} by the map, {volume.counted:.3f} +- {volume.sigma:.3f} counted"
        print(f"{'':10}of the ball of the reach {found}", flush=True)
    return good


if __name__ == "__main__":
    asked = sys.argv[1:] or ["speed", "keep_outs"]
    sys.exit(0 if all({"speed": speed, "keep_outs": keep_outs}[name]() for name in asked) else 1)
