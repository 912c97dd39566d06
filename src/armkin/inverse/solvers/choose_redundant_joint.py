"""Arms with a joint more than their task asks for: the redundant joint, its effect on a target; joints held."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from armkin.errors import UsageError
from armkin.formula import arrays, pose
from armkin.formula.arrays import Array, Entry
from armkin.inverse.closed import spherical, three_parallel
from armkin.inverse.closed.geometry import Geometry
from armkin.inverse.closed.subproblems import Candidates, Pair, Prefer
from armkin.inverse.numeric import tolerances as tol
from armkin.inverse.solvers.solver_of_arm import solver
from armkin.inverse.tasks.choose_task import task_for
from armkin.inverse.tasks.task import Task
from armkin.model.arm import Arm
from armkin.model.lock_joints import lock
from armkin.model.rotation import inverse, joint_motion


class Redundancy(NamedTuple):
    """The redundant joint of an arm and task, and the arm of the others, that joint at zero."""

    joint: int
    rest: Arm
    task: Task  # task of the arm itself
    geometry: Geometry  # geometry of the rest

    @property
    def about_tool_axis(self) -> bool:
        """Whether the redundant joint moves no target: it turns about the tool's z axis, which alone is asked for."""
        return bool(self.joint) and self.task.orientation == "axis"

    @property
    def by_formula(self) -> bool:
        """Whether a recorded closed form has all of the others: branches keep their index along the turn."""
        return self.geometry.ordered and self.geometry.pairs is not None and self.geometry.doubts is None


@lru_cache(maxsize=64)
def redundancy(arm: Arm, task_name: str | None) -> Redundancy | None:
    """What is redundant of an arm that has one joint more than its task asks for; None for every other.

    Chosen by structure, the same for every target: the last joint if that leaves a closed form, else the first. Of an
    arm asked for the direction of its tool's z axis the last joint if it turns about that axis.
    """
    try:
        task = task_for(arm, task_name)
    except UsageError:
        return None
    if arm.n != task.constraints + 1 or arm.n < 3:
        return None
    if task_name is None:
        return redundancy(arm, task.name)  # the rest is prepared once
    # the last joint moves no target where it turns about the tool's z axis, which alone is asked for
    about_tool = max(abs(arm.link[-1][:2, 3]).max() / arm.reach, abs(arm.link[-1][:2, 2]).max()) <= tol.EXACT
    about_tool &= task.orientation == "axis" and task.position == 3
    options = []
    for joint in ([arm.n - 1] if task.orientation == "full" or about_tool else []) + [0]:
        if not arm.prismatic[joint]:
            rest_arm = lock(arm, {arm.joint_names[joint]: 0.0})
            with suppress(UsageError):
                options.append(Redundancy(joint, rest_arm, task, solver(rest_arm, task.name)[1]))
    closed_forms = [option for option in options if option.geometry.pairs is not None]
    return next(iter(closed_forms or options[:1]), None)


@lru_cache(maxsize=64)
def nearly_closed(arm: Arm, redundant: Redundancy) -> Redundancy:
    """A joint whose others miss a closed form by little, to be held in place of the redundant one; else that one."""
    for joint in (arm.n - 1, 0):
        if redundant.task.orientation != "full" or arm.n != 7 or arm.prismatic[joint]:
            continue
        rest_arm = lock(arm, {arm.joint_names[joint]: 0.0})
        for ideal in near_classes(rest_arm, redundant.task):
            if (option := Redundancy(joint, rest_arm, redundant.task, ideal)).by_formula:
                return option
    return redundant


@lru_cache(maxsize=64)
def near_classes(arm: Arm, task: Task) -> tuple[Geometry, ...]:
    """The classes of six joints that an arm misses by little."""
    ideals = (module.recognise(arm, task, tol.NEAR_DEFECT) for module in (spherical, three_parallel))
    return tuple(ideal for ideal in ideals if ideal is not None)


