"""Passes wrist singularities: the tool turns aside a little, or the tip makes a detour within the tolerance.

Near a wrist singularity joint 4 has to swing round over a distance as short as that between path and singularity.
Instead, the wrist joints follow cubics over a window, from the posture before it to the flipped one behind it, while
the first three joints hold the tip on the path. If the tool may not turn but the singularity is within the tolerance,
the tip makes a detour exactly through it, where joint 4 need not swing at all.
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
from armkin.motion.branches.branch_chains import BranchChain
from armkin.motion.branches.branch_columns import BranchColumns
from armkin.motion.branches.joint_steps import MIN_LEVER, joint_change
from armkin.motion.branches.solve_on_route import correct_to_route
from armkin.motion.branches.wrist_window import Window, add_detours
from armkin.motion.tool_path.route import Detour

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.motion.tool_path.route import Route

ASIDE_SHARE = 0.5  # share of the tolerance that a detour of the tip may take
_NEAR_DISTANCE = 2.0  # distance [tolerances] from straight up to which a window is tried
_ARM_MOVEMENT = 0.1  # most movement [rad] of the first three joints in a wrist flip
_HALF_WIDTH, _WIDTH_FACTOR, _WIDTH_COUNT = 0.25, 1.5, 14  # windows: smallest half width [mm], growth factor, count
_WINDOW_GAP = 0.1  # largest gap [mm] between the chains before and behind a singularity
_SLOPE_STEP = 0.01  # distance [mm] of the difference quotients for slopes
_PLACE_COUNT = 97  # places in a window at which the tool is checked
_MAX_SINGULARITIES = 16  # most singularities that one chain passes
_EXACT_ERROR = 1e-6  # greatest error [mm and rad] of a posture that meets its target
_ROUNDING_SHARE = 1e-12  # wrist volume below which it is rounding error
_VOLUME_SHARE = 1e-4  # wrist volume below which joint 4 is undetermined
_MIN_WEIGHT = 1e-8  # weight [1/mm] of position beside direction, which comes first
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
    arm: Arm, route: Route, columns: BranchColumns, chains: list[BranchChain], turn: float, tip_offset: float
) -> list[BranchChain]:
    """The chains, and those that pass a singularity and go on with the wrist flipped.

    turn: [rad] by which the tool may turn aside; tip_offset: [mm] length of a detour, at most.
    """
    s, all_chains, latest = columns.s, list(chains), list(chains)
    max_volume = _NEAR_DISTANCE * max(np.sin(turn), tip_offset / MIN_LEVER)
    for _ in range(_MAX_SINGULARITIES):
        joined_chains = []
        for chain in latest:
            for sample in _straight_samples(arm, chain, max_volume):
                if chain.windows and s[sample] <= chain.windows[-1].end:
                    continue
                for next_chain in chains:
                    new_chain = _chain_through_window(arm, route, s, chain, next_chain, sample, (turn, tip_offset))
                    joined_chains += [] if new_chain is None else [new_chain]
        all_chains, latest = all_chains + joined_chains, joined_chains
        if not joined_chains or len(all_chains) > _MAX_SINGULARITIES * len(chains):
            break
    return all_chains


@lru_cache(maxsize=256)
def _volumes_at_three(arm: Arm) -> tuple[float, float, float]:
    """Volumes [1] that the wrist's axes span where joint 5 has turned by 0, 90 and 180 degrees."""
    postures = np.tile(arm.home, (3, 1))
    postures[:, 4] = np.array([0.0, 0.5, 1.0]) * np.pi / arm.ratio[4]
    axes = jacobian(arm, postures)[:, 3:, 3:]
    a, b, c = np.linalg.det(axes / np.linalg.norm(axes, axis=1, keepdims=True)).tolist()
    return a, b, c


def _wrist_volume(arm: Arm, q: Array) -> Array:
    """The volume of the wrist's axes at joint values (N, n), by joint 5 alone; 0 for a straight wrist: (N,)."""
    a, b, c = _volumes_at_three(arm)
    angle = q[:, 4] * arm.ratio[4]
    return np.asarray((a + c) / 2 + (a - c) / 2 * np.cos(angle) + (b - (a + c) / 2) * np.sin(angle))


