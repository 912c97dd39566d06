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
        self,
        call: Callable[[int], int],
        shape: tuple[int, ...],
        home: Array,
        branches: int,
        complete: bool,
        same: dict[str, Any],
        names: Callable[[int], tuple[str, ...]] | None,
    ) -> None:
        """call: takes a block's address; shape: of a target; complete, same: fields that all solutions share.

        names: of that many branches, for classes that list no more rows than a target has branches; else None.
        """
        self._call, self._shape, self._home, self._same, self._names = call, shape, home, same, names
        self._n, self._branches, self._complete = len(home), branches, complete
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
        results.view(np.bool_)[self._bytes + 3 * self._branches + self._n + 1] = self._complete
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
        end, rows = at + 3 * B + n, B
        said = self._same
        if self._names is not None:
            rows = int(flags[at : at + B].sum())
            said = {**said, "names": self._names(rows)}
        out = Solutions.__new__(Solutions)  # a frozen class sets its fields one by one, for two microseconds
        out.__dict__.update(
            said,
            target=target,
            near=close,
            q=found[: rows * n].reshape(rows, n),
            valid=flags[at : at + rows],
            within_limits=flags[at + B : at + B + rows],
            branch=small[at + 2 * B : at + 2 * B + rows],
            free=flags[at + 3 * B : end],
            status=small[end : end + 1].reshape(()),
            complete=flags[end + 1 : end + 2].reshape(()),
        )
        return out
