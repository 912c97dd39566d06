"""Plans a path and carries it out on a board, for `armkin path` and `armkin send --path`."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any, NamedTuple

import armkin
from armkin.cli.boards import board_link, keep_outs
from armkin.cli.boards.board_link import SIM, Link
from armkin.cli.parsing import arguments, path_options
from armkin.cli.printing import output, path_text, render
from armkin.columns.csv_cells import csv_line
from armkin.columns.joint_columns import joint_columns
from armkin.errors import NoSolutionError, UsageError
from armkin.model import units

if TYPE_CHECKING:
    from armkin.board.backend import Planned
    from armkin.model.arm import Arm
    from armkin.motion.plan.path_plan import PathPlan

_ROW_PERIOD = 0.01  # time [s] between the rows of --out


class PathQuestion(NamedTuple):
    """What is planned."""

    arm: Arm
    moves: Any  # as `armkin.path` takes them
    locked: dict[str, float]  # joint name -> value that it is held at [rad | mm]
    options: dict[str, Any]  # of `armkin.path`, by name


def send_path(
    arm: Arm,
    file: str,
    link: Link,
    speed: str,
    start: str | None,
    trace: str | None,
    *,
    dry_run: bool,
    json: bool,
) -> None:
    """`armkin send ROBOT --path FILE`: the same with send's options, and its default port."""
    moves = path_options.path_moves(arm, file, None, None)
    output.check_destination(trace, "a plan is", ".csv")
    options: dict[str, Any] = {"speed": arguments.percent(speed, "--speed")}
    question = PathQuestion(arm, moves, {}, options)
    if not dry_run:
        carry_out_path(question, link, trace, None, json=json)
        return
    show_plan(plan_from(start, "--from", question, json=json), trace, None, json=json, dry_run=True)


def show_plan(
    plan: PathPlan, out: str | None, plot: str | None, *, json: bool, rehearsal: bool = True, **fields: Any
) -> None:
    """Write `--out` and `--plot`, and print the answer of a plan that is not carried out.

    rehearsal: see `_lay_rehearsal`; fields: the answer's further keys.
    """
    answer = {**_answer(plan, _lay_rehearsal(plan, rehearsal=rehearsal)), **fields}
    _write_files(plan, out, plot)
    _print_answer(plan, answer, json=json, out=out)


def plan_from(start: str | None, option: str, question: PathQuestion, *, json: bool) -> PathPlan:
    """The plan from the joint values of an option, without motion."""
    arm = board_link.arm_for_plan(question.arm)
    begin = arm.home if start is None else board_link.standing_joints(arm, start, option)
    keep_outs.tell_start_hit(arm, begin)
    return _make_plan(question._replace(arm=arm, options=question.options | {"start": begin}), json=json)


def carry_out_path(question: PathQuestion, link: Link, out: str | None, plot: str | None, *, json: bool) -> None:
    """Plan from the arm's position, or from the start of a resumed motion, then move."""
    from armkin.board import path_run
    from armkin.board.planner import where_arm_stands
    from armkin.board.stop_signals import planning
    from armkin.motors import joints as joints_of

    arm = board_link.arm_for_port(question.arm, link.port)
    board, stands = board_link.board_of(arm, rehearsal=link.port == SIM), board_link.assumed_joints(arm, link.assume)
    simulated = board_link.simulation_note(link.assume)
    with board_link.open_backend(board, link.port, link.baud, simulated=simulated, reset=link.reset) as machine:
        board_link.prepare_motion(arm, machine, link.assume, stands)
        keep_outs.check_start(machine, arm, link.no_scene)
        held = board_link.resumed_note(board, link.resume)
        start_counts = machine.counts() if held is None else held.start
        with planning():
            options = question.options | {"start": joints_of(arm, start_counts)}
            plan = _make_plan(question._replace(arm=arm, options=options), json=json)
            path_run.check_gripper(plan, board)
            path_run.check_pauses(plan, sys.stdin.isatty())
            parts = path_run.plan_parts(plan, start_counts, board.plan_trajectory)
            _write_files(plan, out, plot)
        if plan.approach is not None and held is None:
            output.note(f"first a joint move to where the path starts: {plan.approach.duration:.3f} s")
        with board.under_way(parts, held) as (left, first, note), board_link.motion_progress(left, note) as tell:
            path_run.follow_plan(board, plan, left, tell, first, ask=_until_enter)
        answer = {**_answer(plan, parts), "port": machine.port.name, **where_arm_stands(machine)}
        if held is not None:
            answer.pop("approach", None)  # where it began, that motion is over
    _print_answer(plan, answer, json=json, out=out)
    if not json:
        with output.answer_stream(out) as write:
            write(board_link.where_text(arm, answer))


