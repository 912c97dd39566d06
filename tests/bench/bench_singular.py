"""CPU time of everyday poses: multiples of 45 and 15 degrees, straight wrists, own poses; the worst target alone.

python tests/bench/bench_singular.py [ROBOT...] [--poses 1000] [--alone 100]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np

import armkin


def least_cpu(do: Callable[[], object]) -> float:
    """The least CPU time of two runs."""
    times = []
    for _ in range(2):
        begin = time.process_time()
        do()
        times.append(time.process_time() - begin)
    return min(times)


def postures(arm: armkin.Arm, kind: str, count: int) -> np.ndarray:
    rng = np.random.default_rng(1)
    if kind == "straight wrist":
        q = rng.uniform(-np.pi, np.pi, (count, arm.n))
        q[:, 4] = 0.0
    else:
        step = np.radians(float(kind))
        turns = round(np.pi / step)
        q = step * rng.integers(-turns, turns + 1, (count, arm.n))
    return np.where(arm.prismatic, arm.reach / 8 * rng.integers(1, 4, q.shape), q)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("robots", nargs="*", default=["ur5e", "puma560"])
    parser.add_argument("--poses", type=int, default=1000)
    parser.add_argument("--alone", type=int, default=100)
    arguments = parser.parse_args()
    print("robot | poses | us a pose | own pose | singular, boundary | worst alone [ms] of")
    for name in arguments.robots:
        arm = armkin.load(name)
        for kind in ("45", "15", "straight wrist"):
            q = postures(arm, kind, arguments.poses)
            T = armkin.fk(arm, q)
            armkin.ik(arm, T[:64])  # recorded once
            solutions = armkin.ik(arm, T)
            mean = 1e6 * least_cpu(lambda T=T: armkin.ik(arm, T)) / arguments.poses  # type: ignore[misc]
            own_pose = 1e6 * least_cpu(lambda T=T, q=q: armkin.ik(arm, T, near=q)) / arguments.poses  # type: ignore[misc]
            edge = np.flatnonzero(solutions.status != armkin.Status.EXACT)[: arguments.alone]
            worst = max((least_cpu(lambda T=T, k=k: armkin.ik(arm, T[k])) for k in edge), default=0.0)  # type: ignore[misc]
            counts = np.bincount(solutions.status, minlength=3)
            print(
                f"{name} | {arguments.poses} at {kind} | {mean:.0f} | {own_pose:.0f} | {counts[2]}, {counts[1]} "
                f"| {1e3 * worst:.1f} of {len(edge)}",
                flush=True,
            )


if __name__ == "__main__":
    main()
