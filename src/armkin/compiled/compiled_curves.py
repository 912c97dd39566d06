"""Families of a seven-joint arm that are traced, by machine code; targets that it leaves are traced by numpy."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from armkin.compiled import curves_source, toolchain
from armkin.compiled.known_curves import in_stretches
from armkin.formula.arrays import Array, Bool
from armkin.inverse.redundant.curve_starts import VALUES
from armkin.inverse.redundant.families import Curves, CurvesOf
from armkin.inverse.redundant.interval_pieces import Known, Pieces
from armkin.inverse.solvers.choose_redundant_joint import Redundancy, arm_without, nearly_closed

if TYPE_CHECKING:
    from armkin.inverse.redundant.other_joints import Follower
    from armkin.model.arm import Arm

AT_ONCE = 250  # targets that one call of C answers
ROOM = 48  # pieces of a target for which there is room, on average: 32 at most of 1,000 random ones

HeldAnswers = Callable[["Arm", Array], Array]  # all answers (N, B, 6) of targets, nan for none, of an arm of six joints


@lru_cache(maxsize=16)
def compiled_curves(arm: Arm, redundant: Redundancy) -> CompiledCurves | None:
    """The curves of an arm in machine code; None if its families are not traced with another joint's guide."""
    if redundant.about_tool_axis or redundant.by_formula or arm.prismatic.any() or arm.keep_out:
        return None
    guide = nearly_closed(arm, redundant)
    curves = None if guide is redundant else CompiledCurves(arm, redundant, guide)
    return curves if curves is not None and curves.work_bytes else None  # without vectors C leaves all to numpy


class CompiledCurves:
    """The library of an arm whose families are traced with a guide that is not the redundant joint."""

    def __init__(self, arm: Arm, redundant: Redundancy, guide: Redundancy) -> None:
        code = toolchain.load_library(*curves_source.library(arm, redundant, guide), curves_source.LEVEL)
        pointer, size = ctypes.c_void_p, ctypes.c_int64
        self._call = code.arm_families
        self._call.argtypes, self._call.restype = [size, *[pointer] * 3, size, size, *[pointer] * 7], None
        code.arm_work_bytes.restype = size
        self.work_bytes = code.arm_work_bytes()
        joint = curves_source.other_joint(guide)
        self.held_arms = [arm_without(arm, ((arm.joint_names[joint], value),)) for value in VALUES]

    def of(self, held_answers: HeldAnswers) -> CurvesOf:
        """`families.curves_in_numpy` by machine code; held_answers: solves for the others with one joint held."""

        def curves_of(follower: Follower) -> Iterator[Curves]:
            memory = np.empty(self.work_bytes, np.uint8)
            for begin in range(0, len(follower.target), AT_ONCE):
                part = follower.of(slice(begin, begin + AT_ONCE))
                yield from in_stretches(part, *self._solve(part, held_answers, memory))

        return curves_of

    def _solve(self, follower: Follower, held_answers: HeldAnswers, memory: Any) -> tuple[Known, Bool]:
        """Curves of targets N, none of those that are left to numpy, and which are (N,)."""
        N, n = follower.near.shape
        target, near = np.ascontiguousarray(follower.target), np.ascontiguousarray(follower.near)
        answers = [held_answers(arm, target) for arm in self.held_arms]
        width = max(rows.shape[1] for rows in answers)
        held = np.full((len(answers), N, width, n - 1), np.nan)
        for k, rows in enumerate(answers):
            held[k, :, : rows.shape[1]] = rows
        room = ROOM * N
        curve, legal, small = np.empty(room, np.int64), np.empty(room, bool), np.empty(N, bool)
        ends, nearest, counts = np.empty((room, 2)), np.empty((room, n)), np.empty(N, np.int64)
        outputs = (curve, legal, ends, nearest, counts, small, memory)
        inputs = (target, near, held)
        self._call(N, *(x.ctypes.data for x in inputs), width, room, *(x.ctypes.data for x in outputs))
        total = int(np.maximum(counts, 0).sum())
        a, b = ends[:total].T
        row, zero = np.repeat(np.arange(N), np.maximum(counts, 0)), np.zeros(total)
        pieces = Pieces(row, curve[:total], legal[:total], a, b, a, b, zero, zero, zero, nearest[:total])
        return Known(pieces, small, np.zeros(N, bool), nearest[:total]), counts < 0
