"""Whole turns and limits: the copy of a joint value that is legal and nearest."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import ArrayLike

from armkin.errors import UsageError
from armkin.formula.array_shapes import Joints
from armkin.formula.arrays import Array, Bool, Truth, wrap_angle
from armkin.forward import one_pose
from armkin.inverse.numeric import tolerances as tol
from armkin.model.arm import Arm, actual_arm
from armkin.model.limits import SLACK, principal_values
from armkin.model.units import TURN

HALF_TURN = np.pi + SLACK  # largest distance [rad] of a copy above `near`
MAX_COPIES = 50_000  # most copies of a branch from `turns`


def nearest_copy(  # noqa: C901 - one pass over a batch's arrays, which stay in the cache
    value: Array, near: Array | float, lower: float, upper: float, slides: bool = False
) -> tuple[Array, Truth]:
    """The copy of a joint's values, modulo whole turns, that is legal and nearest; a prismatic joint has no copies.

    value: any shape, in [-pi, pi]; near: broadcastable [rad]. Returns the values and
    whether they are within [lower, upper]; without a legal copy the principal value. Of two copies half a turn from
    `near`, to within SLACK, it is the upper one, so that rounding does not decide.
    """
    if slides:
        return value, (value >= lower - SLACK) & (value <= upper + SLACK)
    if lower >= -np.pi and upper <= np.pi:
        # only the principal value can be legal, or one of the two for half a turn
        value, low, high = principal_values(value), lower - SLACK, upper + SLACK
        if low <= -np.pi or high >= np.pi:
            value = _half_turned(value, near, low, high)
        if low <= -np.pi and high >= np.pi:
            return value, True
        return value, (value >= low) & (value <= high)
    at_zero = isinstance(near, float) and near == 0.0
    original = value
    if at_zero:
        value = principal_values(value)
    else:
        copy = np.asarray((near + HALF_TURN) - value)  # one array for all steps, which stays in the cache
        copy /= TURN
        np.floor(copy, out=copy)
        copy *= TURN
        copy += value
        value = copy
    first, last = (-np.pi, -np.pi) if at_zero else (float(np.min(near)) - np.pi, float(np.max(near)) - np.pi)
    if lower <= first and upper >= last + TURN:
        return value, True
    below, above = value < lower - SLACK, value > upper + SLACK
    # The nearest legal copy of a value below the limits is just above the lower limit, one turn after that around
    # `near`; there is none if the limits end before the first such turn.
    if upper > first + TURN - SLACK and below.any():
        shifted = value + TURN * np.ceil((lower - SLACK - value) / TURN)
        fits = below & (shifted <= upper + SLACK)
        value, below = np.where(fits, shifted, value), below & ~fits
    # a copy may lie SLACK above the half turn, and a legal one SLACK below the lower end
    if lower < last + 3 * SLACK and above.any():
        shifted = value - TURN * np.ceil((value - upper - SLACK) / TURN)
        fits = above & (shifted >= lower - SLACK)
        value, above = np.where(fits, shifted, value), above & ~fits
    outside = below | above
    if not at_zero and outside.any():
        value = np.where(outside, principal_values(original), value)
    return value, ~outside


def _half_turned(value: Array, near: Array | float, low: float, high: float) -> Array:
    """Put -pi for principal values [rad] of half a turn where -pi alone is legal, or legal and nearer to `near`."""
    if value.max(initial=0.0) <= np.pi - SLACK:
        return value
    indices = np.flatnonzero(value > np.pi - SLACK)
    above, near_values = value.take(indices), np.broadcast_to(near, value.shape).flat[indices]
    below = above - TURN
    legal = (above >= low) & (above <= high)
    is_below = (below >= low) & (below <= high)
    is_below &= ~legal | (np.abs(below - near_values) < np.abs(above - near_values) - SLACK)
    value = value.copy()
    value.put(indices, np.where(is_below, below, above))
    return value


def nearest_number(  # noqa: C901 - of every joint and branch of a pose alone: a call more would be felt
    value: float, near: float, lower: float, upper: float, slides: bool
) -> tuple[float, bool]:
    """Return what `nearest_copy` returns, for one joint value [rad | mm] and by the same operations.

    >>> nearest_number(3.0, -2.0, -4.0, 4.0, False) == (3.0 - TURN, True)
    True
    """
    low, high = lower - SLACK, upper + SLACK
    if slides:
        return value, low <= value <= high
    principal = value + TURN if value < SLACK - math.pi else value
    if lower >= -math.pi and upper <= math.pi:
        legal = low <= principal <= high
        if (low <= -math.pi or high >= math.pi) and principal > math.pi - SLACK:
            below = principal - TURN
            if low <= below <= high and (not legal or abs(below - near) < abs(principal - near) - SLACK):
                return below, True
        return principal, legal
    if near == 0.0:
        value, first = principal, -math.pi
    else:
        value, first = value + TURN * float(math.floor((near + HALF_TURN - value) / TURN)), near - math.pi
    if (lower <= first and upper >= first + TURN) or low <= value <= high:
        return value, True
    if value < low and upper > first + TURN - SLACK:
        shifted = value + TURN * math.ceil((low - value) / TURN)
        if shifted <= high:
            return shifted, True
    if value > high and lower < first + 3 * SLACK:
        shifted = value - TURN * math.ceil((value - upper - SLACK) / TURN)
        if shifted >= low:
            return shifted, True
    return principal, False


def nearest_row(arm: Arm, q: Array, near: Array) -> tuple[Array, Bool]:
    """Rows (..., n) with every joint at its nearest legal copy, and whether all are within limits: (...)."""
    if (actual := actual_arm(arm)) is not arm:
        rows, legal = nearest_row(actual, q * arm.ratio, near * arm.ratio)
        return rows / arm.ratio, legal
    copies = q.copy(order="K")  # in the memory order of q
    inside = np.ones_like(q[..., 0], bool)
    if not q.size:
        return copies, inside
    for i in range(arm.n):
        slides, limits = bool(arm.prismatic[i]), (float(arm.lower[i]), float(arm.upper[i]))
        value = q[..., i] if slides else wrap_angle(q[..., i])
        copies[..., i], fits = nearest_copy(value, near[..., i], *limits, slides)
        inside &= fits
    return copies, inside


def nearest_of_joint(arm: Arm, i: int, value: Array, near: Array) -> tuple[Array, Truth]:
    """`nearest_copy` of values of joint i, of an arm without ratios."""
    slides, limits = bool(arm.prismatic[i]), (float(arm.lower[i]), float(arm.upper[i]))
    return nearest_copy(value if slides else wrap_angle(value), near, *limits, slides)


def turns(arm: Arm, q: ArrayLike, near: ArrayLike | None = None) -> Joints:
    """All copies of one branch within the limits, the one nearest to `near` first.

    Of the infinitely many copies of an unlimited joint that nearest to `near` is given, of two as near that above it.

    Args:
        arm: the arm, as `armkin.load` gives it.
        q: (n,) [rad | mm] joint values of the branch, one row.
        near: (n,) [rad | mm] joint values to stay close to; by default home.

    Returns:
        (K, n) [rad | mm], K = 0 where no copy is within the limits.

    Raises:
        UsageError: q or near is no finite (n,), or there are more than 50,000 copies.

    >>> import armkin
    >>> arm = armkin.load("robots/ur5e.yaml")  # limits of +-360 degrees, joint 3 of +-180
    >>> len(turns(arm, [0.3, -1.0, 1.2, -0.4, 0.9, 0.7]))
    32
    """
    row = one_pose(arm, q, "q")
    reference = one_pose(arm, arm.home if near is None else near, "near")
    if (actual := actual_arm(arm)) is not arm:
        return turns(actual, row * arm.ratio, reference * arm.ratio) / arm.ratio
    choices = []
    for i in range(arm.n):
        lower, upper = float(arm.lower[i]), float(arm.upper[i])
        if arm.prismatic[i] or not (np.isfinite(lower) and np.isfinite(upper)):
            value, fits = nearest_of_joint(arm, i, row[i : i + 1], reference[i])
            choices.append([float(value[0])] if np.all(fits) else [])
        else:
            first = int(np.ceil((lower - SLACK - row[i]) / TURN))
            last = int(np.floor((upper + SLACK - row[i]) / TURN))
            choices.append([float(row[i] + TURN * k) for k in range(last, first - 1, -1)])
    count = math.prod(map(len, choices))
    if count > MAX_COPIES:
        message = f"{arm.name}: {count:,} copies of one branch are within the limits; at most {MAX_COPIES:,} are listed"
        raise UsageError(message, copies=count, most=MAX_COPIES)
    rows = np.array(list(itertools.product(*choices))).reshape(-1, arm.n)
    unit = np.where(arm.prismatic, 1.0, 180.0 / np.pi)
    motion = (np.abs(rows - reference) * unit).sum(axis=1)
    return rows[np.argsort(motion.round(tol.EQUAL_DECIMALS), kind="stable")]
