"""Ctrl-C in the middle of work, as a test sees it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


def interrupted(work: Callable[..., Any], at: int) -> Callable[..., Any]:
    """The same work, which Ctrl-C ends when it is begun for the `at`-th time."""
    begun = 0

    def stops(*given: object) -> object:
        nonlocal begun
        begun += 1
        if begun == at:
            raise KeyboardInterrupt
        return work(*given)

    return stops
