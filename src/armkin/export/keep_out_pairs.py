"""Tables of an arm's keep-outs for C and JavaScript: segments, obstacles, and the pairs that must not touch."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from armkin.keep_out.body_pairs import guard

if TYPE_CHECKING:
    from armkin.model.arm import Arm

_KINDS = {"floor": 0, "box": 1, "capsule": 2}


class Tables(NamedTuple):
    """The tables of segments, obstacles and pairs."""

    thick: list[float]  # radius of each segment [mm]
    solid: int  # number of bodies that may hit obstacles
    moving: list[tuple[int, int]]  # a segment, and the index of its body among those
    shapes: list[tuple[int, list[float]]]  # kind of each obstacle, and its numbers
    crossings: list[tuple[int, int, int]]  # two segments, and the index of their pair
    pairs: list[tuple[str, str]]  # names of a body and of the other body or obstacle


def pair_tables(arm: Arm) -> Tables:
    """The tables of an arm with keep-outs: pairs of obstacles and moving bodies, then pairs of bodies."""
    arm_guard = guard(arm)
    arm_bodies = arm_guard.bodies
    solid = sorted({int(arm_bodies.owner[k]) for k in arm_guard.moving_segments})
    shapes = []
    for _, obstacle in arm_guard.obstacles:
        kind, values = obstacle.c_function()
        shapes.append((_KINDS[kind], list(map(float, values))))
    pair_of_crossing = np.searchsorted(arm_guard.starts, np.arange(len(arm_guard.ours)), side="right") - 1
    pair_of_crossing += len(shapes) * len(solid)  # pairs of a body and an obstacle are numbered first
    return Tables(
        thick=arm_bodies.radius[arm_bodies.owner].tolist(),
        solid=len(solid),
        moving=[(int(k), solid.index(int(arm_bodies.owner[k]))) for k in arm_guard.moving_segments],
        shapes=shapes,
        crossings=list(zip(arm_guard.ours.tolist(), arm_guard.theirs.tolist(), pair_of_crossing.tolist(), strict=True)),
        pairs=[arm_guard.pair_names(k) for k in range(len(arm_guard.pairs))],
    )
