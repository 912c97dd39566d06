"""A name between backticks in a docstring is one that its module, the package, or another program named there, has."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import armkin
from command_line import ROOT

DOCUMENTED = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
OTHERS = {"calc_junction", "cut", "gcode.c", "report.c", "finally", "nohup"}  # Klipper's, GRBL's, Python's, the shell's
WRITTEN = {"arm.c", "arm_first_pass", "arm_least", "tool_x_mm", "up_axis", "x_mm"}  # of files that are written, or read
ELSEWHERE = {"config", "fit_corrections", "read_robot_file"}  # a field of INFO, and functions of modules not imported


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


def test_every_lower_case_name_is_of_its_own_module() -> None:
    """A parameter that was renamed stays elsewhere as a name: so its own module, and those it imports, are asked."""
    paths = sorted((ROOT / "src").rglob("*.py"))
    dotted = [".".join(path.relative_to(ROOT / "src").with_suffix("").parts) for path in paths]
    trees = {module: ast.parse(path.read_text("utf-8")) for module, path in zip(dotted, paths, strict=True)}
    names = {module: set(_names_in(tree)) for module, tree in trees.items()}
    templates = " ".join(path.read_text("utf-8") for path in (ROOT / "src").rglob("*.c"))
    everywhere = {*armkin.__all__, *OTHERS, *WRITTEN, *ELSEWHERE, *re.findall(r"arm_\w+", templates)}
    everywhere |= {name for path in paths for name in (path.stem, path.parent.name)}
    stale = {
        (module, quoted)
        for module, tree in trees.items()
        for docstring in _docstrings_of(tree)
        for quoted in re.findall(r"(?<!`)`([a-z_]\w*)`", docstring)
        if quoted not in everywhere and not any(quoted in names[near] for near in _near_modules(module, trees))
    }
    assert not stale


def _near_modules(module: str, trees: dict[str, ast.Module]) -> Iterator[str]:
    """The module, what it imports, and the modules of its package if it is an `__init__`."""
    yield module
    for node in ast.walk(trees[module]):
        if isinstance(node, ast.ImportFrom) and node.module:
            places = (node.module, f"{node.module}.__init__", *(f"{node.module}.{name.name}" for name in node.names))
            yield from (place for place in places if place in trees)
    if module.endswith(".__init__"):
        yield from (other for other in trees if other.startswith(module.removesuffix("__init__")))


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
