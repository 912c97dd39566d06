"""`armkin plot`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from armkin.cli.parsing import arguments, lock_and_sweep, piped_answers
from armkin.cli.parsing.csv_to_numbers import batch_rows
from armkin.cli.parsing.number_parsing import comma_separated
from armkin.cli.parsing.options import Joints, Lock, RobotOrPipe, Scene, TaskName
from armkin.cli.printing import render
from armkin.errors import NoSolutionError, UsageError
from armkin.model import units
from armkin.model.target_numbers import label_units, targets_in

if TYPE_CHECKING:
    from armkin.model.arm import Arm

_VIEWS = {"front": (0.0, -90.0), "side": (0.0, 0.0), "top": (90.0, -90.0), "iso": (22.0, -60.0)}

PictureOut = Annotated[
    str | None, typer.Option("--out", "-o", metavar="FILE", help="The picture, .png or .svg. [default: a window]")
]
DrawnTarget = Annotated[
    str | None,
    typer.Option("--target", metavar="X,Y,Z", help="Instead of joint values: all branches that reach it."),
]
DrawnPoses = Annotated[
    str | None,
    typer.Option("--batch", "--path", metavar="FILE|-", help="Instead: all poses of a CSV file, one row a pose."),
]
Frames = Annotated[
    bool | None,
    typer.Option("--frames/--no-frames", help="The joint frames. [default: for a single pose]"),
]
View = Annotated[
    str | None,
    typer.Option(
        "--view",
        metavar="VIEW",
        help="front, side, top, iso, or ELEVATION,AZIMUTH of the eye in degrees.",
    ),
]


def plot(
    robot: RobotOrPipe = None,
    q: Joints = None,
    out: PictureOut = None,
    target: DrawnTarget = None,
    batch: DrawnPoses = None,
    task: TaskName = None,
    lock: Lock = None,
    scene: Scene = None,
    frames: Frames = None,
    view: View = None,
) -> None:
    """A picture of the arm.

    In one pose, in all branches of a target, or along a path. Takes what fk, ik and pulses print with --json
    from a pipe, too.
    """
    _check_canvas(out)
    if target is None and (task is not None or lock):
        raise UsageError("--task and --lock belong to --target")
    style: dict[str, Any] = {"frames": frames, "view": None if view is None else _view_angles(view)}
    if target is None and batch is None and not q:
        _draw_piped(robot, scene, out, **style)
        return
    arm = arguments.load_arm(arguments.required_robot(robot), scene)
    if target is not None and q:
        arguments.check_commas(arm, task, target, q)
    if sum((bool(q), target is not None, batch is not None)) > 1:
        raise UsageError("joint values, --target and --batch: give one of the three")
    if target is not None:
        _draw_branches(arm, target, task, lock, out, **style)
    elif batch is not None:
        _draw_poses(arm, _poses_of_file(arm, batch), out, **style)
    else:
        _draw_pose(arm, arguments.joints(arm, q), out, **style)


def _check_canvas(out: str | None) -> None:
    """Raise an error for a file that no picture is, or without one where no window can be opened."""
    from armkin.plot import canvas

    if out is not None:
        canvas.check_picture(out)
    else:
        try:
            canvas.window_pyplot()
        except UsageError as error:
            raise UsageError(error.message, advice="for example -o arm.png") from None
    canvas.require_matplotlib()


def _draw_pose(arm: Arm, values: list[float], out: str | None, **style: Any) -> None:
    """A single pose [deg | mm]."""
    import numpy as np

    from armkin.plot import plot_poses

    q = units.joints_in(arm, values)
    plot_poses(arm, q, out, title=render.pose_line(arm, values), **style)
    [violations] = render.violations(arm, np.array([values]), q[None])
    render.warn_of_limits(arm, violations)


def _draw_poses(arm: Arm, poses: Any, out: str | None, **style: Any) -> None:
    """Poses (K, n) [deg | mm], one after another."""
    from armkin.plot import plot_poses

    plot_poses(arm, units.joints_in(arm, poses), out, title=f"{arm.name}: {len(poses)} poses", **style)


def _draw_piped(robot: str | None, scene: str | None, out: str | None, **style: Any) -> None:
    """What a command before the pipe has printed: its branches, or its poses."""
    from armkin.plot import plot_poses

    arm_and_answers = piped_answers.answers(robot, scene)
    if arm_and_answers is None:
        arm = arguments.load_arm(arguments.required_robot(robot), scene)
        names = " ".join(arm.joint_names)
        raise UsageError(f"nothing to draw: give joint values ({names}), a pose's name, --target or --batch")
    arm, answers = arm_and_answers
    if len(answers) == 1 and len(answers[0].get("branches") or ()) > 1:
        branches = answers[0]["branches"]
        q = units.joints_in(arm, [branch["joints"] for branch in branches])
        plot_poses(arm, q, out, names=[str(branch["name"]) for branch in branches], **style)
        return
    values = piped_answers.joints_of(arm, answers)
    if len(values) == 1:
        _draw_pose(arm, values[0], out, **style)
    else:
        _draw_poses(arm, values, out, **style)


def _view_angles(text: str) -> tuple[float, float]:
    if text in _VIEWS:
        return _VIEWS[text]
    if "," not in text:
        raise UsageError(f"--view {text}: there are {', '.join(_VIEWS)}, or ELEVATION,AZIMUTH, for example 20,-60")
    elevation, azimuth = comma_separated(text, ("elevation", "azimuth"), "--view")
    return elevation, azimuth


def _draw_branches(
    arm: Arm, text: str, task: str | None, lock: list[str] | None, out: str | None, **style: Any
) -> None:
    """All branches of one target."""
    import numpy as np

    from armkin.forward import position
    from armkin.inverse import choose_branch
    from armkin.inverse.tasks.choose_task import task_for
    from armkin.plot import plot_poses

    chosen_task = task_for(arm, task)
    values = arguments.target_list(arm, chosen_task, text)
    request = choose_branch.Request(arm=arm, task=chosen_task.name, held=lock_and_sweep.locked_values(arm, lock))
    [answer] = choose_branch.solve(request, targets_in(chosen_task.labels, [values]))
    goal = render.label_values(chosen_task.labels, values, label_units(chosen_task.labels))
    if not answer.branches:
        raise NoSolutionError(f"{arm.name} cannot reach {goal}: there is no branch to draw")
    q = np.array([branch.q for branch in answer.branches])
    names = [branch.name for branch in answer.branches]
    # The point is where the arm's tips are: the target of a planar arm has no z.
    plot_poses(arm, q, out, names=names, target=position(arm, q[0]), title=f"{arm.name}: {goal}", **style)


def _poses_of_file(arm: Arm, path: str) -> Any:
    """The rows of a file (K, n) [deg | mm]."""
    import numpy as np

    from armkin.plot.pose_picture import MAX_POSES

    parts: list[Any] = []
    for chunk in batch_rows(path, arm.joint_names, arm.name, units.poses_out(arm)):
        parts.append(chunk.values)
        if sum(map(len, parts)) > MAX_POSES:
            raise UsageError(f"{path}: more than {MAX_POSES} poses are too many for one picture")
    if not parts:
        raise UsageError(f"{path}: no poses; give one row of {','.join(arm.joint_names)} for each")
    return np.concatenate(parts)
