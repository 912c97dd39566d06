"""The examples in the core's docstrings are true."""

import doctest
from importlib import import_module
from pathlib import Path

import pytest

MODULES = [
    "forward", "model.limits", "model.rotation", "model.lock", "formula.arrays", "inverse.solve",
    "inverse.branches.whole_turns", "inverse.branches.names", "inverse.answers.closest", "inverse.closed.subproblems",
]  # fmt: skip


@pytest.mark.parametrize("name", MODULES)
def test_examples(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(Path(__file__).parents[1])  # they load robots/...
    result = doctest.testmod(import_module(f"armkin.{name}"))
    assert result.attempted > 0
    assert result.failed == 0
