"""The tool up, down and level along each axis, any yaw: `python tests/bench/bench_tool_down.py [targets of a set]`.

Processor time a pose, the least of several runs, of targets at positions of random postures: machine code in a batch,
numpy in a batch (a quarter of the targets) and alone (the median and the worst of 20), and the share that is complete.
Set OMP_NUM_THREADS=1 and OPENBLAS_NUM_THREADS=1.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from bench_batches import c_alone, least_cpu

import armkin

sys.path.append(str(Path(__file__).parents[1] / "inverse"))

from gen3_lite import arm_and_screws  # of the inverse tests

ARMS = ("jaco_j2n6s300", "gen3_lite", "fanuc_crx10ia", "xarm6", "mycobot_280")
WAYS = {"up": (0, 0, 1), "down": (0, 0, -1), "+x": (1, 0, 0), "-x": (-1, 0, 0), "+y": (0, 1, 0), "-y": (0, -1, 0)}
RUNS, ALONE = 5, 20


def targets(arm: armkin.Arm, way: tuple[int, int, int], count: int) -> np.ndarray:
    """Poses (count, 4, 4) whose z axis points that way."""
    rng = np.random.default_rng(7)
    low, high = np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi)
    T = armkin.fk(arm, rng.uniform(low, high, (count, arm.n)))
    yaw, z = rng.uniform(-np.pi, np.pi, (count, 1)), np.array(way, float)
    first = np.array([1.0, 0, 0]) if abs(z[2]) > 0.5 else np.array([0, 0, 1.0])
    x = np.cos(yaw) * first + np.sin(yaw) * np.cross(z, first)
    T[:, :3, :3] = np.stack([x, np.cross(z, x), np.broadcast_to(z, x.shape)], axis=-1)
    return T


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000
    print("arm            way   compiled us  C alone us  numpy us  alone ms, median / worst  complete, C / numpy")
    for name in ARMS:
        arm = arm_and_screws(name)[0]
        fast = armkin.compile(arm)
        for label, way in WAYS.items():
            T = targets(arm, way, count)
            sample = T[: max(count // 4, 1)]
            armkin.ik(arm, T[:2])
            python, compiled = armkin.ik(arm, sample), fast.ik(T)
            quick = 1e6 * least_cpu(lambda T=T: fast.ik(T), RUNS) / count  # type: ignore[misc]
            inside = 1e6 * min(c_alone(fast, T) for _ in range(RUNS)) / count
            plain = 1e6 * least_cpu(lambda sample=sample: armkin.ik(arm, sample)) / len(sample)  # type: ignore[misc]
            alone = [1e3 * least_cpu(lambda goal=goal: armkin.ik(arm, goal)) for goal in T[:ALONE]]  # type: ignore[misc]
            print(
                f"{name:14s} {label:5s} {quick:11.1f} {inside:11.1f} {plain:9.0f} {np.median(alone):12.2f} / "
                f"{max(alone):.2f} {100 * compiled.complete.mean():16.2f} / {100 * python.complete.mean():.2f} %",
                flush=True,
            )


if __name__ == "__main__":
    main()
