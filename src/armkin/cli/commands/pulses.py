"""`armkin pulses`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import repeat
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, cast

import typer

import armkin
from armkin.cli.parsing import arguments, piped_answers
from armkin.cli.parsing.options import Batch, BatchOut, Cluster, Joints, JsonLines, Resume, RobotOrPipe, Scene, Workers
from armkin.cli.parsing.row_chunks import Chunk, one_row
from armkin.cli.printing import output, render
from armkin.cli.printing.render import fixed_text
from armkin.model import units

if TYPE_CHECKING:
    from armkin.cli.answers import Pulses, Violation
    from armkin.columns.table import Table
    from armkin.model.arm import Arm
    from armkin.motors import Best


def pulses(
    robot: RobotOrPipe = None,
    q: Joints = None,
    start: Annotated[
        str | None,
        typer.Option("--from", metavar="Q,...", help="Pose that the moves start from. [default: the home pose]"),
    ] = None,
    best: Annotated[
        bool,
        typer.Option("--best", help="The pulses whose tip is nearest to the target, not each motor's nearest pulse."),
    ] = False,
    scene: Scene = None,
    json: JsonLines = False,
    batch: Batch = None,
    out: BatchOut = None,
    workers: Workers = 1,
    cluster: Cluster = None,
    resume: Resume = False,
) -> None:
    """Motor pulses from home to a pose.

    Whole steps counted from home, rounded half away from zero; for RC servos the pulse width, for bus servos
    the count. Also where these pulses put the joints and the tip.
    """
    if batch is not None:
        arguments.no_numbers(q)
        arm, values = arguments.load_arm(arguments.required_robot(robot), scene), list[list[float]]()
    else:
        arm, values = piped_answers.arm_and_poses(robot, q, scene)
    origin = units.home_out(arm) if start is None else arguments.joint_list(arm, start, "--from")
    if batch is None and len(values) == 1:
        arguments.one_alone(workers, cluster, resume)
        [answer] = _answers(arm, one_row(values[0]), origin, best)
        with output.destination(out, "one answer is", output.TEXT) as write:
            write(f"{render.to_json(answer)}\n" if json else _text(arm, answer))
        render.warn_of_limits(arm, answer["violations"], answer)
        for name in answer["outside_travel"]:
            output.warn(f"the servo of {name} cannot turn that far: its pulses are outside its range")
        return
    from armkin.cli.batches.batch_answers import BatchRun
    from armkin.cli.batches.batch_pieces import InputRows

    rows = InputRows(batch, arm.joint_names, arm.name, units.poses_out(arm), values)
    identity = {"command": "pulses", "robot file": arm.sha256, "scene": arm.scene_sha256, "from": origin, "best": best}
    questions = PulseQuestions(arm, origin, best)
    batch_run = BatchRun(
        questions=questions, out=out, as_json=json, workers=workers, cluster=cluster, resume=resume, settings=identity
    )
    batch_run.run(rows).conclude(questions.unsolvable, "the limits or what a servo can turn")


@dataclass(frozen=True)
class PulseQuestions:
    """The questions of `pulses` for each row of a batch."""

    arm: Arm
    origin: list[float]
    best: bool
    unsolvable = False

    def table(self, chunk: Chunk) -> tuple[Table, Any]:
        """The columns, and which rows are within limits and the servos' travel."""
        from armkin.columns import fk_columns

        return fk_columns.pulse_columns(self.arm, chunk.values, self.best)

    def objects(self, chunk: Chunk) -> Iterator[Pulses]:
        """An object a row."""
        return _answers(self.arm, chunk, self.origin, self.best)


class _Row(NamedTuple):
    """What the counts of one target come to; tips [mm]: exact, as the counts have it, and their difference."""

    joints: list[float]
    pulses: list[int]
    moves: list[int]
    actual_joints: list[float]
    exact_tip: list[float]
    actual_tip: list[float]
    tip_error: list[float]
    error_mm: float
    violations: list[Violation]
    beyond_travel: list[bool]  # whether each motor's servo cannot turn that far

    def answer(self, of_all: dict[str, Any]) -> Pulses:
        """The row's object; of_all: what all rows begin with."""
        tips = {"theoretical": self.exact_tip, "actual": self.actual_tip, "difference": self.tip_error}
        answer = of_all | {
            "joints": self.joints,
            "pulses": self.pulses,
            "moves": self.moves,
            "actual_joints": self.actual_joints,
            "position_mm": tips,
            "error_mm": self.error_mm,
            "within_limits": not self.violations,
            "violations": self.violations,
            "outside_travel": [
                motor for motor, is_outside in zip(of_all["motors"], self.beyond_travel, strict=True) if is_outside
            ],
        }
        return cast("Pulses", answer)


