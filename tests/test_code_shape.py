"""How long files, classes and functions may be, and how much stands in one line of thought."""

from __future__ import annotations

import ast

import armkin
from command_line import ROOT
from source_trees import FUNCTION, MODULES, nodes_of

WRITTEN_BY_HAND = {".py", ".c", ".h", ".ino", ".js", ".css", ".html"}
BRANCHES = {ast.If, ast.IfExp, ast.For, ast.While, ast.ExceptHandler, ast.comprehension, ast.match_case}


def test_files_have_at_most_400_lines() -> None:
    """Of the package and the firmware, in whatever language; what others wrote, and tests, are not counted."""
    files = [path for folder in ("src", "firmware") for path in sorted((ROOT / folder).rglob("*"))]
    counted = [
        path
        for path in files
        if path.suffix in WRITTEN_BY_HAND and not {"vendor", "test"} & set(path.relative_to(ROOT).parts)
    ]
    assert {".py", ".c", ".h", ".js"} <= {path.suffix for path in counted}
    long = {path.relative_to(ROOT).as_posix() for path in counted if len(path.read_text("utf-8").splitlines()) > 400}
    assert not long


def test_classes_have_at_most_250_lines() -> None:
    long = {node.name for _, node in nodes_of(ast.ClassDef) if node.end_lineno - node.lineno >= 250}
    assert not long


def test_functions_have_at_most_60_lines() -> None:
    """Outside `cli`, where a command's options are its function's parameters.

    A public name's docstring, which has a line for every parameter (`test_docstrings`), is not counted.
    """
    long = {
        f"{module}.{node.name}"
        for module, node in nodes_of(FUNCTION)
        if not module.startswith("armkin.cli.") and _line_count(module, node) > 60
    }
    assert not long


def _line_count(module: str, node: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    public = module == f"armkin.{armkin._HOME.get(node.name)}"
    docstring = (node.body[0].end_lineno or 0) - node.body[0].lineno + 1 if public else 0
    return (node.end_lineno or 0) - node.lineno + 1 - docstring


def test_functions_have_at_most_15_branches() -> None:
    """Counted in full: an `and`, an `or`, a conditional expression and every `for` and `if` of a comprehension are one.

    More need a reason at the function's first line, as ruff's eight ways do.
    """
    branched = {
        f"{module}.{node.name}"
        for module, node in nodes_of(ast.FunctionDef)
        if _branch_count(node) > 15
        if "noqa: C901" not in MODULES[module].read_text("utf-8").splitlines()[node.lineno - 1]
    }
    assert not branched


def _branch_count(function: ast.FunctionDef) -> int:
    """Ways through a function, one more than its decisions; functions in it are counted by themselves."""
    left: list[ast.AST] = [*function.body]
    count = 1
    while left:
        node = left.pop()
        count += type(node) in BRANCHES
        if isinstance(node, ast.BoolOp):
            count += len(node.values) - 1
        elif isinstance(node, ast.comprehension):
            count += len(node.ifs)
        if not isinstance(node, ast.FunctionDef | ast.ClassDef):
            left += ast.iter_child_nodes(node)
    return count


def test_branches_are_counted_in_full() -> None:
    [node] = ast.parse("def f(x):\n    return [y for y in x if y and (y > 1 or y < 0)] if x else 0").body
    assert isinstance(node, ast.FunctionDef)
    assert _branch_count(node) == 6


def test_no_conditional_expression_stands_in_another() -> None:
    """A reader holds one condition at a time: the inner choice gets a name, or an `if`."""
    nested = {
        f"{module}:{node.lineno}"
        for module, node in nodes_of(ast.IfExp)
        if sum(isinstance(inner, ast.IfExp) for inner in ast.walk(node)) > 1
    }
    assert not nested


def test_at_most_three_values_are_assigned_at_once() -> None:
    """One by one by a tuple on the right: what belongs together stands on one line."""
    crowded = {
        f"{module}:{node.lineno}"
        for module, node in nodes_of(ast.Assign)
        if isinstance(node.targets[0], ast.Tuple) and isinstance(node.value, ast.Tuple) and len(node.value.elts) > 3
    }
    assert not crowded
