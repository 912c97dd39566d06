"""`armkin send`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

import armkin
from armkin.cli.boards import board_link, keep_outs
from armkin.cli.boards.board_link import SIM, Assume, Baud, Link, NoReset, Resume
from armkin.cli.boards.default_port import PortName
from armkin.cli.boards.keep_outs import Ignore, NoScene
from armkin.cli.boards.send_goals import TargetOptions
from armkin.cli.boards.send_goals import read_goals as read_goals
from armkin.cli.parsing import arguments
from armkin.cli.parsing.number_parsing import number
from armkin.cli.parsing.options import BranchName, Joints, Json, Lock, RobotOrPipe, Scene, Speed, TaskName, Tool
from armkin.cli.printing import output, render
from armkin.columns.csv_cells import csv_line
from armkin.columns.joint_columns import joint_columns
from armkin.errors import NoSolutionError, UsageError
from armkin.model import units

if TYPE_CHECKING:
    from armkin.board.backend import Planned
    from armkin.board.backend.board import Board
    from armkin.board.planner import Planner, Stream
    from armkin.cli.boards.send_goals import Goals
    from armkin.errors import ArmkinError
    from armkin.formula.arrays import Array
    from armkin.model.arm import Arm

GoalTarget = Annotated[
    str | None,
    typer.Option("--target", metavar="X,Y,Z", help="Solve for a target, and take the branch nearest to the arm."),
]
NearPose = Annotated[
    str | None,
    typer.Option("--near", metavar="Q,...", help="Take the branch nearest to this pose. [default: to the arm]"),
]
Waypoints = Annotated[
    str | None,
    typer.Option(
        "--batch",
        metavar="FILE|-",
        help="Joint values of many waypoints, one row each; the arm stops in each, but for --blend.",
    ),
]
BlendRadius = Annotated[
    str | None,
    typer.Option(
        "--blend",
        metavar="DEG|MM",
        help="With --batch FILE: round the corners, so far from each waypoint, without a stop.",
    ),
]
PathSource = Annotated[
    str | None, typer.Option("--path", metavar="FILE|-", help="Along a path file, as armkin path does.")
]
OnlyPlan = Annotated[bool, typer.Option("--dry-run", help="Plan from --from, move nothing.")]
DryRunStart = Annotated[
    str | None,
    typer.Option("--from", metavar="Q,...", help="Where a dry run starts. [default: the home pose]"),
]
Trace = Annotated[
    str | None,
    typer.Option("--trace", metavar="FILE|-", help="CSV of the plan: time, joints, every joint's position."),
]
MissingAccel = Annotated[
    str | None,
    typer.Option(
        "--accel",
        metavar="DEG/S2|MM/S2",
        help="In a rehearsal (--dry-run, --port sim): for joints without a max_accel in the robot file.",
    ),
]


def send(
    robot: RobotOrPipe = None,
    q: Joints = None,
    port: PortName = None,
    target: GoalTarget = None,
    near: NearPose = None,
    branch: BranchName = None,
    task: TaskName = None,
    lock: Lock = None,
    batch: Waypoints = None,
    blend: BlendRadius = None,
    path: PathSource = None,
    scene: Scene = None,
    tool: Tool = None,
    no_scene: NoScene = False,
    ignore_keep_out: Ignore = False,
    speed: Speed = "100",
    assume: Assume = None,
    dry_run: OnlyPlan = False,
    start: DryRunStart = None,
    trace: Trace = None,
    accel: MissingAccel = None,
    resume: Resume = False,
    baud: Baud = None,
    no_reset: NoReset = False,
    json: Json = False,
) -> None:
    """Move the arm.

    All joints start and stop together, within each joint's max_speed, max_accel and max_jerk. Ctrl-C stops the
    arm on its path; its position stays known.
    """
    from armkin.board.planner import Planner

    keep_outs.check_together(scene, no_scene)
    fraction = arguments.percent(speed, "--speed")
    rehearsal = dry_run or port == SIM
    _check_together(start, accel, trace, batch, dry_run=dry_run, rehearsal=rehearsal)
    if resume:
        _check_rows_are_kept(batch)
        board_link.can_resume({"--dry-run": dry_run, "--assume": assume, "--port sim": port == SIM})
    link = Link(port, baud, assume, resume, reset=not no_reset, no_scene=no_scene)
    if path is not None:
        from armkin.cli.boards.carry_out_path import send_path

        other_options = {"joint values": q, "--target": target, "--batch": batch, "--blend": blend, "--near": near}
        other_options |= {"--branch": branch, "--task": task, "--lock": lock, "--accel": accel}
        arm = keep_outs.load_moving_arm(_of_a_path(robot, other_options), scene, ignore_keep_out, tool)
        send_path(arm, path, link, speed, start, trace, dry_run=dry_run, json=json)
        return
    radius = _blend_radius(blend, batch)
    arm, goals = read_goals(robot, q, TargetOptions(target, task, branch, lock, near), batch, scene, tool)
    output.check_destination(trace, "a plan is", ".csv")
    arm = keep_outs.mark_ignored(arm, ignore_keep_out)
    arm = _with_accel(arm, accel)
    arm = arm if dry_run else board_link.arm_for_port(arm, port)
    planner = Planner(_board_of(arm, rehearsal=rehearsal), fraction, radius)
    stands = board_link.assumed_joints(arm, assume)
    if dry_run:
        _dry_run(planner, goals, start, trace, json)
    else:
        _plan_and_move(planner, goals, link, stands, trace, json=json)


def _check_together(
    start: str | None, accel: str | None, trace: str | None, batch: str | None, *, dry_run: bool, rehearsal: bool
) -> None:
    """Raise UsageError for options that make no sense together."""
    if start is not None and not dry_run:
        raise UsageError("--from belongs to --dry-run: the arm starts where it stands")
    if accel is not None and not rehearsal:
        raise UsageError("--accel is for --dry-run and --port sim: a real arm's max_accel stands in its robot file")
    if trace is not None and batch == "-" and not dry_run:
        raise UsageError("--trace needs all waypoints before the arm moves: not with --batch -")


def _check_rows_are_kept(batch: str | None) -> None:
    """Raise UsageError where --resume cannot have the rows again."""
    if batch == "-":
        raise UsageError(
            "--resume needs the same rows again, and standard input (--batch -) cannot be read a second time\n"
            "give a file with the rows, --batch FILE; without --resume they start where the arm stands"
        )


def _of_a_path(robot: str | None, options: Mapping[str, object]) -> str:
    """The robot of --path. Raises UsageError without one, and where one of the `options` is given, too."""
    options_given = [name for name, value in options.items() if value]
    if options_given:
        raise UsageError(f"--path and {options_given[0]}: give one of them; armkin path has more options")
    if robot is None:
        raise UsageError("--path needs a robot: armkin send three_dof --path FILE")
    return robot


def _board_of(arm: Arm, *, rehearsal: bool) -> Board:
    """The arm's board; where a rehearsal lacks accelerations alone, --accel is what gives them."""
    try:
        return board_link.board_of(arm, rehearsal=rehearsal)
    except UsageError as error:
        if rehearsal and all(line.startswith("max_accel") for line in error.fields.get("lines_to_add", ["no"])):
            error.fields["option"] = "--accel"
        raise


