"""What a batch costs, small and large, of random poses and of everyday ones: whole call, C alone, worst single target.

OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python tests/bench/bench_batches.py [largest]

Microseconds of processor time a pose, the least of three runs. Everyday sets are a thousand poses (a JACO's 200):
joints at multiples of 45 degrees, the tool straight down (at positions of random postures), joint 5 at zero.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import armkin

SIZES = (1, 1_000, 20_000, 80_000)
ARMS = ("three_dof", "puma560", "ur5e", "labvolt_5150", "jaco_j2n6s300")
SETS = ("random", "45 degrees", "tool down", "q5 = 0")
RUNS, ALONE, FEW = 3, 60, 1_000


def postures(arm: armkin.Arm, kind: str, count: int) -> np.ndarray | None:
    """Joint values (N, n) of a set; None if the arm has no such."""
    rng = np.random.default_rng(7)
    q: np.ndarray = rng.uniform(-np.pi, np.pi, (count, arm.n))
    if kind == "45 degrees":
        q = rng.integers(-4, 4, (count, arm.n)) * (np.pi / 4)
    if kind == "q5 = 0":
        if arm.n != 6:
            return None
        q[:, 4] = 0.0
    return None if kind == "tool down" and arm.n != 6 else q


def targets(arm: armkin.Arm, kind: str, count: int) -> np.ndarray | None:
    """Targets of the arm's own task."""
    q = postures(arm, kind, count)
    if q is None:
        return None
    T = armkin.fk(arm, q)
    if kind == "tool down":
        yaw = q[:, 0]
        T[:, :3, :3] = np.diag([1.0, -1.0, -1.0])
        T[:, 0, 0], T[:, 0, 1], T[:, 1, 0], T[:, 1, 1] = np.cos(yaw), np.sin(yaw), np.sin(yaw), -np.cos(yaw)
    from armkin.inverse.tasks.choose_task import task_for
    from armkin.inverse.tasks.task import targets_of

    return np.asarray(targets_of(task_for(arm), T, q))


def least_cpu(work: Callable[[], Any], runs: int = RUNS) -> float:
    """Processor seconds, the least of several runs."""
    times = []
    for _ in range(runs):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def c_alone(fast: Any, T: np.ndarray) -> float:
    """Seconds within the machine code of one batch."""
    inner, spent = fast._library_for(None), [0.0]
    call = inner._batch

    def time_call(*arguments: Any) -> int:
        start = time.process_time()
        answered = int(call(*arguments))
        spent[0] += time.process_time() - start
        return answered

    inner._batch = time_call
    fast.ik(T)
    inner._batch = call
    return spent[0]


def main() -> None:
    largest = int(sys.argv[1]) if len(sys.argv) > 1 else SIZES[-1]
    print("arm            set            poses  numpy us  compiled us  C alone us  worst single, numpy / compiled us")
    for name in ARMS:
        arm = armkin.load(name)
        fast = armkin.compile(arm)
        for kind in SETS:
            slow_count = FEW if kind == "random" and name != "jaco_j2n6s300" else FEW // 5
            for size in SIZES if kind == "random" else (slow_count,):
                if size > (largest if name != "jaco_j2n6s300" else min(largest, 1_000)):
                    continue
                T = targets(arm, kind, size)
                if T is None:
                    break
                fast.ik(T[:2])
                armkin.ik(arm, T[:2])
                plain, quick, inside = (
                    1e6 * least_cpu(lambda T=T: armkin.ik(arm, T)) / size,  # type: ignore[misc]
                    1e6 * least_cpu(lambda T=T: fast.ik(T)) / size,  # type: ignore[misc]
                    1e6 * min(c_alone(fast, T) for _ in range(RUNS)) / size,
                )
                worst = ""
                if size in (slow_count, FEW):
                    sampled = range(min(ALONE, size))
                    singles = [
                        max(1e6 * least_cpu(lambda k=k, f=f: f(T[k]), 2) for k in sampled)  # type: ignore[misc]
                        for f in (lambda goal: armkin.ik(arm, goal), fast.ik)
                    ]
                    worst = f"{singles[0]:10.0f} / {singles[1]:.0f}"
                print(f"{name:14s} {kind:12s} {size:7d} {plain:9.2f} {quick:12.2f} {inside:11.2f}  {worst}", flush=True)


if __name__ == "__main__":
    main()
