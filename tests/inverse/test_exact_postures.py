"""Words and branches of 2,700 typed postures against exact arithmetic: `exact_postures`."""

from __future__ import annotations

from collections.abc import Callable

import exact_postures
import numpy as np
import pytest
import truth
from geometries import Case, case_of
from oracle import distance, goal_of_joints

import armkin
from armkin import Status
from armkin.inverse.solvers.solver_of_arm import solver

POSTURES = exact_postures.read_postures()
REACH = 0.1  # [rad, reaches] how far a component reaches that is no manifold: docs/solution.md


def arm_of(name: str) -> Case:
    task, kinds, table = exact_postures.ARMS[name]
    rows = [
        {
            "dh": {"alpha": 90 * alpha, "a": a, "d": d, "theta": 0},
            "type": "prismatic" if kind == "P" else "revolute",
        }
        for kind, (d, a, alpha) in zip(kinds, table, strict=True)
    ]
    return case_of({"convention": "standard", "joints": rows}, task)


def test_there_are_2000_of_every_kind() -> None:
    kinds = {(row.lost, row.multiplicity) for row in POSTURES}
    assert len(POSTURES) >= 2000
    assert kinds >= {(0, 1), (1, 2), (1, 0), (2, 0)}


def test_the_file_is_what_its_script_computes() -> None:
    field = exact_postures.Field(exact_postures.PRIMES[0])
    for row in POSTURES[::97]:
        assert exact_postures.posture_structure(field, row.arm, row.angles) == row


@pytest.mark.parametrize("name", exact_postures.ARMS)
def test_the_word_is_what_exact_arithmetic_says(name: str, sample: Callable[[int, int], int]) -> None:
    """Simple roots are branches, whatever else the target has; multiple ones boundaries; curves free their joints."""
    c, rows = arm_of(name), [row for row in POSTURES if row.arm == name][:: 3 - sample(2, 1)]
    kinds = exact_postures.ARMS[name][1]
    q = np.array([exact_postures.joint_values(kinds, row.angles) for row in rows])
    T = armkin.fk(c.arm, q)
    s = armkin.ik(c.arm, T if c.task == "pose" else T[:, :3, 3], c.task)
    away = distance(c.screw, s.q, q[:, None]).min(axis=1, initial=np.inf)
    wrong = []
    for k, row in enumerate(rows):
        status = s.status[k]
        if row.multiplicity == 1:
            good = away[k] < 1e-6
        elif row.multiplicity:
            good = (status == Status.BOUNDARY and away[k] < REACH) or status == Status.SINGULAR
        elif row.lost > 1 and status == Status.BOUNDARY:  # curves that cross may be complex: x^2 + y^2 = 0 is one point
            goals = goal_of_joints(solver(c.arm, c.task)[0], c.screw, q[[k]])
            good = away[k] < REACH and not any(truth.can_move(c.screw, goals, q[[k]], j).any() for j in range(c.arm.n))
        else:
            moving = [int(j) - 1 for j in row.moving]
            good = status == Status.SINGULAR and bool(s.free[k, moving].all())
        if not good:
            wrong.append((row, Status(int(status)).name, s.free[k].tolist(), float(away[k])))
    assert not wrong
