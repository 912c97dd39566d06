"""One target at a time: a block of memory that C reads and writes, so that a call costs microseconds."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

import numpy as np

from armkin.formula.arrays import Array
from armkin.inverse.solutions import Solutions

if TYPE_CHECKING:
    from collections.abc import Callable


class Single:
    """`arm_single` of parts/batch.c for one arm and task; every thread has a block of its own."""

    def __init__(
        self, call: Callable[[int], int], shape: tuple[int, ...], home: Array, branches: int, same: dict[str, Any]
    ) -> None:
        """call: takes a block's address; shape: of a target; same: fields that all solutions share."""
        self._call, self._shape, self._home, self._same = call, shape, home, same
        self._n, self._branches = len(home), branches
        self._local = threading.local()
        size, n, B = int(np.prod(shape)), len(home), branches
        self._results = size + n
        self._bytes = 8 * B * n
        self._size = size + n + B * n + (3 * B + n + 3 + 7) // 8

    def _block(self) -> tuple[Array, Array, Array, int]:
        """Target, near, results, and the block's address."""
        block = np.zeros(self._size)
        size = self._results - self._n
        results = block[self._results :]
        results.view(np.bool_)[self._bytes + 3 * self._branches + self._n + 1] = True  # complete
        parts = block[:size].reshape(self._shape), block[size : self._results], results, block.ctypes.data
        self._local.block = parts
        return parts

    def solve(self, target: Array, near: Array | None) -> Solutions | None:
        """The branches of a target of float64 in the task's shape; None if C leaves it open. near: (n,) or None."""
        try:
            target_in, near_in, results, address = self._local.block
        except AttributeError:
            target_in, near_in, results, address = self._block()
        close = self._home if near is None else near
        target_in[...] = target
        near_in[...] = close
        if self._call(address):
            return None
        found = results.copy()
        flags, small = found.view(np.bool_), found.view(np.int8)
        n, B, at = self._n, self._branches, self._bytes
        end = at + 3 * B + n
        out = Solutions.__new__(Solutions)  # a frozen class sets its fields one by one, for two microseconds
        out.__dict__.update(
            self._same,
            target=target,
            near=close,
            q=found[: B * n].reshape(B, n),
            valid=flags[at : at + B],
            within_limits=flags[at + B : at + 2 * B],
            branch=small[at + 2 * B : at + 3 * B],
            free=flags[at + 3 * B : end],
            status=small[end : end + 1].reshape(()),
            complete=flags[end + 1 : end + 2].reshape(()),
        )
        return out
