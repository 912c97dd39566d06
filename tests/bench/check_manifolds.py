"""Self-motions beside singular postures: rows on one manifold, and postures on none that is listed, by small steps.

    python tests/bench/check_manifolds.py [targets] [seed] [arm ...]

Poses are random, with a third of the joints 1e-9 to 0.03 rad beside a multiple of 45 degrees. Of those that are
answered as singular, twice: targets with two rows that a walk in small steps finds on one manifold; lost: targets of
which a search from 64 random postures ends at one from which no walk comes by a row. 60 of an arm take 40 s.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import armkin
from armkin.formula.arrays import Array
from armkin.inverse.numeric import newton
from armkin.inverse.tasks.choose_task import task_for

sys.path.insert(0, str(Path(__file__).parents[1] / "inverse"))
from bench_ik import random_joints
from small_steps import manifolds, walk

POSES = 20_000
ARMS = ("puma560", "ur5e", "irb120", "ar4", "thor")
AT_ROW = 1e-5  # distance [rad] of a posture from a row that is the same


def main() -> None:
    words = sys.argv[1:]
    count, seed = int(words[0]) if words else 100, int(words[1]) if len(words) > 1 else 1
    print("arm              singular  asked   rows  twice   lost")
    for name in words[2:] or ARMS:
        print(manifold_row(name, count, seed), flush=True)


def manifold_row(name: str, count: int, seed: int) -> str:
    arm = armkin.load(name)
    T = armkin.fk(arm, beside_round(arm, POSES, seed))
    s = armkin.ik(arm, T, "pose")
    singular = np.flatnonzero(s.status == armkin.Status.SINGULAR)
    picked = np.random.default_rng(seed).permutation(singular)[:count]
    twice, lost = [], []
    for k in picked.tolist():
        rows = s.q[k][s.valid[k]]
        if len(manifolds(arm, T[k], rows)) < len(rows):
            twice.append(k)
        if is_lost(arm, T[k], rows):
            lost.append(k)
    row_count = int(s.valid[picked].sum())
    text = f"{name:16s} {len(singular):8d} {len(picked):6d} {row_count:6d} {len(twice):6d} {len(lost):6d}"
    return text + (f"   twice {twice}" if twice else "") + (f"   lost {lost}" if lost else "")


def beside_round(arm: armkin.Arm, count: int, seed: int) -> Array:
    """Random postures (count, n), a third of whose joints are beside a multiple of 45 degrees."""
    q, rng = random_joints(arm, count, seed), np.random.default_rng(seed)
    distance = 10.0 ** rng.uniform(-9.0, -1.5, q.shape) * rng.choice([-1.0, 1.0], q.shape)
    near_round = ~arm.prismatic & (rng.random(q.shape) < 0.35)
    return np.where(near_round, np.pi / 4 * np.rint(q / (np.pi / 4)) + distance, q)


def is_lost(arm: armkin.Arm, T: Array, rows: Array) -> bool:
    """Whether a search finds a posture that is no row, and on no row's manifold."""
    task = task_for(arm, "pose")
    found = newton.many_starts(arm, task, T[None], np.ones(1, bool))[0]
    found = found[~np.isnan(found[:, 0])]
    found = found[newton.misses(arm, task, found, T[None].repeat(len(found), axis=0)) < 1e-10]
    for q in found:
        if newton.wrapped_distance(arm, rows, q).min(initial=np.inf) > AT_ROW:
            postures = np.concatenate([rows, q[None]])
            if not any(walk(arm, T, postures, len(rows), sense) for sense in (1.0, -1.0)):
                return True
    return False


if __name__ == "__main__":
    main()
