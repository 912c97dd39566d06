"""Measure the general 6-joint solver: `python tests/bench/bench_elimination.py [targets per arm]`.

One run prints, for each arm: preparation, time per pose in a batch and alone, the share of generating joints
found, branches and accuracy.  Times depend on the machine and on who else uses it, so the first line gives
what one 16 x 16 eigenvalue problem costs in numpy at the same time: compare in multiples of that.
Set OPENBLAS_NUM_THREADS=1 (or your BLAS's variable) to measure one thread.
"""

import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "inverse"))

from general_arms import (
    ARMS,
    PRISMATIC_PATTERNS,
    Arm,
    nearest_distance,
    pose_of,
    pose_residual,
    random_arm,
    random_joints,
)

from armkin.inverse.elimination import method


def shortest_run(work: Callable[[], object], repeats: int) -> float:
    """The shortest of several runs."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return min(times)


def print_line(name: str, arm: Arm, count: int) -> None:
    """One line of the table."""
    q = random_joints(arm, count, 1)
    T = pose_of(arm, q)
    plan = method.prepare(*arm)
    prepare = shortest_run(lambda: method.prepare(*arm), 3)
    begin = time.perf_counter()
    solutions, doubtful, *_ = method.solve(plan, T)
    batch = (time.perf_counter() - begin) / count
    alone = np.median([shortest_run(partial(method.solve, plan, T[i : i + 1]), 1) for i in range(15)])
    branches = (~np.isnan(solutions[..., 0])).sum(axis=1)
    size = plan.plans[0].size if plan.plans else 0
    print(
        f"{name:9} {size:4} {1e3 * prepare:8.1f} {1e6 * batch:9.1f} {1e3 * alone:8.2f} "
        f"{100 * np.mean(nearest_distance(arm, q, solutions) < 1e-6):8.3f} {branches.mean():6.2f} {branches.max():4} "
        f"{pose_residual(arm, solutions, T):9.1e} {100 * doubtful.mean():9.2f}",
        flush=True,
    )


def main() -> None:
    """Print the table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    matrices = np.random.default_rng(0).standard_normal((256, 16, 16))
    print(f"one 16 x 16 eig: {shortest_run(lambda: np.linalg.eig(matrices), 5) / 256 * 1e6:.0f} us")
    print("arm        eig  prep ms  us/pose   one ms    hit %  mean  max  residual doubtful %")
    for name, arm in ARMS.items():
        print_line(name, arm, count // 10 if name in ("PUMA", "STANFORD") else count)
    for seed in range(50):
        print_line(f"random {seed}", random_arm(seed), max(1, count // 10))
    for number, pattern in enumerate(PRISMATIC_PATTERNS):
        print_line(pattern, random_arm(100 + number, pattern), max(1, count // 10))


if __name__ == "__main__":
    main()
