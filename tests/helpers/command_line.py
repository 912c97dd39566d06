"""Running the command line in tests: in this process (quick) or as a process of its own."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[2]
THREE_DOF = "robots/three_dof.yaml"
POSE = (-30, 5, -5)  # its published pose [deg] (tests/test_published.py)
COUNTS = [-1067, -10144, 5667]  # of its motors there, from home


class Result(NamedTuple):
    """What a command line came to."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        """The one JSON object on stdout."""
        return json.loads(self.out)

    @property
    def lines(self) -> list[Any]:
        """JSON Lines on stdout."""
        return [json.loads(line) for line in self.out.splitlines()]


def run(*words: object, stdin: bytes = b"", cwd: Path = ROOT) -> Result:
    """Run a command line in this process, from the project's folder or another."""
    from armkin.cli.app import run as run_app

    out, err, before, folder = io.StringIO(), io.StringIO(), sys.stdin, Path.cwd()
    sys.stdin = io.TextIOWrapper(io.BytesIO(stdin))
    os.chdir(cwd)
    try:
        with redirect_stdout(out), redirect_stderr(err):
            code = run_app([str(word) for word in words])
    finally:
        sys.stdin = before
        os.chdir(folder)
    return Result(code, out.getvalue(), err.getvalue())


BUSY = (
    "the boot loader answered nothing",
    "no board answers",
    "does not answer any more",
    "too slow or too noisy",
    "half a second",
)


def run_patiently(*words: object, run: Callable[..., Result] = run) -> Result:
    """Run a command on a board in real time, again where the machine was too busy for it, five times at most.

    That the arm then stands on its path and can be sent on is what the command says, and what this takes it at.
    """
    for _ in range(5):
        completed = run(*words)
        if completed.code == 0 or not any(words_said in completed.err for words_said in BUSY):
            break
        if "position is known" in completed.err:
            words = tuple(word for word in words if word != "--assume-home")
    return completed


def run_process(*words: object, **settings: Any) -> Result:
    """Run `python -m armkin` as a process."""
    completed = subprocess.run(
        [sys.executable, "-m", "armkin", *map(str, words)],
        **{"cwd": ROOT, "capture_output": True, "timeout": 180, **settings},
    )
    return Result(completed.returncode, (completed.stdout or b"").decode(), (completed.stderr or b"").decode())
