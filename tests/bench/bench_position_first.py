"""Position first against brute force: 1,000 targets of four arms.

python tests/bench/bench_position_first.py [targets] [arm] [first target]

Every joint but the first three on a grid, these by Newton's method from random postures; the best of all are refined
by stencils that shrink around them, so that what brute force finds is a minimum to about 1e-8 degrees, of the same
basin or another. No answer may be worse by 1e-6 degrees; what is listed is within limits and at the position.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

import armkin
from armkin.forward import tip_and_jacobian

sys.path.insert(0, str(Path(__file__).parents[1] / "inverse"))
from position_first_targets import ARMS, random_targets

GRID = {1: 200, 2: 28}  # values of each joint but the first three, by how many these are
STARTS = {1: 16, 2: 8}
BEST = (24, 8, 4)  # postures refined: at first, after 6 and after 11 stencils
ROUNDS = 34
WORSE = np.deg2rad(1e-6)


def move_onto(arm: armkin.Arm, q: np.ndarray, p: np.ndarray, steps: int) -> np.ndarray:
    """Postures (M, n) with the first three joints moved to where the tool is at p [mm]."""
    unit = np.where(arm.prismatic[:3], arm.reach, 1.0)
    q, nudge = q.copy(), arm.reach * 1e-9 * np.random.default_rng(0).normal(size=(3, 3))
    for _ in range(steps):
        T, J = tip_and_jacobian(arm, q)
        move = np.linalg.solve(J[:, :3, :3] * unit + nudge, (p - T[:, :3, 3])[:, :, None])[:, :, 0]
        q[:, :3] += move * np.minimum(1.0, 0.5 / np.maximum(np.abs(move).max(axis=1), 0.5))[:, None] * unit
    return q


def angles_and_copies(arm: armkin.Arm, q: np.ndarray, T: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The angle to a target (M,) [rad], infinite beyond limits and beside its position; the nearest copies (M, n)."""
    wrapped = np.where(arm.prismatic, q, q - 2 * np.pi * np.rint(q / (2 * np.pi)))
    for turn in (2 * np.pi, -2 * np.pi):
        beyond = (wrapped < arm.lower) if turn > 0 else (wrapped > arm.upper)
        wrapped = np.where(beyond & ~arm.prismatic, wrapped + turn, wrapped)
    pose = armkin.fk(arm, q)
    legal = ((wrapped >= arm.lower - 1e-12) & (wrapped <= arm.upper + 1e-12)).all(axis=1)
    legal &= np.abs(pose[:, :3, 3] - T[:3, 3]).max(axis=1) < 1e-8 * arm.reach
    chord = np.sqrt(((pose[:, :3, :3] - T[:3, :3]) ** 2).sum(axis=(1, 2)) / 8.0)
    return np.where(legal, 2.0 * np.arcsin(np.minimum(1.0, chord)), np.inf), wrapped


def by_brute_force(arm: armkin.Arm, T: np.ndarray, rng: np.random.Generator) -> float:
    """The least angle [rad] to one target; infinite if no posture of the grid reaches it."""
    free = arm.n - 3
    low, high = np.where(np.isfinite(arm.lower), arm.lower, -np.pi), np.where(np.isfinite(arm.upper), arm.upper, np.pi)
    axes = [np.linspace(a, b, GRID[free]) for a, b in zip(low[3:], high[3:], strict=True)]
    free_values = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, free).repeat(STARTS[free], axis=0)
    q = np.concatenate([rng.uniform(low[:3], high[:3], (len(free_values), 3)), free_values], axis=1)
    angle, q = angles_and_copies(arm, move_onto(arm, q, T[:3, 3], 14), T)
    stencil = np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, 5)] * free, indexing="ij"), axis=-1).reshape(-1, free)
    size, count = (high - low)[3:] / (GRID[free] - 1), BEST[0]
    for k in range(ROUNDS):
        best = np.argsort(angle)[:count]
        angle, q = angle[best], q[best]
        beside = q.repeat(len(stencil), axis=0)
        beside[:, 3:] = np.clip(beside[:, 3:] + np.tile(stencil * size, (len(q), 1)), low[3:], high[3:])
        angles, beside = angles_and_copies(arm, move_onto(arm, beside, T[:3, 3], 4 if k < 6 else 2), T)
        angles = angles.reshape(len(q), -1)
        place, rows = angles.argmin(axis=1), np.arange(len(q))
        better = angles[rows, place] < angle
        q = np.where(better[:, None], beside.reshape(len(q), -1, arm.n)[rows, place], q)
        angle = np.minimum(angle, angles[rows, place])
        size = size * (0.62 if better.any() else 0.5)
        count = BEST[(k >= 5) + (k >= 10)]
    return float(angle.min())


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000
    names = sys.argv[2:3] or ARMS
    first = int(sys.argv[3]) if len(sys.argv) > 3 else 0
    print("arm            targets  ms each  worse  equal to 1e-6 deg  brute force worse, deg at most  position off, mm")
    for name in names:
        arm = armkin.load(name)
        T = random_targets(arm, max(1_000, first + count), 7)[first : first + count]
        start = time.process_time()
        s = armkin.ik(arm, T, "pose", position_first=True)
        spent = (time.process_time() - start) / count
        assert s.angle is not None
        rng = np.random.default_rng(first)
        gain = np.array([by_brute_force(arm, goal, rng) for goal in T]) - s.angle[:, 0]
        error = np.abs(armkin.fk(arm, s.q[:, 0])[:, :3, 3] - T[:, :3, 3]).max()
        print(
            f"{name:14s} {count:7d} {1e3 * spent:8.1f} {(gain < -WORSE).sum():6d} {(np.abs(gain) <= WORSE).sum():18d} "
            f"{np.rad2deg(gain[np.isfinite(gain)].max()):31.4f} {error:17.1e}",
            flush=True,
        )


if __name__ == "__main__":
    main()
