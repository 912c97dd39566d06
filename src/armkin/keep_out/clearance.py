"""`armkin.clearance`: how far an arm is from the nearest thing that it must not touch, and hits in words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armkin.formula.arrays import Array
from armkin.forward import as_joints
from armkin.model.lock_joints import unlock

if TYPE_CHECKING:
    from armkin.keep_out.body_pairs import Guard
    from armkin.model.arm import Arm


@dataclass(frozen=True, eq=False)
class Clearance:
    """How far an arm is from the nearest thing that it must not touch.

    Attributes:
        mm: (...) [mm] least distance of any pair, `Arm.clearance` taken off; negative where the arm hits something, inf
            for an arm without keep-outs, nan where a joint value is.
        body: (...) the moving body of that pair; text for one posture, empty where there is none.
        other: (...) what it is nearest to.
    """

    mm: Array
    body: NDArray[np.str_]
    other: NDArray[np.str_]


Hit = TypedDict("Hit", {"body": str, "with": str, "depth_mm": float})  # a pair that is too near


def clearance(arm: Arm, q: ArrayLike) -> Clearance:
    """How far an arm is from hitting anything.

    Args:
        arm: the arm, as `armkin.load` gives it.
        q: (..., n) [rad | mm] joint values; leading axes are a batch.

    Returns:
        The least distances (...) [mm] and the names of the pairs that have them.

    Raises:
        UsageError: q is no array of numbers, or its last axis has not the arm's n values.

    >>> import armkin, numpy as np
    >>> arm = armkin.load("three_dof", scene="examples/scenes/three_dof.yaml")
    >>> found = armkin.clearance(arm, np.deg2rad([0, 0, -45]))
    >>> found.mm.round(3), str(found.body), str(found.other)
    (np.float64(-47.505), 'q3', 'table')
    """
    values = as_joints(arm, q)
    full_arm, full = whole_arm(arm, values.reshape(-1, arm.n))
    lead = values.shape[:-1]
    if not full_arm.keep_out:
        nothing = np.full(lead, "", dtype="<U1")
        return Clearance(np.where(np.isnan(values).any(axis=-1), np.nan, np.inf)[()], nothing[()], nothing[()])
    held = _guard(full_arm)
    mm, pairs = held.least_clearances(full)
    return name_clearances(full_arm, mm, pairs, lead)


def name_clearances(arm: Arm, mm: Array, pairs: NDArray[np.intp], lead: tuple[int, ...]) -> Clearance:
    """Clearances (N,) of pairs (N,) with their names, in the shape of a batch."""
    held = _guard(arm)
    bodies, partners = (np.array([held.pair_names(k)[side] for k in range(len(held.pairs))] or [""]) for side in (0, 1))
    return Clearance(mm.reshape(lead)[()], bodies[pairs].reshape(lead)[()], partners[pairs].reshape(lead)[()])


def least_clearances(arm: Arm, q: Array) -> Array:
    """Least clearances and the numbers of their pairs of an arm with keep-outs: q (N, n) -> (N, 2)."""
    return np.stack(_guard(arm).least_clearances(q), axis=1)


def whole_arm(arm: Arm, q: Array) -> tuple[Arm, Array]:
    """The arm whose joints `armkin.lock` held, and its joint values: q (N, n)."""
    while arm.whole is not None:
        arm, held = arm.whole
        q = unlock(arm, held, q)
    return arm, q


def hits_nothing(arm: Arm, q: Array) -> NDArray[np.bool_]:
    """Which postures hit nothing: q (..., n) [rad | mm] -> (...,); a row of nan is none."""
    full_arm, full = whole_arm(arm, q.reshape(-1, arm.n))
    free: NDArray[np.bool_] = np.asarray(np.isfinite(full).all(axis=1))
    if full_arm.keep_out:
        free[free] = _guard(full_arm).least_clearances(full[free])[0] >= 0.0
    return free.reshape(q.shape[:-1])


def hits(arm: Arm, q: Array) -> list[tuple[float | None, list[Hit]]]:
    """The least clearance [mm] of each posture (N, n) (None: nothing counts) and its hits, the deepest first."""
    full_arm, full = whole_arm(arm, q)
    held = _guard(full_arm)
    answers = []
    for row in held.clearances(full):
        deep = [k for k in np.argsort(row, kind="stable") if row[k] < 0]
        hit: list[Hit] = [
            {"body": held.pair_names(k)[0], "with": held.pair_names(k)[1], "depth_mm": float(-row[k])} for k in deep
        ]
        answers.append((float(row.min()) if len(row) else None, hit))
    return answers


def hits_text(hits: list[Hit]) -> str:
    """Hits in words.

    >>> hits_text([{"body": "q3", "with": "table", "depth_mm": 12.345}])
    'hits table by 12.3 mm (q3)'
    """
    words = [f"{hit['with']} by {_size_text(hit['depth_mm'])} ({hit['body']})" for hit in hits]
    return f"hits {', '.join(words)}" if words else ""


def _size_text(mm: float) -> str:
    return f"{mm:.1f} mm" if mm >= 0.05 else "less than 0.1 mm"


def assumed_radii(arm: Arm) -> list[tuple[str, float]]:
    """Bodies whose radius no file states, and the radius [mm] that is taken: none for an arm without keep-outs."""
    full_arm = whole_arm(arm, np.empty((0, arm.n)))[0]
    if not full_arm.keep_out:
        return []
    form = _guard(full_arm).bodies
    return [(name, float(r)) for name, r, taken in zip(form.names, form.radius, form.assumed, strict=True) if taken]


def _guard(arm: Arm) -> Guard:
    """The pairs of an arm with keep-outs; what they need is imported for such arms alone."""
    from armkin.keep_out.body_pairs import guard

    return guard(arm)
