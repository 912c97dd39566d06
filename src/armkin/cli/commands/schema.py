"""`armkin schema`."""

from typing import Annotated

import typer

from armkin.cli.parsing.options import SchemaOut
from armkin.cli.printing import output
from armkin.errors import UsageError


def schema(
    path: Annotated[bool, typer.Option("--path", help="That of path files instead.")] = False,
    scene: Annotated[bool, typer.Option("--scene", help="That of scenes instead.")] = False,
    out: SchemaOut = None,
) -> None:
    """JSON Schema of robot files, for editors."""
    import json

    from armkin import path_file, robot_file
    from armkin.robot_file.robot_schema import scene_schema

    if path and scene:
        raise UsageError("--path and --scene: give one of the two")
    reader = path_file if path else robot_file
    json_schema = scene_schema() if scene else reader.json_schema()
    with output.destination(out) as write:
        write(json.dumps(json_schema, indent=2) + "\n")
