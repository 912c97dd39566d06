"""The command line: one file for each command, which parses, calls the API, renders and exits.

app.py     the group of commands, and the function that runs a command line; exit_codes.py: errors -> exit codes
advice.py  the next step after an error
commands/  one file a command, and the table of them
answers/   the JSON of every command, as types

From words to values:

negative_numbers.py  keeps negative numbers from being taken for options
options.py           options that several commands share; completion.py: completion by Tab
number_parsing.py    numbers as users write them; unit_notes.py: notes on numbers that look like metres or radians
arguments.py         the arm, a pose, a target; lock_and_sweep.py: joints held or swept
drawing_path.py      drawings as paths: G-code and SVG
row_chunks.py        rows of numbers in chunks; csv_to_numbers.py: rows from CSV
batch_pieces.py      pieces of a batch for parallel work; batch_answers.py: their answers
piped_answers.py     answers on standard input; send_goals.py: all kinds of goals of `send`
default_port.py      the port; board_link.py: an open machine, signals; link_trace.py: a log of its bytes
lerobot_zero.py      `zero --from`
compiled_ik.py       ik and fk by machine code
terminal_keys.py     keys of a terminal, and whether one is held
keep_outs.py         assumed radii, the scene of a port, ignored hits

Output:

output.py        destinations of data and messages
progress_bar.py  progress of a long command, with rate and time left
render.py        JSON and aligned columns; ik_answer.py: ik's JSON; ik_text.py, info_text.py, path_text.py: as text

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
