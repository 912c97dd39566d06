"""`armkin pulses`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import typer

import armkin
from armkin.cli import arguments, output, piped_answers, render
from armkin.cli.options import Batch, BatchOut, Cluster, Joints, JsonLines, Resume, RobotOrPipe, Scene, Workers
from armkin.cli.render import fixed_text
from armkin.cli.row_chunks import Chunk, one_row
from armkin.model import units

if TYPE_CHECKING:
    from armkin.cli.answers import Pulses
    from armkin.columns.table import Table
    from armkin.model.arm import Arm


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
    from armkin.cli.batch_answers import Batch as Run
    from armkin.cli.batch_pieces import Rows

    rows = Rows(batch, arm.joint_names, arm.name, units.poses_out(arm), values)
    identity = {"command": "pulses", "robot file": arm.sha256, "scene": arm.scene_sha256, "from": origin, "best": best}
    questions = Questions(arm, origin, best)
    Run(questions, out, json, workers, cluster, resume, identity).run(rows).conclude(questions.unsolvable)


@dataclass(frozen=True)
class Questions:
    """What is asked of each row of a batch."""

    arm: Arm
    origin: list[float]
    best: bool
    unsolvable = False

    def table(self, chunk: Chunk) -> tuple[Table, Any]:
        """The columns, and which rows are within limits."""
        from armkin.columns import fk_columns

        columns = fk_columns.counts(self.arm, chunk.values, self.best)
        return columns, columns["within_limits"]

    def objects(self, chunk: Chunk) -> Iterator[Pulses]:
        """An object a row."""
        return _answers(self.arm, chunk, self.origin, self.best)


def _answers(arm: Arm, chunk: Chunk, origin: list[float], best: bool) -> Iterator[Pulses]:
    from armkin.motors import motor_names, outside_travel, pulse_units, resolution

    q = units.joints_in(arm, chunk.values)
    best_vectors = armkin.best_pulses(arm, q) if best else None
    rounded = armkin.rounding(arm, q) if best_vectors is None else best_vectors.rounded
    r = rounded if best_vectors is None else best_vectors.chosen
    moves = (r.pulses - armkin.pulses(arm, units.joints_in(arm, origin))).tolist()
    actual = units.joints_out(arm, r.actual_joints).tolist()
    violations, near = render.violations(arm, chunk.values, q), render.near_by(arm, q)
    in_scene = render.scene_and_tool(arm)
    too_far = outside_travel(arm, r.pulses)
    names = motor_names(arm)
    head, kinds, joint_units = render.head(arm), pulse_units(arm), units.names(arm)
    steps = units.joints_out(arm, resolution(arm)).tolist()
    # Columns of the whole chunk, then plain Python: numpy is slow at single numbers.
    columns = zip(
        chunk.values.tolist(),
        r.pulses.tolist(),
        moves,
        actual,
        (r.theoretical + 0.0).tolist(),
        (r.actual + 0.0).tolist(),
        r.difference.tolist(),
        r.error.tolist(),
        violations,
        too_far.tolist(),
        strict=True,
    )
    plain = None if best_vectors is None else list(zip(rounded.pulses.tolist(), rounded.error.tolist(), strict=True))
    gains = [] if best_vectors is None else best_vectors.gain.tolist()
    for i, (joints, counts, move, actual_joints, exact, actual_tip, tip_error, error, outside, far) in enumerate(
        columns
    ):
        answer: Pulses = {
            "robot": head["robot"],
            "robot_file": head["robot_file"],
            "robot_sha256": head["robot_sha256"],
            "motors": names,
            "pulse_units": kinds,
            "joint_units": joint_units,
            "resolution": steps,
            "from": origin,
            "joints": joints,
            "pulses": counts,
            "moves": move,
            "actual_joints": actual_joints,
            "position_mm": {"theoretical": exact, "actual": actual_tip, "difference": tip_error},
            "error_mm": error,
            "within_limits": not outside,
            "violations": outside,
            "outside_travel": [name for name, beyond in zip(names, far, strict=True) if beyond] if any(far) else [],
        }
        answer.update(in_scene)
        answer.update(near[i])
        if best_vectors is not None and plain is not None:
            answer["rounded"] = {"pulses": plain[i][0], "error_mm": plain[i][1]}
            answer["gain_mm"] = gains[i]
            answer["tried"] = best_vectors.tried
        yield answer


def _text(arm: Arm, answer: Pulses) -> str:
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
        joints.append([name, *(fixed_text(v, 6) for v in (target, actual, abs(actual - target), step)), unit])
    tip = [["tip", "exact", "actual", "difference", ""]]
    position = answer["position_mm"]
    for i, axis in enumerate("xyz"):
        tip.append([axis, *(fixed_text(position[key][i], 6) for key in ("theoretical", "actual", "difference")), "mm"])
    error = f"{fixed_text(answer['error_mm'], 6)} mm"
    last = f"the tip is {error} off"
    if "rounded" in answer:
        gain, before = fixed_text(answer["gain_mm"], 6), fixed_text(answer["rounded"]["error_mm"], 6)
        last += f", {gain} mm nearer than with each motor rounded by itself ({before} mm)\n"
        last += f"best of {answer['tried']} pulse vectors around the target"
    tables = (render.table(motors, (0, 3)), render.table(joints, (0, 5)), render.table(tip, (0, 4)))
    return "\n\n".join([render.pose_line(arm, answer["joints"]), *tables, last]) + "\n"
