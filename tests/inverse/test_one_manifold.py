"""A manifold is one row, whichever of its postures are candidates, and is followed once."""

from __future__ import annotations

import numpy as np
import pytest

import armkin
from armkin.inverse.closed import crossings

# The wrist 0.001 degrees off straight, its centre all but on axis 1: two directions are nearly lost
BESIDE = [-5.660692012689249e-06, -8.204135961199831e-06, 524.75, np.pi / 2, -3.1415681650441143, 3.1415661793087657]
# A Puma whose joints 1 to 3 are within 1e-5 rad of a fold: the manifold is short, and both its ends are known
SHORT = [1.5836968407619585, -0.8901812286952255, 1.617829428444212, -2.8485155934616904, 2.8328757558239435,
         -1.8342311940795621]  # fmt: skip


@pytest.mark.parametrize("others", [0, 60])
def test_a_wrist_beside_straight_is_listed_once_a_shoulder(others: int) -> None:
    """On either side of the straight wrist lie candidates that miss by nothing; those between them miss by 5e-10.

    They were two or three rows, the number depending on what else was in the batch.
    """
    arm = armkin.load("stanford")
    rest = np.pi / 2 * np.random.default_rng(1).integers(-2, 3, (others, arm.n))
    q = np.concatenate([[BESIDE], np.where(arm.prismatic, BESIDE[2], rest)])
    found = armkin.ik(arm, armkin.fk(arm, q), near=q)
    rows = found.q[0][found.valid[0]]
    assert found.status[0] == armkin.Status.SINGULAR
    assert found.complete[0]
    assert len(rows) == 2
    np.testing.assert_array_equal(rows[0], BESIDE)
    assert rows[1][2] == pytest.approx(-BESIDE[2])


def test_nothing_is_sought_that_crosses_a_manifold_of_which_all_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    """It was half of the time of the dearest random targets."""
    arm = armkin.load("puma560")
    T = armkin.fk(arm, SHORT)
    before = armkin.ik(arm, T)
    assert before.status == armkin.Status.SINGULAR
    monkeypatch.setattr(crossings, "beside", None)
    np.testing.assert_array_equal(armkin.ik(arm, T).q, before.q)
