"""Straight through or beside a wrist singularity: the tip stays on the path, the tool may be turned a little.

Beside a singularity of the wrist joint 4 has to swing round within a distance as short as the path's own from it.
Over a window about that place the last three joints are cubics instead, from the posture before it to the one behind
it in which the wrist is flipped, and the first three hold the tip on the path.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.forward import fk, jacobian
from armkin.motion.branches.branch_chains import Chain
from armkin.motion.branches.branch_columns import Columns
from armkin.motion.branches.joint_steps import change
from armkin.motion.branches.on_route import corrected
from armkin.motion.branches.windows import Window

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.motion.tool_path.route import Route

_NEAR = 2.0  # tolerances: a wrist that stays farther from straight is not looked at
_ARM = 0.1  # [rad] of the first three joints between two postures that are a flip of the wrist apart
_HALF, _GROW, _WIDTHS = 0.25, 1.5, 14  # [mm] half of the least window; the next one; how many are tried
_GAP = 0.1  # [mm] between the end of one and the begin of the next
_STEP = 0.01  # [mm] to either side, for slopes
_LOOKED = 97  # places in a window at which the tool's rotation is looked at
_MOST = 16  # singularities on the way


def check(arm: Arm) -> None:
    """Raise UsageError for an arm whose last three joints are no wrist."""
    if arm.n != 6 or arm.prismatic.any():
        raise UsageError(
            f"turn_tolerance is for arms with six joints that turn, the last three a wrist; {arm.name} has "
            f"{arm.n}{' that do not all turn' if arm.n == 6 else ''}: leave it out"
        )


def through_wrists(arm: Arm, route: Route, columns: Columns, all_: list[Chain], tolerance: float) -> list[Chain]:
    """Chains, and those that go on with the wrist flipped behind a singularity; tolerance: [rad]."""
    s, found, new = columns.s, list(all_), list(all_)
    for _ in range(_MOST):
        made = []
        for c in new:
            for j in _straight(arm, c, tolerance):
                if c.windows and s[j] <= c.windows[-1].end:
                    continue
                for other in all_:
                    joined = _joined(arm, route, s, c, other, j, tolerance)
                    made += [] if joined is None else [joined]
        found, new = found + made, made
        if not made or len(found) > _MOST * len(all_):
            break
    return found


def _straight(arm: Arm, c: Chain, tolerance: float) -> list[int]:
    """Samples at which a chain's wrist comes nearest to straight, and near enough."""
    axes = np.concatenate([jacobian(arm, part)[:, 3:, 3:] for part in np.array_split(c.q, len(c.q) // 8192 + 1)])
    off = np.abs(np.linalg.det(axes / np.linalg.norm(axes, axis=1, keepdims=True)))
    step = np.diff(off)
    least = np.append(True, step <= 0) & np.append(step > 0, True)
    between = np.maximum(np.append(0.0, np.abs(step)), np.append(np.abs(step), 0.0))  # it may be nearer by so much
    return (c.first + np.flatnonzero(least & (off - between < _NEAR * np.sin(tolerance)))).tolist()


def _joined(arm: Arm, route: Route, s: Array, c: Chain, other: Chain, j: int, tolerance: float) -> Chain | None:
    """A chain up to a window about sample j, and from there on another one, or itself again; None: none is allowed."""
    on = max(j, other.first)  # exactly on the singularity one may end, and the other one begin behind it
    if not (c.first <= j <= c.last and on <= other.last and s[on] - s[j] <= _GAP):
        return None
    step = change(arm, c.q[j - c.first], other.q[on - other.first])
    if np.abs(step[:3]).max() > _ARM:
        return None
    k = int(np.searchsorted(route.breaks, s[j]))
    low, high = route.breaks[max(k - 1, 0)], route.breaks[min(k, len(route.breaks) - 1)]
    low = max(low, s[c.first], c.windows[-1].end if c.windows else 0.0)
    high = min(high, s[other.last])
    best: tuple[int, int, Window] | None = None
    for half in _HALF * _GROW ** np.arange(_WIDTHS):
        a, b = int(np.searchsorted(s, s[j] - half, side="right")) - 1, int(np.searchsorted(s, s[j] + half))
        if a < c.first or b > min(other.last, len(s) - 1) or s[a] < low or s[b] > high:
            break
        if b < other.first:
            continue
        one = _window(arm, route, s[[a, b]], c.q[a - c.first], other.q[b - other.first])
        if one.turned <= tolerance:
            best = a, b, one
    if best is None:
        return None
    a, b, one = best
    inside = one.joints(arm, route, s[a + 1 : b])
    offset = one.q[1] - other.q[b - other.first]
    q = np.concatenate([c.q[: a + 1 - c.first], inside, other.q[b - other.first :] + offset])
    left, right = c.labels[: j - c.first], other.labels[on - other.first :]
    labels = np.concatenate([left, np.repeat(right[:1], len(q) - len(left) - len(right)), right])
    return Chain(arm, c.first, q, labels, (*c.windows, one))


def _window(arm: Arm, route: Route, at: Array, before: Array, behind: Array) -> Window:
    """From a posture to another one, (n,) each, at lengths `at` (2,)."""
    q = np.stack([before, before + change(arm, before, behind)])
    slopes = []
    for s, one in zip(at.tolist(), q, strict=True):
        both = np.clip([s - _STEP, s + _STEP], 0.0, route.length)
        exact = corrected(arm, route.task, np.stack([one, one]), route.targets(both), steps=12)
        slopes.append((exact[1] - exact[0]) / (both[1] - both[0]))
    window = Window(float(at[0]), float(at[1]), q, np.array(slopes), np.inf)
    s = np.linspace(window.begin, window.end, _LOOKED)
    T, target = fk(arm, window.joints(arm, route, s)), route.targets(s)
    if np.linalg.norm(T[:, :3, 3] - target[:, :3, 3], axis=1).max() > 1e-6:
        return window
    R = np.swapaxes(T[:, :3, :3], 1, 2) @ target[:, :3, :3]
    turned = np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=1)
    angle = np.arctan2(np.linalg.norm(turned, axis=1), np.trace(R, axis1=1, axis2=2) - 1)
    return Window(window.begin, window.end, q, window.d, float(angle.max()))
