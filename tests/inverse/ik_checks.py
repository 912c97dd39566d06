"""What every answer of `armkin.ik` must satisfy, measured with the oracle."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import oracle
import truth
from numpy.typing import NDArray
from oracle import Goal, Screws

import armkin
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.model.arm import Arm

Array = NDArray[np.float64]


class Report(NamedTuple):
    """Figures over a batch of targets made from random joints."""

    arm: Arm
    screw: Screws
    goals: Goal
    q: Array  # (N, n) generating joints
    solutions: armkin.Solutions
    lost: NDArray[np.bool_]  # (N,) generating joints not among the branches
    weak: Array  # (N,) smallest singular value at the generating joints
    mm: float  # largest errors of any branch, by the oracle
    deg: float
    duplicates: int

    @property
    def counts(self) -> NDArray[np.int64]:
        return np.asarray(self.solutions.valid.sum(axis=1))


def random_joints(screw: Screws, count: int, seed: int) -> Array:
    """Joint values over a whole turn, slides over +-500 mm."""
    rng = np.random.default_rng(seed)
    n = len(screw.prismatic)
    turn, slide = rng.uniform(-np.pi, np.pi, (count, n)), rng.uniform(-500, 500, (count, n))
    return np.where(screw.prismatic, slide, turn)


def examine_answers(arm: Arm, screw: Screws, task: str | None, q: Array) -> Report:
    """Solve for what the joints q (N, n) reach and compare with the oracle."""
    definition, _ = solver(arm, task)
    goals = oracle.goal_of_joints(definition, screw, q)
    s = armkin.ik(arm, goals.array(), task)
    weak = oracle.weakness(screw, goals, q)
    nearest = oracle.distance(screw, s.q, q[:, None]).min(axis=1, initial=np.inf)
    # the square root of rounding is all that a double root can be known to
    lost = nearest > 1e-6 + np.minimum(1e-13 / np.maximum(weak, 1e-300), 1e-3)
    # two roots are one branch if what is between them solves the target: half way, moved onto the curve that joins them
    for k in np.flatnonzero(lost & (nearest < 0.3)):
        d = s.q[k, int(oracle.distance(screw, s.q[k], q[k]).argmin())] - q[k]
        middle = q[k] + 0.5 * np.where(screw.prismatic, d, d - 2 * np.pi * np.rint(d / (2 * np.pi)))
        across = truth.settle_across(screw, goals.take([k]), middle[None], weak=1e-4)
        onto = bool(oracle.distance(screw, across[0], middle) > 0.1 * nearest[k])  # one of the two
        residual, turned = oracle.pose_error(screw, goals.take([k]), across)
        # of a rotation's three columns two are at right angles to its axis, and each moves by the angle
        angle = turned[0] / (np.sqrt(2.0) if goals.orientation == "full" else 1.0)
        lost[k] = onto or np.hypot(residual[0] / arm.reach, angle) > 1e-9
    B = s.q.shape[1]
    rows, columns = np.nonzero(s.valid)
    mm, rad = oracle.pose_error(screw, goals.take(rows), s.q[rows, columns])
    duplicates = 0
    for i in range(B):
        for j in range(i):
            duplicates += int((oracle.distance(screw, s.q[:, i], s.q[:, j]) < 1e-6).sum())
    assert np.isnan(s.q[~s.valid]).all()
    return Report(
        arm, screw, goals, q, s, lost, weak,
        float(mm.max(initial=0.0)), float(np.degrees(rad.max(initial=0.0))), duplicates,
    )  # fmt: skip


def not_found(report: Report, rows: NDArray[np.int64], starts: int, seed: int) -> list[tuple[int, Array]]:
    """Solutions that the multi-start oracle knows and `armkin.ik` does not: (row, joints)."""
    branches = oracle.branches(report.screw, report.goals.take(rows), starts, seed)
    unlisted = []
    for row, solutions in zip(rows, branches, strict=True):
        if not len(solutions):
            continue
        ours = report.solutions.q[row]
        d = oracle.distance(report.screw, solutions[:, None], ours[None]).min(axis=1, initial=np.inf)
        unlisted += [(int(row), q) for q in solutions[d > 1e-5]]
    return unlisted
