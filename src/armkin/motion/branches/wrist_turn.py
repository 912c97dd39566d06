"""Straight through a wrist singularity or beside one, the tool turned a little or the tip a little aside.

Beside a singularity of the wrist joint 4 has to swing round within a distance as short as the path's own from it.
Over a window about that place the last three joints are cubics instead, from the posture before it to the one behind
it in which the wrist is flipped, and the first three hold the tip on the path. Where the tool may not be turned and
the singularity lies within the tolerance, the tip goes there: straight through it joint 4 need not swing at all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from armkin.errors import UsageError
from armkin.formula.arrays import Array
from armkin.forward import fk, jacobian
from armkin.motion.branches.branch_chains import Chain
from armkin.motion.branches.branch_columns import Columns
from armkin.motion.branches.joint_steps import MIN_LEVER, joint_change
from armkin.motion.branches.solve_on_route import correct_to_route
from armkin.motion.branches.wrist_window import Window, add_detours
from armkin.motion.tool_path.route import Detour

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.motion.tool_path.route import Route

ASIDE_SHARE = 0.5  # share of the tolerance by which the tip may go aside
_NEAR_DISTANCE = 2.0  # distance [tolerances] from straight beyond which a wrist is not looked at
_ARM_MOVEMENT = 0.1  # movement [rad] of the first three joints between two postures that are a flip of the wrist apart
_HALF_WIDTH, _WIDTH_FACTOR, _WIDTH_COUNT = 0.25, 1.5, 14  # windows: least half [mm], factor, number
_WINDOW_GAP = 0.1  # distance [mm] between the end of one window and the begin of the next
_SLOPE_STEP = 0.01  # distance [mm] to either side at which slopes are taken
_PLACE_COUNT = 97  # places in a window at which the tool's rotation is looked at
_MAX_SINGULARITIES = 16  # singularities, at most, on the way
_EXACT_ERROR = 1e-6  # error [mm and rad] below which a posture meets its target
_ROUNDING_SHARE = 1e-12  # share of the wrist's volume that is rounding
_VOLUME_SHARE = 1e-4  # share of the wrist's volume below which it does not tell joint 4
_MIN_WEIGHT = 1e-8  # weight [1/mm] of a millimetre beside a radian where the tool's direction must be kept
_NEWTON_STEPS = 8  # steps of Newton's method to a straight wrist


def has_wrist(arm: Arm) -> bool:
    """Whether the last three joints can be taken for a wrist: of six that all turn."""
    return arm.n == 6 and not arm.prismatic.any()


def check_wrist(arm: Arm) -> None:
    """Raise UsageError for an arm whose last three joints are no wrist."""
    if not has_wrist(arm):
        raise UsageError(
            f"turn_tolerance is for arms with six joints that turn, the last three a wrist; {arm.name} has "
            f"{arm.n}{' that do not all turn' if arm.n == 6 else ''}: leave it out"
        )


def add_wrist_chains(
    arm: Arm, route: Route, columns: Columns, chains: list[Chain], turn: float, tip_offset: float
) -> list[Chain]:
    """Chains, and those that go on with the wrist flipped behind a singularity.

    turn: [rad] by which the tool may be turned for it, tip_offset: [mm] that the tip may go.
    """
    s, all_chains, latest = columns.s, list(chains), list(chains)
    near = _NEAR_DISTANCE * max(np.sin(turn), tip_offset / MIN_LEVER)
    for _ in range(_MAX_SINGULARITIES):
        joined_chains = []
        for c in latest:
            for j in _straight_samples(arm, c, near):
                if c.windows and s[j] <= c.windows[-1].end:
                    continue
                for next_chain in chains:
                    joined = _chain_through_window(arm, route, s, c, next_chain, j, (turn, tip_offset))
                    joined_chains += [] if joined is None else [joined]
        all_chains, latest = all_chains + joined_chains, joined_chains
        if not joined_chains or len(all_chains) > _MAX_SINGULARITIES * len(chains):
            break
    return all_chains


@lru_cache(maxsize=256)
def _volumes_at_three(arm: Arm) -> tuple[float, float, float]:
    """Volumes [1] that the wrist's axes span where joint 5 has turned by 0, 90 and 180 degrees."""
    tried = np.tile(arm.home, (3, 1))
    tried[:, 4] = np.array([0.0, 0.5, 1.0]) * np.pi / arm.ratio[4]
    axes = jacobian(arm, tried)[:, 3:, 3:]
    a, b, c = np.linalg.det(axes / np.linalg.norm(axes, axis=1, keepdims=True)).tolist()
    return a, b, c


