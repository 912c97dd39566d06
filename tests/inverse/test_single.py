"""One target in plain numbers is answered as in a batch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from oracle import goal_of_joints
from shipped_arms import UNLIKE, shipped_arm

import armkin
from armkin.inverse.branches.whole_turns import nearest_copy, nearest_number
from armkin.inverse.run import single as one_target
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.model.arm import Arm

# without a closed form, of which none is answered in plain numbers
GENERAL = {"fanuc_crx10ia", "jaco_j2n6s300", "kinova_gen3", "moveo", "niryo_ned2", "panda", "xarm6"}
CLOSED = [name for name in UNLIKE if name not in GENERAL]
FIELDS = [f.name for f in fields(armkin.Solutions)]


def ask_single(arm: Arm, target: np.ndarray, near: np.ndarray | None) -> armkin.Solutions | None:
    """One target by the short way, and a check that it is as in a batch."""
    single = one_target.short_way(arm, None)
    assert single is not None
    alone = single.solve(target, near)
    batch = armkin.ik(arm, target[None], near=None if near is None else near[None])
    if alone is None:
        return None
    for name in FIELDS:
        a, b = getattr(alone, name), getattr(batch, name)
        if isinstance(b, np.ndarray):
            assert a.shape == b.shape[1:], name
            assert a.dtype == b.dtype, name
            if name == "q":  # numpy's vectors and the C library round tangents in their own ways
                assert np.allclose(a, b[0], rtol=0, atol=1e-7 * max(arm.reach, 1.0), equal_nan=True)
            elif name in ("target", "rounding"):
                assert np.allclose(a, b[0], rtol=0, atol=1e-15 * max(arm.reach, 1.0))
            else:
                assert (a == b[0]).all(), name
        elif name != "arm":
            assert a == b, name
    return alone


@pytest.mark.parametrize("name", CLOSED)
@pytest.mark.parametrize("limits", ["own", "half a turn", "narrow", "wide", "none"])
def test_one_is_as_in_a_batch(name: str, limits: str, sample: Callable[[int, int], int]) -> None:
    arm, screw = shipped_arm(name)
    task, geometry = solver(arm, None)
    assert geometry.pairs
    turn = np.where(arm.prismatic, 300.0, np.pi)
    lower, upper = {
        "own": (arm.lower, arm.upper),
        "half a turn": (-turn, turn),
        "narrow": (-0.4 * turn, 0.3 * turn),
        "wide": (-1.6 * turn, 2.2 * turn),
        "none": (np.full(arm.n, -np.inf), np.full(arm.n, np.inf)),
    }[limits]
    arm = replace(arm, lower=lower, upper=upper)
    rng = np.random.default_rng(5)
    q = rng.uniform(-np.pi, np.pi, (30, arm.n)) * np.where(arm.prismatic, arm.reach / 10, 1.0)
    targets = goal_of_joints(task, screw, q).array()
    short = 0
    for k, target in enumerate(targets[: sample(12, 6)]):
        near = None if k % 3 == 0 else rng.uniform(-1.5, 1.5, arm.n) * turn
        alone = ask_single(arm, target, near)
        short += alone is not None and bool(alone.valid.any())
    assert short > 0.75 * sample(12, 6)
    beyond = targets[0].copy()
    beyond[(..., 3) if beyond.ndim == 2 else slice(0, 2)] *= 1.0 if beyond.ndim == 2 else 50.0
    if beyond.ndim == 2:
        beyond[:3, 3] += 3.0 * arm.reach
    ask_single(arm, beyond, None)


def test_what_is_not_plain_is_left_to_the_batch() -> None:
    arm = shipped_arm("puma560")[0]
    T = armkin.fk(arm, np.full(6, 0.3))
    rounded = T.round(8)
    single = one_target.short_way(arm, None)
    assert single is not None
    assert single.solve(T, None) is not None
    assert single.solve(rounded, None) is None  # made a rotation first
    assert single.solve(T * np.nan, None) is None
    assert single.solve(np.array([T, T]), None) is None
    assert single.solve(T, [0.0] * 5) is None
    assert single.solve(armkin.fk(arm, np.zeros(6)), None) is None  # the wrist is singular


ANGLE = st.floats(-np.pi, np.pi)
EDGE = st.sampled_from([-2 * np.pi, -np.pi, -1.0, 0.0, 1.0, np.pi, 2 * np.pi, -np.inf, np.inf])


@given(ANGLE | EDGE.filter(lambda x: abs(x) <= np.pi), st.floats(-20, 20) | st.just(0.0), EDGE | ANGLE, EDGE | ANGLE)
def test_a_number_has_the_copy_that_it_has_in_an_array(value: float, near: float, first: float, other: float) -> None:
    lower, upper = min(first, other), max(first, other)
    assume(lower < np.inf and upper > -np.inf)
    copy, inside = nearest_copy(np.array([value]), near, lower, upper)
    assert nearest_number(value, near, lower, upper, False) == (copy[0], np.broadcast_to(inside, 1)[0])
