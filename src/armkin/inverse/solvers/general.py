"""Every other arm of up to six joints, for full poses: numeric elimination.

An arm with fewer joints gets virtual ones; its own branches are those that leave the virtual joints at zero.
Five joints of which two at an end meet get one through that point, which makes a spherical wrist or shoulder, a
closed form. Others get theirs at the tool, in general position. Completeness: see
`armkin.inverse.elimination.method`; a branch of the shorter arm is an isolated branch of the longer one wherever
its own Jacobian has full rank, because the virtual axes are in general position.
"""

from functools import partial

import numpy as np

from armkin.formula.arrays import Array, Bool, Entry
from armkin.inverse.closed import spherical
from armkin.inverse.closed.candidates import is_sound
from armkin.inverse.closed.geometry import ClosedForm, Geometry, Rows
from armkin.inverse.closed.subproblems import Candidates, Pair, Prefer, distance2
from armkin.inverse.closed.wrist import perpendicular_foot
from armkin.inverse.elimination import method
from armkin.inverse.numeric import newton
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm, from_links
from armkin.model.joint_chain import Chain, is_parallel, reverse_chain
from armkin.model.rotation import inverse, rotation_about

PHASE = 0.7321  # angle [rad] of the plane's arbitrary turn
NAME = "general elimination"  # name of the method, as a solution shows it
_POSE = Task("pose", 3, np.zeros((0, 6)), np.zeros(0), "full")


def recognise(arm: Arm, task: Task) -> Geometry | None:
    """Full poses of any arm of up to six joints."""
    if task.name != "pose" or arm.n > 6 or arm.n < 2:
        return None
    if arm.n == 6:
        prepared = method.prepare(arm.link, arm.prismatic)
        reason = "no axes meet or run parallel as a closed form would need: numeric elimination, up to 16 branches"
        solve, unmoved = (partial(_solve_six, prepared, shake=shake) for shake in (True, False))
        return Geometry(NAME, reason, prepared.complete, None, solve, unmoved, ordered=False, elimination=prepared)
    if arm.n == 5 and (wrist := _with_wrist(arm, task)) is not None:
        return wrist
    link, prismatic = _with_virtual_joints(arm)
    prepared = method.prepare(link, prismatic)

    def rows(T: Array) -> Rows:
        q, doubt, is_settled, shaken, guesses = method.solve(prepared, T)
        n = arm.n
        hit = np.abs(q[:, :, n:]).max(axis=2) < tol.AT_ZERO
        k, b = np.nonzero(hit)
        branches = np.full((*q.shape[:2], n), np.nan)
        if len(k):
            root, size = newton.correct(arm, task, q[k, b, :n], T[k])
            branches[k, b] = np.where((size < tol.ANSWERED)[:, None], root, np.nan)
        absent = np.isnan(branches[:, :, 0])
        count = (~absent).sum(axis=1)
        order = np.argsort(absent, axis=1, kind="stable")[:, : max(int(count.max(initial=0)), 1)]
        branches = np.take_along_axis(branches, order[:, :, None], axis=1)
        doubt = (hit.sum(axis=1) > count) | (doubt & hit.any(axis=1)) | shaken
        return Rows(branches, doubt, is_settled & prepared.complete & ~shaken, shaken, guesses[:, :, :n])

    reason = f"{arm.n} joints for a pose of six: {6 - arm.n} virtual joints added at the tool must stay at zero"
    return Geometry(NAME, reason, prepared.complete, rows=rows, ordered=False)


def _solve_six(prepared: method.Elimination, T: Array, *, shake: bool) -> Rows:
    """Branches of six joints; complete where the elimination settled the pose as it stands, by a regular pencil.

    Of a target that had to be moved, self-motions and double roots are not where they were.
    """
    q, doubt, is_settled, shaken, guesses = method.solve(prepared, T, shake)
    return Rows(q, doubt | shaken, is_settled & prepared.complete & ~shaken, shaken, guesses)


def _with_wrist(arm: Arm, task: Task) -> Geometry | None:
    """Five joints, axes 4 and 5 or 1 and 2 meeting: the closed form with a virtual joint through that point."""
    chain = Chain(arm.link, arm.prismatic)
    for first in (False, True):
        extended = _with_sixth_joint(reverse_chain(chain) if first else chain, tol.EXACT * arm.reach)
        if extended is None:
            continue
        six = reverse_chain(extended) if first else extended
        form = spherical.recognise(from_links(six.link, six.prismatic.tolist()), _POSE)
        if form is not None and form.pairs is not None:
            axes = "1 and 2" if first else "4 and 5"
            reason = f"5 joints for a pose of six: a virtual joint where axes {axes} meet must stay at zero; {form.why}"
            geometry = Geometry("five joints", reason, True, _of_five(form.pairs, first), ordered=form.ordered)
            if is_sound(arm, task, geometry):
                return geometry
    return None


def _of_five(solve: ClosedForm, first: bool) -> ClosedForm:
    """The closed form of five joints from that of six, of which the first or the last is virtual."""
    five = slice(1, 6) if first else slice(0, 5)

    def pairs(goal: list[Entry], prefer: Prefer) -> Candidates:
        virtual = None if prefer[0] is None else Pair(1.0, 0.0)
        candidates = solve(goal, [virtual, *prefer] if first else [*prefer, virtual])
        miss, pair = None, candidates.pairs[0 if first else 5]
        if candidates.miss is not None and not candidates.angles and pair.s is not None:
            # the five joints miss the target by as much as the virtual one is off zero
            miss = candidates.miss + distance2(list(pair), [1.0, 0.0])
        return candidates._replace(pairs=candidates.pairs[five], angles=candidates.angles[five], miss=miss)

    return pairs


def _with_sixth_joint(chain: Chain, tolerance: float) -> Chain | None:
    """Five joints with a sixth one behind, where axes 4 and 5 meet; None if they do not.

    The virtual axis stands across axis 5, turned by `PHASE` from where an axis of a built arm would stand, so that
    the wrist is not singular in the postures that people ask for.
    """
    L = chain.link[4]
    if chain.prismatic[3:].any() or is_parallel(L, tol.PARALLEL_SINE):
        return None
    meeting = (inverse(L) @ [*perpendicular_foot(L), 1.0])[:3]
    if np.hypot(*meeting[:2]) > tolerance:
        return None
    axis = np.eye(4)
    axis[:3, :3] = rotation_about(2, PHASE) @ rotation_about(0, np.pi / 2)
    axis[:3, 3] = meeting
    return Chain(np.array([*chain.link[:5], axis, inverse(axis) @ chain.link[5]]), np.append(chain.prismatic, False))


def _with_virtual_joints(arm: Arm) -> tuple[Array, Bool]:
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
