"""Where a plan is looked at so that what is drawn between these times lies near the motion, however many there are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armkin.forward import position

if TYPE_CHECKING:
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm
    from armkin.motion.plan.path_plan import PathPlan

_MAX_FIRST_STEP = 0.5  # time [s], at most, between two of the first samples
_INNER_PARAMETERS = (0.21, 0.5, 0.79)  # parameters between two samples at which the motion is looked at


def sample_times(arm: Arm, plan: PathPlan, begins: list[float], close: float, most: int) -> tuple[Array, float]:
    """Times [s] between which the tip drawn is off by `close` [mm] at most, or by what `most` of them leave; how much.

    Where they may be too few, those intervals are divided first that leave the most.
    Drawn: joints that go evenly between two times, and the tip's way as its chord. begins: times that are among them.
    """
    count = int(min(most / 4, plan.duration / _MAX_FIRST_STEP)) + 2
    t = np.unique(np.concatenate([np.linspace(0.0, plan.duration, count), begins]))
    a, b = t[:-1], t[1:]  # intervals that may be divided
    errors = _drawn_error(arm, plan, a, b)
    parts = [t]
    worst, room = 0.0, most - len(t)
    while True:
        bad = (errors > close) & (b - a > 1e-3)
        worst = max(worst, float(errors[~bad].max(initial=0.0)))
        a, b, errors = a[bad], b[bad], errors[bad]
        if not len(a) or room <= 0:
            break
        order = np.argsort(-errors, kind="stable")[:room]
        if 4 * len(order) > room:  # the others wait: they may be the least of what is left
            order = order[errors[order] > 0.5 * errors[order[0]]]
        middle = (a[order] + b[order]) / 2
        parts.append(middle)
        room -= len(middle)
        first, last = np.concatenate([a[order], middle]), np.concatenate([middle, b[order]])
        a, b = (np.concatenate([np.delete(values, order), added]) for values, added in ((a, first), (b, last)))
        errors = np.concatenate([np.delete(errors, order), _drawn_error(arm, plan, first, last)])
    return np.unique(np.concatenate(parts)), max(worst, float(errors.max(initial=0.0)))


def _drawn_error(arm: Arm, plan: PathPlan, a: Array, b: Array) -> Array:
    """How far the tip drawn is from the tip [mm], the most seen between the times a and b: (k,)."""
    first, last = plan.q(a), plan.q(b)
    tips = [position(arm, first), position(arm, last)]
    errors = np.zeros(len(a))
    for share in _INNER_PARAMETERS:
        true_tip = position(arm, plan.q(a + share * (b - a)))
        joint_tip = position(arm, first + share * (last - first))
        errors = np.maximum(errors, np.linalg.norm(joint_tip - true_tip, axis=1))
        # The way that is drawn: the distance to the chord.
        way = tips[1] - tips[0]
        long = np.maximum((way * way).sum(axis=1, keepdims=True), 1e-12)
        along = np.clip(((true_tip - tips[0]) * way).sum(axis=1, keepdims=True) / long, 0.0, 1.0)
        errors = np.maximum(errors, np.linalg.norm(true_tip - tips[0] - along * way, axis=1))
    return np.asarray(errors)
