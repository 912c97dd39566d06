"""`armkin schema`."""

from armkin.cli import output
from armkin.cli.options import Out


def schema(out: Out = None) -> None:
    """JSON Schema of robot files, for editors."""
    import json

    from armkin.robot_file import json_schema

    with output.destination(out) as write:
        write(json.dumps(json_schema(), indent=2) + "\n")
