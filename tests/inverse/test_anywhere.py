"""Three axes that are parallel or meet in the middle of an arm: closed forms, complete at every random pose."""

from __future__ import annotations

import numpy as np
import pytest
import truth
from geometries import Case, case_of, random_case, right_angles
from oracle import goal_of_joints

import armkin
from armkin.inverse.elimination import method
from armkin.inverse.solvers.solver_of_arm import solver

RIGHT_ANGLED = {  # seeds of arms that the elimination settles never, hardly ever or slowly, and their class
    168: "three axes that meet",  # 3, 4 and 5: the elimination has a singular pencil's roots at joint 4 = 0 and 180
    196: "three parallel axes",  # 4, 5 and 6
    2: "three axes that meet",  # 2, 3 and 4
    0: "three parallel axes",  # 3, 4 and 5, axes 1 and 2 apart
    46: "three parallel axes",  # 1, 2 and 3
}


def right_angled_case(seed: int) -> Case:
    return case_of(right_angles(np.random.default_rng(seed)), "pose")


@pytest.mark.parametrize("seed", RIGHT_ANGLED)
def test_right_angled_arms_are_complete(seed: int) -> None:
    arm, screw, task = right_angled_case(seed)
    assert armkin.method(arm, task)[0] == RIGHT_ANGLED[seed]
    q = np.random.default_rng(1).uniform(-np.pi, np.pi, (400, 6))
    verdict = truth.judge(arm, screw, task, q, goal_of_joints(solver(arm, task)[0], screw, q).array())
    assert verdict, str(verdict)
    assert verdict.solutions.complete.mean() >= 0.99


@pytest.mark.parametrize("seed", RIGHT_ANGLED)
def test_round_postures_and_singular_surfaces_of_right_angled_arms(seed: int) -> None:
    arm, screw, task = right_angled_case(seed)
    definition, _ = solver(arm, task)
    kinds = {f"multiples of {step}": truth.round_postures(arm, step, 4, seed=2) for step in (90, 45)}
    kinds |= truth.singular_postures(arm, screw, task, 2, seed=2)
    q = np.concatenate(list(kinds.values()))
    target = goal_of_joints(definition, screw, q).array()
    for near in (None, q):
        verdict, report = truth.judge_kinds(arm, screw, kinds, target, near, task)
        assert verdict, report


@pytest.mark.parametrize(
    ("seed", "kind", "count", "rows"),
    [
        (46, "J4 = 90", 60, [9, 12]),  # joint 5 is free, and few of its values leave the others a solution
        (131, "J3 moved", 60, [5]),  # two double roots of the quartic
        (40, 90.0, 60, [9, 29]),  # joints 2 and 6 are free, and for one value of theirs joint 1 is
        (155, 90.0, 60, [45]),
        (168, "J4 moved", 60, [1]),  # a fold where the wrist is straight: one self-motion, two of its postures
    ],
)
def test_postures_that_were_lost(seed: int, kind: str | float, count: int, rows: list[int]) -> None:
    arm, screw, task = right_angled_case(seed)
    if isinstance(kind, str):
        q = truth.singular_postures(arm, screw, task, count)[kind][rows]
    else:
        q = truth.round_postures(arm, kind, count)[rows]
    target = goal_of_joints(solver(arm, task)[0], screw, q).array()
    for near in (None, q):
        verdict = truth.judge(arm, screw, task, q, target, near)
        assert verdict, str(verdict)


@pytest.mark.parametrize(
    "name",
    [
        "three parallel axes 1, 2, 3",
        "three parallel axes 4, 5, 6",
        "three parallel axes 2, 3, 4, none meet",
        "three parallel axes 2, 3, 4, and 5, 6",
        "three axes that meet 3, 4, 5",
    ],
)
def test_as_many_branches_as_the_elimination_finds(name: str) -> None:
    arm, _, task = random_case(name, 1)
    T = armkin.fk(arm, np.random.default_rng(3).uniform(-np.pi, np.pi, (150, 6)))
    s = armkin.ik(arm, T, task)
    assert s.complete.all()
    assert s.method in ("three parallel axes", "three axes that meet")
    solutions = method.solve(method.prepare(arm.link, arm.prismatic), T)
    exact = s.status == armkin.Status.EXACT  # two roots that a curve of solutions joins are one branch
    assert exact.mean() > 0.98
    assert (s.valid.sum(axis=1) == (~np.isnan(solutions.q[:, :, 0])).sum(axis=1))[exact].all()
