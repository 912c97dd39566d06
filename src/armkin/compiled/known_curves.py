"""Curves that machine code knows, and numpy's of the targets that it leaves, in the order of the targets."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from armkin.formula.array_tuples import rows_of
from armkin.formula.arrays import Bool
from armkin.inverse.redundant.families import Curves, curves_in_numpy
from armkin.inverse.redundant.interval_pieces import Known

if TYPE_CHECKING:
    from armkin.inverse.redundant.other_joints import Follower


def in_stretches(follower: Follower, known: Known, left: Bool) -> Iterator[Curves]:
    """The curves of all targets, stretch by stretch: of those that are left (N,) numpy's, else known ones."""
    begins = np.flatnonzero(np.diff(left, prepend=~left[:1])).tolist()
    for a, b in zip(begins, [*begins[1:], len(left)], strict=True):
        if left[a]:
            yield from curves_in_numpy(follower.of(slice(a, b)))
            continue
        part = slice(*np.searchsorted(known.pieces.row, [a, b]))
        pieces = rows_of(known.pieces, part)
        yield Known(pieces._replace(row=pieces.row - a), known.short[a:b], known.complete[a:b], known.nearest[part])