def _until_enter() -> None:
    output.note("the path rests here: press Enter to go on")
    sys.stdin.readline()


def _make_plan(question: PathQuestion, *, json: bool) -> PathPlan:
    """The plan; of a path that is not carried, what is known of it is printed first."""
    arm, moves, locked, options = question
    try:
        if locked:
            from armkin.motion.path_planner.held_joints import path_held
            from armkin.motion.path_planner.path_request import PathRequest

            plan = path_held(arm, moves, locked, PathRequest(**options))
        else:
            plan = armkin.path(arm, moves, **options)
    except NoSolutionError as error:
        if error.plan is not None:
            _print_answer(error.plan, _answer(error.plan, None), json=json)
        raise
    keep_outs.tell_ignored([plan.motion] if plan.approach is None else [plan.approach, plan.motion])
    return plan


def _lay_rehearsal(plan: PathPlan, *, rehearsal: bool) -> list[Planned] | None:
    """The plan on the robot file's board, or on a made-up one; None without drives.

    rehearsal: a gripper that could not do its part is refused, too.
    """
    from armkin.board import path_run
    from armkin.motors import pulses

    try:
        board = board_link.board_of(plan.arm, rehearsal=True)
    except UsageError:
        return None
    if rehearsal:
        path_run.check_gripper(plan, board)
    return path_run.plan_parts(
        plan, pulses(plan.arm, (plan.approach or plan.motion).start).tolist(), board.plan_trajectory
    )


def _answer(plan: PathPlan, parts: list[Planned] | None) -> dict[str, Any]:
    """The answer as data."""
    from armkin.motion.path_planner.branch_report import plan_fields

    segments = None if parts is None else sum(part.segments for part in parts[plan.approach is not None :])
    return {**render.head(plan.arm), **plan_fields(plan), "segments": segments}


def _write_files(plan: PathPlan, out: str | None, plot: str | None) -> None:
    """`--out` and `--plot`."""
    if out is not None:
        _write_samples(plan, out)
    if plot is not None:
        from armkin.plot.path_picture import plot_path

        plot_path(plan, plot)


def _write_samples(plan: PathPlan, name: str) -> None:
    """CSV: time, joints, their speeds, the tool, the way."""
    import numpy as np

    arm = plan.arm
    others = [*(f"{j}_speed" for j in arm.joint_names), "x_mm", "y_mm", "z_mm", "s_mm"]
    heading = ["time_s", *joint_columns(arm.joint_names), *others]
    t = np.append(np.arange(0.0, plan.duration, _ROW_PERIOD), plan.duration)
    with output.destination(name) as write:
        write(csv_line(heading) + "\n")
        for part in np.array_split(t, max(len(t) // 10_000, 1)):
            q = plan.q(part)
            rows = np.column_stack([
                part, units.joints_out(arm, q), units.joints_out(arm, plan.qd(part)), armkin.fk(arm, q)[:, :3, 3],
                plan.s(part),
            ])  # fmt: skip
            write("".join(csv_line(row) + "\n" for row in (rows + 0.0).tolist()))


def _print_answer(plan: PathPlan, answer: dict[str, Any], *, json: bool, out: str | None = None) -> None:
    """The answer, on stderr while the samples of `--out -` have stdout."""
    with output.answer_stream(out) as write:
        write(render.to_json(answer) + "\n" if json else path_text.plan_summary(plan, answer))
