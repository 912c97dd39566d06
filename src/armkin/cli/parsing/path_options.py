"""Options of `armkin path`, and its moves and numbers as `armkin.path` takes them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from armkin import files
from armkin.cli.parsing import arguments
from armkin.cli.parsing.number_parsing import comma_separated, number, whole_number
from armkin.errors import UsageError
from armkin.model import units

if TYPE_CHECKING:
    from armkin.model.arm import Arm

PathSource = Annotated[
    str | None, typer.Argument(metavar="[FILE|-]", help="A path file (YAML), waypoints as CSV, G-code or SVG.")
]
Corner = Annotated[
    list[str] | None,
    typer.Option("--via", metavar="X,Y,Z", help="Instead of a file: a waypoint on straight lines. Repeatable."),
]
MovePort = Annotated[
    str | None,
    typer.Option("--port", "-p", metavar="PORT", help="Move: to the start by a joint move, then along the path."),
]
OnlyPlan = Annotated[bool, typer.Option("--dry-run", help="Plan and report; nothing moves, whatever --port says.")]
Tolerance = Annotated[
    str | None,
    typer.Option("--tolerance", metavar="MM", help="Greatest distance between plan and path. [default: 0.05]"),
]
BlendRadius = Annotated[
    str | None, typer.Option("--blend", metavar="MM", help="Radius that rounds corners; 0 stops in them.")
]
CornersBy = Annotated[
    str | None,
    typer.Option(
        "--corners",
        metavar="stop|blend|tolerance",
        help="How corners are passed; tolerance: dense points as one curve.",
    ),
]
AccelShare = Annotated[str, typer.Option("--accel", metavar="PERCENT", help="Of every joint's max_accel.")]
ToolSpeed = Annotated[str | None, typer.Option("--tool-speed", metavar="MM/S", help="Greatest speed of the tool.")]
GreatestJerk = Annotated[
    str | None,
    typer.Option("--jerk", metavar="DEG/S3", help="Greatest jerk of every joint. [default: its max_jerk]"),
]
StandsAt = Annotated[
    str | None,
    typer.Option("--start", metavar="Q,...", help="Where the arm stands, for a plan. [default: the home pose]"),
]
MaySplit = Annotated[bool, typer.Option("--split", help="Where no branch carries on, change it there by a joint move.")]
FirstTargets = Annotated[
    str | None, typer.Option("--samples", metavar="N", help="Targets solved at first. [default: one a mm]")
]
PlanOut = Annotated[
    str | None,
    typer.Option("--out", "-o", metavar="FILE|-", help="The plan as CSV: joints over time; whole or not at all."),
]


def path_moves(arm: Arm, file: str | None, via: list[str] | None, task: str | None) -> Any:
    """The moves as `armkin.path` takes them."""
    from armkin import path_file

    if (file is None) == (not via):
        raise UsageError("give a path file, or corners with --via X,Y,Z --via X,Y,Z: one of the two")
    if via:
        from armkin.inverse.tasks.choose_task import task_for

        labels = task_for(arm, task).labels
        first, *later_corners = [_corner_values(text, labels) for text in via]
        return path_file.validate_path({"moves": [{"point": first}, *({"line": corner} for corner in later_corners)]})
    assert file is not None
    if file == "-":
        return path_file.parse_path_file(arguments.standard_input(path_file.MAX_BYTES), "standard input")
    files.protect_input(file)
    return path_file.read_path_file(file)


def _corner_values(text: str, labels: tuple[str, ...]) -> list[float]:
    """`--via X,Y,Z`, or with the rest of the target."""
    position_labels = labels[: 2 if labels[2:3] != ("z",) else 3]
    return comma_separated(text, position_labels if text.count(",") + 1 == len(position_labels) else labels, "--via")


def path_numbers(
    arm: Arm,
    *,
    tolerance: str | None,
    blend: str | None,
    speed: str,
    accel: str,
    tool_speed: str | None,
    jerk: str | None,
    near: str | None,
    samples: str | None,
) -> dict[str, Any]:
    """Options that are numbers, as `armkin.path` takes them. Raises UsageError for one out of range."""
    return {
        "tolerance": None if tolerance is None else _number_from(tolerance, "--tolerance", 1e-6),
        "blend": None if blend is None else _number_from(blend, "--blend", 0),
        "speed": arguments.percent(speed, "--speed"),
        "accel": arguments.percent(accel, "--accel"),
        "tool_speed": None if tool_speed is None else _number_from(tool_speed, "--tool-speed", 1e-3),
        "jerk": None if jerk is None else units.joints_in(arm, [_number_from(jerk, "--jerk", 1e-3)] * arm.n),
        "near": None if near is None else units.joints_in(arm, arguments.joint_list(arm, near, "--near")),
        "samples": None if samples is None else whole_number(samples, "--samples", 10, 1_000_000),
    }


def _number_from(text: str, option: str, minimum: float) -> float:
    value = number(text, option)
    if value < minimum:
        raise UsageError(f"{option}: '{text}' must be at least {minimum:g}")
    return value
