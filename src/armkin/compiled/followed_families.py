"""Families of arms whose other joints have a closed form, followed along the redundant joint by machine code.

parts/followed_families.c does what `armkin.inverse.redundant.followed_branches` does where all places of a change are
known, and says which targets it leaves to Python.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from armkin.formula import arrays
from armkin.formula.array_tuples import rows_of, stack_rows
from armkin.inverse.redundant.boundaries import boundaries, from_joint7
from armkin.inverse.redundant.families import Curves, _nearest_postures
from armkin.inverse.redundant.followed_branches import Followed
from armkin.inverse.redundant.interval_pieces import Known, Pieces

if TYPE_CHECKING:
    from armkin.inverse.redundant.other_joints import Follower

SHORT, LEFT = 1, 2  # states of parts/family_branches.c
AT_ONCE = 500  # targets whose places are found together
MAX_PIECES = 64  # pieces, at most, of a target in C


class FollowedFamilies:
    """Families in the library of an arm."""

    def __init__(self, code: ctypes.CDLL) -> None:
        pointer, size = ctypes.c_void_p, ctypes.c_int64
        self._call = code.arm_families
        self._call.argtypes = [size, pointer, pointer, pointer, size, size, *[pointer] * 6]
        self._call.restype = size

    def curves_of(self, follower: Follower) -> Iterator[Curves]:
        """Curves of all targets, some at a time."""
        for rows in arrays.slices(len(follower.target), AT_ONCE):
            yield self._known(follower.of(rows))

    def _known(self, follower: Follower) -> Known:
        """Curves of some targets, of which Python follows those that C leaves to it."""
        N, n = len(follower.target), follower.arm.n
        bounds = boundaries(follower.arm)
        assert bounds is not None
        rotation, shoulder = from_joint7(bounds, follower.target)
        frame = np.concatenate([rotation.reshape(N, 9), shoulder], axis=1)
        target, near = np.ascontiguousarray(follower.target), np.ascontiguousarray(follower.near)
        state, count = np.empty(N, np.uint8), np.empty(N, np.int64)
        room = N * MAX_PIECES
        branch, legal = np.empty(room, np.int64), np.empty(room, bool)
        interval, q = np.empty((room, 2)), np.empty((room, n))
        pointers = (x.ctypes.data for x in (state, count, branch, legal, interval, q))
        self._call(N, target.ctypes.data, frame.ctypes.data, near.ctypes.data, n, room, *pointers)
        total = int(count.sum())
        row = np.repeat(np.arange(N), count)
        a, b = interval[:total].T.copy()
        pieces = Pieces(row, branch[:total], legal[:total], a, b, a, b, a, a, b, q[:total])
        known = Known(pieces, state == SHORT, state != LEFT, q[:total])
        rows = np.flatnonzero(~known.complete)
        return _with_followed(follower, known, rows) if len(rows) else known


def _with_followed(follower: Follower, known: Known, rows: arrays.Int) -> Known:
    """The curves with those of some targets, rows (M,), by Python."""
    part = follower.of(rows)
    followed = Followed.along(part)
    nearest = _nearest_postures(part.arm, followed, part.near[followed.pieces.row])
    kept = ~np.isin(known.pieces.row, rows)
    pieces = followed.pieces._replace(row=rows[followed.pieces.row])
    known.short[rows], known.complete[rows] = followed.short, followed.complete
    return known._replace(
        pieces=stack_rows([rows_of(known.pieces, kept), pieces]), nearest=np.concatenate([known.nearest[kept], nearest])
    )
