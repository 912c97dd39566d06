"""`armkin.compile` against numpy and EAIK in one run; the exported C against Python, pose by pose.

    pip install -e '.[bench]'
    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python tests/bench/bench_compiled.py [--poses 80000]
    python tests/bench/bench_compiled.py --agree 100000        # exported C and armkin.compile beside armkin.ik
    python tests/bench/bench_compiled.py --memory 1000000      # peak memory beyond the results

Times are the best of several runs, the sides in turn, because machines drift, in seconds of the processor (but for the
column of two workers), because machines are shared; everything counts, as in bench_ik.py.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "export"))

from bench_ik import ROBOTS, best_time, peer_job, random_joints, targets_of
from exported_c import compare_answers

import armkin

# arm, peer, how many poses of those asked for
ROWS = [
    ("three_dof", "eaik", 1.0),
    ("labvolt_5150", "eaik", 1.0),
    ("puma560", "eaik", 1.0),
    ("ur5e", "eaik", 1.0),
    ("irb120", "eaik", 1.0),
    ("stanford", None, 1.0),
    ("cobra600", None, 1.0),
    ("jaco_j2n6s300", "ssik", 0.1),
    ("moveo", None, 0.05),
]


def print_speed(poses: int, only: str | None) -> None:
    print(
        "| arm | compiled us/pose | wall, 1 and 2 workers | numpy us/pose | peer | its us/pose | faster | one pose us |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for name, tool, share in ROWS:
        if only and name != only:
            continue
        arm = armkin.load(ROBOTS / f"{name}.yaml")
        fast = armkin.compile(arm)
        q = random_joints(arm, int(poses * share))
        goal = targets_of(arm, None, q)
        jobs: list[Callable[[], object]] = [
            lambda: fast.ik(goal),
            lambda: armkin.ik(arm, goal[:5000]),
        ]
        peer = peer_job(tool, arm, armkin.fk(arm, q[:5000]))
        if peer:
            jobs.append(peer[1])
        times = best_time(*jobs)
        ours = times[0] / len(q) * 1e6
        numpy = times[1] / min(len(q), 5000) * 1e6
        walls = best_time(lambda: fast.ik(goal), lambda: fast.ik(goal, workers=2), clock=time.perf_counter)
        wall = ", ".join(f"{t / len(q) * 1e6:.3f}" for t in walls)
        fast.ik(goal[0])
        single = min(best_time(*[lambda k=k: [fast.ik(goal[k]) for _ in range(20)] for k in range(40)])) / 20 * 1e6
        theirs = times[2] / peer[2] * 1e6 if peer else np.nan
        print(
            f"| {name} | {ours:.3f} | {wall} | {numpy:.3f} | {peer[0] if peer else '-'} "
            f"| {theirs:.2f} | {theirs / ours:.0f} | {single:.1f} |",
            flush=True,
        )


def print_agreement(count: int, only: str | None) -> None:
    print("| arm | poses | exported: edges | different | joints apart | fk apart | compiled: different |")
    print("|---|---|---|---|---|---|---|")
    for name, _, share in ROWS:
        if only and name != only:
            continue
        arm = armkin.load(ROBOTS / f"{name}.yaml")
        N = int(count * share) if not only else count
        with tempfile.TemporaryDirectory() as folder:
            compared = compare_answers(arm, Path(folder), N)
        q = random_joints(arm, N)
        goal = targets_of(arm, None, q)
        a, b = armkin.ik(arm, goal), armkin.compile(arm).ik(goal)
        masks = ("valid", "within_limits", "branch", "status")
        alike = a.q.shape == b.q.shape and np.all(
            [np.equal(getattr(a, m), getattr(b, m)).reshape(N, -1).all(axis=1) for m in masks], axis=0
        )
        unlike = int(np.sum(~alike)) if np.ndim(alike) else N
        print(
            f"| {name} | {N} | {compared.edges} | {len(compared.different)} | {compared.largest:.0e} "
            f"| {compared.largest_fk:.0e} | {unlike} |",
            flush=True,
        )
        for line in compared.different[:5]:
            print("   ", line)


_PEAK = """
import resource, sys, numpy as np, armkin
arm = armkin.load(sys.argv[1]); N = int(sys.argv[2])
sys.path.insert(0, sys.argv[4])
from bench_ik import random_joints, targets_of
fast = armkin.compile(arm) if sys.argv[3] == "compiled" else None
solve = fast.ik if fast else lambda goal: armkin.ik(arm, goal)
first = targets_of(arm, None, random_joints(arm, 5000))
goal = np.empty((N, *first.shape[1:]))
for k in range(0, N, 5000):
    goal[k : k + 5000] = targets_of(arm, None, random_joints(arm, 5000, k))
solve(goal[:5000])
before = int(open("/proc/self/statm").read().split()[1]) * resource.getpagesize()
s = solve(goal)
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
names = ("q", "valid", "within_limits", "branch", "status", "free", "complete", "rounding")
results = sum(getattr(s, name).nbytes for name in names)
if not np.shares_memory(s.target, goal):  # the results keep their own
    results += s.target.nbytes
print(results / 1e6, (peak - before - results) / 1e6)
"""


def print_memory(count: int, only: str | None) -> None:
    print("| arm | way | results MB | peak beyond the results MB |")
    print("|---|---|---|---|")
    for name, _, share in ROWS[:8]:
        if only and name != only:
            continue
        for way in ("compiled", "numpy"):
            words = [sys.executable, "-c", _PEAK, str(ROBOTS / f"{name}.yaml"), str(int(count * share)), way]
            completed = subprocess.run([*words, str(Path(__file__).parent)], capture_output=True, text=True, check=True)
            results, beyond = map(float, completed.stdout.split())
            print(f"| {name} | {way} | {results:.0f} | {beyond:.0f} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--poses", type=int, default=80_000)
    parser.add_argument("--agree", type=int, metavar="N")
    parser.add_argument("--memory", type=int, metavar="N")
    parser.add_argument("--only", help="one robot")
    args = parser.parse_args()
    if args.agree:
        print_agreement(args.agree, args.only)
    elif args.memory:
        print_memory(args.memory, args.only)
    else:
        print_speed(args.poses, args.only)


if __name__ == "__main__":
    main()
