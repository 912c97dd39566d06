"""Small numbers have a name and a reason, in one place."""

from __future__ import annotations

import ast
from pathlib import Path

import armkin.inverse

ROOM = Path(armkin.inverse.__file__).parent
TOLERANCES = ROOM / "numeric" / "tolerances.py"


TASKS = ROOM / "tasks"  # above it: its own stand at the top of its files


def small_number_lines(file: Path) -> list[int]:
    """Lines of a file with a float between 0 and 0.01; of a task's no constants."""
    tree = ast.parse(file.read_text())
    if file.parent == TASKS:
        tree.body = [node for node in tree.body if not isinstance(node, ast.Assign)]
    numbers = (node for node in ast.walk(tree) if isinstance(node, ast.Constant))
    return [node.lineno for node in numbers if isinstance(node.value, float) and 0.0 < node.value < 0.01]


def test_no_number_below_a_hundredth_stands_elsewhere() -> None:
    numbers_in = {
        str(file.relative_to(ROOM)): small_number_lines(file) for file in ROOM.rglob("*.py") if file != TOLERANCES
    }
    assert {file: lines for file, lines in numbers_in.items() if lines} == {}


def test_each_has_a_name_and_a_comment() -> None:
    lines = TOLERANCES.read_text().splitlines()
    assert all("  # " in lines[number - 1] for number in small_number_lines(TOLERANCES))
