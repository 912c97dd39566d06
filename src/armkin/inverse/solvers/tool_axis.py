"""Position and direction of the tool's z axis with five joints: xyz_axis.

A sixth, virtual joint about the tool's z axis makes it a full pose whose turn about z is
anything: any orientation with the wanted axis will do, and the virtual joint is dropped.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from armkin.formula import arrays, pose
from armkin.formula.arrays import Array, Entry
from armkin.inverse.closed.geometry import Geometry, Rows
from armkin.inverse.closed.subproblems import Candidates, Prefer
from armkin.inverse.elimination.merge import projection
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm, from_links


def recognise(arm: Arm, task: Task, class_of: Callable[[Arm], Geometry]) -> Geometry | None:
    """Five joints of any geometry; class_of: the class of an arm of six joints for full poses."""
    if task.name != "xyz_axis" or arm.n != 5:
        return None
    inner = class_of(from_links([*arm.link, np.eye(4)], [*arm.prismatic, False]))
    reason = f"with a virtual joint about the tool's axis: {inner.why}"
    if inner.pairs is not None:
        solve = inner.pairs

        def pairs(goal: list[Entry], prefer: Prefer) -> Candidates:
            # where the virtual joint is free the other joints' values give its own
            candidates = solve(pose_of(goal), [*prefer, prefer[4]])
            return candidates._replace(pairs=candidates.pairs[:5], angles=candidates.angles[:5])

        ends = tuple(j for j in inner.ends if j < 5)
        return replace(inner, why=reason, pairs=pairs, ends=ends, doubts=None)
    solve_rows = inner.rows
    assert solve_rows is not None

    def rows(goal: Array) -> Rows:
        T = np.empty((len(goal), 4, 4))
        pose.write_pose(pose_of(list(goal.T)), T)
        branches = solve_rows(T)
        guesses = None if branches.guesses is None else branches.guesses[:, :, :5]
        q = branches.q[:, :, :5]
        order = projection(arm.prismatic, q).argsort(axis=1)
        return branches._replace(q=np.take_along_axis(q, order[:, :, None], axis=1), guesses=guesses)

    return replace(inner, why=reason, rows=rows, unmoved=None, places=None)


def pose_of(goal: list[Entry]) -> pose.Pose:
    """A pose at x y z whose z axis is ax ay az; x is across, without a jump near the poles' axis (Duff et al. 2017)."""
    x, y, z = goal[3:6]
    sign = arrays.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    return [1.0 + sign * x * x * a, sign * b, -sign * x, b, sign + y * y * a, -y, x, y, z, *goal[:3]]
