"""Every other arm of up to six joints, for full poses: numeric elimination.

An arm with fewer joints gets virtual ones at its tool; its own branches are those that
leave the virtual joints at zero. Completeness: see `armkin.inverse.elimination.method`; a branch of the
shorter arm is an isolated branch of the longer one wherever its own Jacobian has full rank,
because the virtual axes are in general position.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from armkin.formula.arrays import Array, Bool
from armkin.inverse.closed.geometry import Geometry, Rows
from armkin.inverse.elimination import method
from armkin.inverse.numeric import newton
from armkin.inverse.numeric.tolerances import AT_ZERO
from armkin.inverse.tasks.task import Task
from armkin.model.rotation import inverse

if TYPE_CHECKING:
    from armkin.model.arm import Arm


def recognise(arm: Arm, task: Task) -> Geometry | None:
    """Full poses of any arm of up to six joints."""
    if task.name != "pose" or arm.n > 6 or arm.n < 2:
        return None
    if arm.n == 6:
        prepared = method.prepare(arm.link, arm.prismatic)
        return Geometry(
            "general elimination",
            "no axes meet or run parallel as a closed form would need: numeric elimination, up to 16 branches",
            prepared.complete,
            rows=lambda T: _six(prepared, T),
            ordered=False,
            elimination=prepared,
        )
    link, prismatic = _padded(arm)
    prepared = method.prepare(link, prismatic)

    def rows(T: Array) -> Rows:
        q, _, settled = method.solve(prepared, T)
        n = arm.n
        with np.errstate(invalid="ignore"):
            hit = np.abs(q[:, :, n:]).max(axis=2) < AT_ZERO
        k, b = np.nonzero(hit)
        own = np.full((*q.shape[:2], n), np.nan)
        if len(k):
            better, size = newton.correct(arm, task, q[k, b, :n], T[k])
            own[k, b] = np.where((size < 1e-12)[:, None], better, np.nan)
        missing = np.isnan(own[:, :, 0])
        count = (~missing).sum(axis=1)
        order = np.argsort(missing, axis=1, kind="stable")[:, : max(int(count.max(initial=0)), 1)]
        return Rows(
            np.take_along_axis(own, order[:, :, None], axis=1), hit.sum(axis=1) > count, settled & prepared.complete
        )

    return Geometry(
        "general elimination",
        f"{arm.n} joints for a pose of six: {6 - arm.n} virtual joints added at the tool must stay at zero",
        prepared.complete,
        rows=rows,
        ordered=False,
    )


def _six(prepared: method.Elimination, T: Array) -> Rows:
    """Branches of six joints; complete where the elimination settled the pose and the arm has a regular pencil."""
    q, doubt, settled = method.solve(prepared, T)
    return Rows(q, doubt, settled & prepared.complete)


def _padded(arm: Arm) -> tuple[Array, Bool]:
    """The arm's chain with virtual revolute joints after its tool, up to six joints."""
    rng = np.random.default_rng(7)
    links = list(arm.link)
    undo = np.eye(4)
    for _ in range(6 - arm.n):
        G = np.eye(4)
        G[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        if np.linalg.det(G[:3, :3]) < 0:
            G[:3, 0] *= -1
        G[:3, 3] = rng.uniform(0.2, 0.4, 3) * arm.reach
        links[-1] = links[-1] @ G
        links.append(np.eye(4))
        undo = undo @ G
    links[-1] = inverse(undo)
    return np.array(links), np.array([*arm.prismatic, *[False] * (6 - arm.n)])
