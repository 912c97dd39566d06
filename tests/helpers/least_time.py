"""How long something takes, on a machine that may be busy."""

from __future__ import annotations

import time
from collections.abc import Callable


def least_seconds(work: Callable[[], object], bound: float, clock: Callable[[], float] = time.process_time) -> float:
    """Least seconds of a piece of work, which is done again, at most five times in all, while it takes a bound or more.

    On a virtual machine that others keep busy even processor seconds are longer than they were on an idle one.
    """
    best = float("inf")
    for _ in range(5):
        began = clock()
        work()
        best = min(best, clock() - began)
        if best < bound:
            break
    return best
