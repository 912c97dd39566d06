"""Sample times of a plan for playback, dense enough that a drawing interpolated between them is accurate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armkin.forward import position

if TYPE_CHECKING:
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm
    from armkin.motion.plan.path_plan import PathPlan

_MAX_FIRST_STEP = 0.5  # largest step [s] of the first samples
_INNER_PARAMETERS = (0.21, 0.5, 0.79)  # parameters between two samples at which the error is measured


def sample_times(arm: Arm, plan: PathPlan, begins: list[float], accuracy: float, max_count: int) -> tuple[Array, float]:
    """At most `max_count` times [s] for drawing a plan to within `accuracy` [mm], and the greatest error left [mm].

    Drawings interpolate joint values linearly between two times, and draw the tip's path as a chord. The intervals with
    the largest errors are divided first. begins: times that must be among the result.
    """
    count = int(min(max_count / 4, plan.duration / _MAX_FIRST_STEP)) + 2
    t = np.unique(np.concatenate([np.linspace(0.0, plan.duration, count), begins]))
    a, b = t[:-1], t[1:]  # intervals that may be divided
    errors = _drawn_error(arm, plan, a, b)
    parts = [t]
    largest_error, room = 0.0, max_count - len(t)
    while True:
        too_far = (errors > accuracy) & (b - a > 1e-3)
        largest_error = max(largest_error, float(errors[~too_far].max(initial=0.0)))
        a, b, errors = a[too_far], b[too_far], errors[too_far]
        if not len(a) or room <= 0:
            break
        order = np.argsort(-errors, kind="stable")[:room]
        if 4 * len(order) > room:  # divide only the worst ones while there is little room
            order = order[errors[order] > 0.5 * errors[order[0]]]
        middle = (a[order] + b[order]) / 2
        parts.append(middle)
        room -= len(middle)
        first, last = np.concatenate([a[order], middle]), np.concatenate([middle, b[order]])
        a, b = (np.concatenate([np.delete(values, order), added]) for values, added in ((a, first), (b, last)))
        errors = np.concatenate([np.delete(errors, order), _drawn_error(arm, plan, first, last)])
    return np.unique(np.concatenate(parts)), max(largest_error, float(errors.max(initial=0.0)))


def _drawn_error(arm: Arm, plan: PathPlan, a: Array, b: Array) -> Array:
    """The greatest distance of the drawn tip from the tip [mm] between the times a and b: (k,)."""
    first, last = plan.q(a), plan.q(b)
    tips = [position(arm, first), position(arm, last)]
    errors = np.zeros(len(a))
    for share in _INNER_PARAMETERS:
        true_tip = position(arm, plan.q(a + share * (b - a)))
        joint_tip = position(arm, first + share * (last - first))
        errors = np.maximum(errors, np.linalg.norm(joint_tip - true_tip, axis=1))
        # The error of the drawn path is the distance to its chord.
        chord = tips[1] - tips[0]
        square = np.maximum((chord * chord).sum(axis=1, keepdims=True), 1e-12)
        fraction = np.clip(((true_tip - tips[0]) * chord).sum(axis=1, keepdims=True) / square, 0.0, 1.0)
        errors = np.maximum(errors, np.linalg.norm(true_tip - tips[0] - fraction * chord, axis=1))
    return np.asarray(errors)
