"""Threads that share a batch give what one gives, to the bit."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
from shipped_arms import shipped_arm

import armkin
from armkin.engines.threads import share_rows
from armkin.errors import UsageError
from armkin.formula import arrays
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.inverse.tasks.task import targets_of


@pytest.mark.parametrize(
    ("name", "count", "chunk"),  # at least three chunks
    [("three_dof", 9000, 512), ("puma560", 9000, 512), ("stanford", 400, 128), ("ra02", 5000, 512),
     ("jaco_j2n6s300", 600, 200)],
)  # fmt: skip
def test_results_do_not_depend_on_the_workers(
    name: str, count: int, chunk: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(arrays, "CHUNK", chunk)
    arm, _ = shipped_arm(name)
    q = np.random.default_rng(11).uniform(-3, 3, (count, arm.n))
    q[::97, :] = np.round(q[::97, :] / (np.pi / 2)) * (np.pi / 2)  # targets on an edge, too
    q[:, arm.prismatic] *= 200  # [mm]
    goal = targets_of(solver(arm, None)[0], armkin.fk(arm, q), q)
    alone, three = armkin.ik(arm, goal), armkin.ik(arm, goal, workers=3)
    for field in fields(alone):
        a, b = getattr(alone, field.name), getattr(three, field.name)
        if isinstance(a, np.ndarray):
            np.testing.assert_array_equal(a, b, err_msg=field.name)
        else:
            assert a == b or field.name == "arm"


def test_a_chunk_gives_what_a_longer_one_gives(monkeypatch: pytest.MonkeyPatch) -> None:
    arm, _ = shipped_arm("ur5e")
    T = armkin.fk(arm, np.random.default_rng(12).uniform(-3, 3, (5000, arm.n)))
    in_one_chunk = armkin.ik(arm, T)
    monkeypatch.setattr(arrays, "CHUNK", 700)
    np.testing.assert_array_equal(armkin.ik(arm, T).q, in_one_chunk.q)


@pytest.mark.parametrize(("workers", "least", "step"), [(1, 10, 1), (2, 10, 1), (3, 256, 256), (16, 1, 1)])
def test_every_row_is_given_once_and_in_order(workers: int, least: int, step: int) -> None:
    rows = share_rows(lambda rows: list(range(rows.start, rows.stop)), 1000, workers, least, step)
    assert [row for part in rows for row in part] == list(range(1000))
    assert all(part[0] % step == 0 for part in rows)


def test_no_worker_is_refused() -> None:
    arm, _ = shipped_arm("three_dof")
    with pytest.raises(UsageError, match="workers: 0; at least 1 thread is needed"):
        armkin.ik(arm, np.full((5, 3), 200.0), workers=0)
