"""Chooses the task of an arm: the requested one, that of the robot file, or the one that its structure suggests."""

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armkin.errors import RedundantArmError, UsageError
from armkin.formula.arrays import Array
from armkin.inverse.tasks.residuals import task_jacobian
from armkin.inverse.tasks.task import LABELS, Task
from armkin.model.arm import Arm
from armkin.model.joint_chain import Chain, joint_axes
from armkin.model.units import radian_or_reach

NEARLY_PARALLEL = 3e-3  # largest angle [rad] of axes that count as parallel for the choice of a task
INDEPENDENT = 1e-4  # least singular value of independent rows of a task
Z = np.array([0.0, 0.0, 1.0])  # the base's z axis


def task_for(arm: Arm, name: str | None = None) -> Task:
    """The task of that name for this arm; without a name the robot file's, or the one its structure suggests.

    Raises UsageError if the task does not exist or does not fit the arm's joints.
    """
    name = name or arm.task or default_task(arm)
    if name is None:
        raise _taskless_error(arm)
    if name not in LABELS:
        raise UsageError(f"unknown task '{name}'; tasks are {', '.join(LABELS)}")
    task = _BUILDERS[name](arm, name)
    if isinstance(task, str):
        raise UsageError(f"{arm.name}: task {name} does not fit its {_joint_kinds(arm)}: {task}")
    return task


def _taskless_error(arm: Arm) -> UsageError:
    """The error of an arm whose structure suggests no task."""
    problem = f"{arm.name}: no task fits its {_joint_kinds(arm)} by itself"
    free = rank(arm, _free_task(arm, "pose"))
    if free < 2:
        return UsageError(f"{problem}: fk, pulses and workspace work, ik does not")
    if free < arm.n:
        problem += f": together they move the tool in {free} of its six directions"
        return redundant_error(arm, arm.n - free, problem)
    return UsageError(problem, advice="ask for task pose, whole poses of which it reaches some", needs="task")


def redundant_error(arm: Arm, surplus: int, problem: str) -> RedundantArmError:
    """The error of an arm of which `surplus` joints have to be held."""
    names = list(arm.joint_names)
    advice = f"hold {surplus} of {', '.join(names)} with armkin.lock(arm, {{joint: value}})"
    return RedundantArmError(problem, advice=advice, robot=arm.name, joints=names, surplus=surplus)


def default_task(arm: Arm) -> str | None:
    """The task that the arm's structure suggests, or None."""
    order = {
        2: ("xy",),
        3: ("xy_theta", "xyz"),
        4: ("xyz_yaw", "xyz_pitch", "xyz_roll"),
        5: ("xyz_pitch_roll", "xyz_axis"),
    }.get(arm.n, ("pose",) if arm.n > 5 else ())
    for name in order:
        if not isinstance(task := _BUILDERS[name](arm, name), str) and rank(arm, task) == min(task.constraints, arm.n):
            return name
    return None


def rank(arm: Arm, task: Task, tolerance: float = INDEPENDENT) -> int:
    """Rank of the task's Jacobian at poses in general position; tolerance: of the reach, and in rad."""
    from armkin.forward import fk, jacobian

    q = np.random.default_rng(1).uniform(-2.0, 2.0, (4, arm.n)) * np.where(arm.prismatic, arm.reach / 4, 1.0)
    Jt = task_jacobian(task, jacobian(arm, q), fk(arm, q))
    Jt[:, : task.position] /= arm.reach
    Jt = Jt * radian_or_reach(arm)
    return int(max(np.linalg.matrix_rank(Jt, tol=tolerance)))


def _joint_kinds(arm: Arm) -> str:
    kinds = "".join("P" if p else "R" for p in arm.prismatic)
    return f"{arm.n} joint{'s' * (arm.n > 1)} ({kinds})"


def _plain_task(arm: Arm, name: str, position: int, sums: ArrayLike, offsets: ArrayLike) -> Task:
    rows = np.asarray(sums, dtype=float).reshape(-1, arm.n)
    return Task(name, position, rows, np.asarray(offsets, dtype=float), "none")


