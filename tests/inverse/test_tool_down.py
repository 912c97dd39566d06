"""Tool up, down, level: poses that make axes 6 and 1 parallel, or let them meet, are complete like any others."""

from __future__ import annotations

import numpy as np
import pytest
import truth
from gen3_lite import arm_and_screws
from numpy.typing import NDArray

import armkin
from armkin import Arm
from armkin.inverse.elimination import choose_variable, method, pencil, roots
from armkin.inverse.elimination.closed_loop import roles
from armkin.model.rotation import inverse, rotation_about

Array = NDArray[np.float64]


def special_targets(arm: Arm, kind: str, count: int, tilt: float = 0.0) -> Array:
    """Targets whose axis 6 is parallel to axis 1, meets it, or is reached by turns of right angles."""
    rng = np.random.default_rng([3, count])
    first, last = arm.link[0], arm.link[-1]
    G = inverse(first) @ armkin.fk(arm, rng.uniform(-np.pi, np.pi, (count, arm.n))) @ inverse(last)
    quarter = np.pi / 2
    for k, (a, b, c) in enumerate(rng.integers(4, size=(count, 3))):
        free = rng.uniform(-np.pi, np.pi)
        if kind == "parallel":
            G[k, :3, :3] = rotation_about(2, free) @ rotation_about(0, 2 * quarter * a + tilt)
        elif kind == "right angles":
            G[k, :3, :3] = (
                rotation_about(2, quarter * a) @ rotation_about(0, quarter * b) @ rotation_about(2, quarter * c)
            )
        else:
            along = np.arctan2(G[k, 1, 2], G[k, 0, 2]) + tilt
            G[k, :2, 3] = np.hypot(*G[k, :2, 3]) * np.array([np.cos(along), np.sin(along)])
    return np.asarray(first @ G @ last)


@pytest.mark.parametrize("name", ["jaco_j2n6s300", "gen3_lite", "xarm6", "fanuc_crx10ia", "mycobot_280"])
@pytest.mark.parametrize("kind", ["parallel", "meeting", "right angles"])
def test_special_axes_are_complete(name: str, kind: str) -> None:
    """JACO with its tool straight down: no target was complete, and one took 30 ms."""
    arm, screw = arm_and_screws(name)
    T = special_targets(arm, kind, 40)
    solutions = armkin.ik(arm, T)
    assert solutions.complete.all()
    solved = np.flatnonzero(solutions.valid.any(axis=1))
    assert len(solved) > 20
    q = solutions.q[solved, solutions.valid[solved].argmax(axis=1)]
    verdict = truth.judge(arm, screw, None, q, T[solved])
    truth.ask_oracle(arm, screw, verdict, T[solved], np.arange(3), 250, 3)
    assert verdict, verdict


@pytest.mark.parametrize("tilt", [1e-12, 1e-7, 1e-4, 0.02])
def test_all_but_special_axes_are_complete(tilt: float) -> None:
    arm, _ = arm_and_screws("jaco_j2n6s300")
    for kind in ("parallel", "meeting"):
        exact, beside = (armkin.ik(arm, special_targets(arm, kind, 40, axis_tilt)) for axis_tilt in (0.0, tilt))
        assert beside.complete.all()
        same = exact.valid.sum(axis=1) == beside.valid.sum(axis=1)
        assert same.mean() >= (0.85 if tilt > 1e-3 else 1.0)


@pytest.mark.parametrize("hidden", [0, 1, 2])
def test_a_wide_pencil_has_the_joints_of_its_pose(hidden: int) -> None:
    """Each wide role of a JACO gives back the postures whose tool is down, where the others are singular."""
    arm, _ = arm_and_screws("jaco_j2n6s300")
    elimination = method.prepare(arm.link, arm.prismatic)
    closed = elimination.loop
    T = special_targets(arm, "parallel", 10)
    goal, known_q = closed.goal(T), armkin.ik(arm, T).q
    worst = {}
    for wide in (False, True):
        errors = []
        for role in roles(closed.prismatic, 0, (hidden,), wide):
            built = pencil.build_pencil(role, closed.links, closed.prismatic, choose_variable.PSI[0])
            seed = roots.root_seeds(built, inverse(goal), 0.02, part=True)
            for pose, q in enumerate(known_q):
                step = q[~np.isnan(q[:, 0])][:, None] - seed.q[seed.pose == pose]
                errors += np.abs(np.angle(np.exp(1j * step))).max(axis=2).min(axis=1, initial=9.0).tolist()
        worst[wide] = np.quantile(errors, 0.9)
    assert worst[True] < 1e-6
    assert worst[False] > 1e-2


def test_only_what_stands_so_is_special() -> None:
    arm, _ = arm_and_screws("jaco_j2n6s300")
    elimination = method.prepare(arm.link, arm.prismatic)
    for kind, expected in (("parallel", choose_variable.Kind.PARALLEL), ("meeting", choose_variable.Kind.MEETING)):
        assert (
            choose_variable.pose_kinds(elimination.loop, elimination.loop.goal(special_targets(arm, kind, 50)))
            == expected
        ).all()
    q = np.random.default_rng(1).uniform(-np.pi, np.pi, (500, 6))
    assert (
        choose_variable.pose_kinds(elimination.loop, elimination.loop.goal(armkin.fk(arm, q)))
        == choose_variable.Kind.PLAIN
    ).mean() > 0.95
