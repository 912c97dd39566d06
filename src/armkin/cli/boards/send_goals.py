"""Where `armkin send` is told to go: joint values, a target, a file or a stream of waypoints, a piped answer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import armkin
from armkin.cli.parsing import arguments, lock_and_sweep, piped_answers
from armkin.cli.parsing.csv_to_numbers import streamed_rows
from armkin.cli.parsing.number_parsing import decimal_count
from armkin.errors import FileError, NoSolutionError, UsageError
from armkin.model import units
from armkin.model.target_numbers import label_units, targets_in

if TYPE_CHECKING:
    from armkin.board.planner import Stream
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm


class TargetOptions(NamedTuple):
    """`--target`, and the options that belong to it."""

    target: str | None
    task: str | None = None
    branch: str | None = None
    lock: Sequence[str] | None = None
    near: str | None = None


def read_goals(
    robot: str | None,
    q: list[str] | None,
    target_options: TargetOptions,
    batch: str | None,
    scene: str | None,
    tool: str | None,
) -> tuple[Arm, Goals | Stream]:
    """The arm and where it shall go; what is outside its limits is refused here, before a port is opened."""
    target = target_options.target
    sources = [name for name, value in (("Q...", q), ("--target", target), ("--batch", batch)) if value]
    if target is not None and q and robot is not None and batch is None:
        arguments.check_commas(arguments.load_arm(robot), target_options.task, target, q)
    if len(sources) > 1:
        raise UsageError(f"{' and '.join(sources)}: give one of them")
    if target is None and any(option not in (None, []) for option in target_options):
        raise UsageError("--branch, --task, --near and --lock belong to --target")
    if not sources:
        return _from_pipe(robot, scene, tool)
    if robot is None:
        raise UsageError(f"{sources[0]} needs a robot file: armkin send robots/three_dof.yaml ...")
    arm = arguments.load_arm(robot, scene, tool)
    if target is not None:
        return arm, _of_target(arm, target, target_options)
    if batch is not None:
        return arm, _of_rows(arm, batch)
    return arm, _checked_goals(arm, [], [arguments.joints(arm, q)])


def _of_target(arm: Arm, target: str, target_options: TargetOptions) -> Goals:
    """`--target`, which is solved when it is known where the arm stands."""
    import numpy as np

    from armkin.inverse.answers.rounding import printed_rounding
    from armkin.inverse.tasks.choose_task import task_for

    chosen_task = task_for(arm, target_options.task)
    values = np.array([arguments.target_list(arm, chosen_task, target)])
    near_joints = None if target_options.near is None else arguments.joint_list(arm, target_options.near, "--near")
    decimals = [[decimal_count(word) for word in target.split(",")]]
    rounding = printed_rounding(label_units(chosen_task.labels), values, arm.reach, decimals)
    held = lock_and_sweep.locked_values(arm, target_options.lock)
    return Goals(
        joints=None,
        rows=[1],
        target=targets_in(chosen_task.labels, values),
        task=chosen_task.name,
        branch=target_options.branch,
        held=held,
        near=near_joints,
        rounding=rounding,
    )


def _of_rows(arm: Arm, batch: str) -> Goals | Stream:
    """`--batch`: all rows of a file, or those of standard input as they come."""
    from armkin.board.planner import Stream

    rows = streamed_rows(batch, arm.joint_names, arm.name, units.poses_out(arm))
    if batch == "-":
        return Stream(arm, rows)
    numbered = list(rows)
    if not numbered:
        raise UsageError(f"{batch} has no rows: it needs one of {','.join(arm.joint_names)} per waypoint")
    return _checked_goals(arm, [number for number, _ in numbered], [values for _, values in numbered])


_NEIGHBOUR_DISTANCE = 2.5  # distance [pulses] from the exact value within which `pulses --best` may choose
_MAX_PULSES = 2**53  # pulses of a goal, at most


@dataclass
class Goals:
    """Where to go: joint values (w, n) [rad | mm], with their row numbers, or one target for ik."""

    joints: Array | None
    rows: Sequence[int]
    target: Array | None = None
    task: str | None = None
    branch: str | None = None
    held: Mapping[str, float] = field(default_factory=dict)  # joint name -> value [deg | mm]
    near: Sequence[float] | None = None  # [deg | mm] what the branch is chosen by; None: where the arm stands
    rounding: Array | None = None  # (1,) of the target

    def resolve(self, arm: Arm, near: Array) -> Array:
        """Joint values (w, n); near: where the arm stands [rad | mm]."""
        if self.joints is not None:
            return self.joints
        from armkin.inverse import choose_branch

        reference = units.joints_out(arm, near).tolist() if self.near is None else self.near
        request = choose_branch.Request(
            arm=arm, task=self.task, near=reference, branch=self.branch, held=self.held, ignore=arm.ignores_keep_out
        )
        [answer] = choose_branch.solve(request, self.target, self.rounding)  # type: ignore[arg-type]
        if answer.best is None and answer.within_limits and answer.refused is None:
            raise choose_branch.blocked_error(request, answer)
        if answer.best is None:
            [nearest] = choose_branch.closest(request, self.target)  # type: ignore[arg-type]
            raise choose_branch.refusal_error(request, answer, nearest.distance)
        return answer.branches[answer.best].q[None]


def _checked_goals(arm: Arm, rows: Sequence[int], values: Sequence[Sequence[float]]) -> Goals:
    """Goals [deg, mm] as joint values within limits; NoSolutionError names the row that is not."""
    from armkin.model.limits import check_limits

    joints = units.joints_in(arm, values)
    for i, goal in enumerate(joints):
        try:
            check_limits(arm, goal[None])
        except NoSolutionError as error:
            if rows:
                raise error.within(f"row {rows[i]}", row=rows[i]) from None
            raise
    return Goals(joints, rows)


def _from_pipe(robot: str | None, scene: str | None, tool: str | None) -> tuple[Arm, Goals]:
    """The arm and the goals (N, n) [rad | mm] of the answer on standard input.

    Raises FileError if its robot file, scene or tool is another one now.
    """
    import numpy as np

    answer = piped_answers.read_poses(robot)
    arm = arguments.load_arm(answer.robot_file, scene, tool)
    if answer.scene_sha256 is not None and answer.scene_sha256 != arm.scene_sha256:
        raise FileError(
            f"the answer on standard input was computed in the scene {answer.scene}; "
            + (f"{arm.scene} is another one, or it has changed" if arm.scene else f"give --scene {answer.scene}")
        )
    if answer.tool is not None and answer.tool != list(arm.tool or ()):
        raise FileError(
            "the answer on standard input was computed with another tool; "
            f"give --tool {','.join(map(repr, answer.tool))}"
        )
    if arm.sha256 != answer.robot_sha256:
        raise FileError(
            f"{answer.robot_file} is not the file that the answer on standard input was computed with: "
            "it has changed; compute the answer again"
        )
    poses = []
    for pose in answer.poses:
        if len(pose.joints) != arm.n:
            raise UsageError(f"the answer has {len(pose.joints)} joint values, {arm.name} has {arm.n} joints")
        [exact] = _checked_goals(arm, [], [pose.joints]).joints  # type: ignore[misc]
        if pose.pulses is not None and armkin.pulses(arm, exact).tolist() != pose.pulses:
            exact = _of_pulses(arm, exact, pose.pulses)
        poses.append(exact)
    return arm, Goals(np.array(poses), list(range(1, len(poses) + 1)))


def _of_pulses(arm: Arm, q: Array, counts: list[int]) -> Array:
    """Joint values of pulses that are not those of plain rounding, as `pulses --best` chooses them among neighbours.

    Raises UsageError, naming the joint, for pulses that mean another pose than the joint values beside them.
    """
    import numpy as np

    from armkin.motors import resolution

    if len(counts) != len(arm.motor_gain):
        raise UsageError(f"the answer has {len(counts)} pulses, {arm.name} has {len(arm.motor_gain)} motors")
    if max(map(abs, counts)) > _MAX_PULSES:
        raise UsageError(f"the answer on standard input is damaged: {max(counts, key=abs)} pulses")
    pulse_joints = armkin.joints(arm, counts)
    pulse_error = np.abs(pulse_joints - q) / resolution(arm)
    if (joint := int(pulse_error.argmax())) >= 0 and pulse_error[joint] > _NEIGHBOUR_DISTANCE:
        stated_value, pulse_value = (float(units.joints_out(arm, values)[joint]) for values in (q, pulse_joints))
        name = arm.joint_names[joint]
        raise UsageError(
            f"the answer contradicts itself: {name} = {stated_value:.10g}, and its pulses mean {name} = "
            f"{pulse_value:.10g}: compute it again",
            joint=name,
            value=stated_value,
            by_pulses=pulse_value,
        )
    return pulse_joints
