"""Solves one target in microseconds, through a block of memory that C reads and writes."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array
from armkin.inverse.answers.solutions import Solutions, Status

if TYPE_CHECKING:
    from collections.abc import Callable


LEFT = 4  # state that `arm_single` returns for a target that Python has to solve
_BOOL, _INT8 = np.dtype(np.bool_), np.dtype(np.int8)


def _read_only(value: object) -> NDArray[Any]:
    """A read-only array () that solutions share."""
    array = np.array(value)
    array.flags.writeable = False
    return array


_STATUS = tuple(_read_only(np.int8(status)) for status in sorted(Status))


class Single:
    """`arm_single` of parts/batch.c for one arm and task, with a block for each thread."""

    def __init__(
        self,
        call: Callable[[int], int],
        shape: tuple[int, ...],
        home: Array,
        branches: int,
        shared_fields: dict[str, Any],
        names: Callable[[int], tuple[str, ...]] | None,
    ) -> None:
        """call: takes the address of a block; shape: of a target; shared_fields: fields that all solutions share.

        names: names of a number of branches, for classes that list only the branches of a target; else None.
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
        """Target, near, results, the address of the block, and the array from which near was copied."""
        block = np.zeros(self._size)
        size = self._results - self._n
        target, near, results = np.split(block, [size, self._results])
        parts = [target.reshape(self._shape), near, results, block.ctypes.data, None]
        self._local.block = parts
        return parts

    def _split_block(self, rows: int) -> tuple[Any, ...]:
        """Slices of q, valid, within, branch and free for `rows` branches, with the shape of q, and shared fields."""
        n, B, first = self._n, self._branches, self._bytes
        masks = [slice(start, start + rows) for start in (first, first + B, first + 2 * B)]
        shared_fields = (
            self._shared_fields if self._names is None else {**self._shared_fields, "names": self._names(rows)}
        )
        self._cuts[rows] = slice(0, rows * n), (rows, n), *masks, slice(first + 3 * B, first + 3 * B + n), shared_fields
        return self._cuts[rows]

    def solve(self, target: Array, near: Array | None) -> Solutions | None:
        """The branches of a float64 target in the task's shape; None if C cannot solve it. near: (n,) or None."""
        try:
            block = self._local.block
        except AttributeError:
            block = self._block()
        target_in, near_in, results, address, copied_near = block
        near_values = self._home if near is None else near
        target_in[...] = target
        if near_values is not copied_near:
            near_in[...] = near_values
            block[4] = self._home if near is None else None  # home never changes, while other arrays may
        state = self._call(address)
        if state == LEFT:
            return None
        values = results.copy()
        flags, rows = values.view(_BOOL), self._branches
        if self._names is not None:
            rows = int(flags[self._bytes : self._bytes + rows].sum())
        q, shape, valid, within_part, branch, free, shared_fields = self._cuts.get(rows) or self._split_block(rows)
        solutions = Solutions.__new__(Solutions)  # the constructor of a frozen class would take two microseconds
        solutions.__dict__.update(
            shared_fields,
            target=target.copy(),  # the caller may change its array
            near=near_values,
            q=values[q].reshape(shape),
            valid=flags[valid],
            within_limits=flags[within_part],
            branch=values.view(_INT8)[branch],
            free=flags[free],
            status=_STATUS[state],
        )
        return solutions
