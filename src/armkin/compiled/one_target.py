"""One target at a time: a block of memory that C reads and writes, so that a call costs microseconds."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array
from armkin.inverse.answers.solutions import Solutions, Status

if TYPE_CHECKING:
    from collections.abc import Callable


LEFT = 4  # what `arm_single` returns for a target that it leaves to Python
_BOOL, _INT8 = np.dtype(np.bool_), np.dtype(np.int8)


def _read_only(value: object) -> NDArray[Any]:
    """An array () that solutions share, and so nobody may change."""
    array = np.array(value)
    array.flags.writeable = False
    return array


_STATUS = tuple(_read_only(np.int8(status)) for status in sorted(Status))


class Single:
    """`arm_single` of parts/batch.c for one arm and task; every thread has a block of its own."""

    def __init__(
        self,
        call: Callable[[int], int],
        shape: tuple[int, ...],
        home: Array,
        branches: int,
        shared_fields: dict[str, Any],
        names: Callable[[int], tuple[str, ...]] | None,
    ) -> None:
        """call: takes a block's address; shape: of a target; shared_fields: fields that all solutions share.

        names: of that many branches, for classes that list no more rows than a target has branches; else None.
        """
        self._call, self._shape = call, shape
        self._home, self._names = home, names
        self._shared_fields = shared_fields | {
            "rounding": _read_only(0.0),
            "complete": _read_only(shared_fields["complete"]),
        }
        self._n, self._branches = len(home), branches
        self._cuts: dict[int, tuple[Any, ...]] = {}
        self._local = threading.local()
        size, n, B = int(np.prod(shape)), len(home), branches
        self._results = size + n
        self._bytes = 8 * B * n
        self._size = size + n + B * n + (3 * B + n + 2 + 7) // 8

    def _block(self) -> list[Any]:
        """Target, near, results, the block's address, and the array that near was copied from."""
        block = np.zeros(self._size)
        size = self._results - self._n
        target, near, results = np.split(block, [size, self._results])
        parts = [target.reshape(self._shape), near, results, block.ctypes.data, None]
        self._local.block = parts
        return parts

    def _split_block(self, rows: int) -> tuple[Any, ...]:
        """Where q, valid, within, branch and free of `rows` branches stand, and the fields that do not differ.

        q's shape follows its place.
        """
        n, B, first = self._n, self._branches, self._bytes
        masks = [slice(start, start + rows) for start in (first, first + B, first + 2 * B)]
        same = self._shared_fields if self._names is None else {**self._shared_fields, "names": self._names(rows)}
        self._cuts[rows] = slice(0, rows * n), (rows, n), *masks, slice(first + 3 * B, first + 3 * B + n), same
        return self._cuts[rows]

    def solve(self, target: Array, near: Array | None) -> Solutions | None:
        """The branches of a target of float64 in the task's shape; None if C leaves it open. near: (n,) or None."""
        try:
            block = self._local.block
        except AttributeError:
            block = self._block()
        target_in, near_in, results, address, before = block
        close = self._home if near is None else near
        target_in[...] = target
        if close is not before:
            near_in[...] = close
            block[4] = self._home if near is None else None  # home does not change, other arrays may
        state = self._call(address)
        if state == LEFT:
            return None
        values = results.copy()
        flags, rows = values.view(_BOOL), self._branches
        if self._names is not None:
            rows = int(flags[self._bytes : self._bytes + rows].sum())
        q, shape, valid, within, branch, free, same = self._cuts.get(rows) or self._split_block(rows)
        solutions = Solutions.__new__(Solutions)  # a frozen class sets its fields one by one, for two microseconds
        solutions.__dict__.update(
            same,
            target=target.copy(),  # the caller's array may change
            near=close,
            q=values[q].reshape(shape),
            valid=flags[valid],
            within_limits=flags[within],
            branch=values.view(_INT8)[branch],
            free=flags[free],
            status=_STATUS[state],
        )
        return solutions
