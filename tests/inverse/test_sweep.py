"""Sweeps: prepared once a value, and in memory that does not grow with rows times values."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import armkin
from armkin.inverse import choose_branch
from armkin.inverse.solvers.solver_of_arm import solver

ARM = armkin.load("planar_3dof")
TARGETS = np.random.default_rng(3).uniform([50, -100], [250, 100], (40, 2))
SWEPT = choose_branch.Request(arm=ARM, task="xy", swept={"q1": np.linspace(-90, 90, 60).tolist()}, every=False)


@pytest.mark.parametrize("branch", [None, "elbow up", "elbow down"])
def test_what_is_dropped_is_not_shown(branch: str | None) -> None:
    request = replace(SWEPT, branch=branch)
    for shortened, every in zip(
        choose_branch.solve(request, TARGETS), choose_branch.solve(replace(request, every=True), TARGETS), strict=True
    ):
        assert (shortened.status, shortened.total, shortened.within_limits, shortened.refused) == (
            every.status,
            every.total,
            every.within_limits,
            every.refused,
        )
        assert every.total == len(every.branches)
        assert every.within_limits == sum(answer.within_limits for answer in every.branches)
        best = [None if answer.best is None else answer.branches[answer.best].joints for answer in (shortened, every)]
        assert best[0] == best[1]
        assert [answer.joints for answer in shortened.branches[:1]] == [answer.joints for answer in every.branches[:1]]
    assert any(answer.best is not None for answer in choose_branch.solve(request, TARGETS))


def test_each_value_is_prepared_once_for_all_rows() -> None:
    choose_branch.solve(SWEPT, TARGETS[:1])  # the arm with its redundant joint at zero
    for joint, most in (("q2", 3), ("q1", 1)):  # of q1, the redundant one, all values have one arm
        request = replace(SWEPT, swept={joint: [1.25, 2.5, 3.75]})
        before = solver.cache_info().misses
        for first in range(0, 40, 10):
            choose_branch.solve(request, TARGETS[first : first + 10])
        assert solver.cache_info().misses - before <= most


def test_branches_kept_do_not_grow_with_the_values(monkeypatch: pytest.MonkeyPatch) -> None:
    counts: list[int] = []
    add = choose_branch._SweptTarget.add

    def note_and_call(collected: choose_branch._SweptTarget, *arguments: Any) -> None:
        add(collected, *arguments)
        counts.append(len(collected.branches))

    monkeypatch.setattr(choose_branch._SweptTarget, "add", note_and_call)
    request = replace(SWEPT, swept={"q1": [0.0, 10.0, 20.0, 30.0, 40.0] * 40})
    [*_, most] = sorted(answer.total for answer in choose_branch.solve(request, TARGETS[:6]))
    assert most > 60
    assert max(counts) < 30


def test_all_branches_of_many_values_are_solved_in_parts() -> None:
    every = replace(SWEPT, every=True, swept={"q1": [0.0] * 100, "q2": [0.0] * 50})
    assert choose_branch.most_targets(every) * choose_branch.combinations(every) <= 16_384
    assert choose_branch.most_targets(replace(every, swept={"q1": [0.0] * 100, "q2": [0.0] * 100})) == 1
