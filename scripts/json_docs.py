#!/usr/bin/env python3
"""Write docs/json.md from the types of the commands' answers (src/armkin/cli/answers/)."""

from __future__ import annotations

import types
from pathlib import Path
from typing import Annotated, Any, Literal, NotRequired, Union, get_args, get_origin, get_type_hints, is_typeddict

from armkin.cli import answers

PAGE = Path(__file__).parents[1] / "docs" / "json.md"
HEAD = """# JSON of the commands

Written by `scripts/json_docs.py` from `src/armkin/cli/answers/`; a test holds the two equal, and real
answers of every command to these types.

With `--json` a command prints one object on one line to stdout, at full precision, in millimetres and
degrees, without NaN or infinity; with `--batch` one object a row. An error is one object on stderr
([Error](#error)), and stdout stays empty unless the exit code is 3.
"""
_WORDS = {float: "number", int: "whole number", str: "text", bool: "true or false", type(None): "null", Any: "any"}


def page() -> str:
    """The whole page."""
    commands = ["| command | answer |", "| --- | --- |"]
    shown: list[type] = []
    for name, kinds in answers.ANSWERS.items():
        commands.append(f"| `{name}` | {', '.join(_link(kind) for kind in kinds)} |")
        for kind in kinds:
            _collect(kind, shown)
    _collect(answers.Error, shown)
    return "\n".join([HEAD, *commands, "", *(section(kind) for kind in shown)])


def section(kind: type) -> str:
    """One answer, or a part of one, as a table."""
    rows = ["| key | value | meaning |", "| --- | --- | --- |"]
    for key, hint in get_type_hints(kind, include_extras=True).items():
        value, meaning, optional = _taken_apart(hint)
        absent = " (not always)" if optional else ""
        meaning = meaning.replace("|", "\\|")
        rows.append(f"| `{key}`{absent} | {words(value)} | {meaning} |")
    return "\n".join([f"## {kind.__name__}", "", " ".join((kind.__doc__ or "").split()), "", *rows, ""])


def words(hint: Any) -> str:
    """A type as a reader says it."""
    origin, parts = get_origin(hint), get_args(hint)
    if is_typeddict(hint):
        return _link(hint)
    if origin is Literal:
        return " or ".join(f"`{str(part).lower() if isinstance(part, bool) else part}`" for part in parts)
    if origin in (Union, types.UnionType):
        return " or ".join(words(part) for part in parts)
    if origin is list:
        return f"list of {words(parts[0])}"
    if origin is dict:
        return f"object, text to {words(parts[1])}"
    return _WORDS[hint]


def _taken_apart(hint: Any) -> tuple[Any, str, bool]:
    """The type itself, what it means, whether the key may be absent."""
    meaning, optional = "", False
    while get_origin(hint) in (Annotated, NotRequired):
        if get_origin(hint) is Annotated:
            hint, meaning = get_args(hint)[0], get_args(hint)[1]
        else:
            hint, optional = get_args(hint)[0], True
    return hint, meaning, optional


def _collect(hint: Any, shown: list[type]) -> None:
    """A type and the types that its keys name, each once."""
    if is_typeddict(hint):
        if hint in shown:
            return
        shown.append(hint)
        for inner in get_type_hints(hint).values():
            _collect(inner, shown)
    else:
        for part in get_args(hint):
            _collect(part, shown)


def _link(kind: type) -> str:
    return f"[{kind.__name__}](#{kind.__name__.lower()})"


if __name__ == "__main__":
    PAGE.write_text(page())
