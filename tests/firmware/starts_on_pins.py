"""A path sent from elsewhere by the command line: every step that the emulated Uno's pins make against the path."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from emulator import EmulatedBoard
from pins import net_steps

import armkin
from armkin.errors import NoSolutionError
from command_line import THREE_DOF, run, run_patiently
from simulated_starts import Result, judge_motion


def send_path_from(board: EmulatedBoard, folder: Path, moves: dict[str, Any], place: Sequence[float]) -> Result:
    """Put the arm into a place [deg], send the path from there, and read the pins while it moves.

    Raises NoSolutionError if it was refused, without a step.
    """
    arm = armkin.load(THREE_DOF)
    file = folder / "path.yaml"
    file.write_text(json.dumps(moves))
    axes = board.stats()["axes"]
    assume = [] if any(axes[name]["positive"] or axes[name]["negative"] for name in "XYZ") else ["--assume-home"]
    placed = run_patiently("send", THREE_DOF, *place, "--port", board.port, *assume)
    assert placed.code == 0, placed.err
    before, begin = net_steps(board), 0

    def note_and_call(*words: object) -> Any:
        """The same command, where the motors stand before it: a busy machine may have held the arm on its way."""
        nonlocal before, begin
        before, begin = net_steps(board), board.control("cycles")["cycle"]
        return run(*words)

    completed = run_patiently("path", THREE_DOF, file, "--port", board.port, "--json", run=note_and_call)
    if completed.code == 3:
        assert net_steps(board) == before
        raise NoSolutionError(completed.err.strip())
    assert completed.code == 0, completed.err
    assert net_steps(board) == completed.json["pulses"]
    trace = board.trace()
    steps = [(when[when > begin], way[when > begin]) for when, way in map(trace.steps, "XYZ")]
    cycle = np.concatenate([when for when, _ in steps])
    change = np.zeros((len(cycle), 3), np.int64)
    at = 0
    for k, (when, direction) in enumerate(steps):
        change[at : at + len(when), k] = direction
        at += len(when)
    counts = before + np.cumsum(change[np.argsort(cycle, kind="stable")], axis=0)
    plan = armkin.path(arm, moves, start=armkin.joints(arm, before))
    return judge_motion(plan, np.vstack([before, counts, net_steps(board)]).astype(float))
