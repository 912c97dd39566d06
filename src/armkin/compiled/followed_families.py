"""Families of arms whose other joints have a closed form, followed along the redundant joint by machine code.

parts/followed_families.c does what `armkin.inverse.redundant` does where all places of a change are known, finds each
family's posture nearest to near, and says which targets it leaves to Python.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from armkin.compiled.families_source import MAX_PIECES
from armkin.compiled.known_curves import in_stretches
from armkin.formula import arrays
from armkin.inverse.redundant.boundaries import boundaries, from_joint7
from armkin.inverse.redundant.families import Curves
from armkin.inverse.redundant.interval_pieces import Known, Pieces

if TYPE_CHECKING:
    from armkin.inverse.redundant.other_joints import Follower

AT_ONCE = 500  # targets whose curves are asked together
SHORT_STATE, LEFT_STATE = 1, 2  # of parts/family_branches.c: no joint moves by much; the target is left to Python


class FollowedFamilies:
    """Families in the library of an arm."""

    def __init__(self, code: ctypes.CDLL) -> None:
        pointer, size = ctypes.c_void_p, ctypes.c_int64
        self._call = code.arm_families
        self._call.argtypes, self._call.restype = [size, pointer, pointer, pointer, size, *[pointer] * 6], None

    def curves_of(self, follower: Follower) -> Iterator[Curves]:
        """Curves of all targets, some at a time."""
        for rows in arrays.slices(len(follower.target), AT_ONCE):
            part = follower.of(rows)
            known = self._known(part)
            yield from in_stretches(part, known, ~known.complete)

    def _known(self, follower: Follower) -> Known:
        """Curves of some targets, none of those that are left to Python, which are not complete."""
        bounds = boundaries(follower.arm)
        assert bounds is not None
        (N, n), room = follower.near.shape, len(follower.target) * MAX_PIECES
        rotation, shoulder = from_joint7(bounds, follower.target)
        frame = np.concatenate([rotation.reshape(N, 9), shoulder], axis=1)
        target, near = np.ascontiguousarray(follower.target), np.ascontiguousarray(follower.near)
        state, count = np.empty(N, np.uint8), np.empty(N, np.int64)
        branch, legal = np.empty(room, np.int64), np.empty(room, bool)
        interval, q = np.empty((room, 2)), np.empty((room, n))
        outputs = (x.ctypes.data for x in (state, count, branch, legal, interval, q))
        self._call(N, target.ctypes.data, frame.ctypes.data, near.ctypes.data, n, *outputs)
        used = slice(0, int(count.sum()))
        row, q = np.repeat(np.arange(N), count), q[used]
        a, b = interval[used].T
        pieces = Pieces(row, branch[used], legal[used], a, b, a, b, a, a, b, q)
        return Known(pieces, state == SHORT_STATE, state != LEFT_STATE, q)
