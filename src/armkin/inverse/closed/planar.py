"""Arms that move in the base's x-y plane: xy, xy_theta, and the SCARA's xyz_yaw.

A joint that slides along z does not move the tool in the plane, so a SCARA is a planar arm
and a lift, wherever the lift stands. Where the direction of the tool is given, one turning
joint at an end of the chain is known from the others: the tip moves back to that joint and
two joints remain, which are a `Position` problem with a virtual slide along z for joint 1.
"""

from collections.abc import Callable

import numpy as np

from armkin.formula import arrays, pose
from armkin.formula.arrays import Array, Bool, Entry
from armkin.inverse.closed.elbow import TwoLink
from armkin.inverse.closed.geometry import Geometry
from armkin.inverse.closed.subproblems import Candidates, Doubt, Pair, Prefer
from armkin.inverse.closed.three_joints import Position
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm
from armkin.model.joint_chain import Chain, joint_axes, reverse_chain
from armkin.model.rotation import FLIP, inverse

Solve = Callable[[list[Entry], Prefer], tuple[list[Pair], Doubt]]


def recognise(arm: Arm, task: Task, tolerance: float = tol.EXACT) -> Geometry | None:
    """Planar and SCARA arms with as many joints as constraints."""
    if task.name not in ("xy", "xy_theta", "xyz_yaw") or arm.n != task.constraints:
        return None
    _, w = joint_axes(Chain(arm.link, arm.prismatic))
    lift = next((i for i in range(arm.n) if arm.prismatic[i] and abs(w[i, 2]) > 0.5), None)
    if (task.name == "xyz_yaw") != (lift is not None) or _leaves_plane(w, arm.prismatic, lift) > tolerance:
        return None
    chain, joints = _in_plane(arm, lift)
    solve_plane = _two_joints(chain) if task.name == "xy" else _three_joints(chain, task, joints)
    if solve_plane is None:
        return None
    kinds = "".join("P" if p else "R" for p in arm.prismatic)
    name, more = ("planar", "") if lift is None else ("SCARA", " or along z")
    why = f"{kinds}: all joints move in the base's x-y plane{more}"
    solve = _with_lift(arm, solve_plane, joints, lift, w)
    return Geometry(name, why, True, solve, labels=() if chain.prismatic.any() else ("", "elbow", ""))


def _in_plane(arm: Arm, lift: int | None) -> tuple[Chain, list[int]]:
    """The chain without the lift, and which joints it has."""
    joints = [i for i in range(arm.n) if i != lift]
    if lift is None:
        return Chain(arm.link, arm.prismatic), joints
    link = np.array([*arm.link[:lift], arm.link[lift] @ arm.link[lift + 1], *arm.link[lift + 2 :]])
    return Chain(link, np.delete(arm.prismatic, lift)), joints


def _with_lift(
    arm: Arm, solve_plane: Solve, joints: list[int], lift: int | None, w: Array
) -> Callable[[list[Entry], Prefer], Candidates]:
    """The closed form of all joints by that of the others, joints; w: (n, 3) the joints' axes."""
    fixed = [pose.constant(L) for L in arm.link]

    def solve(goal: list[Entry], prefer: Prefer) -> Candidates:
        pairs, doubt = solve_plane(goal, [prefer[i] for i in joints])
        if lift is None:
            return Candidates(pairs, doubt)
        # the lift is the missing height with the lift at zero
        P = fixed[0]
        motions = iter(pairs)
        for i in range(arm.n):
            if i != lift:
                pair = next(motions)
                P = pose.slide(P, pair.c) if pair.s is None else pose.rotate(P, *pair)
            P = pose.compose(P, fixed[i + 1])
        pairs.insert(lift, Pair((goal[2] - P[11]) * float(np.sign(w[lift, 2])), None))
        return Candidates(pairs, doubt)

    return solve


def _leaves_plane(w: Array, prismatic: Bool, lift: int | None) -> float:
    """The largest deviation of axes w (n, 3) from rotation about z, sliding in the x-y plane, and lifting along z."""
    upright, level = ~prismatic, prismatic.copy()
    if lift is not None:
        upright[lift], level[lift] = True, False
    return float(max(np.hypot(*w[upright, :2].T).max(initial=0.0), np.abs(w[level, 2]).max(initial=0.0)))


def _two_joints(chain: Chain) -> Solve:
    """Two planar joints that place a point.

    Two turning ones are an elbow; otherwise a virtual slide along z, whose value does not
    matter, makes it a `Position` problem.
    """
    if not chain.prismatic.any():
        return _two_turning(chain)
    virtual = Chain(np.array([np.eye(4), *chain.link]), np.array([True, *chain.prismatic]))
    position = Position(virtual, chain.link[2][:3, 3])

    def solve(goal: list[Entry], prefer: Prefer) -> tuple[list[Pair], Doubt]:
        pairs, doubt = position.solve([goal[0], goal[1], 0.0 * goal[0]], [Pair(0.0, None), *prefer])
        return pairs[1:], doubt

    return solve


