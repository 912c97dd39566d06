"""Paths of arms with one joint more than their task asks for: it is held, at a value that carries the whole path.

Of the values that joint may have, those are planned for at which every way of the path has, at targets along it, a
branch within limits; those at which the arm hits nothing first, and of these the nearest to where the joint stands.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from armkin.errors import NoSolutionError, UsageError
from armkin.formula.arrays import Array
from armkin.inverse.solve import ik
from armkin.inverse.solvers.redundancy import Redundancy, moved, redundancy
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

VALUE_COUNT = 72  # values of the redundant joint, over its range, that are asked
TARGET_STEP = 0.02  # distance, as a share of the arm's reach, between targets that are asked
MAX_TARGETS = 200  # targets of a way, at most, that are asked
MIN_GAP = 0.01  # distance, as a share of the arm's reach, that values had best keep from what must not be touched
MAX_POSTURES = 8_000  # targets, at most, that are asked for that distance
MAX_VALUES = 6  # values, at most, that are planned for
SAME_VALUE = 1e-9  # difference [rad] of values of joint moves that are one


def path_redundant(arm: Arm, file: PathFile, spare: Redundancy, request: PathRequest) -> PathPlan:
    """`armkin.path` of an arm with a redundant joint, whose plan says in `held` where that is held.

    The file's joint moves say where; else it is where `near` has it, by default where it stands when the path begins,
    if that carries the path, or the nearest value that does. Raises as `armkin.path` does, UsageError also for joint
    moves that want the joint at different values.
    """
    name, standing = arm.joint_names[spare.joint], request.start_joints(arm)
    begin = _start_posture(arm, file, standing)
    fixed = _redundant_start(arm, file, spare.joint, standing)
    stands = standing if begin is None else begin
    close = stands if request.near is None else np.asarray(request.near, dtype=float)
    path_of_others = _path_of_other_joints(arm, file, spare.joint)
    refused: NoSolutionError | None = None
    near = float(close[spare.joint]), float(stands[spare.joint])
    for value in _values_to_try(arm, file, request.task, *near) if fixed is None else [fixed]:
        try:
            return path_held(arm, path_of_others, {name: value}, request, begin)
        except NoSolutionError as error:
            refused = refused or error
    assert refused is not None
    raise refused


def values_to_hold(arm: Arm, file: PathFile, spare: Redundancy) -> tuple[float, ...]:
    """Values of the redundant joint at which a path from home may be carried [rad]: the nearest to its start first."""
    if (fixed := _redundant_start(arm, file, spare.joint, arm.home)) is not None:
        return (fixed,)
    begin = _start_posture(arm, file, arm.home)
    close = float((arm.home if begin is None else begin)[spare.joint])
    t = np.unique(_values_over_range(arm, spare.joint, close))
    return tuple(t[np.argsort(np.abs(t - close), kind="stable")].tolist())


def _values_over_range(arm: Arm, joint: int, close: float) -> Array:
    """Values over a joint's range [rad], and the one that it had best have, within it."""
    low, high = float(arm.lower[joint]), float(arm.upper[joint])
    low, high = (low if np.isfinite(low) else close - np.pi), (high if np.isfinite(high) else close + np.pi)
    return np.append(np.linspace(low, high, VALUE_COUNT), close if low <= close <= high else low)


def _start_posture(arm: Arm, file: PathFile, standing: Array) -> Array | None:
    """The posture (n,) that the file's start fixes, if it does."""
    value = file.start if file.start is None or isinstance(file.start, str) else file.start.joints
    return None if value is None else _joint_values(arm, standing, value, file.place("start"))


def _joint_values(arm: Arm, standing: Array, value: Any, place: str) -> Array:
    try:
        return path_numbers.joint_values(arm, standing, value)
    except UsageError as error:
        raise error.within(place) from None


def _redundant_start(arm: Arm, file: PathFile, joint: int, standing: Array) -> float | None:
    """Where joint moves want the redundant joint [rad]; None: there are none that say so."""
    name, first = arm.joint_names[joint], None
    for k, move in enumerate(file.moves):
        if move.joint is None:
            continue
        place = file.place_of(k, k)
        value = float(_joint_values(arm, standing, move.joint, place)[joint])
        if isinstance(move.joint, Mapping) and name not in move.joint:
            continue
        if first is None:
            first = value
        elif abs(value - first) > SAME_VALUE:
            a, b = np.rad2deg([first, value])
            message = f"{name} is redundant and held along a path: it cannot be at {a:g} and then at {b:g} deg"
            advice = "write two paths, or hold another joint"
            raise UsageError(message, advice=advice, needs="other joint").within(place)
    return first