def move_targets(arm: Arm, redundant: Redundancy, target: Array, t: Array) -> Array:
    """Targets (M, m) or (M, 4, 4) as those of the rest, for values t (M,) of the redundant joint."""
    if redundant.about_tool_axis:
        return target.copy()
    Z = joint_motion(False, -t)
    if redundant.joint:
        return np.asarray(target @ (inverse(arm.link[-1]) @ Z @ arm.link[-1]))
    G = arm.link[0] @ Z @ inverse(arm.link[0])
    if redundant.task.orientation == "full":
        return np.asarray(G @ target)
    targets, p = target.copy(), redundant.task.position
    targets[:, :p] = np.einsum("mij,mj->mi", G[:, :p, :p], target[:, :p]) + G[:, :p, 3]
    targets[:, p : p + len(redundant.task.sums)] -= t[:, None] * redundant.task.sums[:, 0]
    if redundant.task.orientation == "axis":
        targets[:, 3:] = np.einsum("mij,mj->mi", G[:, :3, :3], target[:, 3:])
    return targets


def held_by_near(arm: Arm, redundant: Redundancy) -> Geometry:
    """The class of the rest as one of the whole arm: the redundant joint is where the preferred motion has it."""
    r, solve_others = redundant.joint, redundant.geometry.pairs
    reason = f"{redundant.geometry.why}; {arm.joint_names[r]} is redundant and held where near has it"
    if solve_others is None:
        return replace(redundant.geometry, why=reason)

    def pairs(goal: list[Entry], prefer: Prefer) -> Candidates:
        pair = prefer[r]
        assert pair is not None
        candidates = solve_others(move_entries(arm, redundant, goal, pair), [*prefer[:r], *prefer[r + 1 :]])
        angles = [*(candidates.angles or [None] * len(candidates.pairs))]
        angles.insert(r, None)
        return candidates._replace(pairs=[*candidates.pairs[:r], pair, *candidates.pairs[r:]], angles=angles)

    return replace(redundant.geometry, pairs=pairs, why=reason, doubts=None)


def move_entries(arm: Arm, redundant: Redundancy, goal: list[Entry], pair: Pair) -> list[Entry]:
    """`move_targets` of one target's entries, for the cosine and sine of the redundant joint."""
    c, s = pair
    if redundant.about_tool_axis:
        return goal
    if redundant.joint:
        L = arm.link[-1]
        undo = pose.rotate(pose.constant(inverse(L)), c, arrays.sub(0.0, s))
        return pose.compose(pose.compose(goal, undo), pose.constant(L))
    L = arm.link[0]
    G = pose.compose(pose.rotate(pose.constant(L), c, arrays.sub(0.0, s)), pose.constant(inverse(L)))
    if redundant.task.orientation == "full":
        return pose.compose(G, goal)
    p = redundant.task.position
    entries = pose.apply(G, [*goal[:p], 0.0][:3])[:p]
    angle = arrays.arctan2(s, c)
    for k, rate in enumerate(redundant.task.sums[:, 0].tolist(), p):
        entries.append(arrays.sub(goal[k], arrays.mul(rate, angle)))
    return [*entries, *(pose.turn_direction(G, goal[3:6]) if redundant.task.orientation == "axis" else [])]


@lru_cache(maxsize=128)
def arm_without(arm: Arm, held: tuple[tuple[str, float], ...]) -> Arm:
    """The arm with joints locked at values [rad | mm]; the same object for the same values: it is prepared once."""
    return lock(arm, dict(held)) if held else arm


def redundant_alone(arm: Arm, task_name: str | None, held: Mapping[str, float]) -> Redundancy | None:
    """The redundant joint, if that alone is held: for all its values one arm is prepared once, with other targets."""
    if len(held) != 1 or arm.keep_out or (arm.ratio != 1.0).any():
        return None
    redundant = redundancy(arm, task_name)
    return redundant if redundant is not None and arm.joint_names[redundant.joint] in held else None


def without_held(arm: Arm, task_name: str | None, held: Mapping[str, float], targets: Array) -> tuple[Arm, Array]:
    """The arm of the joints that are not held [rad | mm], and targets (N, ...) as its own."""
    redundant = redundant_alone(arm, task_name, held)
    if redundant is None:
        return arm_without(arm, tuple(held.items())), targets
    [value] = held.values()
    return redundant.rest, move_targets(arm, redundant, targets, np.full(len(targets), value))


def redundant_joint(arm: Arm, task_name: str | None) -> str:
    """The name of the redundant joint; of an arm that has one."""
    redundant = redundancy(arm, task_name)
    return "" if redundant is None else arm.joint_names[redundant.joint]