def _wrist_volume(arm: Arm, q: Array) -> Array:
    """The volume of the wrist's axes at joint values (N, n): 0 where it is straight; joint 5 alone tells: (N,)."""
    a, b, c = _volumes_at_three(arm)
    angle = q[:, 4] * arm.ratio[4]
    return np.asarray((a + c) / 2 + (a - c) / 2 * np.cos(angle) + (b - (a + c) / 2) * np.sin(angle))


def _straight_samples(arm: Arm, c: Chain, near: float) -> list[int]:
    """Samples at which a chain's wrist comes nearest to straight, and near enough."""
    volumes = np.abs(_wrist_volume(arm, c.q))
    volumes[volumes < _ROUNDING_SHARE] = 0.0  # else every other sample of an all singular way were a least one
    step = np.diff(volumes)
    least = np.append(True, step <= 0) & np.append(step > 0, True)
    between = np.maximum(np.append(0.0, np.abs(step)), np.append(np.abs(step), 0.0))  # it may be nearer by so much
    return (c.first + np.flatnonzero(least & (volumes - between < near))).tolist()


def _window_spans(route: Route, s: Array, c: Chain, next_chain: Chain, j: int) -> Iterator[tuple[int, int]]:
    """First and last samples of windows about sample j, wider and wider, on one piece of the route."""
    k = int(np.searchsorted(route.breaks, s[j]))
    low, high = route.breaks[max(k - 1, 0)], route.breaks[min(k, len(route.breaks) - 1)]
    low = max(low, s[c.first], c.windows[-1].end if c.windows else 0.0)
    high = min(high, s[next_chain.last])
    for half in _HALF_WIDTH * _WIDTH_FACTOR ** np.arange(_WIDTH_COUNT):
        a, b = int(np.searchsorted(s, s[j] - half, side="right")) - 1, int(np.searchsorted(s, s[j] + half))
        if a < c.first or b > min(next_chain.last, len(s) - 1) or s[a] < low or s[b] > high:
            return
        if b >= next_chain.first:
            yield a, b


def _widest_window(
    arm: Arm, route: Route, window: Callable[[int], Window], numbers: range, allowed: tuple[float, float]
) -> tuple[int, Window] | None:
    """The widest window that turns the tool by little enough, else one about which the tip goes, and its number.

    window: by its number, the higher the wider; allowed: how far the tool may turn [rad], and its tip go aside [mm].
    """
    turn, aside = allowed
    if turn and (turning := [k for k in numbers if window(k).turned <= turn]):
        return turning[-1], window(turning[-1])
    for k in reversed(numbers) if aside else ():
        around = _window_with_offset(arm, route, window(k))
        if around is None or around.tip_offset > aside:  # a narrower window has it as well
            return None
        if _follows_detour(arm, route, around):
            return k, around
    return None


def _chain_through_window(
    arm: Arm, route: Route, s: Array, c: Chain, next_chain: Chain, j: int, allowed: tuple[float, float]
) -> Chain | None:
    """A chain up to a window about sample j, and from there on another one, or itself again; None: none is allowed."""
    next_sample = max(j, next_chain.first)  # exactly on the singularity one may end, and the other one begin behind it
    if not (c.first <= j <= c.last and next_sample <= next_chain.last and s[next_sample] - s[j] <= _WINDOW_GAP):
        return None
    step = joint_change(arm, c.q[j - c.first], next_chain.q[next_sample - next_chain.first])
    if np.abs(step[:3]).max() > _ARM_MOVEMENT:
        return None
    spans = list(_window_spans(route, s, c, next_chain, j))

    @cache
    def window(k: int) -> Window:
        a, b = spans[k]
        return _window_between(arm, route, s[[a, b]], c.q[a - c.first], next_chain.q[b - next_chain.first])

    best = _widest_window(arm, route, window, range(len(spans)), allowed)
    if best is None:
        return None
    (a, b), chosen = spans[best[0]], best[1]
    inside = _joints_in_window(arm, route, chosen, s[a + 1 : b])
    offset = chosen.q[1] - next_chain.q[b - next_chain.first]
    q = np.concatenate([c.q[: a + 1 - c.first], inside, next_chain.q[b - next_chain.first :] + offset])
    left, right = c.labels[: j - c.first], next_chain.labels[next_sample - next_chain.first :]
    labels = np.concatenate([left, np.repeat(right[:1], len(q) - len(left) - len(right)), right])
    return Chain(arm, c.first, q, labels, (*c.windows, chosen))


