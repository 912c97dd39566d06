"""Lines in the workspace of an arm."""

from __future__ import annotations

import numpy as np

import armkin
from armkin.inverse.tasks.choose_task import task_for
from armkin.inverse.tasks.task import targets_of
from armkin.motion.tool_path.path_pieces import Piece, Spot, split_target
from armkin.motion.tool_path.piece_shapes import line


def random_line(arm: armkin.Arm, rng: np.random.Generator) -> Piece:
    """300 mm in a random direction from where random legal joint values put the tool."""
    task = task_for(arm)
    low = np.where(np.isfinite(arm.lower), arm.lower, -np.pi)
    high = np.where(np.isfinite(arm.upper), arm.upper, np.pi)
    q = rng.uniform(low, high)
    a = split_target(task, targets_of(task, armkin.fk(arm, q)[None], q[None])[0])
    d = rng.normal(size=len(a.position))
    return line(task, a, Spot(a.position + 300 * d / np.linalg.norm(d), a.sums, a.orientation))
