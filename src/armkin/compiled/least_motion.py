"""`ik_columns.nearest_branches`, the branch that moves the joints least, by machine code with identical results."""

import ctypes
import hashlib
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armkin.compiled import toolchain
from armkin.formula.arrays import Array, Bool
from armkin.inverse.numeric.tolerances import EQUAL_DECIMALS

SOURCE = Path(__file__).parent / "parts" / "least_motion.c"
MAX_JOINTS = 7  # most joints that numpy sums from left to right


def nearest_branches(q: Array, candidates: Bool, near: Array, scale: Array) -> tuple[NDArray[np.intp], Array] | None:
    """See `armkin.columns.ik_columns.nearest_branches`; None for more than `MAX_JOINTS` joints."""
    N, B, n = q.shape
    if n > MAX_JOINTS:
        return None
    branch, motion, differences = np.empty(N, np.int64), np.full(N, np.nan), np.empty(B * n)
    inputs = np.ascontiguousarray(q), np.ascontiguousarray(candidates), np.tile(near, B), np.tile(scale, B), differences
    pointers = (array.ctypes.data for array in inputs)
    _library()(N, B, n, *pointers, 10.0**EQUAL_DECIMALS, branch.ctypes.data, motion.ctypes.data)
    return branch, motion


@cache
def _library() -> Any:
    """`arm_nearest` of parts/least_motion.c. Raises MissingExtraError without a C compiler."""
    text = SOURCE.read_text(encoding="utf-8")
    content = hashlib.sha256(text.encode()).hexdigest()
    function = toolchain.load_library(text.replace("@content@", content), content, 3).arm_nearest
    size, pointer = ctypes.c_int64, ctypes.c_void_p
    function.argtypes, function.restype = [*[size] * 3, *[pointer] * 5, ctypes.c_double, *[pointer] * 2], None
    return function
