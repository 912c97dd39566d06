"""The Python API given what it does not expect: words of ours, and nothing shared that may change."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable

import numpy as np
import pytest

import armkin

ARM = armkin.load("three_dof")
PLAN = armkin.path(ARM, [[390.0, 80.0, 300.0], [390.0, 100.0, 300.0]])


@pytest.mark.parametrize("again", [copy.copy, copy.deepcopy, lambda arm: pickle.loads(pickle.dumps(arm))])
def test_a_copied_arm_is_read_only(again: Callable[[armkin.Arm], armkin.Arm]) -> None:
    arm = again(ARM)
    arrays = [value for value in vars(arm).values() if isinstance(value, np.ndarray)]
    assert len(arrays) > 10
    assert not any(array.flags.writeable for array in arrays)
    assert armkin.fk(arm, [0.1, 0.2, 0.3]).tolist() == armkin.fk(ARM, [0.1, 0.2, 0.3]).tolist()


def test_solutions_share_no_memory_with_the_callers_arrays() -> None:
    target, near = np.array([[390.0, 80.0, 300.0]]), np.zeros((1, 3))
    s = armkin.ik(ARM, target, near=near)
    target[:] = near[:] = 7.0
    assert s.target.tolist() == [[390.0, 80.0, 300.0]]
    assert s.near.tolist() == [[0.0, 0.0, 0.0]]


@pytest.mark.parametrize(
    "call",
    [
        lambda: armkin.workspace(ARM, 10, seed=1.5),  # type: ignore[arg-type]
        lambda: armkin.workspace(ARM, "x"),  # type: ignore[arg-type]
        lambda: armkin.workspace(ARM, True),
        lambda: armkin.unlock(ARM, {"q1": 0.0}, [1.0, 2.0, 3.0, 4.0]),
        lambda: armkin.unlock(ARM, {"nope": 0.0}, [1.0, 2.0]),
        lambda: armkin.unlock(ARM, {"q1": "x"}, [1.0, 2.0]),  # type: ignore[dict-item]
        lambda: armkin.unlock(ARM, {"q1": 0.0}, 1.0),
        lambda: armkin.turns(ARM, [1.0, 2.0]),
        lambda: armkin.load(b"three_dof"),  # type: ignore[arg-type]
        lambda: armkin.load(None),  # type: ignore[arg-type]
        lambda: PLAN.q("a"),
        lambda: PLAN.qdd([1, [2, 3]]),  # type: ignore[arg-type]
        lambda: PLAN.s("a"),
    ],
)
def test_what_does_not_fit_is_a_usage_error(call: Callable[[], object]) -> None:
    with pytest.raises(armkin.UsageError):
        call()
