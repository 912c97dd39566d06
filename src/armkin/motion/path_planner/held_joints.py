"""Paths of arms with joints held at fixed values: the free joints are planned, the plan has the values of all."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from armkin.errors import NoSolutionError
from armkin.formula.arrays import Array
from armkin.model.limits import check_limits
from armkin.model.lock_joints import lock, unlock
from armkin.motion.joint_moves import approach_move, check_jerk, check_rates, straight_move
from armkin.motion.path_planner.path_request import PathRequest, plan_path
from armkin.motion.plan.path_plan import PathPlan
from armkin.motion.plan.trajectory_proof import prove_plan
from armkin.motion.timing.cubic_knots import Knots
from armkin.motion.timing.curved_stretch import Curve
from armkin.motion.timing.limit_jerk import Smoothed
from armkin.motion.timing.trajectory import Straight, Stretch
from armkin.motion.tool_path import path_numbers

if TYPE_CHECKING:
    from armkin.model.arm import Arm


def path_held(
    arm: Arm, moves: Any, held: Mapping[str, float], request: PathRequest, begin: Array | None = None
) -> PathPlan:
    """`armkin.path` with joints held: joint name -> value [rad | mm]. The plan is one of the whole arm.

    request: its start, near and jerk are those of all joints. Held joints go to their values in the plan's approach;
    begin: (n,) where the motion begins instead, with a joint move to its first posture. Raises as
    `armkin.path` does, NoSolutionError also for a value outside its joint's limits.
    """
    check_rates(arm)
    free_arm = lock(arm, held)
    free_indices = [number for number, name in enumerate(arm.joint_names) if name not in held]
    start = request.start_joints(arm)
    held_start = unlock(arm, held, start[free_indices])
    check_limits(arm, held_start[None])
    near, jerk = (_free_values(value, arm.n, free_indices) for value in (request.near, request.jerk))
    free_request = replace(request, start=start[free_indices], near=near, jerk=jerk)
    try:
        plan = plan_path(free_arm, path_numbers.as_path_file(free_arm, moves, request.task), free_request)
    except NoSolutionError as error:
        if error.plan is not None:
            error.plan = _plan_of_all_joints(error.plan, arm, held)
        raise
    full_plan, first_posture = _plan_of_all_joints(plan, arm, held), unlock(arm, held, plan.motion.start)
    stretches = [_unlock_stretch(item, arm, held) for item in plan.motion.stretches]
    pace = plan.speed, request.accel, check_jerk(arm, request.jerk)
    if begin is not None and (first_move := straight_move(arm, begin, first_posture, *pace)).duration > 0:
        stretches, first_posture, shift = [first_move, *stretches], begin, 1
    else:
        shift = 0
    for number, (_, base) in plan.on_path.items():
        full_plan.note_stretch(number + shift, stretches[number + shift], base)
    full_plan.approach = approach_move(arm, start, first_posture, *pace)
    markers = [replace(item, before=item.before + shift) for item in plan.markers]
    return prove_plan(full_plan.set_motion(first_posture, stretches, markers))


def _free_values(values: ArrayLike | None, n: int, free_indices: list[int]) -> Array | None:
    """The values of the free joints from () or (n,) of all; None without any."""
    return None if values is None else np.broadcast_to(np.asarray(values, dtype=float), n)[free_indices]


def _plan_of_all_joints(plan: PathPlan, arm: Arm, held: Mapping[str, float]) -> PathPlan:
    """A plan of the free joints with the values of all joints in its branches and runs; its motion is left out."""

    def with_held(q: Array) -> Array:
        return unlock(arm, held, q)

    singularity = plan.nearest_singularity
    return replace(
        plan,
        arm=arm,
        held=dict(held),
        runs=[
            replace(run, start_joints=with_held(run.start_joints), end_joints=with_held(run.end_joints))
            for run in plan.runs
        ],
        branches=[replace(branch, start_joints=with_held(branch.start_joints)) for branch in plan.branches],
        reconfigurations=[
            replace(change, index=None if change.joint is None else arm.joint_names.index(change.joint))
            for change in plan.reconfigurations
        ],
        nearest_singularity=None if singularity is None else (*singularity[:2], with_held(singularity[2])),
        markers=[],
        trajectory=None,
        approach=None,
        on_path={},
    )


def _unlock_stretch(stretch: Stretch, arm: Arm, held: Mapping[str, float]) -> Stretch:
    """The stretch in all joints of the arm, the held ones at rest."""
    if isinstance(stretch, Smoothed):
        return replace(stretch, curve=_unlock_curve(stretch.curve, arm, held))
    if isinstance(stretch, Curve):
        return _unlock_curve(stretch, arm, held)
    assert isinstance(stretch, Straight)
    return replace(stretch, start=unlock(arm, held, stretch.start), end=unlock(arm, held, stretch.end))


def _unlock_curve(curve: Curve, arm: Arm, held: Mapping[str, float]) -> Curve:
    zero_slopes = dict.fromkeys(held, 0.0)
    knots = curve.path
    return Curve(Knots(knots.s, unlock(arm, held, knots.q), unlock(arm, zero_slopes, knots.d)), curve.x)