def _path_of_other_joints(arm: Arm, file: PathFile, joint: int) -> PathFile:
    """The path as one of the joints that are not held."""
    name = arm.joint_names[joint]

    def without_joint(value: Any) -> Any:
        if isinstance(value, Mapping):
            return {key: angle for key, angle in value.items() if key != name}
        return value if isinstance(value, str) else [v for k, v in enumerate(value) if k != joint]

    def free_move(item: Move) -> Move:
        return item if item.joint is None else item.model_copy(update={"joint": without_joint(item.joint)})

    start = file.start
    if start is not None and not isinstance(start, str) and start.joints is not None:
        start = start.model_copy(update={"joints": without_joint(start.joints)})
    return file.model_copy(update={"start": start, "moves": [free_move(item) for item in file.moves]})


def _values_to_try(arm: Arm, file: PathFile, task: str | None, close: float, start: float) -> Iterator[float]:
    """Values of the redundant joint to plan for [rad]: those at which targets along all ways have a branch.

    Those at which it hits nothing come first, and of these those that keep `MIN_GAP`; then the nearest to `close`.
    Where there is none, the one at which most have. A way that begins where the joints stand keeps them there.
    """
    turned = actual_arm(arm)
    spare = redundancy(turned, task or file.task)
    assert spare is not None
    j = spare.joint
    try:
        _, ways = route_targets(arm, file.model_copy(update={"task": task or file.task}), TARGET_STEP * arm.reach)
    except UsageError:  # what is wrong with it, if anything, is said by its plan
        yield start
        return
    t = _values_over_range(arm, j, close)
    joint_angles = t * arm.ratio[j]
    lacking = np.zeros((1, len(t)), int)
    for way in ways:
        lacking += _count_lacking(turned, spare, way, joint_angles, MAX_TARGETS, [])
    order = np.argsort(np.abs(t - close), kind="stable")
    carried = order[lacking[0, order] == lacking.min()]
    if turned.keep_out and not turned.ignores_keep_out and len(carried) > 1:
        # near a keep-out a proof takes long: values that keep away from it come first
        margins = [0.0, MIN_GAP * turned.reach]
        count = max(MAX_POSTURES // (len(carried) * len(ways)), 2)
        near = np.zeros((3, len(carried)), int)
        for way in ways:
            near += _count_lacking(turned, spare, way, joint_angles[carried], min(count, MAX_TARGETS), margins)
        carried = carried[np.lexsort((near[2] > 0, near[1]))]
    yield from t[carried[: MAX_VALUES if lacking.min() == 0 else 1]].tolist()


def _count_lacking(
    arm: Arm, spare: Redundancy, way: Array, values: Array, count: int, margins: list[float]
) -> NDArray[np.intp]:
    """How many of some targets of a way lack a branch at each of the redundant joint's values (V,), and how many one
    that keeps each of the margins [mm] besides: (1 + margins, V). Where branches have names it is one all the way.
    """
    sample = way[np.unique(np.linspace(0, len(way) - 1, count).astype(int))]
    goals = np.repeat(sample[None], len(values), axis=0).reshape(-1, *sample.shape[1:])
    joint_angles = np.repeat(values, len(sample))
    s = ik(spare.rest, moved(arm, spare, goals, joint_angles), spare.task.name, examine=False)
    legal = s.within_limits
    kinds = [legal]
    if margins:
        q = np.insert(s.q, spare.joint, joint_angles[:, None], axis=2)
        mm = np.full(legal.shape, -np.inf)
        mm[legal] = clearance(arm, q[legal]).mm
        kinds += [mm >= margin for margin in margins]
    counts = []
    for good in kinds:
        solved = good.any(axis=1, keepdims=True)
        if spare.geometry.ordered:
            solved = (good[:, :, None] & (s.branch[:, :, None] == np.arange(len(s.names)))).any(axis=1)
        counts.append(len(sample) - solved.reshape(len(values), len(sample), -1).sum(axis=1).max(axis=1))
    return np.array(counts)
