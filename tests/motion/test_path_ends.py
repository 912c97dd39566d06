"""Paths that begin or end exactly on a boundary or at a singular home: carried, or the truth about why not."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import armkin
from armkin.errors import NoSolutionError
from armkin.model.arm import Arm


def planned_to(arm: Arm, points: list[np.ndarray], start: dict[str, Any]) -> np.ndarray:
    """Where the tip is at the end of lines through points."""
    plan = armkin.path(arm, {"start": start, "moves": [{"line": p.tolist()} for p in points]})
    assert plan.deviation <= 0.05
    assert (plan.limits["accel"] <= 1.002).all()
    return np.asarray(armkin.fk(arm, plan.q(plan.duration))[:3, 3])


@pytest.mark.parametrize("joints", [(20.0, 40.0, 0.0), (0.0, 0.0, 0.0), (-50.0, 60.0, 0.0)])
def test_both_branches_go_on_from_a_boundary_and_end_on_it(joints: tuple[float, ...]) -> None:
    """The arm is straight at the edge of its reach, where the two elbows meet."""
    arm = armkin.load("three_dof")
    edge = armkin.fk(arm, np.deg2rad(joints))[:3, 3]
    out = edge - np.array([0.0, 0.0, 170.0])
    inside = edge - 30 * out / np.linalg.norm(out)
    beside = inside + np.array([0.0, 5.0, 3.0])
    for start, way in (
        ({"joints": list(joints)}, [inside]),
        ({"point": edge.tolist()}, [inside]),
        ({"point": inside.tolist()}, [edge]),
        ({"point": inside.tolist()}, [edge, beside]),
    ):
        np.testing.assert_allclose(planned_to(arm, way, start), way[-1], atol=0.01)


@pytest.mark.parametrize("name", ["ar4", "irb120", "irb2400", "kuka_kr6_r700", "fanuc_crx10ia"])
def test_a_singular_home_is_left_or_the_wrist_turns_first(name: str) -> None:
    """20 mm up and 20 mm sideways; --split turns the wrist at rest where the straight way makes the joints jump."""
    arm = armkin.load(name)
    speed, accel = (np.where(np.isnan(x), 2.0, x) for x in (arm.max_speed, arm.max_accel))
    arm = replace(arm, max_speed=speed, max_accel=accel)
    home = armkin.fk(arm, arm.home)[:3, 3]
    up, sideways = ({"start": "home", "moves": [{"offset": {"xyz": way}}]} for way in ([0, 0, 20], [0, 20, 0]))
    plan = armkin.path(arm, up)
    np.testing.assert_allclose(armkin.fk(arm, plan.q(plan.duration))[:3, 3], home + [0, 0, 20], atol=0.01)
    with pytest.raises(NoSolutionError, match="with 1 change of branch it can be done"):
        armkin.path(arm, sideways)
    plan = armkin.path(arm, sideways, split=True)
    turn = plan.motion.stretches[0]  # at rest before and after
    assert np.abs(turn.end - arm.home).max() > 1.0
    assert np.linalg.norm(armkin.fk(arm, turn.end)[:3, 3] - home) <= 0.01
    np.testing.assert_allclose(armkin.fk(arm, plan.q(plan.duration))[:3, 3], home + [0, 20, 0], atol=0.01)
    assert (plan.limits["speed"] <= 1.002).all()