def _plan_and_move(
    planner: Planner, goals: Goals | Stream, link: Link, start: Array | None, trace: str | None, *, json: bool
) -> None:
    """Plan from where the arm stands, or from where the motion that is resumed began; move; tell where it stands."""
    from armkin.board.planner import Stream, where_arm_stands
    from armkin.board.stop_signals import planning

    arm, board, simulated = planner.arm, planner.board, board_link.simulation_note(link.assume)
    with board_link.open_backend(board, link.port, link.baud, simulated=simulated, reset=link.reset) as machine:
        board_link.prepare_motion(arm, machine, link.assume, start)
        keep_outs.check_start(machine, arm, link.no_scene)
        held = board_link.resumed_note(board, link.resume)
        start_counts = machine.counts() if held is None else held.start
        if isinstance(goals, Stream):
            with output.progress("ms of motion", None) as tick:  # how many rows will come is not known
                row_plans = keep_outs.telling_ignored(goals.plans(planner, start_counts))
                machine.run(planner.sum_up(row_plans), lambda elapsed, _: tick(round(1000 * elapsed)))
        else:
            with planning():
                plans = _all_plans(planner, goals, start_counts)  # every refusal before anything moves
                _write_trace(arm, plans, trace)
            start_counts = machine.counts()
            _carry_out(planner, plans, held)
        plan_totals = planner.total_sent.summary(start_counts)
        answer: dict[str, Any] = {**plan_totals, "port": machine.port.name, **where_arm_stands(machine)}
    _report_end(arm, plan_totals, answer, goals.problem if isinstance(goals, Stream) else None, trace, json=json)


