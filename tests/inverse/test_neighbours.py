"""What is said of a target does not depend on the targets that stand beside it in a batch: bit for bit."""

from __future__ import annotations

import numpy as np
import pytest
from shipped_arms import shipped_arm

import armkin


@pytest.mark.parametrize(("name", "count", "part"), [("puma560", 64, 4), ("ur5e", 120, 4), ("jaco_j2n6s300", 32, 8)])
def test_an_answer_is_that_of_its_target(name: str, count: int, part: int) -> None:
    """Postures of round and of any angles: regular, singular in one way and in several."""
    arm, _ = shipped_arm(name)
    rng = np.random.default_rng(3)
    q = rng.uniform(-3, 3, (count, arm.n))
    q = np.where(rng.random(q.shape) < 0.6, rng.integers(-4, 5, q.shape) * np.pi / 4, q)
    T = armkin.fk(arm, q)
    together = armkin.ik(arm, T)
    assert len(np.unique(together.status)) > 1
    for start in range(0, count, part):
        rows = slice(start, start + part)
        subset = armkin.ik(arm, T[rows])
        width = min(subset.q.shape[1], together.q.shape[1])
        for field in ("q", "valid", "within_limits", "branch"):
            np.testing.assert_array_equal(getattr(subset, field)[:, :width], getattr(together, field)[rows, :width])
        for field in ("status", "free", "complete"):
            np.testing.assert_array_equal(getattr(subset, field), getattr(together, field)[rows])


def test_a_self_motion_is_told_alone_as_beside_a_corner() -> None:
    """Where several directions are lost the first step is longer: only there, whatever else is asked about."""
    arm, _ = shipped_arm("ur5e")
    rng = np.random.default_rng(4)
    q = rng.uniform(-3, 3, (64, 6))
    q[:, 4] = 10.0 ** rng.uniform(-9, -7, 64)  # a wrist that is nearly straight
    corner = armkin.fk(arm, np.deg2rad([[0, -90, 0, -90, 0, 0], [90, -90, 0, 0, 0, 90]]))
    T = armkin.fk(arm, q)
    alone, beside = armkin.ik(arm, T), armkin.ik(arm, np.concatenate([corner, T]))
    assert 3 < (alone.status == armkin.Status.SINGULAR).sum() < 64
    np.testing.assert_array_equal(alone.status, beside.status[2:])
    np.testing.assert_array_equal(alone.free, beside.free[2:])