def _two_turning(chain: Chain) -> Solve:
    base, L1 = chain.link[0], chain.link[1]
    sense2 = np.sign(L1[2, 2])
    if sense2 < 0:
        L1 = L1 @ FLIP
    tip = (FLIP if sense2 < 0 else np.eye(4))[:3, :3] @ chain.link[2][:3, 3]
    two_link = TwoLink(L1[:2, 3], (L1[:3, :3] @ tip)[:2], float(sense2))
    start = pose.constant(inverse(base))

    def solve(goal: list[Entry], prefer: Prefer) -> tuple[list[Pair], Doubt]:
        # the height does not matter, so take 0
        p = pose.apply(start, [goal[0], goal[1], 0.0])
        first, second, doubt = two_link.solve(p[0], p[1], prefer[0], prefer[1])
        return [first, second], doubt

    return solve


def _three_joints(chain: Chain, task: Task, joints: list[int]) -> Solve:
    """Three planar joints with the tool's direction given."""
    weights = task.sums[0][joints]
    if not chain.prismatic[2]:
        return _known_last(chain, task, weights)
    if not chain.prismatic[0]:
        return _known_first(chain, task, weights)
    return _known_middle(chain, task, weights)


def _at_zero(chain: Chain) -> Array:
    """The tool's pose when all joints are zero."""
    return np.asarray(np.linalg.multi_dot(list(chain.link)))


def _last_of_sum(goal: list[Entry], task: Task, weights: Array, pairs: list[Pair | None], joint: int) -> Pair:
    """The remaining joint, from the sum of all."""
    c, s = arrays.cos_sin(goal[-1] - task.offsets[0])
    for w, pair in zip(weights, pairs, strict=True):
        if pair is not None and pair.s is not None and w:
            c, s = c * pair.c + w * s * pair.s, s * pair.c - w * c * pair.s
    return Pair(c, float(weights[joint]) * s)


def _known_last(chain: Chain, task: Task, weights: Array) -> Solve:
    """Joint 3 is revolute: place the point on its axis with joints 1 and 2."""
    back, R0 = pose.constant(inverse(chain.link[3])), _at_zero(chain)
    R0[:3, 3] = 0.0
    two = _two_joints(Chain(chain.link[:3], chain.prismatic[:2]))

    def solve(goal: list[Entry], prefer: Prefer) -> tuple[list[Pair], Doubt]:
        c, s = arrays.cos_sin(goal[-1] - task.offsets[0])
        R = pose.compose([c, s, 0.0, -s, c, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], pose.constant(R0))  # about z
        x, y, _ = pose.turn_direction(R, back[9:12])
        pairs, doubt = two([goal[0] + x, goal[1] + y], prefer[:2])
        return [*pairs, _last_of_sum(goal, task, weights, [*pairs, None], 2)], doubt

    return solve


def _known_first(chain: Chain, task: Task, weights: Array) -> Solve:
    """Joint 3 is prismatic and joint 1 revolute: the same with the chain reversed."""
    level = np.eye(4)  # the tool's frame when all joints are zero, turned so that z is the plane's normal
    level[:3, :3] = _at_zero(chain)[:3, :3].T
    back = reverse_chain(Chain(np.array([*chain.link[:3], chain.link[3] @ level]), chain.prismatic))
    two = _two_joints(Chain(back.link[:3], back.prismatic[:2]))
    axis = [float(v) for v in chain.link[0][:2, 3]]

    def solve(goal: list[Entry], prefer: Prefer) -> tuple[list[Pair], Doubt]:
        c, s = arrays.cos_sin(goal[-1] - task.offsets[0])
        x, y = axis[0] - goal[0], axis[1] - goal[1]
        (third, second), doubt = two([c * x + s * y, c * y - s * x], [prefer[2], prefer[1]])
        return [_last_of_sum(goal, task, weights, [None, second, third], 0), second, third], doubt

    return solve


def _known_middle(chain: Chain, task: Task, weights: Array) -> Solve:
    """Joints 1 and 3 are prismatic: joint 2 is given, and two equations are linear in the slides."""
    link = [pose.constant(L) for L in chain.link]

    def solve(goal: list[Entry], prefer: Prefer) -> tuple[list[Pair], Doubt]:
        second = _last_of_sum(goal, task, weights, [None, None, None], 1)
        P = pose.compose(link[0], link[1])
        a = link[0][6:8]
        P = pose.compose(pose.rotate(P, *second), link[2])
        b = P[6:8]
        end = pose.compose(P, link[3])
        x, y = goal[0] - end[9], goal[1] - end[10]
        det = arrays.sub(arrays.mul(a[0], b[1]), arrays.mul(a[1], b[0])) + 0.0 * x
        parallel = arrays.absolute(det) < tol.NO_AREA
        inverse_det = arrays.sign(det) / arrays.maximum(arrays.absolute(det), tol.NO_AREA)
        d1 = (arrays.mul(x, b[1]) - arrays.mul(y, b[0])) * inverse_det
        d3 = (arrays.mul(a[0], y) - arrays.mul(a[1], x)) * inverse_det
        return [Pair(d1, None), second, Pair(d3, None)], Doubt(parallel, parallel)

    return solve
