"""The tip jogged along an axis while a button is held: on its line, at rest before what is in the way."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from served_page import Page

import armkin
from armkin.errors import NoSolutionError, UsageError
from armkin.model import units
from armkin.motion.path_planner.jog_line import jog_axes, jog_line

BENT = [0.0, 60.0, -60.0]  # three_dof, far from its edges

SCENES = Path(__file__).parents[2] / "examples" / "scenes"


def jog_until(page: Page, has_arrived: Callable[[dict[str, Any]], bool], **jog: Any) -> list[np.ndarray]:
    """Joint values on the way, while a jog is asked for until the board is there."""
    joints = []

    def look(state: dict[str, Any]) -> bool:
        if state["joints"] is not None:
            joints.append(np.array(state["joints"]))
        return has_arrived(state)

    page.jog(look, **jog)
    return joints


def tips_of(joints: list[np.ndarray]) -> np.ndarray:
    """Where three_dof's tip was, in mm."""
    arm = armkin.load("three_dof")
    return np.array([armkin.fk(arm, units.joints_in(arm, q))[:3, 3] for q in joints])


def send_to(page: Page, q: list[float]) -> np.ndarray:
    """Send the arm there; its tip as the pins have it."""
    assert page.act("send", q=q, speed=100)[0] == 200
    tip: np.ndarray = tips_of([np.array(page.idle()["joints"])])[0]
    return tip


def test_the_tip_keeps_its_line_and_stops_when_nobody_asks(sim: Page) -> None:
    begin = send_to(sim, BENT)
    joints = jog_until(
        sim, lambda now: abs(tips_of([now["joints"]])[0][1] - begin[1]) > 40, axis="y", frame="base", percent=40
    )
    assert sim.state()["doing"] == "jog"
    began = sim.clock()  # the page falls silent
    state = sim.idle()
    assert sim.clock() - began < 1.5  # 0.3 s after the last sign of life it brakes
    assert (state["position"], state["error"]) == ("known", "")
    way = tips_of([*joints, np.array(state["joints"])]) - begin
    assert 40 < way[-1][1] < 200  # the line would have gone on to the edge of the reach
    assert np.abs(way[:, [0, 2]]).max() < 0.05 + 0.15  # the tolerance, and half a step of each joint at the tip
    assert (np.diff(way[:, 1]) > -0.2).all()
    jog_until(sim, lambda now: tips_of([now["joints"]])[0][1] < begin[1] + 20, axis="y", frame="base", percent=-40)
    sim.let_go()
    sim.idle()


def test_a_late_sign_of_life_does_not_revive_a_jog_that_brakes(sim: Page) -> None:
    begin = send_to(sim, BENT)
    jog_until(sim, lambda now: abs(tips_of([now["joints"]])[0][2] - begin[2]) > 5, axis="z", frame="base", percent=-20)
    for _ in range(20):
        if sim.state()["doing"] != "jog":
            break
        time.sleep(0.35)
        sim.hold()
    else:
        raise AssertionError("the jog goes on")
    stood = sim.idle()["pulses"]
    sim.hold()
    assert sim.idle()["pulses"] == stood


def test_stop_passes_a_jog_of_the_tip(sim: Page) -> None:
    begin = send_to(sim, BENT)
    jog_until(sim, lambda now: abs(tips_of([now["joints"]])[0][2] - begin[2]) > 5, axis="z", frame="base", percent=-20)
    assert sim.act("stop")[0] == 200
    assert sim.idle()["error"] == "stopped"
    assert sim.act("send", q=BENT, speed=100)[0] == 200
    assert sim.idle()["error"] == ""


def test_it_rests_before_a_limit_and_says_which(sim: Page) -> None:
    send_to(sim, BENT)
    jog_until(sim, lambda now: "limit" in now["error"], axis="x", frame="base", percent=-100)
    state = sim.idle()
    assert "q2 is at its limit" in state["error"]
    assert state["position"] == "known"
    arm = armkin.load("three_dof")
    q = units.joints_in(arm, state["joints"])
    assert ((q >= arm.lower) & (q <= arm.upper)).all()
    assert np.rad2deg(arm.upper[1] - q[1]) < 5


