"""Targets that are singular by two joints about one line, or by four bars: decided at once as posture by posture."""

from __future__ import annotations

import numpy as np
import pytest
from shipped_arms import shipped_arm

import armkin
from armkin import Status
from armkin.inverse.singular import linkages


@pytest.mark.parametrize("name", ["puma560", "irb120", "ur5e"])
def test_all_at_once_is_as_posture_by_posture(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    arm, _ = shipped_arm(name)
    rng = np.random.default_rng(5)
    q = rng.uniform(-2.5, 2.5, (16, 6))
    q[:, 4] = 0.0
    q[8:] = np.pi / 4 * rng.integers(-3, 4, (8, 6))
    T, near = armkin.fk(arm, q), rng.uniform(-1.0, 1.0, 6)
    decided = []
    decide = linkages.decide_self_motions

    def keep_decided(*arguments: object) -> linkages.Linkages:
        decided.append(decide(*arguments))  # type: ignore[arg-type]
        return decided[-1]

    def decide_nothing(goals: object, *arguments: object) -> linkages.Linkages:
        decided_one = decide(goals, *arguments)  # type: ignore[arg-type]
        none = np.zeros_like(decided_one.known)
        return decided_one._replace(known=none, lacking=none)

    monkeypatch.setattr(linkages, "decide_self_motions", keep_decided)
    fast = armkin.ik(arm, T, near=near)
    assert sum(decided_one.known.sum() for decided_one in decided) > 7
    monkeypatch.setattr(linkages, "decide_self_motions", decide_nothing)
    slow = armkin.ik(arm, T, near=near)
    np.testing.assert_array_equal(fast.status, slow.status)
    np.testing.assert_array_equal(fast.free, slow.free)
    np.testing.assert_array_equal(fast.valid.sum(axis=1), slow.valid.sum(axis=1))
    assert fast.complete.all()
    assert (fast.status[:8] == Status.SINGULAR).all()
    assert np.nanmax(fast.residual()[1]) < 1e-9
    if name == "ur5e":  # four bars: whichever of the postures that were tried is nearest
        return
    # of a line's postures that are equally near either may be listed
    ways = [np.abs(np.remainder(s.q - near + np.pi, 2 * np.pi) - np.pi).sum(axis=2) for s in (fast, slow)]
    np.testing.assert_allclose(np.sort(ways[0], axis=1), np.sort(ways[1], axis=1), atol=1e-7)
