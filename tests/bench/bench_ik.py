"""Inverse kinematics against the peers, in one run, one thread: hit rates, branches, time a pose.

    pip install -e '.[bench]'
    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python tests/bench/bench_ik.py [--poses 80000]
    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python tests/bench/bench_ik.py --workers 2    # wall time of threads

Everything counts: all branches, masks, limits, residual check, arrays in the API's layout. A
peer that is not installed is left out of the table. Times are the best of several runs, the
two sides in turn, because machines drift, in seconds of the processor, because machines are shared.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

import armkin
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.model.arm import from_links
from armkin.model.rotation import rotation_about

ROBOTS = Path(__file__).parents[2] / "robots"
LEAST = 1.0  # seconds that jobs run in all


class Row(NamedTuple):
    """An arm and what is asked of it. share: of the poses asked for. The bars are those of one machine with EAIK."""

    name: str
    task: str | None = None
    tool: str | None = None
    share: float = 1.0
    faster: float = 0.0  # times as fast as the peer's batch
    batch: float = 0.0  # us a pose, if there is no peer
    one: float = 50.0  # us for one pose
    off: float = 0.0  # [rad, reaches] by which every axis of a calibrated arm is off


ROWS = [
    Row("three_dof", tool="eaik", faster=10),
    Row("puma560", tool="eaik", faster=7),
    Row("ur5e", tool="eaik", faster=7),
    Row("irb120", tool="eaik", faster=8),
    Row("irb2400", tool="eaik"),
    Row("labvolt_5150", tool="eaik", faster=13),
    Row("labvolt_5150", "pose", "eaik", faster=5),
    Row("jaco_j2n6s300", tool="ssik", share=0.1, one=0),
    Row("ur5e", share=0.05, batch=160, one=2500, off=1e-4),
    Row("three_dof", batch=20, one=150, off=1e-4),
    Row("moveo", share=0.05, batch=200, one=0),
    Row("cobra600"),
    Row("ra02"),
    Row("stanford"),
]


def arm_of_row(row: Row) -> armkin.Arm:
    """The arm of a row, its axes off by up to `off`."""
    arm = armkin.load(ROBOTS / f"{row.name}.yaml")
    if not row.off:
        return arm
    rng, link = np.random.default_rng(8), arm.link.copy()
    for L in link:
        turn = rotation_about(0, rng.normal(0, row.off)) @ rotation_about(1, rng.normal(0, row.off))
        L[:3, :3], L[:3, 3] = L[:3, :3] @ turn, L[:3, 3] + rng.normal(0, row.off, 3) * arm.reach
    return from_links(link, arm.prismatic, name=f"{row.name}, calibrated")


def targets_of(arm: armkin.Arm, task_name: str | None, q: np.ndarray) -> np.ndarray:
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


def best_time(
    *jobs: Callable[[], object], repeat: int = 5, clock: Callable[[], float] = time.process_time
) -> list[float]:
    """Shortest time [s] of each job, the jobs taken in turn: as often as asked for, and for a second in all.

    On a shared machine a job of 4 ms meets no quiet moment in five runs.
    """
    best, spent, rounds = [np.inf] * len(jobs), [0.0] * len(jobs), 0
    while rounds < repeat or (repeat > 1 and sum(spent) < LEAST):
        for i, job in enumerate(jobs):
            start = clock()
            job()
            took = clock() - start
            best[i], spent[i] = min(best[i], took), spent[i] + took
        rounds += 1
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
        poses = list(_in_metres(T))
        return "EAIK", lambda: robot.IK_batched(poses, 1), len(poses)
    if tool == "ssik":
        try:
            from ssik.prebuilt.kinova import jaco2_ik
        except ImportError:
            return None
        sample = _in_metres(T)[:300]
        return "ssik prebuilt", lambda: [jaco2_ik.solve(p) for p in sample], len(sample)
    return None


def _in_metres(T: np.ndarray) -> np.ndarray:
    scaled = T.copy()
    scaled[:, :3, 3] *= 1e-3
    return scaled


def share_found(arm: armkin.Arm, q: np.ndarray, s: armkin.Solutions) -> float:
    """Share of the generating joints found again, to 1e-6 rad."""
    d = s.q - q[:, None, :]
    d = np.where(arm.prismatic, d / arm.reach, d - 2 * np.pi * np.rint(d / (2 * np.pi)))
    worst = np.where(np.isnan(d), np.inf, np.abs(d)).max(axis=2)
    return float((worst.min(axis=1) < 1e-6).mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--poses", type=int, default=80_000)
    parser.add_argument("--only", help="one robot")
    parser.add_argument("--workers", type=int, default=1, help="wall time with that many threads beside one")
    args = parser.parse_args()
    if args.workers > 1:
        print(f"| arm | task | one thread, us/pose | {args.workers} threads | times faster |\n|---|---|---|---|---|")
        for row in ROWS:
            if not args.only or row.name == args.only:
                print(thread_line(row, int(args.poses * row.share), args.workers), flush=True)
        return
    print("| arm | task | method | hit % | branches | us/pose | one pose us | peer | its us/pose | faster | bars |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for row in ROWS:
        if not args.only or row.name == args.only:
            print(table_line(row, int(args.poses * row.share)), flush=True)


def thread_line(row: Row, poses: int, workers: int) -> str:
    """One line of the table of threads, by the clock on the wall: wants a quiet machine."""
    arm = arm_of_row(row)
    goal = targets_of(arm, row.task, random_joints(arm, poses))
    armkin.ik(arm, goal, row.task, workers=workers)
    best = [np.inf, np.inf]
    for _ in range(5):
        for i, count in enumerate((1, workers)):
            start = time.perf_counter()
            armkin.ik(arm, goal, row.task, workers=count)
            best[i] = min(best[i], time.perf_counter() - start)
    single, threaded_time = (t / poses * 1e6 for t in best)
    return f"| {arm.name} | {row.task or '-'} | {single:.3f} | {threaded_time:.3f} | {single / threaded_time:.2f} |"


def table_line(row: Row, poses: int) -> str:
    """One line of the table."""
    arm = arm_of_row(row)
    q = random_joints(arm, poses)
    goal = targets_of(arm, row.task, q)
    solution = armkin.ik(arm, goal, row.task)
    jobs: list[Callable[[], object]] = [lambda: armkin.ik(arm, goal, row.task)]
    peer = peer_job(row.tool, arm, armkin.fk(arm, q[:10_000]))
    if peer:
        jobs.append(peer[1])
    times = best_time(*jobs)
    ours = times[0] / len(q) * 1e6
    single = (
        min(best_time(*[lambda k=k: [armkin.ik(arm, goal[k], row.task) for _ in range(5)] for k in range(50)])) / 5e-6
    )
    theirs = times[1] / peer[2] * 1e6 if peer else 0.0
    bars = []
    if row.faster and peer:
        bars.append(f"{row.faster:g} times: {'pass' if theirs / ours >= row.faster else 'miss'}")
    if row.batch:
        bars.append(f"{row.batch:g} us: {'pass' if ours <= row.batch else 'miss'}")
    if row.one:
        bars.append(f"one {row.one:g} us: {'pass' if single <= row.one else 'miss'}")
    return (
        f"| {arm.name} | {solution.task.name} | {solution.method} | {100 * share_found(arm, q, solution):.2f} "
        f"| {solution.valid.sum(axis=1).mean():.2f} | {ours:.3f} | {single:.0f} | {peer[0] if peer else '-'} "
        f"| {f'{theirs:.2f}' if peer else '-'} | {f'{theirs / ours:.1f}' if peer else '-'} | {', '.join(bars) or '-'} |"
    )


if __name__ == "__main__":
    main()
