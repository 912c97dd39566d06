"""Arms with one joint more than the target asks for: targets, legal postures with that joint held, intervals."""

from __future__ import annotations

import numpy as np

import armkin
from armkin.model.arm import from_links


def arm_with_shoulder_and_wrist(rng: np.random.Generator, limits: np.ndarray) -> armkin.Arm:
    """Seven axes anywhere, but for a shoulder and a wrist."""
    links = np.tile(np.eye(4), (8, 1, 1))
    for k in range(8):
        Q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        links[k, :3, :3] = Q * np.linalg.det(Q)
        if k not in (1, 2, 5):
            links[k, :3, 3] = 200 * rng.normal(size=3)
    return from_links(links, [False] * 7, limits=limits)


def redundant_postures(arm: armkin.Arm, task: str | None, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Joint values within limits (N, n), and the targets that they reach."""
    low, high = np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi)
    q = np.random.default_rng(seed).uniform(low, high, (count, arm.n))
    T = armkin.fk(arm, q)
    return q, T[:, :2, 3] if task == "xy" else T


def held_answers(arm: armkin.Arm, joint: int, value: float, target: np.ndarray, task: str | None) -> np.ndarray:
    """Legal postures (B, n) with the redundant joint held: the arm is built anew, as `--lock` does.

    Neither what stands between two roots that have just vanished is one, which misses its target by 1e-12 and more (an
    answer by 1e-14), nor what lies beyond a limit within its slack of 1e-9 rad: an interval ends where the limit is.
    """
    held = {arm.joint_names[joint]: value}
    s = armkin.ik(armkin.lock(arm, held), target, task, examine=False)
    mm, rad = s.residual()
    exact = s.within_limits & (np.maximum(mm / arm.reach, np.nan_to_num(rad)) <= 1e-13)
    q = armkin.unlock(arm, held, s.q[exact])
    return np.asarray(q[((q >= arm.lower - 1e-12) & (q <= arm.upper + 1e-12)).all(axis=1)])


def covers_value(arm: armkin.Arm, intervals: np.ndarray, value: float | np.ndarray, slack: float = 1e-8) -> np.ndarray:
    """Which intervals (B, 2) hold a value, modulo whole turns."""
    middle, half = intervals.mean(axis=-1), np.ptp(intervals, axis=-1) / 2
    return np.asarray(np.abs(np.remainder(value - middle + np.pi, 2 * np.pi) - np.pi) <= half + slack)


def assert_ends(arm: armkin.Arm, intervals: np.ndarray, joint: int, target: np.ndarray) -> None:
    """Beside each end of intervals (B, 2), 2e-8 rad from it, as many hold the value as the arm with the joint held has
    legal postures."""
    for end in np.unique(intervals.ravel().round(9)):
        for value in (float(end) - 2e-8, float(end) + 2e-8):
            if arm.lower[joint] < value < arm.upper[joint]:
                own = held_answers(arm, joint, value, target, None)
                assert covers_value(arm, intervals, value, 0.0).sum() == len(own), np.rad2deg(value)