def _straight_samples(arm: Arm, chain: BranchChain, max_volume: float) -> list[int]:
    """Samples at which the wrist volume of a chain has a local minimum below `max_volume`."""
    volumes = np.abs(_wrist_volume(arm, chain.q))
    volumes[volumes < _ROUNDING_SHARE] = 0.0  # else rounding makes minima all along a singular route
    step = np.diff(volumes)
    is_minimum = np.append(True, step <= 0) & np.append(step > 0, True)
    # possible decrease between samples
    decrease = np.maximum(np.append(0.0, np.abs(step)), np.append(np.abs(step), 0.0))
    return (chain.first + np.flatnonzero(is_minimum & (volumes - decrease < max_volume))).tolist()


def _window_spans(
    route: Route, s: Array, chain: BranchChain, next_chain: BranchChain, j: int
) -> Iterator[tuple[int, int]]:
    """First and last samples of ever wider windows around sample j, within one piece of the route."""
    piece = int(np.searchsorted(route.breaks, s[j]))
    low, high = route.breaks[max(piece - 1, 0)], route.breaks[min(piece, len(route.breaks) - 1)]
    low = max(low, s[chain.first], chain.windows[-1].end if chain.windows else 0.0)
    high = min(high, s[next_chain.last])
    for half_width in _HALF_WIDTH * _WIDTH_FACTOR ** np.arange(_WIDTH_COUNT):
        a, b = int(np.searchsorted(s, s[j] - half_width, side="right")) - 1, int(np.searchsorted(s, s[j] + half_width))
        if a < chain.first or b > min(next_chain.last, len(s) - 1) or s[a] < low or s[b] > high:
            return
        if b >= next_chain.first:
            yield a, b


def _widest_window(
    arm: Arm, route: Route, window: Callable[[int], Window], numbers: range, allowed: tuple[float, float]
) -> tuple[int, Window] | None:
    """The widest window in which the tool turns little enough, else one with a detour of the tip, and its number.

    window: gives a window by its number, the higher the wider; allowed: turn of the tool [rad], detour of the tip [mm].
    """
    turn, max_offset = allowed
    if turn and (allowed_numbers := [k for k in numbers if window(k).turned <= turn]):
        return allowed_numbers[-1], window(allowed_numbers[-1])
    for k in reversed(numbers) if max_offset else ():
        detour_window = _window_with_offset(arm, route, window(k))
        if detour_window is None or detour_window.tip_offset > max_offset:  # a narrower window needs the same detour
            return None
        if _follows_detour(arm, route, detour_window):
            return k, detour_window
    return None


def _chain_through_window(
    arm: Arm, route: Route, s: Array, chain: BranchChain, next_chain: BranchChain, j: int, allowed: tuple[float, float]
) -> BranchChain | None:
    """A chain up to a window around sample j, then `next_chain`, which may be the same; None: no window is allowed."""
    next_sample = max(j, next_chain.first)  # at a singularity one chain may end before the other begins
    if not (chain.first <= j <= chain.last and next_sample <= next_chain.last and s[next_sample] - s[j] <= _WINDOW_GAP):
        return None
    step = joint_change(arm, chain.q[j - chain.first], next_chain.q[next_sample - next_chain.first])
    if np.abs(step[:3]).max() > _ARM_MOVEMENT:
        return None
    spans = list(_window_spans(route, s, chain, next_chain, j))

    @cache
    def window(k: int) -> Window:
        a, b = spans[k]
        return _window_between(arm, route, s[[a, b]], chain.q[a - chain.first], next_chain.q[b - next_chain.first])

    widest = _widest_window(arm, route, window, range(len(spans)), allowed)
    if widest is None:
        return None
    (a, b), crossing = spans[widest[0]], widest[1]
    q_inside = _joints_in_window(arm, route, crossing, s[a + 1 : b])
    offset = crossing.q[1] - next_chain.q[b - next_chain.first]
    q = np.concatenate([chain.q[: a + 1 - chain.first], q_inside, next_chain.q[b - next_chain.first :] + offset])
    left, right = chain.labels[: j - chain.first], next_chain.labels[next_sample - next_chain.first :]
    labels = np.concatenate([left, np.repeat(right[:1], len(q) - len(left) - len(right)), right])
    return BranchChain(arm, chain.first, q, labels, (*chain.windows, crossing))


