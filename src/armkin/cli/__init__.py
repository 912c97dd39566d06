"""The command line: one file a command; each parses, calls, renders and exits.

    __init__ (the table of commands, main) -> app (group, errors -> exit codes)
    fk, ik, ... : the commands             -> options, numbers, units, batch, output, render

A command is a function of the same name in a module of the same name, written for Typer:
`armkin.cli.fk.fk`. A module is imported when its command runs, and imports nothing but typer and its
neighbours at its top, so that ``armkin --help`` stays cheap.
"""

# Name, and the first sentence of the function's docstring (a test compares the two).
COMMANDS = {
    "fk": "Where the tool is for given joint values.",
    "ik": "All joint values that reach a target.",
    "pulses": "Motor pulses from home to a pose.",
    "info": "What a robot file says, checked.",
    "schema": "JSON Schema of robot files, for editors.",
}


def main(arguments: list[str] | None = None) -> int:
    """Run a command line and return its exit code; arguments: without the program's name."""
    try:
        from armkin.cli.app import run

        return run(arguments)
    except KeyboardInterrupt:
        return 130  # during the imports, before `run` takes care of it
