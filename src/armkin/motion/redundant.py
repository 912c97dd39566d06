"""Paths of arms with one joint more than their task asks for: it is held, at a value that carries the whole path.

Of the values that joint may have, those are planned for at which every way of the path has, at targets along it, a
branch within limits; the one nearest to where the joint stands comes first.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from armkin.errors import NoSolutionError, UsageError
from armkin.formula.arrays import Array
from armkin.inverse.solve import ik
from armkin.inverse.solvers.redundant import Redundancy, moved, redundancy
from armkin.model.arm import actual
from armkin.motion import path_numbers
from armkin.motion.held import path_held
from armkin.motion.outline import routes

if TYPE_CHECKING:
    from armkin.model.arm import Arm
    from armkin.motion.path_plan import PathPlan
    from armkin.path_file import Move, PathFile

VALUES = 72  # of the redundant joint that are asked, over its range
STEP = 0.02  # of the arm's reach, between targets that are asked
ASKED = 200  # targets of a way, at most
MOST = 6  # values that are planned for
SAME = 1e-9  # [rad] values of joint moves that are one


def path_redundant(
    arm: Arm,
    file: PathFile,
    spare: Redundancy,
    *,
    start: ArrayLike | None = None,
    near: ArrayLike | None = None,
    task: str | None = None,
    **options: Any,
) -> PathPlan:
    """`armkin.path` of an arm with a redundant joint, whose plan says in `held` where that is held.

    The file's joint moves say where; else it is where `near` has it, by default where it stands when the path begins,
    if that carries the path, or the nearest value that does. Raises as `armkin.path` does, UsageError also for joint
    moves that want the joint at different values.
    """
    name, here = arm.joint_names[spare.joint], arm.home if start is None else np.asarray(start, dtype=float)
    begin = _begin(arm, file, here)
    said = _said(arm, file, spare.joint, here)
    stands = here if begin is None else begin
    close = stands if near is None else np.asarray(near, dtype=float)
    others = _of_others(arm, file, spare.joint)
    refused: NoSolutionError | None = None
    for value in (
        _values(arm, file, task, float(close[spare.joint]), float(stands[spare.joint])) if said is None else [said]
    ):
        try:
            return path_held(arm, others, {name: value}, start=start, near=near, task=task, begin=begin, **options)
        except NoSolutionError as error:
            refused = refused or error
    assert refused is not None
    raise refused


def values_to_hold(arm: Arm, file: PathFile, spare: Redundancy) -> tuple[float, ...]:
    """Values of the redundant joint at which a path from home may be carried [rad]: the nearest to its start first."""
    if (said := _said(arm, file, spare.joint, arm.home)) is not None:
        return (said,)
    begin = _begin(arm, file, arm.home)
    close = float((arm.home if begin is None else begin)[spare.joint])
    t = np.unique(_over_range(arm, spare.joint, close))
    return tuple(t[np.argsort(np.abs(t - close), kind="stable")].tolist())


def _over_range(arm: Arm, joint: int, close: float) -> Array:
    """Values over a joint's range [rad], and the one that it had best have, within it."""
    low, high = float(arm.lower[joint]), float(arm.upper[joint])
    low, high = (low if np.isfinite(low) else close - np.pi), (high if np.isfinite(high) else close + np.pi)
    return np.append(np.linspace(low, high, VALUES), close if low <= close <= high else low)


def _begin(arm: Arm, file: PathFile, here: Array) -> Array | None:
    """The posture (n,) that the file's start fixes, if it does."""
    value = file.start if file.start is None or isinstance(file.start, str) else file.start.joints
    return None if value is None else _joints(arm, here, value, file.place("start"))


def _joints(arm: Arm, here: Array, value: Any, place: str) -> Array:
    try:
        return path_numbers.joints(arm, here, value)
    except UsageError as error:
        raise error.within(place) from None


def _said(arm: Arm, file: PathFile, joint: int, here: Array) -> float | None:
    """Where joint moves want the redundant joint [rad]; None: there are none that say so."""
    name, first = arm.joint_names[joint], None
    for k, move in enumerate(file.moves):
        if move.joint is None:
            continue
        place = file.place_of(k, k)
        value = float(_joints(arm, here, move.joint, place)[joint])
        if isinstance(move.joint, Mapping) and name not in move.joint:
            continue
        if first is None:
            first = value
        elif abs(value - first) > SAME:
            a, b = np.rad2deg([first, value])
            message = f"{name} is redundant and held along a path: it cannot be at {a:g} and then at {b:g} deg"
            raise UsageError(f"{message}; write two paths, or hold another joint").within(place)
    return first


def _of_others(arm: Arm, file: PathFile, joint: int) -> PathFile:
    """The path as one of the joints that are not held."""
    name = arm.joint_names[joint]

    def without(value: Any) -> Any:
        if isinstance(value, Mapping):
            return {key: angle for key, angle in value.items() if key != name}
        return value if isinstance(value, str) else [v for k, v in enumerate(value) if k != joint]

    def move(one: Move) -> Move:
        return one if one.joint is None else one.model_copy(update={"joint": without(one.joint)})

    start = file.start
    if start is not None and not isinstance(start, str) and start.joints is not None:
        start = start.model_copy(update={"joints": without(start.joints)})
    return file.model_copy(update={"start": start, "moves": [move(one) for one in file.moves]})


def _values(arm: Arm, file: PathFile, task: str | None, close: float, stands: float) -> Iterator[float]:
    """Values of the redundant joint to plan for [rad]: those at which targets along all ways have a branch.

    The nearest to `close` first; where there is none, the one at which most have. A way that begins where the joints
    stand keeps them there.
    """
    turned = actual(arm)
    spare = redundancy(turned, task or file.task)
    assert spare is not None
    j = spare.joint
    try:
        _, ways = routes(arm, file.model_copy(update={"task": task or file.task}), STEP * arm.reach)
    except UsageError:  # what is wrong with it, if anything, is said by its plan
        yield stands
        return
    t = _over_range(arm, j, close)
    missing = np.zeros(len(t), int)
    for every in ways:
        way = every[np.unique(np.linspace(0, len(every) - 1, ASKED).astype(int))]
        goals = np.repeat(way[None], len(t), axis=0).reshape(-1, *way.shape[1:])
        goals = moved(turned, spare, goals, np.repeat(t * arm.ratio[j], len(way)))
        s = ik(spare.rest, goals, spare.task.name, examine=False)
        legal = s.valid & s.within_limits
        if spare.geometry.ordered:  # one branch all the way
            legal = (legal[:, :, None] & (s.branch[:, :, None] == np.arange(len(s.names)))).any(axis=1)
            legal = legal.reshape(len(t), len(way), -1)
            missing += len(way) - legal.sum(axis=1).max(axis=1)
        else:
            missing += len(way) - legal.any(axis=1).reshape(len(t), -1).sum(axis=1)
    order = np.lexsort((np.abs(t - close), missing))
    carried = order[missing[order] == missing.min()]
    yield from t[carried[: MOST if missing.min() == 0 else 1]].tolist()