@pytest.mark.parametrize(
    "wrong", [{"axis": "rx"}, {"axis": "w"}, {"axis": 3}, {"frame": "world"}, {"percent": 0}, {"percent": 1e9}]
)
def test_a_jog_that_makes_no_sense_is_refused(sim: Page, wrong: dict[str, Any]) -> None:
    assert sim.press(**{"axis": "x", "frame": "base", "percent": 10, **wrong})[0] == 422
    assert sim.idle()["pulses"] == [0, 0, 0]


@pytest.mark.parametrize("frame", ["base", "tool"])
@pytest.mark.parametrize(("robot", "axis"), [("parol6", "x"), ("parol6", "ry"), ("so101", "phi"), ("cobra600", "x")])
def test_a_line_goes_along_its_axis_and_no_other(robot: str, axis: str, frame: Any) -> None:
    arm = armkin.load(robot)
    if np.isnan(arm.max_accel).any():
        arm = _with_rates(arm)
    bend = [4.0, 70, 0, 0] if robot == "cobra600" else [4.0, -9, 7, 25, 30, 5][: arm.n]
    q = arm.home + np.deg2rad(bend)
    begin = armkin.fk(arm, q)
    plan, _ = jog_line(arm, q, axis, frame, 0.1)
    place = armkin.fk(arm, plan.q(np.linspace(0, plan.duration, 50)))
    moved = place[:, :3, 3] - begin[:3, 3]
    turned = begin[:3, :3].T @ place[:, :3, :3] if frame == "tool" else place[:, :3, :3] @ begin[:3, :3].T
    if axis in ("x", "z"):
        unit = np.eye(3)["xyz".index(axis)]
        unit = begin[:3, :3] @ unit if frame == "tool" else unit
        assert (moved @ unit)[-1] > 5
        assert np.abs(moved - np.outer(moved @ unit, unit)).max() < 0.05
        assert np.abs(turned - np.eye(3)).max() < (1e-3 if robot == "parol6" else 2)
    else:
        assert np.abs(moved).max() < 0.05
        assert np.linalg.norm(turned[-1] - np.eye(3)) > 0.02
    if axis == "ry":
        assert np.abs(turned[:, 1, [0, 2]]).max() < 1e-3
    assert (plan.q(plan.duration) <= arm.upper).all()
    assert (plan.q(plan.duration) >= arm.lower).all()


def _with_rates(arm: armkin.Arm) -> armkin.Arm:
    rate = np.where(arm.prismatic, 200.0, 1.0)
    return replace(arm, max_speed=rate, max_accel=3 * rate)


def test_a_line_ends_before_what_it_would_hit() -> None:
    arm = armkin.load("three_dof", scene=str(SCENES / "three_dof.yaml"))
    q = np.deg2rad(BENT)
    free, _ = jog_line(armkin.load("three_dof"), q, "z", "base", -0.4)
    plan, why = jog_line(arm, q, "z", "base", -0.4)
    assert "would hit" in why
    assert plan.length < free.length - 20
    assert armkin.clearance(arm, plan.q(np.linspace(0, plan.duration, 400))).mm.min() > 0


def test_an_arm_near_a_singularity_may_leave_it_and_not_go_deeper() -> None:
    arm, stretched = armkin.load("three_dof"), np.deg2rad([-30, 5, -5])
    assert jog_line(arm, stretched, "y", "base", 0.2)[0].length > 300  # inwards
    with pytest.raises(NoSolutionError, match="a singularity is near"):
        jog_line(arm, stretched, "y", "base", -0.2)


def test_where_no_way_leads_it_says_so() -> None:
    arm = armkin.load("parol6")  # its wrist is straight at home
    with pytest.raises(NoSolutionError, match="x of the base: a singularity is near"):
        jog_line(arm, arm.home, "x", "base", 0.2)
    with pytest.raises(UsageError, match="none of x, y, z, rx, ry, rz"):
        jog_line(arm, arm.home, "phi", "base", 0.2)
    assert jog_axes(armkin.load("planar_2dof")) == ("x", "y")
    assert jog_axes(armkin.load("panda")) == ()
