"""What a class of arms provides to be solved."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array, Entry
from armkin.inverse.closed.subproblems import Candidates, Prefer

EXACT = 1e-12  # axes parallel [rad] or meeting [of the reach] to this count as exactly so
NEAR = 1e-3  # and to this as nearly so: `armkin.inverse.nearly_special`


@dataclass(frozen=True, eq=False)
class Geometry:
    """A solver for one arm and task.

    Closed forms set `pairs`: called with the target's entries (the columns of the targets,
    or a `Pose`) and the preferred motions of free joints, it returns `Candidates`. It is made of numpy's
    elementwise functions alone, so that `armkin.formula.trace` can record it. Others set `rows`: called with
    targets (N, m) or (N, 4, 4) it returns q (N, B, n), nan past the last branch, and doubt.
    """

    name: str
    why: str
    complete: bool
    pairs: Callable[[list[Entry], Prefer], Candidates] | None = None
    rows: Callable[[Array], tuple[Array, NDArray[np.bool_]]] | None = None
    labels: tuple[str, ...] = ()  # what the branch axes mean: ("shoulder", "elbow", "wrist")
    ordered: bool = True  # a branch keeps its index along a path; else `branches.tracking` sees to it
    branches: int | None = None  # of `rows`: columns that the labels name; what follows is numbered
