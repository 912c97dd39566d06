"""The command line: one file a command; each parses, calls, renders and exits.

    __init__ (main) -> app (group, errors -> exit codes) -> commands/__init__ (the table of commands)
    commands/fk, commands/ik, ... -> options, numbers, batch, output, render

A command is a function of the same name in a module of the same name, written for Typer:
`armkin.cli.commands.fk.fk`. A module is imported when its command runs, and imports nothing but typer and its
neighbours at its top, so that ``armkin --help`` stays cheap.
"""

from __future__ import annotations

import gc
import io
import os
import sys

TYPE_CHECKING = False  # importing typing takes long enough for a Ctrl-C, which `main` takes care of

if TYPE_CHECKING:
    from typing import NoReturn


def main() -> NoReturn:
    """Run the command line in `sys.argv` and end the process with its exit code."""
    try:
        code = _run()
    except KeyboardInterrupt:
        code = 130  # before `run` could take care of it
    # All is written and closed. Leaving the ordinary way would take numpy, pydantic and Typer apart
    # object by object, a fifth of the time of a short command.
    os._exit(code)


def _run() -> int:
    # Start-up makes many objects and hardly any garbage: look for it seldom.
    gc.set_threshold(100_000, 50, 100)
    # Threads take longer to start than matrices of this size could gain by them.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # of a terminal in ASCII or cp1252
    from armkin.cli.app import run

    return run(sys.argv[1:])
