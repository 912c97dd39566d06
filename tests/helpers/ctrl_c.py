"""Ctrl-C in the middle of work, as a test sees it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


def interrupt_at(work: Callable[..., Any], number: int) -> Callable[..., Any]:
    """The same work, which Ctrl-C ends when it is begun for the `number`-th time."""
    begun = 0

    def stops(*arguments: object) -> object:
        nonlocal begun
        begun += 1
        if begun == number:
            raise KeyboardInterrupt
        return work(*arguments)

    return stops
