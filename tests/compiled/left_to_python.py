"""How many targets machine code leaves to Python."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import armkin
from armkin.inverse import solve


def left_to_python(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many targets Python is asked, call by call, from now on."""
    counts: list[int] = []
    answered = solve.solve_by

    def count_and_call(
        arm: armkin.Arm, task: Any, geometry: Any, targets: np.ndarray, *others_given: Any, **named: Any
    ) -> armkin.Solutions:
        counts.append(len(targets))
        return answered(arm, task, geometry, targets, *others_given, **named)

    monkeypatch.setattr(solve, "solve_by", count_and_call)
    return counts
