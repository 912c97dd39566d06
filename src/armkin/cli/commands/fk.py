"""`armkin fk`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import typer

import armkin
from armkin.cli.parsing import arguments
from armkin.cli.parsing.options import (
    Batch,
    BatchOut,
    Cluster,
    Compiled,
    Joints,
    JsonLines,
    Resume,
    RobotOrPipe,
    Scene,
    Tool,
    Workers,
)
from armkin.cli.parsing.row_chunks import Chunk, one_row
from armkin.cli.printing import output, render
from armkin.cli.printing.render import fixed_text
from armkin.model import units

if TYPE_CHECKING:
    from armkin.cli.answers import Fk
    from armkin.columns.table import Table
    from armkin.model.arm import Arm


def fk(
    robot: RobotOrPipe = None,
    q: Joints = None,
    frames: Annotated[bool, typer.Option("--frames", help="Also the base's and every joint's frame.")] = False,
    compiled: Compiled = False,
    scene: Scene = None,
    tool: Tool = None,
    json: JsonLines = False,
    batch: Batch = None,
    out: BatchOut = None,
    workers: Workers = 1,
    cluster: Cluster = None,
    resume: Resume = False,
) -> None:
    """Where the tool is for given joint values."""
    if batch is not None:
        arguments.no_numbers(q)
        arm, values = arguments.load_arm(arguments.required_robot(robot), scene, tool), list[list[float]]()
    else:
        arm, values = _arm_and_poses(robot, q, scene, tool)
        if len(values) == 1:
            arguments.one_alone(workers, cluster, resume)
            [answer] = _answers(arm, one_row(values[0]), frames, compiled)
            with output.destination(out, "one answer is", output.TEXT) as write:
                write(f"{render.to_json(answer)}\n" if json else _text(arm, answer))
            render.warn_of_limits(arm, answer["violations"], answer)
            return
    from armkin.cli.batches.batch_answers import BatchRun
    from armkin.cli.batches.batch_pieces import InputRows

    rows = InputRows(batch, arm.joint_names, arm.name, units.poses_out(arm), values)
    identity = {
        "command": "fk",
        "robot file": arm.sha256,
        "scene": arm.scene_sha256,
        "tool": arm.tool,
        "frames": frames,
        "compiled": compiled,
    }
    if frames and not json:
        output.note("--frames goes with --json: columns have the tool alone")
    questions = FkQuestions(arm, frames, compiled)
    batch_run = BatchRun(
        questions=questions, out=out, as_json=json, workers=workers, cluster=cluster, resume=resume, settings=identity
    )
    batch_run.run(rows).conclude(questions.unsolvable)


@dataclass(frozen=True)
class FkQuestions:
    """The questions of `fk` for each row of a batch."""

    arm: Arm
    frames: bool
    compiled: bool
    unsolvable = False

    def table(self, chunk: Chunk) -> tuple[Table, Any]:
        """The columns, and which rows are within limits."""
        from armkin.columns import fk_columns

        T = armkin.compile(self.arm).fk(units.joints_in(self.arm, chunk.values)) if self.compiled else None
        columns = fk_columns.pose_columns(self.arm, chunk.values, T)
        return columns, columns["within_limits"]

    def objects(self, chunk: Chunk) -> Iterator[Fk]:
        """An object a row."""
        return _answers(self.arm, chunk, self.frames, self.compiled)


def _arm_and_poses(
    robot: str | None, q: list[str] | None, scene: str | None, tool: str | None
) -> tuple[Arm, list[list[float]]]:
    """The arm and its poses; `piped_answers` is imported for standard input alone, so fk starts sooner."""
    if q:
        arm = arguments.load_arm(arguments.required_robot(robot), scene, tool)
        return arm, [arguments.joints(arm, q)]
    from armkin.cli.parsing import piped_answers

    return piped_answers.arm_and_poses(robot, q, scene, tool)


def _answers(arm: Arm, chunk: Chunk, with_frames: bool, compiled: bool) -> Iterator[Fk]:
    """Answers of `armkin fk`, one a row of joint values (N, n) [deg | mm]: poses in mm and deg."""
    from armkin.model import rotation

    q = units.joints_in(arm, chunk.values)
    frames = armkin.frames(arm, q) if with_frames else None
    fk = armkin.compile(arm).fk if compiled else partial(armkin.fk, arm)
    T = (fk(q) if frames is None or compiled else frames[:, -1]) + 0.0  # no -0.0
    rpy = units.angles_out(rotation.rpy(T[:, :3, :3])).tolist()
    quaternion = rotation.quaternion(T[:, :3, :3]).tolist()
    violations, near = render.violations(arm, chunk.values, q), render.near_by(arm, q)
    in_scene = render.scene_and_tool(arm)
    joints = chunk.values.tolist()
    joint_units, head = units.unit_names(arm), render.head(arm)
    for i, pose in enumerate(T):
        answer: Fk = {
            "robot": head["robot"],
            "robot_file": head["robot_file"],
            "robot_sha256": head["robot_sha256"],
            "joints": joints[i],
            "joint_units": joint_units,
            "position_mm": pose[:3, 3].tolist(),
            "rotation": pose[:3, :3].tolist(),
            "rpy_deg": rpy[i],
            "quaternion_wxyz": quaternion[i],
            "within_limits": not violations[i],
            "violations": violations[i],
        }
        answer.update(in_scene)
        answer.update(near[i])
        if frames is not None:
            answer["frames"] = [
                {"name": name, "position_mm": frame[:3, 3].tolist(), "rotation": frame[:3, :3].tolist()}
                for name, frame in zip(["base", *arm.joint_names, "tool"], frames[i] + 0.0, strict=True)
            ]
        yield answer


def _text(arm: Arm, answer: Fk) -> str:
    xyz, rpy, R = answer["position_mm"], answer["rpy_deg"], answer["rotation"]
    rows = [
        ["position", *_label_numbers("xyz", xyz), "mm"],
        ["orientation", *_label_numbers(("roll", "pitch", "yaw"), rpy), "deg"],
    ]
    for i, row in enumerate(R):
        numbers = [word for value in row for word in ("", fixed_text(value, 6))]
        rows.append(["" if i else "rotation", *numbers, ""])
    text = f"{render.pose_line(arm, answer['joints'])}\n\n{render.table(rows, left_aligned=(0, 1, 3, 5, 7))}\n"
    if "frames" in answer:
        table = [["frame", "x/mm", "y/mm", "z/mm"]]
        table += [[frame["name"], *map(fixed_text, frame["position_mm"])] for frame in answer["frames"]]
        text += f"\n{render.table(table)}\n"
    return text


def _label_numbers(names: Any, values: list[float]) -> list[str]:
    return [word for name, value in zip(names, values, strict=True) for word in (name, fixed_text(value))]
