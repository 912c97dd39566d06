"""Exported C at every singular posture of every class: the flag of an edge, and an arm that stands there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import truth
from exported_c import Exported
from shipped_arms import shipped_arm

from armkin.inverse.solvers.solver_of_arm import solver
from armkin.inverse.tasks.task import targets_of

ONE_OF_A_CLASS = ["puma560", "ur5e", "wx250s", "stanford", "labvolt_5150", "three_dof", "cobra600", "planar_2dof"]


@pytest.mark.parametrize("single", [False, True])
@pytest.mark.parametrize("robot", ONE_OF_A_CLASS)
def test_every_singular_posture_is_an_edge(robot: str, single: bool, tmp_path: Path) -> None:
    """Wrists, elbows and shoulders, of poses that the exported fk makes itself, in its own precision.

    Of 300 Pumas with a straight wrist the flag was missing on 288 in float. An arm that stands there stays: where a
    joint is free `near` decides it.
    """
    arm, screw = shipped_arm(robot)
    code, (task, _) = Exported(arm, tmp_path, single), solver(arm, None)
    kinds = truth.singular_postures(arm, screw, None, 8, seed=4)
    assert len(kinds) >= 2
    for kind, q in kinds.items():
        q = q.astype(code.real).astype(float)
        poses = np.array([code.fk(posture) for posture in q])
        for near, target in zip(q, targets_of(task, poses, q), strict=True):
            assert code.ik(target, arm.home)[1], kind
            if ((near >= arm.lower) & (near <= arm.upper)).all():
                count, _, rows, best = code.ik(target, near)
                assert count > 0, kind
                np.testing.assert_allclose(rows[best], near, atol=1e-6 if single else 0.0, err_msg=kind)
