"""`armkin plot`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from armkin.cli import holding, inputs, render
from armkin.cli.csv_rows import batch_rows
from armkin.cli.numbers import listed
from armkin.cli.options import Joints, Lock, Robot, TaskName
from armkin.errors import NoSolutionError, UsageError
from armkin.model import units

if TYPE_CHECKING:
    from armkin.model.arm import Arm

_VIEWS = {"front": (0.0, -90.0), "side": (0.0, 0.0), "top": (90.0, -90.0), "iso": (22.0, -60.0)}


def plot(
    robot: Robot,
    q: Joints = None,
    out: Annotated[str | None, typer.Option("--out", metavar="FILE", help="The picture, .png or .svg.")] = None,
    target: Annotated[
        str | None,
        typer.Option("--target", metavar="X,Y,Z", help="Instead of joint values: all branches that reach it."),
    ] = None,
    path: Annotated[
        str | None,
        typer.Option("--path", metavar="FILE|-", help="Instead: all poses of a CSV file, one row a pose."),
    ] = None,
    task: TaskName = None,
    lock: Lock = None,
    frames: Annotated[
        bool | None,
        typer.Option("--frames/--no-frames", help="The joint frames. [default: for a single pose]"),
    ] = None,
    view: Annotated[
        str | None,
        typer.Option(
            "--view",
            metavar="VIEW",
            help="front, side, top, iso, or ELEVATION,AZIMUTH of the eye in degrees.",
        ),
    ] = None,
) -> None:
    """A picture of the arm.

    In one pose, in all branches of a target, or along a path.
    """
    if out is None:
        raise UsageError("plot needs --out FILE, a .png or .svg")
    from armkin.plot import canvas, plot_poses

    canvas.check(out)
    canvas.require()
    arm = inputs.load(robot)
    if target is not None and q:
        _no_words(arm, task, target, q)
    if sum((bool(q), target is not None, path is not None)) > 1:
        raise UsageError("joint values, --target and --path: give one of the three")
    if not (q or target or path):
        raise UsageError(f"nothing to draw: give joint values ({' '.join(arm.joint_names)}), --target or --path")
    if target is None and (task is not None or lock):
        raise UsageError("--task and --lock belong to --target")
    eye = None if view is None else _eye(view)
    if target is not None:
        _branches(arm, target, task, lock, out, frames=frames, view=eye)
    elif path is not None:
        poses = _poses(arm, path)
        title = f"{arm.name}: {len(poses)} poses"
        plot_poses(arm, units.joints_in(arm, poses), out, title=title, frames=frames, view=eye)
    else:
        import numpy as np

        values = inputs.joints(arm, q)
        title = render.pose_line(arm, values)
        plot_poses(arm, units.joints_in(arm, values), out, title=title, frames=frames, view=eye)
        [outside] = render.violations(arm, np.array([values]), units.joints_in(arm, [values]))
        render.warn_of_limits(arm, outside)


def _no_words(arm: Arm, task: str | None, target: str, q: list[str]) -> None:
    """`--target 390 80 300`: say that it wants commas, where that is what is wrong."""
    from armkin.inverse.tasks.fitting import task_for

    inputs.target_list(arm, task_for(arm, task), target, q)


def _eye(text: str) -> tuple[float, float]:
    if text in _VIEWS:
        return _VIEWS[text]
    if "," not in text:
        raise UsageError(f"--view {text}: there are {', '.join(_VIEWS)}, or ELEVATION,AZIMUTH, for example 20,-60")
    elevation, azimuth = listed(text, ("elevation", "azimuth"), "--view")
    return elevation, azimuth


def _branches(arm: Arm, text: str, task: str | None, lock: list[str] | None, out: str, **style: Any) -> None:
    """All branches of one target."""
    import numpy as np

    from armkin.forward import position
    from armkin.inverse import choose
    from armkin.inverse.tasks.fitting import task_for
    from armkin.plot import plot_poses

    what = task_for(arm, task)
    values = inputs.target_list(arm, what, text)
    request = choose.Request(arm=arm, task=what.name, held=holding.locks(arm, lock))
    [answer] = choose.solve(request, units.targets_in(what.labels, [values]))
    goal = render.labelled(what.labels, values, units.label_units(what.labels))
    if not answer.branches:
        raise NoSolutionError(f"{arm.name} cannot reach {goal}: there is no branch to draw")
    q = np.array([branch.q for branch in answer.branches])
    names = [branch.name for branch in answer.branches]
    # The point is where the arm's tips are: the target of a planar arm has no z.
    plot_poses(arm, q, out, names=names, target=position(arm, q[0]), title=f"{arm.name}: {goal}", **style)


def _poses(arm: Arm, path: str) -> Any:
    """The rows of a file (K, n) [deg | mm]."""
    import numpy as np

    from armkin.plot.poses import MOST

    parts: list[Any] = []
    for chunk in batch_rows(path, arm.joint_names, arm.name):
        parts.append(chunk.values)
        if sum(map(len, parts)) > MOST:
            raise UsageError(f"{path}: more than {MOST} poses cannot be told apart in one picture")
    if not parts:
        raise UsageError(f"{path}: no poses; give one row of {','.join(arm.joint_names)} for each")
    return np.concatenate(parts)
