"""A name between backticks in a docstring is one that the package, or another program named there, has."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from command_line import ROOT

DOCUMENTED = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
OTHERS = {"calc_junction", "gcode.c", "report.c", "finally", "nohup"}  # Klipper's, GRBL's, Python's and the shell's
WRITTEN = {"arm.c", "arm_first_pass", "arm_least", "tool_x_mm", "up_axis"}  # of files that are written, or read


def test_every_name_in_a_docstring_is_there() -> None:
    trees = {path: ast.parse(path.read_text("utf-8")) for path in (ROOT / "src").rglob("*.py")}
    there = {name for tree in trees.values() for name in _names_in(tree)} | OTHERS | WRITTEN
    files = {
        path.name for folder in ("src", "docs", "firmware", "scripts", "tests") for path in (ROOT / folder).rglob("*")
    }
    files |= {path.name for path in ROOT.iterdir()}
    there |= {name.split(".")[0] for name in files}
    stale = {
        (path.relative_to(ROOT).as_posix(), quoted)
        for path, tree in trees.items()
        for docstring in _docstrings_of(tree)
        for quoted in re.findall(r"`([\w./]+)`", docstring)
        if not (quoted in there or Path(quoted).name in files or set(re.split(r"[./]", quoted)) <= there)
    }
    assert not {one for one in stale if re.search(r"[A-Za-z_]{2}", one[1])}


def _docstrings_of(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, DOCUMENTED):
            yield ast.get_docstring(node, clean=False) or ""


def _names_in(tree: ast.Module) -> Iterator[str]:
    """What code names: variables, attributes, parameters, functions, classes, modules, and words of texts in code."""
    docstrings = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, DOCUMENTED) and node.body and isinstance(node.body[0], ast.Expr)
    }
    for node in ast.walk(tree):
        for field in ("id", "attr", "arg", "name", "module"):
            yield from str(getattr(node, field, None) or "").split(".")
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings:
            yield from re.findall(r"\w+", node.value)
