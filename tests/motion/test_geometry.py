"""Pieces of tool paths: the arc through three points, whichever way round, and however far."""

from __future__ import annotations

import math

import numpy as np
import pytest

import armkin
from armkin.inverse.tasks.choose_task import task_for
from armkin.motion.tool_path.corner_blend import blend
from armkin.motion.tool_path.path_pieces import rotation_matrices, split_target
from armkin.motion.tool_path.piece_shapes import arc, line

TASK = task_for(armkin.load("three_dof"))


@pytest.mark.parametrize("degrees", [10, 90, 179, 181, 270, 350])
@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("tilt", [0.0, 1.1, math.pi])
def test_an_arc_goes_through_its_points_once_and_no_farther(degrees: float, way: int, tilt: float) -> None:
    centre, radius = np.array([300.0, -40.0, 210.0]), 55.0

    def on_circle(angle: float) -> np.ndarray:
        x, y = math.cos(angle), math.sin(angle)
        return centre + radius * np.array([x, y * math.cos(tilt), y * math.sin(tilt)])

    angle = way * math.radians(degrees)
    first, via, last = on_circle(0.3), on_circle(0.3 + 0.4 * angle), on_circle(0.3 + angle)
    piece = arc(TASK, split_target(TASK, first), via, split_target(TASK, last))
    assert piece.length == pytest.approx(radius * abs(angle), rel=1e-9)
    shares = np.linspace(0.0, 1.0, 41)
    expected = np.array([on_circle(0.3 + share * angle) for share in shares])
    np.testing.assert_allclose(piece.targets(shares * piece.length), expected, atol=1e-8)


def test_a_rounded_corner_turns_the_tool_on_as_the_next_line_does() -> None:
    """Position and orientation both leave a blend in the direction in which the next piece goes on."""
    task = task_for(armkin.load("ur5e"))
    places = [np.eye(4), np.eye(4), np.eye(4)]
    for place, xyz, rpy in zip(places, ([300, 0, 300], [400, 0, 300], [400, 100, 300]), (0.0, 0.9, -0.8), strict=True):
        place[:3, 3] = xyz
        place[:3, :3] = rotation_matrices(np.array([rpy, 0.4 * rpy**2, 0.3]))
    spots = [split_target(task, place) for place in places]
    _, rounded, after, _ = blend(task, line(task, *spots[:2]), line(task, *spots[1:]), 30.0, 100.0)
    np.testing.assert_allclose(rounded.direction(rounded.length), after.direction(0.0), atol=1e-4)
