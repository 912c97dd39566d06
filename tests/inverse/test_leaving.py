"""As an arm leaves a singular family its target's word changes once at most each: singular, boundary, exact."""

from __future__ import annotations

import numpy as np
import pytest
import truth
from oracle import goal_of_joints
from shipped_arms import shipped_arm

import armkin
from armkin import Status
from armkin.inverse.singular.local_structure import local_structure
from armkin.inverse.solvers.solver_of_arm import solver

OFFSETS = np.array([0.0, 1e-12, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2])
RANK = {Status.SINGULAR: 2, Status.BOUNDARY: 1, Status.EXACT: 0}
COUNT = 1  # postures a family
NAMES = [
    *("yaw_two_link", "three_dof", "ra02", "labvolt_5150", "cobra600", "stanford", "irb120", "irb2400", "puma560"),
    *("ur3e", "ur5e", "xarm6", "jaco_j2n6s300", "fanuc_crx10ia", "ar4", "kuka_kr6_r700", "mycobot_280", "parol6"),
    *("thor", "wx250s"),
]


@pytest.mark.parametrize("name", NAMES)
def test_the_word_changes_in_one_order_and_never_back(name: str) -> None:
    """3e-8 rad off a straight wrist a Puma was a boundary, and 1e-7 off exact though 0.3 rad missed by 8e-10."""
    arm, screw = shipped_arm(name)
    task, _ = solver(arm, None)
    rng = np.random.default_rng(5)
    for family, postures in truth.singular_postures(arm, screw, None, COUNT, seed=2).items():
        for q0 in postures[:COUNT]:
            way = (
                rng.uniform(0.3, 1.0, arm.n) * rng.choice([-1.0, 1.0], arm.n) * np.where(arm.prismatic, arm.reach, 1.0)
            )
            q = q0 + OFFSETS[:, None] * way
            target = goal_of_joints(task, screw, q).array()
            s = armkin.ik(arm, target, near=q)
            rank = np.array([RANK.get(Status(int(word)), 3) for word in s.status])
            assert (np.diff(rank) <= 0).all(), f"{family}: {[Status(int(word)).name for word in s.status]}"
            structure = local_structure(arm, task, q, target)
            sure = structure.known & (structure.second > 1e-3)
            assert (rank[sure & structure.manifold] == 2).all(), family
            short = (
                structure.high - structure.low < 6e-4
            )  # of longer ones a closed form does not say that two roots are close
            assert (rank[sure & structure.boundary & short] >= 1).all(), family
