"""Paths of arms with one redundant joint, which is held at a value that carries the whole path.

The planner samples the joint's range and keeps the values at which targets along every route have a branch within
limits. It tries the values at which the arm hits nothing first, and of these the nearest to the joint's present value.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from armkin.errors import NoSolutionError, UsageError
from armkin.formula.arrays import Array
from armkin.inverse.solve import ik
from armkin.inverse.solvers.choose_redundant_joint import Redundancy, move_targets, redundancy
from armkin.keep_out.clearance import clearance
from armkin.model.arm import actual_arm
from armkin.motion.path_planner.held_joints import path_held
from armkin.motion.path_planner.path_outline import route_targets
from armkin.motion.tool_path import path_numbers

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.motion.path_planner.path_request import PathRequest
    from armkin.motion.plan.path_plan import PathPlan
    from armkin.path_file import Move, PathFile

VALUE_COUNT = 72  # values of the redundant joint that are tested, over its range
TARGET_STEP = 0.02  # distance between tested targets, as a share of the arm's reach
MAX_TARGETS = 200  # tested targets of a route, at most
MIN_GAP = 0.01  # preferred clearance to keep-outs, as a share of the arm's reach
MAX_POSTURES = 8_000  # postures, at most, whose clearance is measured
MAX_VALUES = 6  # values, at most, with which a plan is tried
SAME_VALUE = 1e-9  # difference [rad] below which two joint moves agree


def path_redundant(arm: Arm, file: PathFile, extra: Redundancy, request: PathRequest) -> PathPlan:
    """`armkin.path` for an arm with a redundant joint; the plan's `held` has the value at which it is held.

    The file's joint moves fix that value. Without them it is the joint's value in `near`, by default that at the path's
    start, or the nearest value that carries the path. Raises as `armkin.path` does, and UsageError for joint moves
    that give the joint different values.
    """
    name, start = arm.joint_names[extra.joint], request.start_joints(arm)
    path_start = _start_posture(arm, file, start)
    fixed_value = _redundant_start(arm, file, extra.joint, start)
    first_posture = start if path_start is None else path_start
    preferred = first_posture if request.near is None else np.asarray(request.near, dtype=float)
    path_of_others = _path_of_other_joints(arm, file, extra.joint)
    first_error: NoSolutionError | None = None
    joint_values = float(preferred[extra.joint]), float(first_posture[extra.joint])
    for value in _values_to_try(arm, file, request.task, *joint_values) if fixed_value is None else [fixed_value]:
        try:
            return path_held(arm, path_of_others, {name: value}, request, path_start)
        except NoSolutionError as error:
            first_error = first_error or error
    assert first_error is not None
    raise first_error


def values_to_hold(arm: Arm, file: PathFile, extra: Redundancy) -> tuple[float, ...]:
    """Values [rad] of the redundant joint to try for a path from home, sorted by distance from its start."""
    if (fixed_value := _redundant_start(arm, file, extra.joint, arm.home)) is not None:
        return (fixed_value,)
    path_start = _start_posture(arm, file, arm.home)
    preferred = float((arm.home if path_start is None else path_start)[extra.joint])
    values = np.unique(_values_over_range(arm, extra.joint, preferred))
    return tuple(values[np.argsort(np.abs(values - preferred), kind="stable")].tolist())


def _values_over_range(arm: Arm, joint: int, preferred: float) -> Array:
    """Evenly spaced values over a joint's range [rad], and the preferred one if it is in the range."""
    low, high = float(arm.lower[joint]), float(arm.upper[joint])
    low, high = (low if np.isfinite(low) else preferred - np.pi), (high if np.isfinite(high) else preferred + np.pi)
    return np.append(np.linspace(low, high, VALUE_COUNT), preferred if low <= preferred <= high else low)


def _start_posture(arm: Arm, file: PathFile, start: Array) -> Array | None:
    """The posture (n,) that the file's start fixes, if it does."""
    value = file.start if file.start is None or isinstance(file.start, str) else file.start.joints
    return None if value is None else _joint_values(arm, start, value, file.place("start"))


def _joint_values(arm: Arm, start: Array, value: Any, place: str) -> Array:
    try:
        return path_numbers.joint_values(arm, start, value)
    except UsageError as error:
        raise error.within(place) from None


def _redundant_start(arm: Arm, file: PathFile, joint: int, start: Array) -> float | None:
    """The value [rad] that the joint moves give the redundant joint; None: no joint move names it."""
    name, agreed = arm.joint_names[joint], None
    for number, move in enumerate(file.moves):
        if move.joint is None:
            continue
        place = file.place_of(number, number)
        value = float(_joint_values(arm, start, move.joint, place)[joint])
        if isinstance(move.joint, Mapping) and name not in move.joint:
            continue
        if agreed is None:
            agreed = value
        elif abs(value - agreed) > SAME_VALUE:
            a, b = np.rad2deg([agreed, value])
            message = f"{name} is redundant and held along a path: it cannot be at {a:g} and then at {b:g} deg"
            advice = "write two paths, or hold another joint"
            raise UsageError(message, advice=advice, needs="other joint").within(place)
    return agreed