def _report_end(
    arm: Arm,
    plan_totals: Mapping[str, Any],
    answer: Mapping[str, Any],
    problem: ArmkinError | None,
    trace: str | None,
    *,
    json: bool,
) -> None:
    """Print where the arm stands after a motion; then raise what ended it, if anything did."""
    answer = {**render.head(arm), **answer}
    if problem is not None and not plan_totals["waypoints"]:
        raise problem  # nothing has moved: there is nothing to tell
    if problem is not None and json and not isinstance(problem, NoSolutionError):
        problem.fields["sent"] = answer  # exit codes 0 and 3 alone have something on stdout
        raise problem
    with output.answer_stream(trace) as write:
        write(render.to_json(answer) + "\n" if json else _arrival_text(arm, plan_totals, answer))
    if problem is not None:
        raise problem


def _dry_run(planner: Planner, goals: Goals | Stream, start: str | None, trace: str | None, json: bool) -> None:
    """`--dry-run`: plan from `--from`, print what the plans come to, move nothing."""
    from armkin.board.planner import Total

    arm = planner.arm
    begin = arm.home if start is None else board_link.standing_joints(arm, start, "--from")
    start_counts = planner.counts(begin)
    keep_outs.tell_start_hit(arm, armkin.joints(arm, start_counts))
    plans = _all_plans(planner, goals, start_counts)
    _write_trace(arm, plans, trace)
    plan_totals = Total(arm, plans).summary()
    with output.answer_stream(trace) as write:
        write(
            render.to_json({**render.head(arm), "dry_run": True, **plan_totals}) + "\n"
            if json
            else _text(arm, plan_totals)
        )


def _carry_out(planner: Planner, plans: Sequence[Planned], held: Any) -> None:
    """Move through the plans, or through what is left of them since they were held."""
    board = planner.board
    with board.under_way(plans, held) as (left, _, note), board_link.motion_progress(left, note) as tell:
        board.machine.run(planner.sum_up(left), tell)


def _with_accel(arm: Arm, text: str | None) -> Arm:
    """The arm with `--accel` [deg/s2 | mm/s2] for the joints that have no acceleration."""
    import dataclasses

    import numpy as np

    if text is None:
        return arm
    value = number(text, "--accel")
    if not 1e-6 <= value <= 1e6:
        raise UsageError(f"--accel: {value:g} must be from 0.000001 to 1000000 deg/s2 (mm/s2)")
    accel = units.joints_in(arm, [value] * arm.n)
    return dataclasses.replace(arm, max_accel=np.where(np.isnan(arm.max_accel), accel, arm.max_accel))


