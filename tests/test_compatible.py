"""What 0.1.0 had is still there: public names, commands and their options, exit codes, keys of the JSON.

`snapshots/interface_0_1_0.json` was written by 0.1.0 itself.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import armkin
from armkin.cli.app import load_command
from armkin.cli.parsing.negative_numbers import options_first
from command_line import run

BEFORE: dict[str, Any] = json.loads((Path(__file__).parent / "snapshots" / "interface_0_1_0.json").read_text())


def test_every_public_name() -> None:
    assert set(BEFORE["names"]) <= set(armkin.__all__)


@pytest.mark.parametrize("command", BEFORE["options"])
def test_every_option(command: str) -> None:
    known = {name for p in load_command(command).params for name in (*p.opts, *p.secondary_opts)} | {"--help"}
    assert {options_first([option], known)[0] for option in BEFORE["options"][command]} <= known


@pytest.mark.parametrize("words", BEFORE["json"])
def test_every_key(words: str) -> None:
    completed = run(*words.split(), "--json")
    assert completed.code == BEFORE["json"][words]["exit_code"]
    assert set(BEFORE["json"][words]["keys"]) <= _key_paths(completed.json)


def _key_paths(value: Any, place: str = "") -> set[str]:
    """Names of all keys, with the way to them: ``branches.[]joints``."""
    if isinstance(value, dict):
        inner = [{place + key} | _key_paths(part, f"{place}{key}.") for key, part in value.items()]
    elif isinstance(value, list):
        inner = [_key_paths(part, f"{place}[]") for part in value]
    else:
        return set()
    return set().union(*inner)
