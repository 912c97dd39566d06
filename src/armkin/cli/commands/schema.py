"""`armkin schema`."""

from typing import Annotated

import typer

from armkin.cli import output
from armkin.cli.options import Out


def schema(
    path: Annotated[bool, typer.Option("--path", help="That of path files instead.")] = False, out: Out = None
) -> None:
    """JSON Schema of robot files, for editors."""
    import json

    from armkin import path_file, robot_file

    with output.destination(out) as write:
        write(json.dumps((path_file if path else robot_file).json_schema(), indent=2) + "\n")
