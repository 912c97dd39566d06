"""Seven joints: random reachable targets, whether one is lost, and intervals against brute force along the joint.

python tests/bench/bench_families.py [targets] [targets by brute force]

lost: no row. missed: the generating posture lies in no listed interval. ends off: places 1e-6 degrees inside and
outside of an interval's end, and between ends, where the arm with that joint held has another number of legal postures.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

import armkin

sys.path.insert(0, str(Path(__file__).parents[1] / "inverse"))
from redundant_arms import covers_value, held_answers, redundant_postures

from armkin.inverse.solvers.choose_redundant_joint import redundancy

Ik = Callable[[np.ndarray], armkin.Solutions]

ARMS = ("panda", "iiwa7", "kinova_gen3")
AT_ONCE = 1000  # targets in one call
END = 1e-8  # [rad]


def main() -> None:
    count, brute = (int(word) for word in (sys.argv[1:] + ["10000", "20"][len(sys.argv) - 1 :]))
    print("arm                  targets  ms each  alone, ms  intervals  lost  missed  places asked  ends off")
    for name in ARMS:
        arm = armkin.load(name)
        print(family_row(name, arm, partial(armkin.ik, arm), count, brute), flush=True)
        print(family_row(f"{name} compiled", arm, armkin.compile(arm).ik, count, brute), flush=True)


def family_row(name: str, arm: armkin.Arm, ik: Ik, count: int, brute: int) -> str:
    redundant = redundancy(arm, None)
    assert redundant is not None
    q, target = redundant_postures(arm, None, count, 11)
    ik(target[:1])
    lost = missed = rows = 0
    spent = 0.0
    for begin in range(0, count, AT_ONCE):
        start = time.process_time()
        s = ik(target[begin : begin + AT_ONCE])
        spent += time.process_time() - start
        assert s.interval is not None
        rows += int(s.within_limits.sum())
        lost += int((s.best < 0).sum())
        for k in range(len(s.valid)):
            missed += not covers_value(
                arm, s.interval[k][s.within_limits[k]], q[begin + k, redundant.joint], 1e-8
            ).any()
    alone = []
    for k in range(20):
        start = time.process_time()
        ik(target[k])
        alone.append(time.process_time() - start)
    places, wrong_counts = by_brute_force(arm, ik, redundant.joint, target[:brute])
    return (
        f"{name:20s} {count:7d} {1e3 * spent / count:8.2f} {1e3 * float(np.median(alone)):10.1f} {rows / count:10.2f}"
        f" {lost:5d} {missed:7d} {places:13d} {wrong_counts:9d}"
    )


def by_brute_force(arm: armkin.Arm, ik: Ik, joint: int, target: np.ndarray) -> tuple[int, int]:
    """How many places were asked, and at how many the listed intervals and the arm with the joint held disagree."""
    s, places, wrong_counts = ik(target), 0, 0
    assert s.interval is not None
    for k in range(len(target)):
        legal = s.interval[k][s.within_limits[k]]
        ends = np.sort(legal.ravel())
        ends = ends[np.diff(ends, prepend=-np.inf) > END]  # between ends that rounding parts is no place
        beside = np.deg2rad(1e-6) * np.array([[-1.0], [1.0]]) + ends
        for value in [*beside.ravel(), *(0.5 * (ends[1:] + ends[:-1]))]:
            if arm.lower[joint] < value < arm.upper[joint]:
                places += 1
                held = held_answers(arm, joint, float(value), target[k], None)
                wrong_counts += int(covers_value(arm, legal, float(value), 0.0).sum()) != len(held)
    return places, wrong_counts


if __name__ == "__main__":
    main()
