"""Places of an arm whose joint 1 stands upright beside the base's axis, for targets that say nothing about azimuth.

A yaw then moves joint 1's foot, and each yaw is a question of its own; but what the joints behind it are asked depends
on the target's distance from that foot alone. They are solved at radii so close to each other that between most of
them nothing happens: a branch is there, or is missing by more than the radii are apart, and each joint is farther from
its limits than it moves from radius to radius. What lies there is read off, with joint 1's azimuth. Elsewhere, near
limits and where branches begin, end or meet, the place itself is asked: `by_radius` says where.
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

RADII = 256  # radii from joint 1's axis to the reach
AT_ONCE = 16  # targets whose radii are solved together: they stay in the cache
ROUNDING = 1e-6  # distance [rad, mm, reaches] from a limit, or from being there, below which a place is asked


class Radii(NamedTuple):
    """Branches of T targets in C cells between radii that are `spacing` [mm] apart.

    first: (T, B, C) joint 1 [rad] at azimuth 0. sure, open: (T, B, C) how far [rad] it may be from the middle of its
    limits, so that the branch is legal anywhere in the cell, or may be; below 0: nowhere.
    """

    spacing: float
    first: Array
    sure: Array
    open: Array

    def of_target(self, i: int) -> Radii:
        """The branches (B, C) of one target."""
        return Radii(self.spacing, self.first[i], self.sure[i], self.open[i])


class Feet(NamedTuple):
    """Joint 1's foot [mm] and the yaw [rad] at every place and yaw: (P K,)."""

    x: Array
    y: Array
    yaw: Array


class Answers(NamedTuple):
    """What a target is answered from some of the feet, by their numbers (k,): reached, or to be asked (k,)."""

    feet: NDArray[np.intp]
    reached: NDArray[np.bool_]
    to_ask: NDArray[np.bool_]


def by_radius(
    arm: Arm, task: str, targets: Array, place: Array, turns: Array
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]] | None:
    """Which targets (N, m), at heights above the places, are reached from places (P, 2) at yaws (K,): (P, N, K), and
    which of the rest have to be asked; None for an arm without a closed form."""
    N, K = len(targets), len(turns)
    legal, open_cases = np.zeros((N, len(place) * K), bool), np.zeros((N, len(place) * K), bool)
    feet = _feet(arm, place, turns)
    for start in range(0, N, AT_ONCE):
        block = targets[start : start + AT_ONCE]
        if (radii := _radii(arm, task, block)) is None:
            return None
        for i, target in enumerate(block):
            answers = _answers_from_feet(arm, radii.of_target(i), target, feet)
            legal[start + i, answers.feet], open_cases[start + i, answers.feet] = answers.reached, answers.to_ask
    shape = (N, len(place), K)
    return legal.reshape(shape).transpose(1, 0, 2), open_cases.reshape(shape).transpose(1, 0, 2)


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
    """What is read off the target's branches, by each foot's distance and joint 1's azimuth there; elsewhere: none."""
    dx, dy = target[0] - feet.x, target[1] - feet.y
    every_cell = np.minimum(np.sqrt(dx * dx + dy * dy) * (1.0 / branches.spacing), RADII).astype(np.int32)
    is_open = np.append((branches.open >= 0.0).any(axis=0), False)
    near = np.flatnonzero(is_open.take(every_cell))
    cell = every_cell.take(near)
    # joint 1, from the middle of its limits, for a branch that has it at 0 where the azimuth is 0
    angle = np.arctan2(dy.take(near), dx.take(near))
    angle -= feet.yaw.take(near)
    angle *= 1.0 if arm.link[0][2, 2] > 0 else -1.0
    angle -= _range_middle(arm, 0)
    reached, possible = np.zeros(len(near), bool), np.zeros(len(near), bool)
    for first, sure, most in zip(branches.first, branches.sure, branches.open, strict=True):
        if (most < 0.0).all():
            continue
        away = first.take(cell)
        away += angle
        away -= TURN * np.rint(away * (1.0 / TURN))
        away = np.abs(away, out=away)
        reached |= away <= sure.take(cell)
        possible |= away <= most.take(cell)
    return Answers(near, reached, possible & ~reached)