def _free_task(arm: Arm, name: str) -> Task:
    orientation: Literal["none", "axis", "full"] = {"xyz": "none", "xyz_axis": "axis", "pose": "full"}[name]  # type: ignore[assignment]
    return Task(name, 3, np.zeros((0, arm.n)), np.zeros(0), orientation)


def _axis_directions(arm: Arm) -> Array:
    return joint_axes(Chain(arm.link, arm.prismatic))[1]


def _parallel_signs(directions: Array, reference: Array) -> NDArray[np.float64]:
    """+1 or -1 where a direction is parallel or antiparallel to the reference, else 0."""
    cosine = directions @ reference
    sine = np.linalg.norm(np.cross(directions, reference), axis=1)
    return np.where(sine < NEARLY_PARALLEL, np.sign(cosine), 0.0)


def _planar_task(arm: Arm, name: str) -> Task | str:
    w = _axis_directions(arm)
    turns = np.where(arm.prismatic, 0.0, _parallel_signs(w, Z))
    if (turns[~arm.prismatic] == 0).any() or (np.abs(w[arm.prismatic] @ Z) > NEARLY_PARALLEL).any():
        return "its joints do not all move in the base's x-y plane"
    if name == "xy":
        return _plain_task(arm, name, 2, np.zeros((0, arm.n)), np.zeros(0))
    if not turns.any():
        return "it has no joint that turns"
    # DH angles about the base's z axis: theta is the direction of the last link
    offset = float((turns * arm.dh_sign * arm.dh_theta).sum())
    return _plain_task(arm, name, 2, turns * arm.ratio, [offset])


def _yaw_task(arm: Arm, name: str) -> Task | str:
    from armkin.forward import fk

    upright = _parallel_signs(_axis_directions(arm), Z)
    turns, lifts = np.where(arm.prismatic, 0.0, upright), np.where(arm.prismatic, upright, 0.0)
    if (turns[~arm.prismatic] == 0).any() or not lifts.any() or not turns.any():
        return "it needs joints that turn about the base's z axis and one that slides along it"
    T0 = fk(arm, np.zeros(arm.n))
    return _plain_task(arm, name, 3, turns * arm.ratio, [np.arctan2(T0[1, 0], T0[0, 0])])


def _pitch_task(arm: Arm, name: str) -> Task | str:
    w = _axis_directions(arm)
    last = 3 if name == "xyz_pitch" else 4
    if arm.n != last + 1:
        return f"it needs {last + 1} joints"
    if arm.prismatic[1:].any():
        return "joints 2 and after must turn"
    parallel = _parallel_signs(w, w[1])
    parallel[[0, *range(4, arm.n)]] = 0.0
    if (parallel[1:4] == 0).any():
        return "joints 2, 3 and 4 must be parallel"
    # the canonical axis of a joint with sign -1 points against its DH axis
    weights = parallel * arm.dh_sign[1]
    offset = float((weights * arm.dh_sign * arm.dh_theta).sum()) + arm.pitch_offset
    if name == "xyz_pitch":
        return _plain_task(arm, name, 3, weights * arm.ratio, [offset])
    roll = np.zeros(arm.n)
    roll[4] = arm.dh_sign[4]
    return _plain_task(arm, name, 3, [weights * arm.ratio, roll * arm.ratio], [offset, arm.dh_theta[4]])


def _roll_task(arm: Arm, name: str) -> Task | str:
    w = _axis_directions(arm)
    if arm.n != 4:
        return "it needs 4 joints"
    if arm.prismatic[1:].any():
        return "joints 2 and after must turn"
    parallel = _parallel_signs(w, w[1])
    if parallel[2] == 0 or parallel[3] != 0:
        return "joints 2 and 3 must be parallel, and joint 4 must turn about another direction"
    roll = np.zeros(4)
    roll[3] = arm.dh_sign[3]
    return _plain_task(arm, name, 3, roll * arm.ratio, [arm.dh_theta[3]])


# Each gives the task for an arm, or says why it does not fit.
_BUILDERS = {
    "xy": _planar_task,
    "xy_theta": _planar_task,
    "xyz": _free_task,
    "xyz_pitch": _pitch_task,
    "xyz_pitch_roll": _pitch_task,
    "xyz_roll": _roll_task,
    "xyz_yaw": _yaw_task,
    "xyz_axis": _free_task,
    "pose": _free_task,
}
