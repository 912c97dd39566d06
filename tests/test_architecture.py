"""The house: which room may import which, and no circle anywhere."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "src"

# Room -> the rooms it may import, besides itself. A room is a folder of `armkin`, or a file beside them.
# The order is the way of the data: a room imports what stands above it.
MAY_IMPORT: dict[str, str] = {
    "errors": "",
    "hardware": "",
    "files": "errors",
    "formula": "errors",
    "robot_file": "errors files hardware",
    "model": "errors formula robot_file",
    "forward": "errors formula model",
    "inverse/tasks": "errors formula model forward",
    "inverse/numeric": "errors formula model forward inverse/tasks",
    "inverse/closed": "errors formula model forward inverse/tasks inverse/numeric",
    "inverse/elimination": "errors formula model inverse/numeric",
    "inverse/branches": "errors formula model forward inverse/tasks inverse/numeric inverse/closed",
    "inverse": "errors formula model forward inverse/tasks inverse/numeric inverse/closed inverse/elimination"
    " inverse/branches",
    "motors": "errors formula model forward",
    "motion": "errors formula model forward motors board/firmware",
    "reach": "errors files formula model forward motors",
    "view": "errors formula model forward",
    "plot": "errors files formula model forward view reach",
    "board": "errors hardware board/sim",
    "board/sim": "errors hardware board/firmware",
    "board/firmware": "errors hardware formula model motors motion board robot_file",
}
TOP = {"cli", "__init__", "__main__"}  # may import every room, and no room imports them

MODULES = {
    ".".join(path.relative_to(SOURCE).with_suffix("").parts).removesuffix(".__init__"): path
    for path in sorted(SOURCE.rglob("*.py"))
}


def _room(module: str) -> str:
    """The room of ``armkin.inverse.closed.elbow`` is ``inverse/closed``."""
    path = MODULES[module]
    folder = path.parent.relative_to(SOURCE / "armkin").as_posix()
    room = path.stem if folder == "." else folder
    return room.split("/")[0] if room.startswith("cli") else room


def _imports(module: str) -> Iterator[str]:
    """Modules of armkin that a module imports, anywhere in it: for types and inside functions, too."""
    for node in ast.walk(ast.parse(MODULES[module].read_text())):
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names if name.name in MODULES and name.name != "armkin")
        elif isinstance(node, ast.ImportFrom) and node.module in MODULES:
            for name in node.names:
                inner = f"{node.module}.{name.name}"
                yield inner if inner in MODULES else str(node.module)


IMPORTS = {module: sorted(set(_imports(module)) - {"armkin"}) for module in MODULES}


@pytest.mark.parametrize("module", [module for module in MODULES if _room(module) not in TOP])
def test_a_room_imports_what_stands_above_it(module: str) -> None:
    room = _room(module)
    assert room in MAY_IMPORT, f"{room} is a new room: give it a row in MAY_IMPORT"
    allowed = {room, *MAY_IMPORT[room].split()}
    wrong = {imported: _room(imported) for imported in IMPORTS[module] if _room(imported) not in allowed}
    assert not wrong


def test_no_module_imports_itself_by_way_of_others() -> None:
    done: set[str] = set()

    def visit(module: str, way: tuple[str, ...]) -> None:
        assert module not in way, " -> ".join((*way[way.index(module) :], module))
        if module in done:
            return
        for imported in IMPORTS[module]:
            visit(imported, (*way, module))
        done.add(module)

    for module in MODULES:
        visit(module, ())
