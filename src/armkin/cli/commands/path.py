"""`armkin path`."""

from __future__ import annotations

import armkin
from armkin.cli.boards import board_link, keep_outs
from armkin.cli.boards.board_link import SIM, Assume, Baud, Link, NoReset, Resume
from armkin.cli.boards.carry_out_path import PathQuestion, carry_out_path, plan_from, show_plan
from armkin.cli.boards.keep_outs import Ignore, NoScene
from armkin.cli.parsing import drawing_path, lock_and_sweep, path_options
from armkin.cli.parsing.drawing_path import At, Feed, GripBy, Lift, Placement, Scale
from armkin.cli.parsing.options import BranchName, Json, Lock, Near, Picture, Robot, Scene, Speed, TaskName, Tool
from armkin.cli.parsing.path_options import (
    AccelShare,
    BlendRadius,
    Corner,
    CornersBy,
    FirstTargets,
    GreatestJerk,
    MaySplit,
    MovePort,
    OnlyPlan,
    PathSource,
    PlanOut,
    StandsAt,
    Tolerance,
    ToolSpeed,
)
from armkin.cli.printing import output
from armkin.errors import UsageError


def path(
    robot: Robot,
    file: PathSource = None,
    via: Corner = None,
    port: MovePort = None,
    dry_run: OnlyPlan = False,
    tolerance: Tolerance = None,
    blend: BlendRadius = None,
    corners: CornersBy = None,
    speed: Speed = "100",
    accel: AccelShare = "100",
    tool_speed: ToolSpeed = None,
    jerk: GreatestJerk = None,
    near: Near = None,
    scene: Scene = None,
    tool: Tool = None,
    no_scene: NoScene = False,
    ignore_keep_out: Ignore = False,
    start: StandsAt = None,
    branch: BranchName = None,
    task: TaskName = None,
    lock: Lock = None,
    split: MaySplit = False,
    samples: FirstTargets = None,
    out: PlanOut = None,
    plot: Picture = None,
    assume: Assume = None,
    resume: Resume = False,
    baud: Baud = None,
    no_reset: NoReset = False,
    at: At = None,
    scale: Scale = None,
    feed: Feed = None,
    lift: Lift = None,
    grip_by: GripBy = None,
    json: Json = False,
) -> None:
    """Plan a path through space, and move along it.

    The branch that carries the whole way, within all limits, as fast as the joints allow; where none does: how
    far each one goes, and why no farther. Nothing moves unless the whole path is planned.
    """
    keep_outs.check_together(scene, no_scene)
    if start is not None and port is not None and not dry_run:
        raise UsageError("--start belongs to a plan: with --port the arm starts where it stands")

    arm = keep_outs.load_moving_arm(robot, scene, ignore_keep_out, tool)
    locked = lock_and_sweep.locked_radians(arm, lock)
    locked_arm = armkin.lock(arm, locked) if locked else arm
    placement = Placement(at=at, scale=scale, feed=feed, lift=lift, grip_by=grip_by)
    drawing_moves = drawing_path.drawing_moves(locked_arm, file, task, placement)
    moves = path_options.path_moves(locked_arm, file, via, task) if drawing_moves is None else drawing_moves
    output.check_destination(out, "a plan is", ".csv")
    numbers = path_options.path_numbers(
        arm, tolerance=tolerance, blend=blend, speed=speed, accel=accel, tool_speed=tool_speed, jerk=jerk, near=near,
        samples=samples,
    )  # fmt: skip
    options = {"branch": branch, "task": task, "corners": corners, "split": split, **numbers}
    if resume:
        board_link.can_resume(
            {"a plan": port is None, "--dry-run": dry_run, "--assume": assume, "--port sim": port == SIM}
        )
    question = PathQuestion(arm, moves, locked, options)
    if port is None or dry_run:
        plan = plan_from(start, "--start", question, json=json)
        show_plan(plan, out, plot, rehearsal=dry_run, json=json)
        return
    link = Link(port, baud, assume, resume, reset=not no_reset, no_scene=no_scene)
    carry_out_path(question, link, out, plot, json=json)
