"""A batch takes memory for its results and little more."""

from __future__ import annotations

import tracemalloc
from dataclasses import fields

import numpy as np
import pytest
from shipped_arms import shipped_arm

import armkin
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.inverse.tasks.task import targets_of


def peak_beyond(name: str, count: int) -> float:
    """Peak of a call beyond what it returns [MB]."""
    arm, _ = shipped_arm(name)
    q = np.random.default_rng(7).uniform(-3, 3, (count, arm.n))
    goal = targets_of(solver(arm, None)[0], armkin.fk(arm, q), q)
    armkin.ik(arm, goal[:5000])
    tracemalloc.start()
    s = armkin.ik(arm, goal)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    held = {id(a.base if a.base is not None else a): a for a in (getattr(s, f.name) for f in fields(s))
            if isinstance(a, np.ndarray)}  # fmt: skip
    return (peak - sum(a.nbytes for a in held.values() if a is not s.near)) / 1e6


@pytest.mark.parametrize("name", ["three_dof", "puma560", "ur5e"])
def test_memory_beyond_the_results_does_not_grow_with_the_batch(name: str) -> None:
    small_batch, large_batch = peak_beyond(name, 20_000), peak_beyond(name, 60_000)
    assert large_batch < 20, f"{large_batch:.1f} MB"
    assert large_batch - small_batch < 3, f"{small_batch:.1f} MB, {large_batch:.1f} MB with three times as many"
