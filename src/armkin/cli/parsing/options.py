"""Arguments and options that several commands share: same name, same meaning, same help."""

import sys
from typing import Annotated, Any

import typer

from armkin.cli.parsing import completion
from armkin.cli.parsing.number_parsing import whole_number
from armkin.cli.printing import output

Robot = Annotated[
    str,
    typer.Argument(
        metavar="ROBOT",
        help="Robot file, or the name of a shipped robot: three_dof.",
        autocompletion=completion.robots,
    ),
]
RobotOrPipe = Annotated[
    str | None,
    typer.Argument(
        metavar="[ROBOT]",
        help="Robot file or name; left out where an answer on standard input names it.",
        autocompletion=completion.robots,
    ),
]
Joints = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="Q...",
        help="Joint values in degrees (prismatic joints: mm), or a pose's name: home, ...",
        autocompletion=completion.poses,
    ),
]
Scene = Annotated[
    str | None,
    typer.Option(
        "--scene", metavar="FILE", help="File of keep-outs, what the arm must not touch, added to the robot file's."
    ),
]
Meshes = Annotated[
    str | None,
    typer.Option("--meshes", metavar="URDF", help="Draw the meshes (STL, DAE) of this URDF's visual elements."),
]
Tool = Annotated[
    str | None,
    typer.Option(
        "--tool",
        metavar="X,Y,Z[,R,P,Y]",
        help="Pose of the tool in the last joint's frame (mm, deg), in place of the robot file's.",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="One JSON object at full precision, instead of text.")]
JsonLines = Annotated[bool, typer.Option("--json", help="One JSON object at full precision; with --batch one a line.")]
Batch = Annotated[
    str | None,
    typer.Option(
        "--batch",
        metavar="FILE|-",
        help="Many inputs, one a row: .csv, .npz, .parquet, .jsonl; -: CSV on standard input. Gives CSV, or as --out "
        "ends.",
    ),
]


def _out_option(content: str, *allowed: str) -> Any:
    """`--out`, whose file's name ends as what is written to it, or has no ending."""

    def check(path: str | None) -> str | None:
        if path:
            from armkin import files

            files.file_ending(path, content, allowed, may_lack=True)
        return path

    return typer.Option(
        "--out",
        "-o",
        metavar="FILE|-",
        callback=check,
        help=f"Write to a file, whole or not at all: {', '.join(allowed)}.",
    )


TextOut = Annotated[str | None, _out_option("an answer is", *output.TEXT)]
SchemaOut = Annotated[str | None, _out_option("a schema is", ".json")]
RobotOut = Annotated[str | None, _out_option("a robot file is", ".yaml", ".yml")]
RowsOut = Annotated[str | None, _out_option("rows of joint values are", ".csv")]
Out = Annotated[
    str | None,
    typer.Option("--out", "-o", metavar="FILE|-", help="Write to a file, which appears whole or not at all."),
]
BatchOut = Annotated[
    str | None,
    typer.Option(
        "--out",
        "-o",
        metavar="FILE|-",
        help="Write to a file, whole or not at all: .txt, .json; a batch .csv, .npz, .parquet, .jsonl.",
    ),
]


def _check_drawable(path: str | None) -> str | None:
    """Say what a picture lacks before the work, not after it."""
    if path is not None:
        from armkin.plot import canvas

        canvas.check_picture(path)
        canvas.require_matplotlib()
    return path


Picture = Annotated[
    str | None,
    typer.Option("--plot", metavar="FILE", callback=_check_drawable, help="A picture as .png or .svg."),
]
Speed = Annotated[str, typer.Option("--speed", metavar="PERCENT", help="Of every joint's max_speed.")]
Resume = Annotated[bool, typer.Option("--resume", help="With --batch and --out: go on where an interrupted run ended.")]
Cluster = Annotated[
    str | None,
    typer.Option(
        "--cluster", metavar="ADDRESS", help="Share the work on a Dask cluster, by its scheduler: tcp://HOST:8786."
    ),
]


def _announce_build(is_asked: bool) -> bool:
    """Say on a terminal that something is built, which takes seconds the first time."""
    if is_asked and sys.stderr is not None and sys.stderr.isatty():
        from armkin.compiled import toolchain

        toolchain.announce = lambda: output.note("compiling for this computer, once for each arm: some seconds")
    return is_asked


Compiled = Annotated[
    bool,
    typer.Option(
        "--compiled",
        callback=_announce_build,
        help="Compute by machine code that this computer's C compiler builds: faster, for batches.",
    ),
]


def _worker_count(text: str) -> int:
    return whole_number(text, "--workers", 1, 1000)


Workers = Annotated[
    int,
    typer.Option(
        "--workers",
        metavar="N",
        parser=str,
        callback=_worker_count,
        help="How many processes share the work; the answers are the same.",
    ),
]
Target = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="TARGET...", help="What the arm's task asks for (armkin info), in mm and deg: x y z, or x y z phi, ..."
    ),
]
AllBranches = Annotated[bool, typer.Option("--all-branches", help="List all branches, also those outside limits.")]
Near = Annotated[
    str | None,
    typer.Option(
        "--near",
        metavar="Q,...",
        help="Joint values or a named pose that the answer stays close to. [default: the home pose]",
    ),
]
BranchName = Annotated[
    str | None,
    typer.Option(
        "--branch",
        metavar="NAME",
        help="The branch of that name, for example 'left, elbow up'.",
        autocompletion=completion.branches,
    ),
]
TaskName = Annotated[
    str | None,
    typer.Option(
        "--task",
        metavar="TASK",
        help="What a target prescribes: xyz, xyz_axis, pose, ... [default: the robot file's]",
        autocompletion=completion.tasks,
    ),
]
PositionFirst = Annotated[
    bool,
    typer.Option(
        "--position-first",
        help="With --task pose and 4 or 5 joints: the position exact, the rotation as near as it goes.",
    ),
]
Lock = Annotated[
    list[str] | None,
    typer.Option(
        "--lock",
        metavar="JOINT=VALUE",
        help="Hold a joint at a value, in deg or mm. Repeatable.",
        autocompletion=completion.assignments,
    ),
]
Sweep = Annotated[
    list[str] | None,
    typer.Option(
        "--sweep",
        metavar="JOINT=LOW:HIGH:COUNT",
        help="Try a joint at several values. Repeatable.",
        autocompletion=completion.assignments,
    ),
]
