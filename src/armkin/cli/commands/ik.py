"""`armkin ik`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import typer

import armkin
from armkin.cli.batches import compiled_ik
from armkin.cli.parsing import arguments, lock_and_sweep, piped_answers
from armkin.cli.parsing.number_parsing import decimal_count
from armkin.cli.parsing.options import (
    AllBranches,
    Batch,
    BatchOut,
    BranchName,
    Cluster,
    Compiled,
    JsonLines,
    Lock,
    Near,
    PositionFirst,
    Resume,
    RobotOrPipe,
    Scene,
    Sweep,
    Target,
    TaskName,
    Tool,
    Workers,
)
from armkin.cli.parsing.row_chunks import Chunk, one_row
from armkin.cli.printing import ik_text, output, render
from armkin.cli.printing.ik_answer import answer_of, closest_pose, nearest_to
from armkin.errors import UsageError
from armkin.model import units
from armkin.model.target_numbers import label_units, targets_in, targets_out

if TYPE_CHECKING:
    from armkin.cli.answers import Ik
    from armkin.columns.table import Table
    from armkin.formula.arrays import Array
    from armkin.inverse import choose_branch
    from armkin.inverse.tasks.task import Task
    from armkin.model.arm import Arm

Turns = Annotated[
    bool,
    typer.Option("--turns", help="Also the other copies of each branch, whole turns away, within limits."),
]
Continuous = Annotated[
    bool,
    typer.Option("--continuous", help="With --batch: stay close to the row before, instead of one --near for all."),
]


def ik(
    robot: RobotOrPipe = None,
    target: Target = None,
    all_branches: AllBranches = False,
    near: Near = None,
    branch: BranchName = None,
    turns: Turns = False,
    task: TaskName = None,
    position_first: PositionFirst = False,
    lock: Lock = None,
    sweep: Sweep = None,
    continuous: Continuous = False,
    scene: Scene = None,
    tool: Tool = None,
    compiled: Compiled = False,
    workers: Workers = 1,
    json: JsonLines = False,
    batch: Batch = None,
    out: BatchOut = None,
    cluster: Cluster = None,
    resume: Resume = False,
) -> None:
    """All joint values that reach a target.

    Lists the branch within limits that moves the joints least from --near. Exit code 3: no branch does;
    the nearest pose within limits is shown instead. Without a target, the poses that
    `armkin fk --json` wrote to standard input are the targets.
    """
    from armkin.inverse import choose_branch
    from armkin.inverse.tasks.choose_task import task_for

    _check_together(batch, sweep, position_first=position_first, compiled=compiled, continuous=continuous)
    piped_joints = None if target or batch is not None else piped_answers.joint_values(robot, scene, tool)
    arm = arguments.load_arm(arguments.required_robot(robot), scene, tool) if piped_joints is None else piped_joints[0]
    chosen_task = task_for(arm, task)
    targets_of_pulses = None if piped_joints is None else _reached_targets(arm, chosen_task, piped_joints[1])
    held = lock_and_sweep.locked_values(arm, lock)
    request = choose_branch.Request(
        arm=arm,
        task=chosen_task.name,
        near=None if near is None else arguments.joint_list(arm, near, "--near"),
        branch=branch,
        held=held,
        swept=lock_and_sweep.swept_values(arm, sweep, held),
        every=all_branches or continuous,
        position_first=position_first,
    )
    request = _request_with_solver(request, chosen_task.name, compiled=compiled)
    questions = IkQuestions(request, chosen_task, all_branches, turns, continuous)
    if batch is not None or (targets_of_pulses is not None and len(targets_of_pulses) > 1):
        from armkin.cli.batches.batch_answers import BatchRun
        from armkin.cli.batches.batch_pieces import InputRows

        arguments.no_numbers(target)
        rows = InputRows(batch, chosen_task.labels, f"task {chosen_task.name}", None, targets_of_pulses or [])
        engine = (1, None) if continuous else (workers, cluster)  # each row waits for the one before
        BatchRun(questions, out, json, *engine, resume, questions.request_settings).run(rows).conclude(
            questions.unsolvable
        )
        return
    arguments.one_alone(workers, cluster, resume)
    if targets_of_pulses is None:
        values, words = arguments.target(arm, chosen_task, target), [[decimal_count(word) for word in target or ()]]
    else:
        values, words = targets_of_pulses[0], None
    _single_target(questions, one_row(values).values, words, out, json=json)


def _request_with_solver(request: choose_branch.Request, task: str, *, compiled: bool) -> choose_branch.Request:
    """The request if position first fits the arm; compiled: it is solved by machine code, built if it is missing."""
    from armkin.inverse import choose_branch
    from armkin.inverse.redundant.position_first import check_arm as position_first_is_for

    if request.position_first:
        position_first_is_for(choose_branch.locked_arm(request), task)
    if not compiled:
        return request
    compiled_ik.build_library(request.arm, task)
    return replace(request, ik=compiled_ik.ik, fk=partial(compiled_ik.fk, task=task))


def _check_together(
    batch: str | None, sweep: list[str] | None, *, position_first: bool, compiled: bool, continuous: bool
) -> None:
    """Raise UsageError for options that make no sense together."""
    if position_first and compiled:
        raise UsageError("--position-first has no compiled solver; leave --compiled away")
    if compiled and sweep:
        raise UsageError("--sweep and --compiled: every value would be another arm to compile; leave one away")
    if continuous and batch is None:
        raise UsageError("--continuous belongs to --batch: it compares each row with the row before")


def _single_target(
    questions: IkQuestions, values: Array, words: list[list[int]] | None, out: str | None, *, json: bool
) -> None:
    """Print the answer of one target (1, m) [mm, deg], then raise why it has no branch, if it has none.

    words: the decimals that each of its numbers was written with.
    """
    from armkin.inverse import choose_branch

    request, task = questions.request, questions.task
    goal = targets_in(task.labels, values)
    [answer_set] = choose_branch.solve(request, goal, _decimal_rounding(request.arm, task, values, words))
    closest = closest_pose(request, goal[0], answer_set) if answer_set.best is None else None
    answer = answer_of(request, task, values[0].tolist(), answer_set, questions.all_branches, questions.turns, closest)
    with output.destination(out, "one answer is", output.TEXT) as write:
        write(f"{render.to_json(answer)}\n" if json else ik_text.text(request.arm, answer))
    if answer["best"] is None and answer["closest"] is None:
        raise choose_branch.blocked_error(request, answer_set)
    if answer["best"] is None and answer["closest"] is not None:
        raise choose_branch.refusal_error(request, answer_set, answer["closest"]["distance_mm"])


def _reached_targets(arm: Arm, task: Task, joints: list[list[float]]) -> list[list[float]]:
    """Targets [mm, deg] of the task that joint values [deg | mm] reach."""
    from armkin.inverse.tasks.task import targets_of

    q = units.joints_in(arm, joints)
    return targets_out(task.labels, targets_of(task, armkin.fk(arm, q), q))


def _decimal_rounding(arm: Arm, task: Task, values: Array, decimals: list[list[int]] | None = None) -> Array:
    """How far targets (N, m) [mm, deg] may be off by the decimals that they are printed with; decimals: how many."""
    from armkin.inverse.answers import rounding as target_rounding

    return target_rounding.printed_rounding(label_units(task.labels), values, arm.reach, decimals)


@dataclass
class IkQuestions:
    """The questions of `ik` for each row of a batch; continuous: each row uses the last one's answer."""

    request: choose_branch.Request
    task: Task
    all_branches: bool
    turns: bool
    continuous: bool
    unsolvable = True

    @property
    def request_settings(self) -> dict[str, Any]:
        """What a run that goes on must ask, too."""
        request = self.request
        return {
            "command": "ik",
            "robot file": request.arm.sha256,
            "scene": request.arm.scene_sha256,
            "tool": request.arm.tool,
            "task": self.task.name,
            "near": request.near_out,
            "branch": request.branch,
            "lock": dict(request.held),
            "sweep": dict(request.swept),
            "all_branches": self.all_branches,
            "turns": self.turns,
            "continuous": self.continuous,
            "position_first": request.position_first,
            "compiled": request.ik is compiled_ik.ik,
        }

    @property
    def near(self) -> list[float] | None:
        """Joint values [deg | mm] for the next row; None: rows are independent."""
        return self.request.near_out if self.continuous else None

    @near.setter
    def near(self, joints: list[float]) -> None:
        self.request = replace(self.request, near=joints)

    def table(self, chunk: Chunk) -> tuple[Table, Any]:
        """The columns, and which rows have a best branch."""
        if self.continuous or self.request.swept or self.request.position_first:
            return self._table_of_objects(chunk)
        from armkin.columns import ik_columns

        targets = targets_in(self.task.labels, chunk.values)
        rounding = _decimal_rounding(self.request.arm, self.task, chunk.values)
        nearest_in_c = compiled_ik.nearest if self.request.ik is compiled_ik.ik else None
        numbers = chunk.numbers_array()
        branch_table = ik_columns.branch_columns(
            self.request, targets, numbers, self.all_branches, nearest_in_c, rounding=rounding
        )
        return branch_table.table, ~branch_table.is_unsolved

    def _table_of_objects(self, chunk: Chunk) -> tuple[Table, Any]:
        """What `table` returns, by way of an object a row, for what is not asked of each row by itself."""
        import numpy as np

        from armkin.columns.ik_columns import BRANCH_COLUMNS
        from armkin.columns.joint_columns import joint_columns
        from armkin.columns.table import table_of_records

        joint_names = joint_columns(self.request.arm.joint_names)
        heading = [*BRANCH_COLUMNS[:3], *joint_names, *BRANCH_COLUMNS[3:]]
        records: list[list[Any]] = []
        has_best: list[bool] = []
        for number, answer in zip(chunk.numbers, self.objects(chunk, with_closest=False), strict=True):
            records += _csv_records(self.request.arm, int(number), answer)
            has_best.append(answer["best"] is not None)
        return table_of_records(heading, records), np.array(has_best)

    def objects(self, chunk: Chunk, with_closest: bool = True) -> Iterator[Ik]:
        """An object a row."""
        from armkin.inverse import choose_branch

        part_size = choose_branch.most_targets(self.request)
        for first in range(0, len(chunk.values), part_size):
            part = chunk.values[first : first + part_size]
            targets = targets_in(self.task.labels, part)
            answers = choose_branch.solve(self.request, targets, _decimal_rounding(self.request.arm, self.task, part))
            requests = (
                choose_branch.follow_targets(self.request, answers)
                if self.continuous
                else ((self.request, answer_set) for answer_set in answers)
            )
            row_by_row = self.continuous or not with_closest  # each row's `near` is another one
            nearest = {} if row_by_row else nearest_to(self.request, targets, answers)
            for k, (values, goal, (request, answer_set)) in enumerate(
                zip(part.tolist(), targets, requests, strict=True)
            ):
                wants_closest = with_closest and answer_set.best is None
                closest = closest_pose(request, goal, answer_set, nearest.get(k)) if wants_closest else None
                yield answer_of(request, self.task, values, answer_set, self.all_branches, self.turns, closest)
                if self.continuous and answer_set.best is not None:
                    self.request = replace(request, near=answer_set.branches[answer_set.best].joints)


def _csv_records(arm: Arm, row: int, answer: Ik) -> Iterator[list[Any]]:
    """CSV: one line a branch, or one line without joints. A name has no comma here: `cut` sees one column."""
    for branch in answer["branches"]:
        measures = [branch[key] for key in ("within_limits", "residual_mm", "residual_deg", "motion")]
        yield [row, answer["status"], branch["name"].replace(",", ""), *branch["joints"], *measures]
    if not answer["branches"]:
        yield [row, answer["status"], None, *[None] * arm.n, False, None, None, None]