def _joints_in_window(arm: Arm, route: Route, window: Window, s: Array) -> Array:
    """Joint values at lengths s (N,) inside of a window: (N, n)."""
    q = window.joints(arm, route, s)
    if window.detour is None or not len(s):
        return q
    q = correct_to_route(arm, route.task, q, add_detours(route, (window,)).targets(s), steps=12)
    # interpolate joints 4 and 6 where the wrist is nearly straight
    is_bent = np.abs(_wrist_volume(arm, q)) > _VOLUME_SHARE
    lengths = np.concatenate([[window.begin], s[is_bent], [window.end]])
    q_known = np.concatenate([window.q[:1], q[is_bent], window.q[1:]])
    for joint in (3, 5):
        q[~is_bent, joint] = np.interp(s[~is_bent], lengths, q_known[:, joint])
    return q


def _window_with_offset(arm: Arm, route: Route, window: Window) -> Window | None:
    """The window with the smallest detour of the tip to a straight wrist; None: the wrist is nowhere straight in it."""
    s = np.linspace(window.begin, window.end, _PLACE_COUNT)
    q = window.joints(arm, route, s)
    volumes = _wrist_volume(arm, q)
    crossings = np.flatnonzero(volumes[:-1] * volumes[1:] <= 0)
    if len(crossings) != 1:
        return None
    i = int(crossings[0])
    fraction = float(volumes[i] / (volumes[i] - volumes[i + 1]))
    posture, length = q[i] + fraction * (q[i + 1] - q[i]), float(s[i] + fraction * (s[i + 1] - s[i]))
    free_joints = [0, 1, 2, 3, 5]
    for _ in range(_NEWTON_STEPS):  # keep the direction, then move the tip close; joint 5 stays straight
        target, next_target = route.targets(np.array([length, length + _SLOPE_STEP]))
        tangent = (next_target - target)[:3, 3] / _SLOPE_STEP
        T, J = fk(arm, posture), jacobian(arm, posture)[:, free_joints]
        displacement = T[:3, 3] - target[:3, 3]
        miss = np.concatenate([-_MIN_WEIGHT * displacement, _small_turns(T, target)])
        posture[free_joints] += np.linalg.lstsq(np.concatenate([_MIN_WEIGHT * J[:3], J[3:]]), miss, rcond=1e-9)[0]
        length += float(displacement @ tangent)  # the part along the path is no detour
    return replace(window, turned=0.0, detour=Detour(window.begin, window.end, displacement))


def _follows_detour(arm: Arm, route: Route, window: Window) -> bool:
    """Whether the joints meet the detoured targets in the whole window."""
    s = np.linspace(window.begin, window.end, _PLACE_COUNT)
    T, goal = fk(arm, _joints_in_window(arm, route, window, s)), add_detours(route, (window,)).targets(s)
    miss = np.abs(T[:, :3, 3] - goal[:, :3, 3]).max() + np.abs(_small_turns(T, goal)).max()
    return bool(miss < _EXACT_ERROR)


def _small_turns(T: Array, target: Array) -> Array:
    """Small turns from poses (..., 4, 4) to targets, in the base frame: (..., 3) [rad]."""
    R = target[..., :3, :3] @ np.swapaxes(T[..., :3, :3], -1, -2)
    return np.stack([R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], -1) / 2


def _window_between(arm: Arm, route: Route, lengths: Array, start: Array, end: Array) -> Window:
    """The window from posture `start` to `end`, (n,) each, at lengths (2,)."""
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