def _path_of_other_joints(arm: Arm, file: PathFile, joint: int) -> PathFile:
    """The path without the held joint in its joint moves."""
    name = arm.joint_names[joint]

    def without_joint(value: Any) -> Any:
        if isinstance(value, Mapping):
            return {key: angle for key, angle in value.items() if key != name}
        return value if isinstance(value, str) else [x for index, x in enumerate(value) if index != joint]

    def free_move(item: Move) -> Move:
        return item if item.joint is None else item.model_copy(update={"joint": without_joint(item.joint)})

    start = file.start
    if start is not None and not isinstance(start, str) and start.joints is not None:
        start = start.model_copy(update={"joints": without_joint(start.joints)})
    return file.model_copy(update={"start": start, "moves": [free_move(item) for item in file.moves]})


def _values_to_try(arm: Arm, file: PathFile, task: str | None, preferred: float, start: float) -> Iterator[float]:
    """Values [rad] of the redundant joint with which to plan: those at which targets along all routes have a branch.

    Values without a hit come first, of these the ones that keep `MIN_GAP`, then those nearest to `preferred`. If no
    value serves all targets, the one that serves most is tried. A route that begins at joint values keeps the start's.
    """
    free_arm = actual_arm(arm)
    extra = redundancy(free_arm, task or file.task)
    assert extra is not None
    joint = extra.joint
    try:
        _, routes = route_targets(arm, file.model_copy(update={"task": task or file.task}), TARGET_STEP * arm.reach)
    except UsageError:  # the plan with the start value reports the error
        yield start
        return
    values = _values_over_range(arm, joint, preferred)
    joint_angles = values * arm.ratio[joint]
    lacking_counts = np.zeros((1, len(values)), int)
    for targets in routes:
        lacking_counts += _count_lacking(free_arm, extra, targets, joint_angles, MAX_TARGETS, [])
    order = np.argsort(np.abs(values - preferred), kind="stable")
    candidates = order[lacking_counts[0, order] == lacking_counts.min()]
    if free_arm.keep_out and not free_arm.ignores_keep_out and len(candidates) > 1:
        # a motion near a keep-out takes long to prove, so values with clearance come first
        margins = [0.0, MIN_GAP * free_arm.reach]
        count = max(MAX_POSTURES // (len(candidates) * len(routes)), 2)
        near_hits = np.zeros((3, len(candidates)), int)
        for targets in routes:
            near_hits += _count_lacking(
                free_arm, extra, targets, joint_angles[candidates], min(count, MAX_TARGETS), margins
            )
        candidates = candidates[np.lexsort((near_hits[2] > 0, near_hits[1]))]
    yield from values[candidates[: MAX_VALUES if lacking_counts.min() == 0 else 1]].tolist()


def _count_lacking(
    arm: Arm, extra: Redundancy, targets: Array, values: Array, count: int, margins: list[float]
) -> NDArray[np.intp]:
    """How many of `count` targets have no branch at each value of the redundant joint: (1 + margins, V).

    Row 0 counts targets without a branch within limits, the others those without one that also keeps each margin [mm].
    Where branches have names, all targets must be reached on the same branch.
    """
    sample = targets[np.unique(np.linspace(0, len(targets) - 1, count).astype(int))]
    goals = np.repeat(sample[None], len(values), axis=0).reshape(-1, *sample.shape[1:])
    joint_angles = np.repeat(values, len(sample))
    ik_answers = ik(extra.rest, move_targets(arm, extra, goals, joint_angles), extra.task.name, examine=False)
    is_legal = ik_answers.within_limits
    conditions = [is_legal]
    if margins:
        q = np.insert(ik_answers.q, extra.joint, joint_angles[:, None], axis=2)
        clearances = np.full(is_legal.shape, -np.inf)
        clearances[is_legal] = clearance(arm, q[is_legal]).mm
        conditions += [clearances >= margin for margin in margins]
    counts = []
    for allowed in conditions:
        has_branch = allowed.any(axis=1, keepdims=True)
        if extra.geometry.ordered:
            on_branch = ik_answers.branch[:, :, None] == np.arange(len(ik_answers.names))
            has_branch = (allowed[:, :, None] & on_branch).any(axis=1)
        counts.append(len(sample) - has_branch.reshape(len(values), len(sample), -1).sum(axis=1).max(axis=1))
    return np.array(counts)
