"""The chords between consecutive points: lengths, turns and sagittas."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from armkin.formula.arrays import Array, Bool, Int

CORNER_ANGLE = np.deg2rad(20.0)  # a turn above this angle [rad] is a corner
SHORT_SHARE = 1 / 3  # a neighbour below this share of a chord does not determine its curvature
_SAME_POINT = 1e-6  # distance [mm] below which points are the same


@dataclass(frozen=True)
class Chords:
    """Points (N, d), no two neighbours the same, and which of them are corners."""

    y: Array
    corner: Bool  # (N,) the ends are none

    @cached_property
    def step(self) -> Array:
        """From each point to the next: (N - 1, d)."""
        return np.asarray(np.diff(self.y, axis=0))

    @cached_property
    def length(self) -> Array:
        """Length of every chord: (N - 1,)."""
        return np.asarray(np.linalg.norm(self.step, axis=1))

    @cached_property
    def u(self) -> Array:
        """The length of the polygon from its first point to each point: (N,)."""
        return np.concatenate([[0.0], np.cumsum(self.length)])

    @cached_property
    def curve(self) -> Int:
        """Number of the curve that each chord belongs to: (N - 1,)."""
        return np.asarray(np.cumsum(self.corner[:-1]))

    @cached_property
    def sagitta(self) -> Array:
        """How far the circle through a chord's ends and either neighbour leaves the chord: (N - 1,)."""
        L, sagittas = self.length, np.zeros(len(self.length))
        span = np.linalg.norm(self.y[2:] - self.y[:-2], axis=1)
        turns = turn_angles(self.y)
        with np.errstate(divide="ignore", invalid="ignore"):
            bend = 2 * np.sin(turns) / span  # 1 / radius
        for chord, neighbour in ((slice(1, None), slice(None, -1)), (slice(None, -1), slice(1, None))):
            sine = np.minimum(0.5 * L[chord] * bend, 1.0)
            rise = np.where(bend > 1e-15, (1 - np.sqrt(1 - sine**2)) / np.maximum(bend, 1e-300), 0.0)
            is_known = (turns <= CORNER_ANGLE) & (L[neighbour] >= SHORT_SHARE * L[chord])
            sagittas[chord] = np.maximum(sagittas[chord], np.where(is_known, rise, 0.0))
        return sagittas


def turn_angles(y: Array) -> Array:
    """How far the direction turns at every point but the ends: (N, d) -> (N - 2,) [rad]."""
    step = np.diff(y, axis=0)
    unit = step / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-300)
    a, b = unit[:-1], unit[1:]
    return np.asarray(2 * np.arctan2(np.linalg.norm(a - b, axis=1), np.linalg.norm(a + b, axis=1)))


def distinct_points(y: Array) -> Int:
    """Indices of the points (N, d) that differ from the next one, and of the last."""
    is_new = np.linalg.norm(np.diff(y, axis=0), axis=1) > _SAME_POINT
    return np.flatnonzero(np.append(True, is_new))
