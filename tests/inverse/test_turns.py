"""Whole turns and limits: the nearest legal copy, and all of them."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import armkin
from armkin.inverse.branches.whole_turns import nearest_copy, nearest_number, turns
from armkin.model.arm import from_links

ROBOTS = Path(__file__).parents[2] / "robots"
LIMITS = [
    (0, 360),
    (19, 341),
    (-360, 360),
    (-180, 180),
    (-120, 120),
    (350, 370),
    (-725, 90),
    (-np.inf, np.inf),
    (10, np.inf),
]


@pytest.mark.parametrize("limits", LIMITS)
@settings(max_examples=60)
@given(value=st.floats(-np.pi, np.pi), near=st.floats(-12, 12))
def test_nearest_legal_copy(limits: tuple[float, float], value: float, near: float) -> None:
    lower, upper = np.radians(limits)
    copy, inside = nearest_copy(np.array([value]), near, lower, upper)
    copies = value + 2 * np.pi * np.arange(-6, 7)
    legal = copies[(copies >= lower - 1e-9) & (copies <= upper + 1e-9)]
    assert bool(np.all(inside)) == (len(legal) > 0)
    assert nearest_number(value, near, lower, upper, False) == (float(copy[0]), len(legal) > 0)
    turn = (copy[0] - value) / (2 * np.pi)
    assert turn == pytest.approx(round(turn), abs=1e-9)
    if len(legal):
        assert abs(copy[0] - near) == pytest.approx(np.abs(legal - near).min(), abs=1e-8)


def test_copies_are_the_legal_ones_nearest_to_near() -> None:
    """Against all copies, for limits of every kind."""
    rng = np.random.default_rng(5)
    value = np.concatenate([rng.uniform(-np.pi, np.pi, 300), [np.pi, -np.pi, 0.0]])
    near = rng.uniform(-10, 10, len(value))
    turns = value[:, None] + 2 * np.pi * np.arange(-6, 7)
    for low, high in ((-np.pi, 2.0), (-2.0, np.pi), (-np.pi, np.pi), (-7, 1), (-1, 7), (-20, 20), (2, 5), (-9, -4)):
        copy, is_legal = nearest_copy(value, near, float(low), float(high))
        legal = (turns >= low - 1e-9) & (turns <= high + 1e-9)
        assert (np.broadcast_to(is_legal, value.shape) == legal.any(axis=1)).all(), (low, high)
        apart = np.where(legal, np.abs(turns - near[:, None]), np.inf).min(axis=1)
        has_legal = legal.any(axis=1)
        np.testing.assert_allclose(np.abs(copy - near)[has_legal], apart[has_legal], atol=1e-9)
        principal = np.where(value == -np.pi, np.pi, value)
        np.testing.assert_allclose(copy[~has_legal], principal[~has_legal], atol=1e-12)


def planar_arm(limits: list[tuple[float, float]]) -> armkin.Arm:
    """Two planar links of 200 and 300 mm with these limits [deg]."""
    link = np.tile(np.eye(4), (3, 1, 1))
    link[1, 0, 3], link[2, 0, 3] = 200.0, 300.0
    return from_links(link, [False, False], limits=np.radians(limits), task="xy")


@pytest.mark.parametrize("limits", list(itertools.product(LIMITS[:7], repeat=2)))
def test_turns_are_all_legal_copies(limits: tuple[tuple[float, float], ...]) -> None:
    arm = planar_arm(list(limits))
    rng = np.random.default_rng(1)
    near = rng.uniform(-6, 6, 2)
    s = armkin.ik(arm, armkin.fk(arm, rng.uniform(-3, 3, (20, 2)))[:, :2, 3], near=near)
    for row, within in zip(s.q.reshape(-1, 2), s.within_limits.ravel(), strict=True):
        got = turns(arm, row, near)
        copies = row + 2 * np.pi * np.array(list(itertools.product(range(-5, 6), repeat=2)))
        legal = copies[((copies >= arm.lower - 1e-9) & (copies <= arm.upper + 1e-9)).all(axis=1)]
        assert within == (len(legal) > 0)
        assert len(got) == len(legal)
        if len(legal):
            motion = np.abs(got - near).sum(axis=1)
            assert (np.diff(motion) >= -1e-9).all()
            assert motion[0] == pytest.approx(np.abs(legal - near).sum(axis=1).min())
            np.testing.assert_allclose(got[0], row, atol=1e-9)  # the branch is given by the nearest one
            expected = legal[np.lexsort(legal.T)]
            np.testing.assert_allclose(got[np.lexsort(got.round(9).T)], expected, atol=1e-9)


def test_a_ur_has_copies_by_the_dozen() -> None:
    """Limits of +-360 degrees on six joints: two copies of each, except where a joint stands at zero."""
    arm = armkin.load(ROBOTS / "ur5e.yaml")
    q = np.array([0.3, -1.0, 1.2, -0.4, 0.9, 0.7])
    s = armkin.ik(arm, armkin.fk(arm, q))
    two = ((arm.upper - arm.lower) > 4 * np.pi - 1e-9).sum()
    for row in s.q[s.valid & s.within_limits]:
        assert len(turns(arm, row)) == 2**two


def test_the_first_of_all_copies_is_the_branch_at_half_a_turn_too() -> None:
    """Both copies of a joint half a turn from `near` are as far."""
    arm = armkin.load(ROBOTS / "ur5e.yaml")
    rng = np.random.default_rng(2)
    q, near = (np.pi / 4 * rng.integers(-4, 5, (40, 6)) for _ in range(2))
    s = armkin.ik(arm, armkin.fk(arm, q), near=near)
    best = np.take_along_axis(s.q, s.best[:, None, None], axis=1)[:, 0]
    assert (s.best >= 0).all()
    assert (np.abs(np.abs(best - near) - np.pi) < 1e-9).any()
    for row, close in zip(best, near, strict=True):
        np.testing.assert_allclose(turns(arm, row, close)[0], row, rtol=0, atol=1e-9)


def test_best_is_the_legal_branch_that_moves_least() -> None:
    arm = armkin.load(ROBOTS / "three_dof.yaml")
    rng = np.random.default_rng(5)
    q = rng.uniform(arm.lower, arm.upper, (500, 3))
    near = rng.uniform(arm.lower, arm.upper, (500, 3))
    s = armkin.ik(arm, armkin.fk(arm, q)[:, :3, 3], near=near)
    assert (s.best >= 0).all()
    motion = np.degrees(np.abs(s.q - near[:, None]).sum(axis=2))
    np.testing.assert_allclose(s.motion[s.valid], motion[s.valid])
    legal = np.where(s.within_limits, motion, np.inf)
    np.testing.assert_array_equal(s.best, legal.argmin(axis=1))
    np.testing.assert_array_equal(s.best, s.order[:, 0])
    ranked = np.take_along_axis(np.where(s.valid, motion + 1e6 * ~s.within_limits, np.inf), s.order, axis=1)
    finite = np.nan_to_num(ranked, posinf=1e12)
    assert (np.diff(finite, axis=1) >= 0).all()
    inside = (s.q >= arm.lower - 1e-9) & (s.q <= arm.upper + 1e-9)
    np.testing.assert_array_equal(s.within_limits, inside.all(axis=2) & s.valid)


def test_of_branches_that_move_the_joints_equally_the_first_is_best() -> None:
    arm = planar_arm([(-180, 180), (-180, 180)])
    s = armkin.ik(arm, [300.0, 200.0], near=[np.arctan2(2, 3), 0.0])  # elbow up and down, as far on either side
    assert abs(s.motion[0] - s.motion[1]) < 1e-9
    for noise in (-1e-13, 1e-13):
        shaken = replace(s, q=s.q + np.array([[noise, noise], [0.0, 0.0]]))
        assert shaken.best == 0
        assert shaken.order.tolist() == [0, 1]