def _radii(arm: Arm, task: str, targets: Array) -> Radii | None:
    """The branches of some targets, solved at every radius."""
    T, count = len(targets), RADII + 1
    apart = arm.reach * (1.0 + ROUNDING) / RADII
    goals = np.repeat(targets, count, axis=0)
    goals[:, :2] = arm.link[0][:2, 3]
    goals[:, 0] += np.tile(np.arange(count) * apart, T)
    if (blocks := columns(arm, goals, task, kept=True)) is None:
        return None
    parts = list(blocks)
    values = [np.concatenate([part.values[j] for part in parts], axis=1).reshape(-1, T, count) for j in range(arm.n)]
    miss = np.concatenate([part.miss for part in parts], axis=1).reshape(-1, T, count)
    valid = np.concatenate([part.valid for part in parts], axis=1).reshape(-1, T, count)
    left = np.zeros(T * count, bool)
    left[np.concatenate([part.rows.start + part.left for part in parts])] = True
    # nan, of a branch that is nowhere near its target, is neither sure nor excluded: such cells are asked
    gap = np.sqrt(miss)
    never = _lesser_end(gap) > _cell_motion(gap) + apart / arm.reach
    sure = valid[..., :-1] & valid[..., 1:]
    for j in range(1, arm.n):
        if not arm.prismatic[j] and whole_turn(arm, j):
            continue
        room, moved = _limit_distance(arm, values[j], j), _cell_motion(values[j], not arm.prismatic[j])
        sure &= _lesser_end(room) > moved
        never |= _lesser_end(-room) > moved
    doubted = left.reshape(T, count)
    doubted = doubted[:, :-1] | doubted[:, 1:]
    sure, never = sure & ~doubted, never & ~doubted
    half, moved = _half_range(arm, 0), _cell_motion(values[0], True)
    rows = (1, 0, 2)
    return Radii(
        apart,
        values[0][..., :-1].transpose(rows),
        np.where(sure, half - moved, -1.0).transpose(rows),
        np.where(never, -1.0, np.where(np.isnan(moved), np.inf, half + moved)).transpose(rows),
    )


def _lesser_end(ends: Array) -> Array:
    """The lesser of what stands at a cell's two ends."""
    return np.minimum(ends[..., :-1], ends[..., 1:])


def _cell_motion(value: Array, turns: bool = False) -> Array:
    """How far a value may move within a cell: as far as in that cell or in those beside it."""
    step = np.diff(value, axis=-1)
    if turns:
        step -= TURN * np.rint(step / TURN)
    step = np.abs(step) + ROUNDING
    wide = np.concatenate([step[..., :1], step, step[..., -1:]], axis=-1)
    return np.asarray(np.maximum(np.maximum(wide[..., :-2], wide[..., 2:]), step))


def _range_middle(arm: Arm, joint: int) -> float:
    return 0.0 if whole_turn(arm, joint) else 0.5 * float(arm.lower[joint] + arm.upper[joint])


def _half_range(arm: Arm, joint: int) -> float:
    return np.inf if whole_turn(arm, joint) else 0.5 * float(arm.upper[joint] - arm.lower[joint]) + SLACK


def _limit_distance(arm: Arm, value: Array, joint: int) -> Array:
    """How far from its limits a joint is; negative outside."""
    if arm.prismatic[joint]:
        return np.asarray(np.minimum(value - arm.lower[joint], arm.upper[joint] - value))
    away = value - _range_middle(arm, joint)
    return np.asarray(_half_range(arm, joint) - np.abs(away - TURN * np.rint(away / TURN)))