def _answers(arm: Arm, chunk: Chunk, origin: list[float], best: bool) -> Iterator[Pulses]:
    """Answers of `armkin pulses`, one a row of joint values (N, n) [deg | mm]; origin: those that moves count from."""
    from armkin.motors import motor_names, outside_travel, pulse_units, resolution

    q = units.joints_in(arm, chunk.values)
    best_vectors = armkin.best_pulses(arm, q) if best else None
    rounded = armkin.rounding(arm, q) if best_vectors is None else best_vectors.rounded
    rounding = rounded if best_vectors is None else best_vectors.chosen
    head = render.head(arm)
    of_all = {
        "robot": head["robot"],
        "robot_file": head["robot_file"],
        "robot_sha256": head["robot_sha256"],
        "motors": motor_names(arm),
        "pulse_units": pulse_units(arm),
        "joint_units": units.unit_names(arm),
        "resolution": units.joints_out(arm, resolution(arm)).tolist(),
        "from": origin,
    }
    # Columns of the whole chunk, then plain Python: numpy is slow at single numbers.
    moves = rounding.pulses - armkin.pulses(arm, units.joints_in(arm, origin))
    tips = rounding.theoretical + 0.0, rounding.actual + 0.0, rounding.difference
    columns = chunk.values, rounding.pulses, moves, units.joints_out(arm, rounding.actual_joints), *tips, rounding.error
    violations, beyond_travel = render.violations(arm, chunk.values, q), outside_travel(arm, rounding.pulses).tolist()
    rows = map(_Row, *(column.tolist() for column in columns), violations, beyond_travel)
    beside_best = repeat({}) if best_vectors is None else _rounded_keys(best_vectors)
    in_scene = render.scene_and_tool(arm)
    for row, near, rounded_keys in zip(rows, render.near_by(arm, q), beside_best, strict=False):
        answer = row.answer(of_all)
        answer.update(in_scene)
        answer.update(near)
        answer.update(rounded_keys)
        yield answer


def _rounded_keys(best: Best) -> Iterator[Any]:
    """What plain rounding comes to, beside the best vectors: keys of each row."""
    for pulses, error, gain in zip(
        *(x.tolist() for x in (best.rounded.pulses, best.rounded.error, best.gain)), strict=True
    ):
        yield {"rounded": {"pulses": pulses, "error_mm": error}, "gain_mm": gain, "tried": best.tried}


def _text(arm: Arm, answer: Pulses) -> str:
    """An answer as tables: motors [steps | us], joints [deg | mm], tip [mm]; as asked and as whole pulses give it."""
    motors = [["motor", "pulses", "move", ""]]
    columns = (answer["motors"], answer["pulses"], answer["moves"], answer["pulse_units"])
    for name, count, move, unit in zip(*columns, strict=True):
        motors.append([name, str(count), f"{move:+d}", "steps" if unit == "step" else unit])
    joints = [["joint", "target", "actual", "difference", "one pulse", ""]]
    for name, target, actual, step, unit in zip(
        arm.joint_names,
        answer["joints"],
        answer["actual_joints"],
        answer["resolution"],
        answer["joint_units"],
        strict=True,
    ):
        joints.append([name, *(fixed_text(value, 6) for value in (target, actual, abs(actual - target), step)), unit])
    tip = [["tip", "exact", "actual", "difference", ""]]
    position = answer["position_mm"]
    for i, axis in enumerate("xyz"):
        tip.append([axis, *(fixed_text(position[key][i], 6) for key in ("theoretical", "actual", "difference")), "mm"])
    error = f"{fixed_text(answer['error_mm'], 6)} mm"
    last_line = f"the tip is {error} off"
    if "rounded" in answer:
        gain, rounded_error = fixed_text(answer["gain_mm"], 6), fixed_text(answer["rounded"]["error_mm"], 6)
        last_line += f", {gain} mm nearer than with each motor rounded by itself ({rounded_error} mm)\n"
        last_line += f"best of {answer['tried']} pulse vectors around the target"
    tables = (render.table(motors, (0, 3)), render.table(joints, (0, 5)), render.table(tip, (0, 4)))
    return "\n\n".join([render.pose_line(arm, answer["joints"]), *tables, last_line]) + "\n"
