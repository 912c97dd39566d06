"""The command line: one file a command; each parses, calls, renders and exits.

app.py     the group of commands, and what runs a command line; exit_codes.py: errors -> exit codes
advice.py  the next step after an error
commands/  one file a command, and the table of them
answers/   the JSON of every command, as types

What the words come to:

negative_numbers.py  negative numbers are no options
options.py           options that several commands share; completion.py: what Tab offers
number_parsing.py    numbers as people write them; unit_notes.py: those that look like metres or radians
arguments.py         the arm, a pose, a target; lock_and_sweep.py: joints held or swept
drawing_path.py      drawings as paths: G-code and SVG
row_chunks.py        many of them in chunks; csv_to_numbers.py: from CSV
batch_pieces.py      such chunks shared out; batch_answers.py: their answers
piped_answers.py     answers on standard input; send_goals.py: all that `send` can be told
default_port.py      the port; board_link.py: an open machine, signals; link_trace.py: what is said on it
lerobot_zero.py      `zero --from`
compiled_ik.py       ik and fk by machine code
terminal_keys.py     keys of a terminal, and whether one is held
keep_outs.py         radii that are assumed, the scene of a port, hits that are ignored

What is printed:

output.py        where it goes
progress_bar.py  how far a long command has come, with rate and time left
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

TYPE_CHECKING = False  # importing typing takes long enough for a Ctrl-C, which `main` takes care of

if TYPE_CHECKING:
    from typing import NoReturn


def main() -> NoReturn:
    """Run the command line in `sys.argv` and end the process with its exit code."""
    try:
        # All is written and closed by then. Leaving the ordinary way would take numpy, pydantic and Typer apart
        # object by object, a fifth of the time of a short command.
        os._exit(_run_command_line())
    except KeyboardInterrupt:
        os._exit(130)  # Ctrl-C came before `run` could take care of it, or after


def _run_command_line() -> int:
    import signal

    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # a shell's background job ignores it
        signal.signal(signal.SIGINT, handle_interrupt)
    # Start-up makes many objects and hardly any garbage: look for it seldom.
    gc.set_threshold(100_000, 50, 100)
    # Threads take longer to start than matrices of this size could gain by them.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a terminal may be in ASCII or cp1252
    from armkin.cli.app import run

    return run(sys.argv[1:])
