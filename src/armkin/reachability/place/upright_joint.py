"""Places of an arm with a vertical joint 1 off the base's axis, for targets without a prescribed azimuth.

A yaw then moves the foot of joint 1, so that each yaw is a different problem, but the other joints depend only on the
target's distance from this foot. They are solved at closely spaced radii. Between two radii the answer is certain if a
branch exists at both, or misses by more than the spacing, and if each joint is farther from its limits than it moves
between the radii; then only the azimuth of joint 1 remains to be checked. All other places, near limits and where
branches begin, end or meet, are undecided and need a solve (`by_radius`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armkin.formula.arrays import Array
from armkin.inverse.solve import columns
from armkin.model.limits import SLACK
from armkin.model.units import TURN
from armkin.reachability.cell_answers import whole_turn

if TYPE_CHECKING:
    from armkin.model.arm import Arm

RADII = 256  # number of radii from the axis of joint 1 to the reach
AT_ONCE = 16  # targets whose radii are solved together, so that their arrays fit the cache
ROUNDING = 1e-6  # distance [rad, mm, reaches] from a limit or a solution below which a place is solved


class Radii(NamedTuple):
    """Branches of T targets in C cells between radii with a spacing [mm].

    first: (T, B, C) joint 1 [rad] at azimuth 0. sure, open: (T, B, C) greatest offset [rad] of joint 1 from the middle
    of its limits at which the branch is legal in the whole cell, or may be legal; below 0 for never.
    """

    spacing: float
    first: Array
    sure_distance: Array
    open: Array

    def of_target(self, i: int) -> Radii:
        """The branches (B, C) of one target."""
        return Radii(self.spacing, self.first[i], self.sure_distance[i], self.open[i])


class Feet(NamedTuple):
    """Joint 1's foot [mm] and the yaw [rad] at every place and yaw: (P K,)."""

    x: Array
    y: Array
    yaw: Array


class Answers(NamedTuple):
    """The answers of a target for some feet, by their indices (k,): reached, or to be solved (k,)."""

    feet: NDArray[np.intp]
    reached: NDArray[np.bool_]
    to_ask: NDArray[np.bool_]


def by_radius(
    arm: Arm, task: str, targets: Array, place: Array, turns: Array
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]] | None:
    """Which targets (N, m) with z relative to the places are reached from places (P, 2) at yaws (K,): (P, N, K), and
    which of the others have to be solved; None for an arm without a closed form."""
    N, K = len(targets), len(turns)
    is_legal, is_undecided = np.zeros((N, len(place) * K), bool), np.zeros((N, len(place) * K), bool)
    feet = _feet(arm, place, turns)
    for start in range(0, N, AT_ONCE):
        block = targets[start : start + AT_ONCE]
        if (radii := _radii(arm, task, block)) is None:
            return None
        for i, target in enumerate(block):
            answers = _answers_from_feet(arm, radii.of_target(i), target, feet)
            is_legal[start + i, answers.feet], is_undecided[start + i, answers.feet] = answers.reached, answers.to_ask
    shape = (N, len(place), K)
    return is_legal.reshape(shape).transpose(1, 0, 2), is_undecided.reshape(shape).transpose(1, 0, 2)


def _feet(arm: Arm, place: Array, turns: Array) -> Feet:
    """Joint 1's foot at places (P, 2) and yaws (K,)."""
    c, s = np.cos(turns), np.sin(turns)
    x, y = arm.link[0][:2, 3]
    return Feet(
        x=(place[:, :1] + (c * x - s * y)).ravel(),
        y=(place[:, 1:] + (s * x + c * y)).ravel(),
        yaw=np.tile(turns, len(place)),
    )


def _answers_from_feet(arm: Arm, branches: Radii, target: Array, feet: Feet) -> Answers:
    """The answers from the branches of a target, by the distance of each foot and the azimuth of joint 1."""
    dx, dy = target[0] - feet.x, target[1] - feet.y
    every_cell = np.minimum(np.sqrt(dx * dx + dy * dy) * (1.0 / branches.spacing), RADII).astype(np.int32)
    is_open = np.append((branches.open >= 0.0).any(axis=0), False)
    in_reach = np.flatnonzero(is_open.take(every_cell))
    cell = every_cell.take(in_reach)
    # offset of joint 1 from the middle of its limits, for a branch where it is 0 at azimuth 0
    angle = np.arctan2(dy.take(in_reach), dx.take(in_reach))
    angle -= feet.yaw.take(in_reach)
    angle *= 1.0 if arm.link[0][2, 2] > 0 else -1.0
    angle -= _range_middle(arm, 0)
    is_reached, is_possible = np.zeros(len(in_reach), bool), np.zeros(len(in_reach), bool)
    for first, sure_distance, greatest in zip(branches.first, branches.sure_distance, branches.open, strict=True):
        if (greatest < 0.0).all():
            continue
        offset = first.take(cell)
        offset += angle
        offset -= TURN * np.rint(offset * (1.0 / TURN))
        offset = np.abs(offset, out=offset)
        is_reached |= offset <= sure_distance.take(cell)
        is_possible |= offset <= greatest.take(cell)
    return Answers(in_reach, is_reached, is_possible & ~is_reached)


