"""A name between backticks in a docstring is one that its module, the package, or another program named there, has."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import armkin
from command_line import ROOT
from source_trees import MODULES, SOURCE, tree_nodes

DOCUMENTED = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
OTHERS = {"calc_junction", "cut", "gcode.c", "report.c", "finally", "nohup"}  # Klipper's, GRBL's, Python's, the shell's
WRITTEN = {
    "arm.c",
    "arm_first_pass",
    "arm_least",
    "joint_x",
    "tool_x_mm",
    "up_axis",
    "x_mm",
}  # of files that are written, or read
ELSEWHERE = {"config", "fit_corrections", "read_robot_file"}  # a field of INFO, and functions of modules not imported


def test_every_name_in_a_docstring_is_there() -> None:
    there = {*OTHERS, *WRITTEN}.union(*map(_names_in, MODULES))
    files = {
        path.name for folder in ("src", "docs", "firmware", "scripts", "tests") for path in (ROOT / folder).rglob("*")
    }
    files |= {path.name for path in ROOT.iterdir()}
    there |= {name.split(".")[0] for name in files}
    stale = {
        (module, quoted)
        for module in MODULES
        for docstring in _docstrings_of(module)
        for quoted in re.findall(r"`([\w./]+)`", docstring)
        if not (quoted in there or Path(quoted).name in files or set(re.split(r"[./]", quoted)) <= there)
    }
    assert not {one for one in stale if re.search(r"[A-Za-z_]{2}", one[1])}


def test_every_lower_case_name_is_of_its_own_module() -> None:
    """A parameter that was renamed stays elsewhere as a name: so its own module, and those it imports, are asked."""
    templates = " ".join(path.read_text("utf-8") for path in SOURCE.rglob("*.c"))
    everywhere = {*armkin.__all__, *OTHERS, *WRITTEN, *ELSEWHERE, *re.findall(r"arm_\w+", templates)}
    everywhere |= {name for path in MODULES.values() for name in (path.stem, path.parent.name)}
    stale = {
        (module, quoted)
        for module in MODULES
        for docstring in _docstrings_of(module)
        for quoted in re.findall(r"(?<!`)`([a-z_]\w*)`", docstring)
        if quoted not in everywhere and not any(quoted in _names_in(near) for near in _near_modules(module))
    }
    assert not stale


def _near_modules(module: str) -> Iterator[str]:
    """The module, what it imports, and the modules of its package if it is an `__init__`."""
    yield module
    for node in tree_nodes(MODULES[module]):
        if isinstance(node, ast.ImportFrom) and node.module:
            places = (node.module, *(f"{node.module}.{name.name}" for name in node.names))
            yield from (place for place in places if place in MODULES)
    if MODULES[module].name == "__init__.py":
        yield from (other for other in MODULES if other.startswith(f"{module}."))


def _docstrings_of(module: str) -> Iterator[str]:
    for node in tree_nodes(MODULES[module]):
        if isinstance(node, DOCUMENTED):
            yield ast.get_docstring(node, clean=False) or ""


@cache
def _names_in(module: str) -> set[str]:
    """What code names: variables, attributes, parameters, functions, classes, modules, and words of texts in code."""
    nodes = tree_nodes(MODULES[module])
    docstrings = {
        id(node.body[0].value)
        for node in nodes
        if isinstance(node, DOCUMENTED) and node.body and isinstance(node.body[0], ast.Expr)
    }
    names: set[str] = set()
    for node in nodes:
        for field in ("id", "attr", "arg", "name", "module"):
            names |= {*str(getattr(node, field, None) or "").split(".")}
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings:
            names |= {*re.findall(r"\w+", node.value)}
    return names
