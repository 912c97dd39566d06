"""The command line: one file for each command, which parses, calls the API, renders and exits.

commands/         one file a command, and the table of them
parsing/          from words and rows to values
batches/          many rows, in parallel
boards/           what commands with a board share: the port, an open machine, what the arm must not touch
printing/         where data and messages go, and answers as JSON and as text
answers/          the JSON of every command, as types
app.py            the group of commands, and the function that runs a command line
exit_codes.py     errors -> exit codes
advice.py         the next step after an error
terminal_keys.py  keys of a terminal, and whether one is held

A command is a function of the same name in a module of the same name, written for Typer:
`armkin.cli.commands.fk.fk`. A module is imported when its command runs, and imports nothing but typer, armkin and its
neighbours at its top, so that ``armkin --help`` stays cheap.
"""

from __future__ import annotations

import gc
import io
import os
import sys

from armkin.signals import handle_interrupt

TYPE_CHECKING = False  # importing typing is slow enough for a Ctrl-C to hit it, and `main` handles that

if TYPE_CHECKING:
    from typing import NoReturn


def main() -> NoReturn:
    """Run the command line in `sys.argv` and end the process with its exit code."""
    try:
        # All files are written and closed here. A normal exit would destroy numpy, pydantic and Typer object by object,
        # which takes a fifth of the time of a short command.
        os._exit(_run_command_line())
    except KeyboardInterrupt:
        os._exit(130)  # Ctrl-C outside of `run`, which handles it inside


def _run_command_line() -> int:
    import signal

    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # a background job of a shell ignores SIGINT
        signal.signal(signal.SIGINT, handle_interrupt)
    # Start-up makes many objects and little garbage, so collect seldom.
    gc.set_threshold(100_000, 50, 100)
    # Matrices of this size gain less from threads than starting them costs.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a terminal may be in ASCII or cp1252
    from armkin.cli.app import run

    return run(sys.argv[1:])
