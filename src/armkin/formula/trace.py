"""Runs a recorded formula, as numpy code for batches and as plain Python for one pose."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from armkin.formula import arrays
from armkin.formula.arrays import Array

if TYPE_CHECKING:
    from armkin.formula import numpy_code

SMALL_BATCH = 256  # poses of a batch up to which its buffers are kept, as creating them costs more than filling
UNCOPIED_ELEMENTS = 512  # elements of numpy's buffers; with larger ones it copies operands repeated on branch axes
CACHE = 4_000_000  # size [bytes] of all buffers; 4 to 6 MB are equally fast with 1 MB for each core, 9 MB slower
LENGTHS = 16  # lengths of batches for which a thread keeps buffers


class StraightLineCode:
    """A recorded formula as code without branches or loops, for batches and for one pose."""

    def __init__(self, formula: Callable[[list[Any]], Sequence[Any]], inputs: int) -> None:
        """formula: takes a list of that many arrays, returns a sequence of arrays or numbers."""
        from armkin.formula.recording import record  # imported here, as one pose from the command line records nothing

        self._recording = record(formula, inputs)
        self._batch: tuple[numpy_code.Run, list[numpy_code.Buffer]] | None = None
        self._exact: tuple[numpy_code.Run, list[numpy_code.Buffer]] | None = None
        self._run_single: Callable[..., tuple[Any, ...]] | None = None
        self._thread_buffers = threading.local()

    def at_once(self) -> int:
        """Number of poses computed together: `CHUNK`, or fewer if their buffers would not fit the cache."""
        size = sum(math.prod(b.axes) * np.dtype(b.dtype).itemsize for b in self._numpy_code()[1] if b.full_index < 0)
        return min(arrays.CHUNK, max(CACHE // size, SMALL_BATCH))

    def _numpy_code(self) -> tuple[numpy_code.Run, list[numpy_code.Buffer]]:
        """The code for batches, and the buffers that it needs."""
        from armkin.formula import numpy_code

        if self._batch is None:
            self._batch = numpy_code.write_numpy(self._recording)
        return self._batch

    def workspace(self, length: int) -> list[NDArray[Any]]:
        """Buffers of `run` for batches of a length; every thread has its own, and small ones are kept."""
        from armkin.formula import numpy_code

        _, buffers_needed = self._numpy_code()
        workspaces: dict[int, list[NDArray[Any]]] = self._thread_buffers.__dict__.setdefault("buffers", {})
        if length in workspaces:
            return workspaces[length]
        buffers = numpy_code.workspace(buffers_needed, length)
        if length <= SMALL_BATCH:
            if len(workspaces) >= LENGTHS:
                workspaces.clear()
            workspaces[length] = buffers
        return buffers

    def run(self, inputs: Sequence[Any], workspace: list[NDArray[Any]]) -> tuple[Any, ...]:
        """The formula's outputs for inputs (N,), which are valid until the workspace is used again."""
        assert self._batch is not None  # written for the workspace
        if len(inputs[0]) < 2 * UNCOPIED_ELEMENTS:
            return self._batch[0](*inputs, *workspace)
        previous_size = np.setbufsize(UNCOPIED_ELEMENTS)
        try:
            return self._batch[0](*inputs, *workspace)
        finally:
            np.setbufsize(previous_size)

    def run_exactly(self, inputs: Sequence[Any]) -> list[Array]:
        """The outputs for inputs (N,) as new arrays, identical to `single_pose_function` in the last digit."""
        from armkin.formula import numpy_code

        if self._exact is None:
            self._exact = numpy_code.write_numpy(self._recording, scalar=True)
        run, buffers = self._exact
        return [np.array(x) for x in run(*inputs, *numpy_code.workspace(buffers, len(inputs[0])))]

    def axes(self) -> list[tuple[int, ...]]:
        """Lengths of the branch axes of each output."""
        from armkin.formula.recording import axes_of

        return [axes_of(x) for x in self._recording.outputs]

    def single_pose_function(self) -> Callable[..., tuple[Any, ...]]:
        """The formula for one pose in plain Python: takes numbers; an output on branch axes is a tuple of them."""
        if self._run_single is None:
            from armkin.formula import python_code

            self._run_single = python_code.write_python(self._recording)
        return self._run_single

    def one_by_one(self, inputs: Sequence[Sequence[float]]) -> list[Array]:
        """The formula's outputs for N poses in plain Python, (N, inputs), as arrays (*branch axes, N)."""
        numbers = self.single_pose_function()
        outputs = zip(*(numbers(*pose_inputs) for pose_inputs in inputs), strict=True)
        return [
            np.array(values).reshape(len(inputs), -1).T.reshape(*axes, len(inputs))
            for axes, values in zip(self.axes(), outputs, strict=True)
        ]


class LazyCode:
    """Straight-line code that is recorded at the first batch of 64 poses or the fifth call, as it takes milliseconds.

    The same operations of numpy compute the results before and after, so that results do not depend on earlier calls.
    """

    def __init__(self, formula: Callable[[list[Any]], Sequence[Any]], inputs: int) -> None:
        """The arguments of `StraightLineCode`."""
        self._formula, self._inputs, self._calls = formula, inputs, 0
        self._code: StraightLineCode | None = None

    def get(self, batch: int) -> StraightLineCode | None:
        """The recorded code for a batch of that many poses; None while it is not recorded."""
        self._calls += 1
        return self.record_now() if batch >= 64 or self._calls > 4 or self._code is not None else None

    def record_now(self) -> StraightLineCode:
        """The recorded code; recorded at the first call."""
        if self._code is None:
            self._code = StraightLineCode(self._formula, self._inputs)
        return self._code