def _blend_radius(text: str | None, batch: str | None) -> float:
    """`--blend`: 0 without it."""
    if text is None:
        return 0.0
    radius = number(text, "--blend")
    if radius < 0:
        raise UsageError(f"--blend: '{text}' must be at least 0")
    if batch in (None, "-"):
        raise UsageError("--blend needs all waypoints before the arm moves: with --batch FILE")
    return radius


def _all_plans(planner: Planner, goals: Goals | Stream, start: Sequence[int]) -> list[Planned]:
    """All plans at once, from counts; a stream is read to its end."""
    from armkin.board.planner import Stream

    if isinstance(goals, Stream):
        plans = goals.all_plans(planner, start)
    else:
        near = armkin.joints(planner.arm, list(start))
        plans = [planner.plan(start, goals.resolve(planner.arm, near))]
    keep_outs.tell_ignored([plan.trajectory for plan in plans])
    return plans


def _write_trace(arm: Arm, plans: Sequence[Planned], path: str | None) -> None:
    """The plans as CSV, one after another: time [s], joints [deg, mm] and the joints' positions [mm]; None: no file."""
    if path is None:
        return
    others = [f"{name}_{axis}_mm" for name in [*arm.joint_names, "tool"] for axis in "xyz"]
    heading = ["time_s", *joint_columns(arm.joint_names), *others]
    begin_time = 0.0
    with output.destination(path) as write:
        write(csv_line(heading) + "\n")
        for i, plan in enumerate(plans):
            trace = plan.trajectory.trace()
            first = 1 if i else 0  # a plan starts where the one before it ends
            rows = zip(
                (trace.time + begin_time).tolist()[first:],
                units.joints_out(arm, trace.joints).tolist()[first:],
                (trace.position[:, 1:] + 0.0).reshape(len(trace.time), -1).tolist()[first:],
                strict=True,
            )
            write("".join(csv_line([time, *joints, *positions]) + "\n" for time, joints, positions in rows))
            begin_time += plan.duration


def _arrival_text(arm: Arm, plan_totals: Mapping[str, Any], answer: Mapping[str, Any]) -> str:
    """Where the arm stands, and whether that is where the plan ends."""
    text = board_link.where_text(arm, answer)
    if answer["pulses"] is None:
        return text
    motors = zip(answer["motors"], answer["pulse_units"], plan_totals["pulses"], answer["pulses"], strict=True)
    differences = [f"{name} {count - goal:+d} {unit}" for name, unit, goal, count in motors if count != goal]
    differs = f"not as planned: {', '.join(differences)}" if differences else "as planned"
    return f"{text}read back: {differs}, {answer['duration_s']:.3f} s\n"


def _text(arm: Arm, answer: Mapping[str, Any]) -> str:
    """A dry run for people."""
    headings = render.joint_headings(arm)
    speeds = [f"{name}/s" for name in headings]
    motors = [f"{name}/{unit}" for name, unit in zip(answer["motors"], answer["pulse_units"], strict=True)]
    joints = [
        ["", *headings],
        ["from", *map(render.fixed_text, answer["start_joints"])],
        ["to", *map(render.fixed_text, answer["joints"])],
    ]
    pulses = [
        ["", *motors],
        ["from", *map(str, answer["start_pulses"])],
        ["to", *map(str, answer["pulses"])],
        ["moves", *(f"{move:+d}" for move in answer["moves"])],
        ["top rate /s", *(f"{rate:.0f}" for rate in answer["top_rate"])],
    ]
    top = [["", *speeds], ["top speed", *(render.fixed_text(value, 2) for value in answer["top_speed"])]]
    head = (
        f"{arm.name}: {answer['waypoints']} waypoint{'s' * (answer['waypoints'] != 1)}, "
        f"{answer['duration_s']:.3f} s, {answer['segments']} segments (dry run: nothing moves)"
    )
    return "\n\n".join([head, *(render.table(part) for part in (joints, pulses, top))]) + "\n"
