"""`armkin begin` on the compiled firmware: a board that was just flashed knows nothing."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from emulator import EmulatedBoard

import armkin
from command_line import ROOT, run
from scripted_operator import ENTER, ScriptedOperator, keys_for_direction


def test_a_lost_arm_is_brought_home_by_keys_and_a_motor_turns_the_other_way(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    path = tmp_path / "mine.yaml"
    shutil.copy(ROOT / "robots/three_dof.yaml", path)
    path.chmod(0o644)
    keys = [*keys_for_direction("y"), *keys_for_direction("n"), *keys_for_direction("y")]  # directions
    keys += ["2", "-", ENTER]  # zeros: the second joint is taken back a little
    keys += [ENTER, "y", "y", "y"]  # limits; the first move; check; write
    person = ScriptedOperator(keys, looks=20)

    @contextmanager
    def keys_of() -> Iterator[ScriptedOperator]:
        yield person

    monkeypatch.setattr("armkin.cli.commands.begin.keys", keys_of)
    with EmulatedBoard("uno_cnc_shield") as board:
        completed = run("begin", path, "--port", board.port)
        assert completed.code == 0, completed.err
        assert not person.keys
        assert armkin.load(path).motors[1].invert
        steps = board.net()
        assert steps["X"] > 0
        status = run("status", path, "--port", board.port, "--json")
        assert status.json["position"] in ("known", "retained")
        assert status.json["pulses"] == [0, 0, 0], "home, by the corrected file"
