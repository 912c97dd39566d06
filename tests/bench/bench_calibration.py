"""Calibration against simulated workshops: the bars' figures, 200 seeds for harm, time.

    python tests/bench/bench_calibration.py [seeds for harm, by default 200]

The truth is made by tests/calibration/built_arms.py.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

import armkin

sys.path[:0] = [str(Path(__file__).parents[1] / "calibration")]
from built_arms import Built, build_real_arm, measure_tips, random_commands, rms_distance  # noqa: E402

# arm, noise [mm], play [deg], what a prototype reached [mm]; the bar is 1.5 times as much
FIGURES = [
    ("ur5e", 0.1, 0.0, 0.079),
    ("ar4", 0.1, 0.0, 0.082),
    ("ar4", 1.0, 0.0, 0.68),
    ("ar4", 0.1, 0.1, 0.48),
    ("three_dof", 0.1, 0.0, 0.064),
    ("moveo", 0.1, 0.0, 0.066),
    ("so101", 1.0, 0.0, 0.62),
]


def print_figures() -> None:
    print("| arm | noise/mm | play/deg | file/mm | calibrated/mm | prototype/mm | s |\n|---|---|---|---|---|---|---|")
    for name, noise, play, figure in FIGURES:
        arm = armkin.load(name)
        rows = []
        for seed in range(4):
            rng = np.random.default_rng(100 + seed)
            real_arm = build_real_arm(arm, seed)
            c = random_commands(arm, 60, rng)
            x = measure_tips(real_arm, c, rng, noise=noise)
            if play:
                x += real_arm.tips(c + np.radians(play) * rng.uniform(-1, 1, c.shape)) - real_arm.tips(c)
            began = time.process_time()
            calibrated = armkin.calibrate(arm, c, x).arm
            seconds = time.process_time() - began
            unseen = random_commands(arm, 1000, rng)
            want = real_arm.tips(unseen)
            rows.append([*(rms_distance(armkin.fk(a, unseen)[:, :3, 3], want) for a in (arm, calibrated)), seconds])
        before, after, seconds = np.median(rows, axis=0)
        flag = "" if after <= 1.5 * figure else " (above the bar)"
        print(
            f"| {name} | {noise} | {play} | {before:.1f} | {after:.3f}{flag} | {figure} | {seconds:.1f} |", flush=True
        )


def print_harm(seeds: int) -> None:
    """In how many of so many seeds unseen rows are at most 1.05 times as far off as with the file."""
    print("\n| arm | rows | noise/mm | base off | at most 1.05 times the file's |\n|---|---|---|---|---|")
    for name in ("three_dof", "ar4"):
        for count, noise, base in ((4, 0.1, True), (4, 0.1, False), (4, 1.0, False), (10, 1.0, False), (4, 0.1, None)):
            arm = armkin.load(name)
            good = 0
            for seed in range(seeds):
                rng = np.random.default_rng(1000 + seed)
                real_arm = Built(arm, np.ones(arm.n)) if base is None else build_real_arm(arm, seed, base=base)
                c, unseen = random_commands(arm, count, rng), random_commands(arm, 300, rng)
                calibrated = armkin.calibrate(arm, c, measure_tips(real_arm, c, rng, noise=noise, wrong=0.0)).arm
                tips = measure_tips(real_arm, unseen, rng, noise=noise, wrong=0.0)
                after, before = (rms_distance(armkin.fk(a, unseen)[:, :3, 3], tips) for a in (calibrated, arm))
                good += after <= 1.05 * before
            helped = {True: "yes", False: "no", None: "file right"}[base]
            print(f"| {name} | {count} | {noise} | {helped} | {100 * good / seeds:.1f} % |", flush=True)


if __name__ == "__main__":
    print_figures()
    print_harm(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
