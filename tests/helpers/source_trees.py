"""The package's modules and their syntax trees, parsed once for all tests that read the code."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import UnionType
from typing import Any

from command_line import ROOT

SOURCE = ROOT / "src"
MODULES = {
    ".".join(path.relative_to(SOURCE).with_suffix("").parts).removesuffix(".__init__"): path
    for path in sorted(SOURCE.rglob("*.py"))
}
FUNCTION = ast.FunctionDef | ast.AsyncFunctionDef


@cache
def syntax_tree(path: Path) -> ast.Module:
    """A file's syntax tree: all callers share it."""
    return ast.parse(path.read_text("utf-8"))


@cache
def tree_nodes(path: Path) -> list[ast.AST]:
    """All nodes of a file's syntax tree."""
    return list(ast.walk(syntax_tree(path)))


def nodes_of(kind: type[ast.AST] | UnionType) -> Iterator[tuple[str, Any]]:
    """The package's nodes of a kind, each behind the name of its module."""
    for module, path in MODULES.items():
        yield from ((module, node) for node in tree_nodes(path) if isinstance(node, kind))
