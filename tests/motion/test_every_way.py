"""Branches along lines against brute force over every branch, copy and edge (a sample; all in tests/bench)."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import brute_force_reach
import numpy as np
import pytest
from lines import random_line

import armkin
from armkin.motion.branches.branch_chains import chains_of_columns, fewest_runs
from armkin.motion.branches.linked_branches import link_branches


@pytest.mark.parametrize("name", ["three_dof", "irb120", "ar4", "labvolt_5150"])
def test_reach_is_that_of_brute_force(name: str) -> None:
    arm = armkin.load(name)
    rng = np.random.default_rng(11)
    for _ in range(2):
        way = random_line(arm, rng)
        columns = link_branches(
            arm, way.targets, np.linspace(0, way.length, 150), task=None, tolerance=0.05, near=arm.home
        )
        chains = chains_of_columns(arm, columns)
        mine = max((columns.s[c.carries_to(0)] for c in chains if c.first == 0 and c.carries_to(0) >= 0), default=-1.0)
        dense = np.linspace(0, way.length, 401)
        reached = brute_force_reach.last_sample(arm, way.targets(dense), 0.05)
        assert mine <= (dense[min(reached + 1, 400)] if reached >= 0 else 0.0) + 1e-6
        assert mine >= (dense[reached] if reached >= 0 else -1.0) - 1e-6
        runs = fewest_runs(chains, len(columns.s))
        for a, b in pairwise(runs):
            assert b.first >= a.last


@pytest.mark.parametrize("name", ["three_dof", "irb2400"])
def test_the_tip_stays_within_the_tolerance_between_samples(name: str) -> None:
    arm = armkin.load(name)
    rng = np.random.default_rng(3)
    for _ in range(8):
        way = random_line(arm, rng)
        columns = link_branches(
            arm, way.targets, np.linspace(0, way.length, 60), task=None, tolerance=0.05, near=arm.home
        )
        for chain in chains_of_columns(arm, columns):
            if len(chain.q) < 2:
                continue
            a, b = chain.q[:-1, None], chain.q[1:, None]
            p = armkin.fk(arm, a + np.linspace(0, 1, 20)[:, None] * (b - a))[..., :3, 3]
            chord = p[:, :1] + np.linspace(0, 1, 20)[:, None] * (p[:, -1:] - p[:, :1])
            assert np.linalg.norm(p - chord, axis=2).max() <= 0.05


@pytest.mark.parametrize("most", [np.inf, 9.0])
def test_a_calibrated_joint_goes_round_once_in_its_own_degrees(most: float) -> None:
    """With a ratio of 1.02 a whole turn is 352.9 commanded degrees: the branch does not end where the angle wraps."""
    arm = armkin.load("three_dof")
    arm = replace(
        arm,
        lower=np.array([-most, *arm.lower[1:]]),
        upper=np.array([most, *arm.upper[1:]]),
        ratio=np.array([1.02, 1, 1]),
    )
    height = float(armkin.fk(arm, np.deg2rad([0, 60, -60]))[2, 3])
    moves = {"start": {"joints": [0, 60, -60]}, "moves": [{"circle": {"centre": [0, 0, height]}}]}
    plan = armkin.path(arm, moves)
    assert len(plan.runs) == 1
    turned = np.rad2deg(plan.motion.end - plan.motion.start)
    assert np.abs(turned) == pytest.approx([360 / 1.02, 0, 0], abs=1e-6)
