"""Threads that share a batch, which is possible since numpy and C release Python's lock and targets are independent."""

from collections.abc import Callable
from numbers import Integral
from typing import TypeVar

from armkin.errors import UsageError

Result = TypeVar("Result")


def share_rows(part: Callable[[slice], Result], count: int, workers: int, least: int, step: int = 1) -> list[Result]:
    """``part(rows)`` of all rows, in their order, by `workers` threads.

    least: fewest rows of a thread; step: shares are multiples of it. Raises UsageError for less than one worker.
    """
    check_workers(workers)
    share = max(least, -(-count // (4 * workers)))  # four shares each, so that a slow thread does not delay the others
    share += -share % step
    rows = [slice(start, min(start + share, count)) for start in range(0, count, share)]
    if workers == 1 or len(rows) < 2:
        return [part(slice(0, count))]
    from concurrent.futures import ThreadPoolExecutor  # imported here, as few batches are shared

    with ThreadPoolExecutor(workers) as pool:
        return list(pool.map(part, rows))


def check_workers(workers: int) -> None:
    """Raise UsageError for a number of threads that is below one or not whole."""
    if not isinstance(workers, Integral):
        raise UsageError(f"workers: {workers!r}; a whole number of threads is needed")
    if workers < 1:
        raise UsageError(f"workers: {workers}; at least 1 thread is needed")
