"""`armkin send`."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import typer

from armkin.cli import inputs, linking, output, piped, render, units
from armkin.cli.batch import csv_line, streamed_rows
from armkin.cli.linking import AssumeHome, Baud
from armkin.cli.numbers import listed, number
from armkin.cli.options import BranchName, Joints, Json, TaskName
from armkin.errors import ArmkinError, FileError, NoSolutionError, UsageError

if TYPE_CHECKING:
    from armkin.arm import Arm
    from armkin.configuration import Configuration
    from armkin.motion import Plan
    from armkin.soa import Array


def send(
    robot: Annotated[
        str | None, typer.Argument(metavar="[ROBOT]", help="Robot file; a piped answer names its own.")
    ] = None,
    q: Joints = None,
    port: Annotated[
        str | None,
        typer.Option(
            "--port", metavar="PORT", help="Device, COM port, pyserial URL, or sim: a board in this process."
        ),
    ] = None,
    target: Annotated[
        str | None,
        typer.Option(
            "--target", metavar="X,Y,Z", help="Solve for a target, and take the branch nearest to the arm."
        ),
    ] = None,
    branch: BranchName = None,
    task: TaskName = None,
    batch: Annotated[
        str | None,
        typer.Option(
            "--batch",
            metavar="FILE|-",
            help="Joint values of many waypoints, one row each; the arm stops in each.",
        ),
    ] = None,
    speed: Annotated[
        str, typer.Option("--speed", metavar="PERCENT", help="Of every joint's max_speed.")
    ] = "100",
    assume_home: AssumeHome = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Plan from --from, move nothing.")] = False,
    start: Annotated[
        str | None,
        typer.Option("--from", metavar="Q,...", help="Where a dry run starts. [default: the home pose]"),
    ] = None,
    trace: Annotated[
        str | None,
        typer.Option(
            "--trace", metavar="FILE", help="CSV of the plan: time, joints, every joint's position."
        ),
    ] = None,
    baud: Baud = linking.BAUD,
    json: Json = False,
) -> None:
    """Move the arm.

    All joints start and stop together, within each joint's max_speed and max_accel. Ctrl-C stops the arm on
    its path; its position stays known.
    """
    fraction = number(speed, "--speed") / 100
    if not 0 < fraction <= 1:
        raise UsageError(f"--speed: '{speed}' must be above 0 and at most 100 percent")
    if start is not None and not dry_run:
        raise UsageError("--from belongs to --dry-run: the arm starts where it stands")
    if port is None and not dry_run:
        raise UsageError("--port is missing: armkin ports lists them; sim is a board in this process")
    if trace is not None and batch == "-" and not dry_run:
        raise UsageError("--trace needs all waypoints before the arm moves: not with --batch -")
    arm, goals = _goals(robot, q, target, branch, task, batch)
    configuration = linking.configured(arm)
    planner = _Planner(arm, configuration, fraction)
    if dry_run:
        home = units.home_out(arm) if start is None else inputs.joint_list(arm, start, "--from")
        plans = _all(planner, goals, planner.counts(units.joints_in(arm, home)))
        _write_trace(arm, plans, trace)
        with output.destination(None) as write:
            found = planner.summary(plans)
            write(
                render.to_json({**render.head(arm), "dry_run": True, **found}) + "\n"
                if json
                else _text(arm, found)
            )
        return
    assert port is not None
    with linking.machine(arm, configuration, port, baud) as machine:
        if machine.prepare(assume_home=assume_home) and assume_home:
            output.note("the board takes the arm to stand in its home pose")
        began = machine.counts()
        planner.use(machine.info.clock, machine.info.min_interval)
        if isinstance(goals, _Stream):
            source: Iterable[Plan | None] = goals.plans(planner, began)
        else:
            source = _all(planner, goals, began)  # every refusal before anything moves
            _write_trace(arm, source, trace)
        with output.progress("ms of motion", None) as tick:
            machine.run(planner.noted(source), lambda done, total: tick(round(1000 * done)))
        found = {**planner.summary(planner.done, began), "port": port, **linking.where(machine)}
    with output.destination(None) as write:
        write(
            render.to_json({**render.head(arm), **found}) + "\n" if json else linking.where_text(arm, found)
        )
    if isinstance(goals, _Stream) and goals.problem is not None:
        raise goals.problem


@dataclass
class _Goals:
    """Where to go: joint values (w, n) [rad | mm], with their row numbers, or one target for ik."""

    joints: Array | None
    rows: Sequence[int]
    target: Array | None = None
    task: str | None = None
    branch: str | None = None

    def resolve(self, arm: Arm, near: Array) -> Array:
        """Joint values (w, n); near: where the arm stands [rad | mm]."""
        if self.joints is not None:
            return self.joints
        from armkin.cli import solving

        request = solving.Request(
            arm=arm, task=self.task, near=units.joints_out(arm, near).tolist(), branch=self.branch
        )
        [answer] = solving.solve(request, self.target)  # type: ignore[arg-type]
        if answer.best is None:
            nearest = solving.closest(request, self.target[0])  # type: ignore[index]
            legal = sum(found.within_limits for found in answer.branches)
            raise render.unsolved(
                arm,
                {
                    "status": answer.status,
                    "branches_within_limits": legal,
                    "closest": {"distance_mm": nearest.distance},
                },
            )
        return answer.branches[answer.best].q[None]


class _Stream:
    """Rows of standard input, each planned and sent as soon as it has come."""

    def __init__(self, arm: Arm, source: str) -> None:
        self.problem: ArmkinError | None = None
        self._rows: queue.SimpleQueue[tuple[int, list[float]] | ArmkinError | None] = queue.SimpleQueue()
        self._arm, self._source = arm, source
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        try:
            for row in streamed_rows(self._source, self._arm.joint_names, self._arm.name):
                self._rows.put(row)
        except ArmkinError as error:
            self._rows.put(error)
        self._rows.put(None)

    def plans(self, planner: _Planner, start: Sequence[int]) -> Iterator[Plan | None]:
        """Plans as rows come; None while there is none. What is wrong with a row ends it: `problem`."""
        at, empty = list(start), True
        while True:
            try:
                item = self._rows.get_nowait()
            except queue.Empty:
                yield None
                continue
            if item is None:
                break
            if isinstance(item, ArmkinError):
                self.problem = item
                return
            empty = False
            try:
                plan = planner.plan(at, units.joints_in(self._arm, [item[1]]))
            except (NoSolutionError, UsageError) as error:
                self.problem = type(error)(f"row {item[0]}: {error}; the rows before it were carried out")
                return
            at = plan.end.tolist()
            yield plan
        if empty:
            self.problem = UsageError("standard input has no rows: nothing was moved")


class _Planner:
    """Plans for one arm at one speed, and what they come to."""

    def __init__(self, arm: Arm, configuration: Configuration, speed: float) -> None:
        self.arm, self.speed = arm, speed
        self.done: list[Plan] = []
        self.use(configuration.board.clock, configuration.board.min_interval)

    def use(self, clock: int, min_interval: int) -> None:
        """Take the figures of the board that is there."""
        self.clock, self.min_interval = clock, min_interval

    def counts(self, q: Array) -> list[int]:
        """Counts at joint values."""
        import armkin

        return list(armkin.pulses(self.arm, q).tolist())

    def plan(self, start: Sequence[int], q: Array) -> Plan:
        """A plan through joint values (w, n) [rad | mm]."""
        from armkin.motion import plan

        return plan(self.arm, start, q, speed=self.speed, clock=self.clock, min_interval=self.min_interval)

    def noted(self, plans: Iterable[Plan | None]) -> Iterator[Plan | None]:
        """The same plans, remembered for the summary."""
        for plan in plans:
            if plan is not None:
                self.done.append(plan)
            yield plan

    def summary(self, plans: Sequence[Plan], start: Sequence[int] | None = None) -> dict[str, Any]:
        """JSON: what the plans come to."""
        import numpy as np

        import armkin
        from armkin.pulses import motor_names, pulse_units

        arm = self.arm
        first = list(start) if start is not None else plans[0].start.tolist()
        last = plans[-1].end.tolist() if plans else first
        top = np.max([plan.top_speed for plan in plans], axis=0) if plans else np.zeros(arm.n)
        rate = np.max([plan.top_rate for plan in plans], axis=0) if plans else np.zeros(len(first))
        end = armkin.joints(arm, last)
        return {
            "waypoints": sum(len(plan.moves) for plan in plans),
            "start_joints": units.joints_out(arm, armkin.joints(arm, first)).tolist(),
            "joints": units.joints_out(arm, end).tolist(),
            "joint_units": units.names(arm),
            "motors": motor_names(arm),
            "pulse_units": pulse_units(arm),
            "start_pulses": first,
            "pulses": last,
            "moves": [b - a for a, b in zip(first, last, strict=True)],
            "position_mm": (armkin.fk(arm, end)[:3, 3] + 0.0).tolist(),
            "duration_s": sum(plan.duration for plan in plans),
            "segments": sum(plan.segments for plan in plans),
            "top_speed": units.joints_out(arm, top).tolist(),
            "top_rate": rate.tolist(),
        }


def _goals(
    robot: str | None,
    q: list[str] | None,
    target: str | None,
    branch: str | None,
    task: str | None,
    batch: str | None,
) -> tuple[Arm, _Goals | _Stream]:
    """The arm and where it shall go; what is outside its limits is refused here, before a port is opened."""
    import numpy as np

    given = [name for name, what in (("Q...", q), ("--target", target), ("--batch", batch)) if what]
    if len(given) > 1:
        raise UsageError(f"{' and '.join(given)}: give one of them")
    if target is None and (branch is not None or task is not None):
        raise UsageError("--branch and --task belong to --target")
    if not given:
        return _from_pipe(robot)
    if robot is None:
        raise UsageError(f"{given[0]} needs a robot file: armkin send robots/three_dof.yaml ...")
    arm = inputs.load(robot)
    if target is not None:
        from armkin.ik.tasks import task_for

        what = task_for(arm, task)
        values = listed(target, what.labels, f"--target (task {what.name})")
        goal = units.targets_in(what.labels, np.array([values]))
        return arm, _Goals(None, [1], goal, what.name, branch)
    if batch == "-":
        return arm, _Stream(arm, batch)
    if batch is not None:
        rows = list(streamed_rows(batch, arm.joint_names, arm.name))
        if not rows:
            raise UsageError(f"{batch} has no rows: it needs one of {','.join(arm.joint_names)} per waypoint")
        return arm, _checked(arm, [number for number, _ in rows], [values for _, values in rows])
    return arm, _checked(arm, [], [inputs.joints(arm, q)])


def _checked(arm: Arm, rows: Sequence[int], values: Sequence[Sequence[float]]) -> _Goals:
    from armkin.motion import check_limits

    joints = units.joints_in(arm, values)
    for i, goal in enumerate(joints):
        try:
            check_limits(arm, goal[None])
        except NoSolutionError as error:
            raise NoSolutionError(f"row {rows[i]}: {error}" if rows else str(error)) from None
    return _Goals(joints, rows)


def _from_pipe(robot: str | None) -> tuple[Arm, _Goals]:
    import numpy as np

    import armkin

    answer = piped.read(robot)
    arm = inputs.load(answer.robot_file)
    if arm.sha256 != answer.robot_sha256:
        raise FileError(
            f"{answer.robot_file} is not the file that the answer on standard input was computed with: "
            "it has changed; compute the answer again"
        )
    poses = []
    for pose in answer.poses:
        if len(pose.joints) != arm.n:
            raise UsageError(f"the answer has {len(pose.joints)} joint values, {arm.name} has {arm.n} joints")
        [exact] = _checked(arm, [], [pose.joints]).joints  # type: ignore[misc]
        if pose.pulses is not None and armkin.pulses(arm, exact).tolist() != pose.pulses:
            exact = armkin.joints(arm, pose.pulses)  # of `pulses --best`: not those of plain rounding
        poses.append(exact)
    return arm, _Goals(np.array(poses), list(range(1, len(poses) + 1)))


def _all(planner: _Planner, goals: _Goals | _Stream, start: Sequence[int]) -> list[Plan]:
    """All plans at once, from counts; a stream is read to its end."""
    import armkin

    if isinstance(goals, _Stream):
        import time

        plans = []
        for plan in goals.plans(planner, start):
            if plan is None:
                time.sleep(0.01)
            else:
                plans.append(plan)
        if goals.problem is not None:
            raise goals.problem
        return plans
    near = armkin.joints(planner.arm, list(start))
    return [planner.plan(start, goals.resolve(planner.arm, near))]


def _write_trace(arm: Arm, plans: Sequence[Plan], path: str | None) -> None:
    if path is None:
        return
    names = [*arm.joint_names, "tool"]
    heading = ["time_s", *arm.joint_names, *(f"{name}_{axis}_mm" for name in names for axis in "xyz")]
    began = 0.0
    with output.destination(path) as write:
        write(csv_line(heading) + "\n")
        for i, plan in enumerate(plans):
            trace = plan.trace()
            first = 1 if i else 0  # a plan starts where the one before it ends
            rows = zip(
                (trace.time + began).tolist()[first:],
                units.joints_out(arm, trace.joints).tolist()[first:],
                (trace.position[:, 1:] + 0.0).reshape(len(trace.time), -1).tolist()[first:],
                strict=True,
            )
            write("".join(csv_line([time, *joints, *where]) + "\n" for time, joints, where in rows))
            began += plan.duration


def _text(arm: Arm, found: dict[str, Any]) -> str:
    """A dry run for people."""
    headings = render.joint_headings(arm)
    speeds = [f"{name}/s" for name in headings]
    motors = [f"{name}/{unit}" for name, unit in zip(found["motors"], found["pulse_units"], strict=True)]
    joints = [
        ["", *headings],
        ["from", *map(render.fixed, found["start_joints"])],
        ["to", *map(render.fixed, found["joints"])],
    ]
    pulses = [
        ["", *motors],
        ["from", *map(str, found["start_pulses"])],
        ["to", *map(str, found["pulses"])],
        ["moves", *(f"{move:+d}" for move in found["moves"])],
        ["top rate /s", *(f"{rate:.0f}" for rate in found["top_rate"])],
    ]
    top = [["", *speeds], ["top speed", *(render.fixed(value, 2) for value in found["top_speed"])]]
    head = (
        f"{arm.name}: {found['waypoints']} waypoint{'s' * (found['waypoints'] != 1)}, "
        f"{found['duration_s']:.3f} s, {found['segments']} segments (dry run: nothing moves)"
    )
    return "\n\n".join([head, *(render.table(part) for part in (joints, pulses, top))]) + "\n"
