"""An arm that stands at a posture and is asked for its own pose in few digits: how many joints' best branch moves.

Half of the postures have joint 5 straight, half have every joint at multiples of 15 degrees, every fourth so that the
rotation is one by right angles where the arm has such a posture. The pose is rounded to 6 to 16 decimals of millimetres
and cosines, to as many significant digits, and to float32; asked in numpy, from `armkin.compile`, of exported C, double
and single (the general elimination is exported in double alone), and of exported JavaScript. A joint moves where it
turns by more than 1e-5 rad.

python tests/bench/bench_standing.py [ROBOT...] [--poses 100] [--seed 0]
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

import armkin
from armkin.errors import UsageError

sys.path.insert(0, str(Path(__file__).parents[1] / "export"))
from exported_c import Exported
from exported_js import ask_module

ARMS = ["ur5e", "puma560", "irb120", "jaco_j2n6s300", "fanuc_crx10ia", "ur10e", "xarm6", "kuka_kr6_r700", "thor", "ar4"]
DIGITS = ["float32", *(f"{digits}{kind}" for kind in "fg" for digits in (6, 7, 8, 9, 10, 12, 14, 16))]
MOVES = 1e-5  # [rad]
RIGHT_ANGLES = 400  # postures that one is drawn from whose rotation is by right angles
Best = Callable[[np.ndarray, np.ndarray], np.ndarray]


def postures(arm: armkin.Arm, count: int, rng: np.random.Generator) -> np.ndarray:
    low, high = np.clip(arm.lower, -3.0, 3.0), np.clip(arm.upper, -3.0, 3.0)
    q = rng.uniform(low, high, (count, arm.n))
    q[::2, 4] = 0.0
    q[1::2] = np.radians(15.0 * np.rint(np.degrees(q[1::2]) / 15.0))
    q = np.clip(q, low, high)
    typed = np.radians(15.0 * np.rint(np.degrees(rng.uniform(low, high, (RIGHT_ANGLES * count, arm.n))) / 15.0))
    R = armkin.fk(arm, typed := np.clip(typed, low, high))[:, :3, :3]
    right = typed[(np.abs(R - np.rint(R)) < 1e-14).all(axis=(1, 2))][: count // 4]
    q[1 : 1 + 4 * len(right) : 4] = right
    return q


def round_poses(T: np.ndarray, digits: str) -> np.ndarray:
    """Poses with so many decimals (f) or significant digits (g)."""
    if digits == "float32":
        return T.astype(np.float32)
    return np.array([float(f"{x:.{digits}}") for x in T.ravel()]).reshape(T.shape)


def best_of(solve: Callable[..., armkin.Solutions]) -> Best:
    """The best branch of each target (N, n), nan where there is none."""

    def best(T: np.ndarray, q: np.ndarray) -> np.ndarray:
        solutions = solve(T, near=q)
        chosen_q = solutions.q[np.arange(len(q)), np.maximum(solutions.best, 0)]
        return np.where(solutions.best[:, None] < 0, np.nan, chosen_q)

    return best


def in_c(code: Exported) -> Best:
    def best(T: np.ndarray, q: np.ndarray) -> np.ndarray:
        answers = (code.ik(np.asarray(target, float), near) for target, near in zip(T, q, strict=True))
        return np.array([rows[at] if count > 0 and at >= 0 else np.full(len(q[0]), np.nan)
                         for count, _, rows, at in answers])  # fmt: skip

    return best


def in_js(arm: armkin.Arm, folder: Path) -> Best:
    def best(T: np.ndarray, q: np.ndarray) -> np.ndarray:
        answers = ask_module(arm, folder, q, near=q, targets=np.asarray(T, float))["ik"]
        nothing = [np.nan] * arm.n
        return np.array(
            [nothing if answer["best"] is None else answer["branches"][answer["best"]]["joints"] for answer in answers]
        )

    return best


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("robots", nargs="*", default=ARMS)
    parser.add_argument("--poses", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    print("robot | asked of | poses x digits | moved | most [rad]")
    for name in arguments.robots:
        arm = armkin.load(name)
        fast = armkin.compile(armkin.load(name))
        q = postures(arm, arguments.poses, rng)
        with tempfile.TemporaryDirectory() as folder:
            ways: dict[str, Best] = {"numpy": best_of(lambda T, near, arm=arm: armkin.ik(arm, T, near=near)),
                                     "compiled": best_of(fast.ik)}  # fmt: skip
            for words, single in (("C", False), ("C float", True)):
                try:
                    ways[words] = in_c(Exported(arm, Path(tempfile.mkdtemp(dir=folder)), single))  # a library a folder
                except UsageError:  # the general elimination in float
                    continue
            ways["JS"] = in_js(arm, Path(folder))
            for words, best in ways.items():
                standing = q.astype(np.float32).astype(float) if words == "C float" else q
                T = armkin.fk(arm, standing)
                moved, worst = {}, 0.0
                for digits in DIGITS:
                    motion = np.abs(best(round_poses(T, digits), standing) - standing).max(axis=1)
                    moved[digits] = int((~(motion <= MOVES)).sum())
                    worst = max(worst, float(np.nan_to_num(motion, nan=np.inf).max()))
                moved_text = ", ".join(f"{count} at {digits}" for digits, count in moved.items() if count)
                print(
                    f"{name} | {words} | {arguments.poses} x {len(DIGITS)} | {moved_text or 0} | {worst:.1e}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
