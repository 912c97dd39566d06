"""Reach: CPU time of 10^9 poses by arcs, and the share under keep-outs against a count of its own; CPU time of place.

python tests/bench/bench_reach.py [speed] [keep_outs] [place]
"""

import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

import armkin

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT / "tests" / folder) for folder in ("inverse", "reachability")]
BAR = 2.0  # [s] of one core for 10^9 poses
PLACE = 30.0  # [s] of one core for all closed-form arms


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


def place() -> bool:
    """400 poses from 37 x 37 places and 72 yaws, every shipped arm with a closed form; 1,000 places asked directly."""
    from armkin.inverse.solvers.recognise import solver
    from armkin.inverse.tasks.task import targets_of
    from armkin.reachability import from_place
    from armkin.robot_file import catalogue

    total, different, arms = 0.0, 0, 0
    for name in catalogue.names():
        arm, rng = armkin.load(name), np.random.default_rng(2)
        try:
            task, geometry = solver(arm, None)
        except armkin.UsageError:  # more joints than its task
            continue
        if geometry.pairs is None:
            continue
        q = rng.uniform(-1.0, 1.0, (400, arm.n)) * np.where(arm.prismatic, 0.1 * arm.reach, 1.0)
        targets, half, began = targets_of(task, armkin.fk(arm, q), q), arm.reach, time.process_time()
        step = half / 18
        [found] = armkin.place([arm], targets, area=(-half, half + 1e-6, -half, half + 1e-6), step=step, yaw=np.pi / 36)
        took = time.process_time() - began
        total, arms = total + took, arms + 1
        print(f"{name:16}{took:.2f} s", flush=True)
        asked = from_place.Question(arm, task, targets, 72, np.pi / 36, 0.0)
        for i, j, k in rng.integers(0, found.reached.shape, (1000 // 20, 3)).tolist():
            there = from_place.legal_from(asked, np.array([found.x[i], found.y[j]]), float(found.yaw[k]))
            different += int(there.sum()) != found.reached[i, j, k]
    print(f"place     {arms} arms in {total:.1f} s (bar {PLACE:g}), {different} of {50 * arms:,} places differ")
    return total <= PLACE and not different


if __name__ == "__main__":
    asked = sys.argv[1:] or ["speed", "keep_outs", "place"]
    sys.exit(0 if all({"speed": speed, "keep_outs": keep_outs, "place": place}[name]() for name in asked) else 1)
