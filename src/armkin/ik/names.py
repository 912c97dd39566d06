"""Names of branches: left or right, elbow up or down, wrist flipped or not.

A branch is one choice of sign on each branch axis of a closed form; along a path of
targets it keeps its sign, and so its name, until it merges with its neighbour. What a sign
means is found once for each arm, by looking at a few postures.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from armkin.arm import Arm
    from armkin.ik.geometry import Geometry
    from armkin.ik.tasks import Task


def branch_names(arm: Arm, task: Task, geometry: Geometry, count: int) -> tuple[str, ...]:
    """A name for each branch index."""
    return tuple(f"branch {i + 1}" for i in range(count))
