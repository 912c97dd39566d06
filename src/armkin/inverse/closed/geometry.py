"""The interface of a class of arms: its solver and properties."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from armkin.formula.arrays import Array, Bool, Entry, Int
from armkin.inverse.closed.subproblems import Candidates, Prefer

ClosedForm = Callable[[list[Entry], Prefer], Candidates]  # `Geometry.pairs`


class Rows(NamedTuple):
    """The result of a solver that works row by row.

    q: (N, B, n) branches [rad | mm], nan past a target's last one.  doubt: (N,) targets to be examined by
    `inverse.singular.groups`.  complete: (N,) whether every isolated branch is there.  lost: (N,) whether singular
    postures may be missing.  guesses: (N, G, n) postures that may be close to those.
    """

    q: Array
    doubt: Bool
    complete: Bool
    lost: Bool | None = None
    guesses: Array | None = None


@dataclass(frozen=True, eq=False)
class Geometry:
    """A solver for one arm and task.

    Closed forms set `pairs`: called with the target's entries (the columns of the targets,
    or a `Pose`) and the preferred motions of free joints, it returns `Candidates`. It is made of numpy's
    elementwise functions alone, so that `armkin.formula.trace` can record it. Others set `rows`: called with
    targets (N, m) or (N, 4, 4) it returns `Rows`.  complete: whether the method guarantees every isolated branch;
    for a single target `Rows.complete` may say no.
    """

    name: str
    why: str
    complete: bool
    pairs: ClosedForm | None = None
    rows: Callable[[Array], Rows] | None = None
    unmoved: Callable[[Array], Rows] | None = None  # `rows` for targets whose doubts are examined later
    labels: tuple[str, ...] = ()  # names of the branch axes: ("shoulder", "elbow", "wrist")
    ordered: bool = True  # whether a branch keeps its index along a path; else `branches.tracking` is used
    elimination: Any = None  # prepared elimination behind `rows`, if any
    ends: tuple[int, ...] = ()  # joints that, if free, may have only a few values with solutions
    doubts: "Geometry | None" = None  # slower solver for the targets that `pairs` doubts
    places: Callable[[Array, Array], Int] | None = None  # indices of an elimination's branches
    branches: int | None = None  # columns of `rows` with names; later ones are numbered
