"""`armkin.clearance`: the distance of an arm from the nearest obstacle or body, and texts about hits."""

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
    full_arm, full_q = whole_arm(arm, values.reshape(-1, arm.n))
    batch_shape = values.shape[:-1]
    if not full_arm.keep_out:
        no_name = np.full(batch_shape, "", dtype="<U1")
        return Clearance(np.where(np.isnan(values).any(axis=-1), np.nan, np.inf)[()], no_name[()], no_name[()])
    arm_guard = _guard(full_arm)
    least_clearances, pairs = arm_guard.least_clearances(full_q)
    return name_clearances(full_arm, least_clearances, pairs, batch_shape)


def name_clearances(arm: Arm, mm: Array, pairs: NDArray[np.intp], lead: tuple[int, ...]) -> Clearance:
    """Clearances (N,) and the names of their pairs (N,), in the shape of a batch."""
    guard = _guard(arm)
    bodies, partners = (
        np.array([guard.pair_names(k)[side] for k in range(len(guard.pairs))] or [""]) for side in (0, 1)
    )
    return Clearance(mm.reshape(lead)[()], bodies[pairs].reshape(lead)[()], partners[pairs].reshape(lead)[()])


def least_clearances(arm: Arm, q: Array) -> Array:
    """Least clearances and the indices of their pairs, for an arm with keep-outs: q (N, n) -> (N, 2)."""
    return np.stack(_guard(arm).least_clearances(q), axis=1)


def whole_arm(arm: Arm, q: Array) -> tuple[Arm, Array]:
    """The arm before `armkin.lock`, with all its joints, and its joint values: q (N, n)."""
    while arm.whole is not None:
        arm, locked_values = arm.whole
        q = unlock(arm, locked_values, q)
    return arm, q


def hits_nothing(arm: Arm, q: Array) -> NDArray[np.bool_]:
    """Which postures hit nothing: q (..., n) [rad | mm] -> (...,); False for rows with nan."""
    full_arm, full_q = whole_arm(arm, q.reshape(-1, arm.n))
    is_free: NDArray[np.bool_] = np.asarray(np.isfinite(full_q).all(axis=1))
    if full_arm.keep_out:
        is_free[is_free] = _guard(full_arm).least_clearances(full_q[is_free])[0] >= 0.0
    return is_free.reshape(q.shape[:-1])


def hits(arm: Arm, q: Array) -> list[tuple[float | None, list[Hit]]]:
    """The least clearance [mm] of each posture (N, n) (None without pairs) and its hits, the deepest first."""
    full_arm, full_q = whole_arm(arm, q)
    arm_guard = _guard(full_arm)
    answers = []
    for clearances in arm_guard.clearances(full_q):
        posture_hits: list[Hit] = []
        for pair in np.argsort(clearances, kind="stable")[: int((clearances < 0).sum())]:
            body, partner = arm_guard.pair_names(pair)
            posture_hits.append({"body": body, "with": partner, "depth_mm": float(-clearances[pair])})
        answers.append((float(clearances.min()) if len(clearances) else None, posture_hits))
    return answers


def hits_text(hits: list[Hit]) -> str:
    """A text about hits.

    >>> hits_text([{"body": "q3", "with": "table", "depth_mm": 12.345}])
    'hits table by 12.3 mm (q3)'
    """
    words = [f"{hit['with']} by {_size_text(hit['depth_mm'])} ({hit['body']})" for hit in hits]
    return f"hits {', '.join(words)}" if words else ""


def _size_text(mm: float) -> str:
    return f"{mm:.1f} mm" if mm >= 0.05 else "less than 0.1 mm"


def assumed_radii(arm: Arm) -> list[tuple[str, float]]:
    """Names of bodies without a stated radius, and the assumed one [mm]; empty for an arm without keep-outs."""
    full_arm = whole_arm(arm, np.empty((0, arm.n)))[0]
    if not full_arm.keep_out:
        return []
    arm_bodies = _guard(full_arm).bodies
    return [(arm_bodies.names[k], float(arm_bodies.radius[k])) for k in np.flatnonzero(arm_bodies.assumed)]


def _guard(arm: Arm) -> Guard:
    """The pairs of an arm with keep-outs; the import is local, as other arms do not need it."""
    from armkin.keep_out.body_pairs import guard

    return guard(arm)