def _joints_in_window(arm: Arm, route: Route, window: Window, s: Array) -> Array:
    """Joint values at lengths s (N,) inside of a window: (N, n)."""
    q = window.joints(arm, route, s)
    if window.detour is None or not len(s):
        return q
    q = correct_to_route(arm, route.task, q, add_detours(route, (window,)).targets(s), steps=12)
    bent = np.abs(_wrist_volume(arm, q)) > _VOLUME_SHARE  # nearer to straight joints 4 and 6 go on as they do beside it
    lengths = np.concatenate([[window.begin], s[bent], [window.end]])
    beside = np.concatenate([window.q[:1], q[bent], window.q[1:]])
    for j in (3, 5):
        q[~bent, j] = np.interp(s[~bent], lengths, beside[:, j])
    return q


def _window_with_offset(arm: Arm, route: Route, window: Window) -> Window | None:
    """The window with the tip aside, as little as it can be, to where the wrist is straight; None: it is nowhere."""
    s = np.linspace(window.begin, window.end, _PLACE_COUNT)
    q = window.joints(arm, route, s)
    bent = _wrist_volume(arm, q)
    flips = np.flatnonzero(bent[:-1] * bent[1:] <= 0)
    if len(flips) != 1:
        return None
    i = int(flips[0])
    f = float(bent[i] / (bent[i] - bent[i + 1]))
    posture, length = q[i] + f * (q[i + 1] - q[i]), float(s[i] + f * (s[i + 1] - s[i]))
    free = [0, 1, 2, 3, 5]
    for _ in range(_NEWTON_STEPS):  # the tool's direction first, then the tip as near as it goes; joint 5 is straight
        target, beyond = route.targets(np.array([length, length + _SLOPE_STEP]))
        along = (beyond - target)[:3, 3] / _SLOPE_STEP
        T, J = fk(arm, posture), jacobian(arm, posture)[:, free]
        displacement = T[:3, 3] - target[:3, 3]
        miss = np.concatenate([-_MIN_WEIGHT * displacement, _small_turns(T, target)])
        posture[free] += np.linalg.lstsq(np.concatenate([_MIN_WEIGHT * J[:3], J[3:]]), miss, rcond=1e-9)[0]
        length += float(displacement @ along)  # what leads along the path is no way aside
    return replace(window, turned=0.0, detour=Detour(window.begin, window.end, displacement))


def _follows_detour(arm: Arm, route: Route, window: Window) -> bool:
    """Whether the joints follow a window's detour, all along."""
    s = np.linspace(window.begin, window.end, _PLACE_COUNT)
    T, goal = fk(arm, _joints_in_window(arm, route, window, s)), add_detours(route, (window,)).targets(s)
    missed = np.abs(T[:, :3, 3] - goal[:, :3, 3]).max() + np.abs(_small_turns(T, goal)).max()
    return bool(missed < _EXACT_ERROR)


def _small_turns(T: Array, target: Array) -> Array:
    """Small turns from poses (..., 4, 4) to targets, in the base frame: (..., 3) [rad]."""
    R = target[..., :3, :3] @ np.swapaxes(T[..., :3, :3], -1, -2)
    return np.stack([R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], -1) / 2


def _window_between(arm: Arm, route: Route, lengths: Array, start: Array, end: Array) -> Window:
    """From a posture to another one, (n,) each, at lengths `lengths` (2,)."""
    q = np.stack([start, start + joint_change(arm, start, end)])
    slopes = []
    for s, posture in zip(lengths.tolist(), q, strict=True):
        neighbours = np.clip([s - _SLOPE_STEP, s + _SLOPE_STEP], 0.0, route.length)
        exact = correct_to_route(arm, route.task, np.stack([posture, posture]), route.targets(neighbours), steps=12)
        slopes.append((exact[1] - exact[0]) / (neighbours[1] - neighbours[0]))
    window = Window(float(lengths[0]), float(lengths[1]), q, np.array(slopes), np.inf)
    s = np.linspace(window.begin, window.end, _PLACE_COUNT)
    T, target = fk(arm, window.joints(arm, route, s)), route.targets(s)
    if np.linalg.norm(T[:, :3, 3] - target[:, :3, 3], axis=1).max() > 1e-6:
        return window
    trace = np.einsum("nij,nij->n", T[:, :3, :3], target[:, :3, :3])
    angle = np.arctan2(2 * np.linalg.norm(_small_turns(T, target), axis=1), trace - 1)
    return Window(window.begin, window.end, q, window.d, float(angle.max()))
