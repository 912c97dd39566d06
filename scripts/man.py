#!/usr/bin/env python3
"""Write share/man/man1/armkin.1 from the table of commands; a wheel installs it where `man` looks."""

from __future__ import annotations

from pathlib import Path

from armkin.cli.commands import COMMANDS

PAGE = Path(__file__).resolve().parents[1] / "share/man/man1/armkin.1"
_EXITS = {
    0: "done",
    1: "file or runtime error",
    2: "usage",
    3: "no solution",
    4: "robot file invalid",
    5: "link or device",
    130: "interrupted; a moving arm is stopped first",
    143: "terminated; a moving arm is stopped first",
}
_VARIABLES = {
    "ARMKIN_PORT": "the port of every command that is given none",
    "NO_COLOR": "no colours on a terminal",
    "CC": "the C compiler of --compiled",
    "XDG_CACHE_HOME": "where what it built is kept",
    "XDG_STATE_HOME": "where locks and notes of ports are kept",
}


def page() -> str:
    """The page, in man's macros."""
    lines = [".TH ARMKIN 1", ".SH NAME", "armkin \\- robot arms from a YAML table to real motion"]
    lines += [".SH SYNOPSIS", ".B armkin", "COMMAND [ARGUMENT...] [OPTION...]"]
    lines += [
        ".SH DESCRIPTION",
        "Lengths in mm, angles in degrees. Data on standard output, messages on standard error.",
    ]
    lines += ["armkin COMMAND \\-\\-help explains a command.", ".SH COMMANDS"]
    lines += [f".TP\n.B {name}\n{sentence}" for name, sentence in COMMANDS.items()]
    lines += [".SH EXIT STATUS", *(f".TP\n.B {code}\n{words}" for code, words in _EXITS.items())]
    lines += [".SH ENVIRONMENT", *(f".TP\n.B {name}\n{words}" for name, words in _VARIABLES.items())]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    PAGE.parent.mkdir(parents=True, exist_ok=True)
    PAGE.write_text(page(), "utf-8")
