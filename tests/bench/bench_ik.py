"""Inverse kinematics against the peers, in one run, one thread: hit rates, branches, time a pose.

    pip install -e '.[bench]'
    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python tests/bench/bench_ik.py [--poses 10000]

Everything counts: all branches, masks, limits, residual check, arrays in the API's layout. A
peer that is not installed is left out of the table. Times are the best of several runs, the
two sides in turn, because machines drift.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import armkin
from armkin.inverse.recognise import solver

ROBOTS = Path(__file__).parents[2] / "robots"
# arm, task, peer's tool
ROWS = [
    ("three_dof", None, "eaik"),
    ("puma560", None, "eaik"),
    ("ur5e", None, "eaik"),
    ("irb120", None, "eaik"),
    ("irb2400", None, "eaik"),
    ("labvolt_5150", None, "eaik"),
    ("jaco_j2n6s300", None, "ssik"),
    ("cobra600", None, None),
    ("ra02", None, None),
    ("stanford", None, None),
    ("moveo", None, None),
]


def targets(arm: armkin.Arm, task_name: str | None, q: np.ndarray) -> np.ndarray:
    """Targets that the joint values q reach: (N, m) or (N, 4, 4)."""
    task, _ = solver(arm, task_name)
    T = armkin.fk(arm, q)
    if task.orientation == "full":
        return T
    parts = [T[:, : task.position, 3], q @ task.sums.T + task.offsets]
    if task.orientation == "axis":
        parts.append(T[:, :3, 2])
    return np.concatenate(parts, axis=1)


def random_joints(arm: armkin.Arm, count: int, seed: int = 1) -> np.ndarray:
    """Joint values over a turn, or over the limits of a prismatic joint."""
    rng = np.random.default_rng(seed)
    low = np.where(arm.prismatic, np.where(np.isfinite(arm.lower), arm.lower, -arm.reach / 4), -np.pi)
    high = np.where(arm.prismatic, np.where(np.isfinite(arm.upper), arm.upper, arm.reach / 4), np.pi)
    return rng.uniform(low, high, (count, arm.n))


def best_time(*jobs: Callable[[], object], repeat: int = 5) -> list[float]:
    """Shortest time [s] of each job, the jobs taken in turn."""
    best = [np.inf] * len(jobs)
    for _ in range(repeat):
        for i, job in enumerate(jobs):
            start = time.perf_counter()
            job()
            best[i] = min(best[i], time.perf_counter() - start)
    return best


def peer_job(tool: str | None, arm: armkin.Arm, T: np.ndarray) -> tuple[str, Callable[[], object], int] | None:
    """A peer's name, its job on some of the poses, and how many."""
    if tool == "eaik":
        try:
            from eaik.IK_DH import DhRobot
        except ImportError:
            return None
        assert arm.file is not None
        rows = [j.dh for j in arm.file.joints]
        alpha, a, d = (np.array([getattr(r, key) for r in rows]) for key in ("alpha", "a", "d"))
        robot = DhRobot(np.radians(alpha), a * 1e-3, d * 1e-3)
        poses = list(_metres(T))
        return "EAIK", lambda: robot.IK_batched(poses, 1), len(poses)
    if tool == "ssik":
        try:
            from ssik.prebuilt.kinova import jaco2_ik
        except ImportError:
            return None
        some = _metres(T)[:300]
        return "ssik prebuilt", lambda: [jaco2_ik.solve(p) for p in some], len(some)
    return None


def _metres(T: np.ndarray) -> np.ndarray:
    out = T.copy()
    out[:, :3, 3] *= 1e-3
    return out


def hits(arm: armkin.Arm, q: np.ndarray, s: armkin.Solutions) -> float:
    """Share of the generating joints found again, to 1e-6 rad."""
    d = s.q - q[:, None, :]
    d = np.where(arm.prismatic, d / arm.reach, d - 2 * np.pi * np.rint(d / (2 * np.pi)))
    worst = np.where(np.isnan(d), np.inf, np.abs(d)).max(axis=2)
    return float((worst.min(axis=1) < 1e-6).mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--poses", type=int, default=10_000)
    parser.add_argument("--only", help="one robot")
    args = parser.parse_args()
    print("| arm | task | method | hit % | branches | us/pose | one pose us | peer | its us/pose | times faster |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for name, task_name, tool in ROWS:
        if args.only and name != args.only:
            continue
        arm = armkin.load(ROBOTS / f"{name}.yaml")
        q = random_joints(arm, args.poses)
        goal = targets(arm, task_name, q)
        solution = armkin.ik(arm, goal, task_name)
        jobs: list[Callable[[], object]] = [lambda: armkin.ik(arm, goal, task_name)]
        peer = peer_job(tool, arm, armkin.fk(arm, q))
        if peer:
            jobs.append(peer[1])
        times = best_time(*jobs)
        ours = times[0] / len(q) * 1e6
        single = min(best_time(*[lambda k=k: armkin.ik(arm, goal[k], task_name) for k in range(50)], repeat=5)) * 1e6
        theirs = f"{times[1] / peer[2] * 1e6:.2f}" if peer else "-"
        ratio = f"{times[1] / peer[2] / times[0] * len(q):.1f}" if peer else "-"
        print(
            f"| {name} | {solution.task.name} | {solution.method} | {100 * hits(arm, q, solution):.2f} "
            f"| {solution.valid.sum(axis=1).mean():.2f} | {ours:.3f} | {single:.0f} "
            f"| {peer[0] if peer else '-'} | {theirs} | {ratio} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