def _radii(arm: Arm, task: str, targets: Array) -> Radii | None:
    """The branches of some targets, solved at every radius."""
    T, count = len(targets), RADII + 1
    spacing = arm.reach * (1.0 + ROUNDING) / RADII
    goals = np.repeat(targets, count, axis=0)
    goals[:, :2] = arm.link[0][:2, 3]
    goals[:, 0] += np.tile(np.arange(count) * spacing, T)
    if (blocks := columns(arm, goals, task, kept=True)) is None:
        return None
    parts = list(blocks)
    values = [np.concatenate([part.values[j] for part in parts], axis=1).reshape(-1, T, count) for j in range(arm.n)]
    miss = np.concatenate([part.miss for part in parts], axis=1).reshape(-1, T, count)
    valid = np.concatenate([part.valid for part in parts], axis=1).reshape(-1, T, count)
    is_unsolved = np.zeros(T * count, bool)
    is_unsolved[np.concatenate([part.rows.start + part.left for part in parts])] = True
    # nan, of a branch far from its target, is neither sure nor excluded, so that such cells are solved
    gap = np.sqrt(miss)
    is_excluded = _lesser_end(gap) > _cell_motion(gap) + spacing / arm.reach
    is_sure = valid[..., :-1] & valid[..., 1:]
    for j in range(1, arm.n):
        if not arm.prismatic[j] and whole_turn(arm, j):
            continue
        room, cell_motion = (_limit_distance(arm, values[j], j), _cell_motion(values[j], not arm.prismatic[j]))
        is_sure &= _lesser_end(room) > cell_motion
        is_excluded |= _lesser_end(-room) > cell_motion
    is_doubted = is_unsolved.reshape(T, count)
    is_doubted = is_doubted[:, :-1] | is_doubted[:, 1:]
    is_sure, is_excluded = is_sure & ~is_doubted, is_excluded & ~is_doubted
    half_range, cell_motion = _half_range(arm, 0), _cell_motion(values[0], True)
    axes = (1, 0, 2)
    return Radii(
        spacing,
        values[0][..., :-1].transpose(axes),
        np.where(is_sure, half_range - cell_motion, -1.0).transpose(axes),
        np.where(is_excluded, -1.0, np.where(np.isnan(cell_motion), np.inf, half_range + cell_motion)).transpose(axes),
    )


def _lesser_end(ends: Array) -> Array:
    """The smaller one of the values at both ends of each cell."""
    return np.minimum(ends[..., :-1], ends[..., 1:])


def _cell_motion(value: Array, turns: bool = False) -> Array:
    """Bound of the change of a value within a cell: the greatest change in the cell and its neighbours."""
    step = np.diff(value, axis=-1)
    if turns:
        step -= TURN * np.rint(step / TURN)
    step = np.abs(step) + ROUNDING
    padded = np.concatenate([step[..., :1], step, step[..., -1:]], axis=-1)
    return np.asarray(np.maximum(np.maximum(padded[..., :-2], padded[..., 2:]), step))


def _range_middle(arm: Arm, joint: int) -> float:
    return 0.0 if whole_turn(arm, joint) else 0.5 * float(arm.lower[joint] + arm.upper[joint])


def _half_range(arm: Arm, joint: int) -> float:
    return np.inf if whole_turn(arm, joint) else 0.5 * float(arm.upper[joint] - arm.lower[joint]) + SLACK


def _limit_distance(arm: Arm, value: Array, joint: int) -> Array:
    """Distance of a joint from its limits; negative outside."""
    if arm.prismatic[joint]:
        return np.asarray(np.minimum(value - arm.lower[joint], arm.upper[joint] - value))
    offset = value - _range_middle(arm, joint)
    return np.asarray(_half_range(arm, joint) - np.abs(offset - TURN * np.rint(offset / TURN)))
