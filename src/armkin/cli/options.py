"""Arguments and options that several commands share: same name, same meaning, same help."""

from typing import Annotated

import typer

Robot = Annotated[str, typer.Argument(metavar="ROBOT", help="Robot file, for example robots/three_dof.yaml.")]
Joints = Annotated[
    list[str] | None,
    typer.Argument(metavar="Q...", help="Joint values in degrees (prismatic joints: mm)."),
]
Json = Annotated[
    bool, typer.Option("--json", help="One JSON object at full precision; with --batch one a line.")
]
Batch = Annotated[
    str | None,
    typer.Option(
        "--batch", metavar="FILE|-", help="Many at once: a CSV file (or standard input), one row each. Gives CSV."
    ),
]
Out = Annotated[
    str | None,
    typer.Option("--out", metavar="FILE", help="Write to a file, which appears whole or not at all."),
]
