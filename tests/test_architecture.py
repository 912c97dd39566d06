"""The house: which room may import which, and no circle anywhere."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path

import pytest

from source_trees import MODULES, SOURCE, nodes_of, syntax_tree, tree_nodes

# Room -> the rooms it may import, besides itself. A room is a folder of `armkin`, or a file beside them.
# The order is the way of the data: a room imports what stands above it.
MAY_IMPORT: dict[str, str] = {
    "errors": "",
    "board_catalogue": "",
    "signals": "",
    "user_folders": "",
    "files": "errors",
    "formula": "errors",
    "robot_file": "errors files board_catalogue",
    "model": "errors formula robot_file",
    "forward": "errors formula model",
    "view": "errors formula model forward",
    "keep_out/shapes": "formula robot_file model",
    "keep_out": "errors formula robot_file model forward view keep_out/shapes",
    "inverse/tasks": "errors formula model forward",
    "inverse/numeric": "errors formula model forward inverse/tasks",
    "inverse/closed": "errors formula model forward inverse/tasks inverse/numeric",
    "inverse/elimination": "errors formula model inverse/numeric",
    "inverse/branches": "errors formula model forward inverse/tasks inverse/numeric inverse/closed",
    "inverse/answers": "errors keep_out formula model forward inverse/tasks inverse/numeric inverse/branches",
    "inverse/singular": "keep_out formula model forward inverse/tasks inverse/numeric inverse/closed inverse/branches"
    " inverse/answers",
    "inverse/solvers": "errors formula model forward inverse/tasks inverse/numeric inverse/closed inverse/elimination",
    "engines": "errors",
    "inverse/run": "engines errors formula model forward inverse/tasks inverse/numeric inverse/closed inverse/branches"
    " inverse/answers inverse/singular inverse/solvers",
    "inverse/redundant": "keep_out errors formula model forward inverse/tasks inverse/numeric inverse/closed"
    " inverse/branches inverse/answers inverse/solvers",
    "inverse": "engines keep_out errors formula model forward inverse/tasks inverse/numeric inverse/closed"
    " inverse/elimination inverse/branches inverse/answers inverse/singular inverse/solvers inverse/run"
    " inverse/redundant",
    "columns": "errors files formula model forward inverse/tasks inverse/numeric inverse/branches inverse"
    " inverse/answers motors",
    "motors": "errors formula model forward",
    "path_file": "errors robot_file",
    "motion/timing": "errors formula model forward motors",
    "motion/tool_path": "errors formula model forward inverse/tasks path_file motion/timing",
    "motion/plan": "keep_out errors formula model forward inverse/tasks motion/timing motion/tool_path",
    "motion/branches": "errors formula model forward inverse/tasks inverse/numeric inverse/branches inverse/answers"
    " inverse motors motion/timing motion/tool_path motion/plan",
    "motion": "errors formula model forward motors path_file motion/timing motion/tool_path motion/branches",
    "motion/path_planner": "keep_out errors formula model forward inverse/tasks inverse/numeric inverse/branches"
    " inverse/answers inverse/solvers inverse motors path_file motion/timing motion/tool_path motion/plan"
    " motion/branches motion",
    "reachability": "keep_out errors files formula model forward motors columns engines inverse inverse/answers"
    " inverse/solvers inverse/tasks",
    "reachability/place": "keep_out errors files formula robot_file model columns engines inverse inverse/answers"
    " inverse/solvers inverse/tasks path_file motion motion/plan motion/path_planner reachability",
    "export": "keep_out errors formula robot_file model forward inverse/tasks inverse/numeric inverse/closed"
    " inverse/elimination inverse/solvers view",
    "calibration": "errors formula robot_file model forward export inverse/tasks",
    "export/c": "export keep_out keep_out/shapes errors formula model forward inverse inverse/tasks inverse/numeric"
    " inverse/closed inverse/elimination inverse/branches inverse/solvers",
    "export/js": "errors formula model forward inverse/solvers inverse/tasks inverse/closed inverse/numeric"
    " inverse/elimination inverse/branches keep_out motors export",
    "compiled": "engines keep_out keep_out/shapes errors formula model forward inverse inverse/tasks inverse/numeric"
    " inverse/branches inverse/closed inverse/answers inverse/singular inverse/solvers inverse/run export export/c"
    " columns inverse/redundant user_folders",
    "plot": "keep_out keep_out/shapes errors files formula model forward motion/plan motion/path_planner view"
    " reachability reachability/place",
    "board/ports": "errors user_folders",
    "board/firmware/wire": "errors board/ports board/backend",
    "board/firmware/segments": "errors formula model forward motors motion motion/timing board/backend"
    " board/firmware/wire",
    "board/firmware": "board/backend errors board_catalogue formula model forward motors motion motion/plan"
    " motion/timing board/ports robot_file board/firmware/wire board/firmware/segments",
    "board/backend": "errors board_catalogue formula robot_file model motion motion/plan motion/timing"
    " motors board/ports",
    "board/grbl": "errors formula robot_file model motors motion motion/timing board/ports board/backend",
    "board/feetech": "errors formula robot_file model motors motion board/ports board/backend",
    "board/klipper": "errors formula model motors motion motion/timing board/ports board/backend",
    "board/sim": "errors board_catalogue board/ports board/firmware board/grbl board/feetech board/firmware/wire",
    "board/kinds": "errors board_catalogue formula robot_file model motors motion motion/timing board/ports"
    " board/backend board/firmware board/grbl board/feetech board/klipper board/sim board/firmware/wire"
    " board/firmware/segments",
    "flash": "errors board_catalogue board/ports board/firmware board/firmware/wire",
    "board": "keep_out keep_out/shapes errors signals formula model forward motors motion motion/plan"
    " motion/path_planner motion/timing board/ports board/backend",
    "teach": "keep_out keep_out/shapes errors files formula robot_file model forward inverse inverse/tasks"
    " inverse/branches inverse/solvers motors motion/plan motion/path_planner motion/timing motion/tool_path path_file"
    " reachability view board board/ports board/backend board/kinds board/sim export/js compiled inverse/answers",
}
TOP = {"cli", "__init__", "__main__"}  # may import every room, and no room imports them


def _room_of(module: str) -> str:
    """The room of ``armkin.inverse.closed.elbow`` is ``inverse/closed``."""
    path = MODULES[module]
    folder = path.parent.relative_to(SOURCE / "armkin").as_posix()
    room = path.stem if folder == "." else folder
    return room.split("/")[0] if room.startswith("cli") else room


@cache
def _imports_of(module: str) -> list[str]:
    """Modules of armkin that a module imports, anywhere in it: for types and inside functions, too."""
    return sorted({*_imported_modules(module)} - {"armkin"})


def _imported_modules(module: str) -> Iterator[str]:
    for node in tree_nodes(MODULES[module]):
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names if name.name in MODULES and name.name != "armkin")
        elif isinstance(node, ast.ImportFrom) and node.module in MODULES:
            for name in node.names:
                inner = f"{node.module}.{name.name}"
                yield inner if inner in MODULES else str(node.module)


@pytest.mark.parametrize("module", [module for module in MODULES if _room_of(module) not in TOP])
def test_a_room_imports_what_stands_above_it(module: str) -> None:
    room = _room_of(module)
    assert room in MAY_IMPORT, f"{room} is a new room: give it a row in MAY_IMPORT"
    allowed = {room, *MAY_IMPORT[room].split()}
    wrong = {imported: _room_of(imported) for imported in _imports_of(module) if _room_of(imported) not in allowed}
    assert not wrong


def test_below_the_model_nothing_reads_the_robot_file() -> None:
    """What arms do is in the arm's own fields; `Arm.file` is for the rooms that print the file itself."""
    printing = {"cli", "export"}
    readers = {
        module
        for module, node in nodes_of(ast.Attribute)
        if node.attr == "file" and ast.unparse(node.value).endswith("arm")
    }
    assert not {module for module in readers if _room_of(module) not in printing}


def test_no_row_of_the_table_contradicts_another() -> None:
    rows = {room: above.split() for room, above in MAY_IMPORT.items()}
    assert not {up for above in rows.values() for up in above} - rows.keys(), "a room without a row"
    assert _find_circle(rows) is None


def test_the_rooms_are_those_of_the_table() -> None:
    table = (SOURCE.parent / "docs/architecture.md").read_text().split("## Rooms")[1].split("\n\n")[1]
    rooms = re.findall(r"^\| `([a-z_/]+)` \|", table, re.M)
    assert len(rooms) == len(set(rooms))
    assert set(rooms) == {*MAY_IMPORT, "cli"}


def test_no_module_imports_itself_by_way_of_others() -> None:
    assert _find_circle({module: _imports_of(module) for module in MODULES}) is None


def test_a_circle_is_found() -> None:
    assert _find_circle({"a": ["b"], "b": ["c"], "c": []}) is None
    assert _find_circle({"a": ["b"], "b": ["c"], "c": ["b"]}) == "b -> c -> b"


def _find_circle(graph: Mapping[str, Sequence[str]]) -> str | None:
    """A way along the arrows that comes back to where it began; None if there is none."""
    done: set[str] = set()

    def visit(node: str, way: tuple[str, ...]) -> str | None:
        if node in way:
            return " -> ".join((*way[way.index(node) :], node))
        if node in done:
            return None
        done.add(node)
        return next((found for other in graph[node] if (found := visit(other, (*way, node)))), None)

    return next((found for node in graph if (found := visit(node, ()))), None)


NAMES_ARE_GIVEN = {"cli/commands", "board/kinds"}  # by the command line and by robot files: CONTRIBUTING.md


def test_no_two_files_share_a_name() -> None:
    rooms: dict[str, list[str]] = {}
    for path in MODULES.values():
        folder = path.parent.relative_to(SOURCE / "armkin").as_posix()
        if folder not in NAMES_ARE_GIVEN and path.stem != "__init__":
            rooms.setdefault(path.stem, []).append(folder)
    twice = {name: folders for name, folders in rooms.items() if len(folders) > 1}
    assert not twice


def test_no_file_has_the_name_of_a_folder() -> None:
    """But that of a folder that it stands in, as board/backend/board.py."""
    files = [path.relative_to(SOURCE / "armkin") for path in MODULES.values() if path.stem != "__init__"]
    folders = {name for file in files for name in file.parent.parts}
    given = {file for file in files if file.parent.as_posix() in NAMES_ARE_GIVEN}
    assert not [file for file in files if file.stem in folders - set(file.parent.parts) and file not in given]


def test_nothing_imports_from_a_test() -> None:
    """What two tests share is a module beside them, or in `tests/helpers/`, named by what it holds."""
    imports = {
        f"{path.name}: {line}"
        for path in Path(__file__).parent.rglob("*.py")
        for line in re.findall(r"^ *(?:from|import) (?:\w+\.)*test_\w+.*", path.read_text("utf-8"), re.M)
    }
    assert not imports


PACKAGES = sorted(path.parent for path in SOURCE.rglob("__init__.py"))
LISTED_ELSEWHERE = {  # the table of commands in docs/architecture.md; a kind is one file and no line elsewhere
    SOURCE / "armkin/cli/commands",
    SOURCE / "armkin/board/kinds",
}


@pytest.mark.parametrize("package", [path for path in PACKAGES if path not in LISTED_ELSEWHERE], ids=lambda p: p.name)
def test_a_package_lists_its_files(package: Path) -> None:
    """And no other files: every word that ends in .py is one of its own, or has a path before it."""
    text = ast.get_docstring(syntax_tree(package / "__init__.py")) or ""
    files = {
        f"{path.name}{'/' * path.is_dir()}" for path in package.iterdir() if path.suffix == ".py" or _is_room(path)
    }
    named = set(re.findall(r"(?<![\w./])(\w+(?:\.py|/))", text))
    assert files - {"__init__.py", "__main__.py"} <= named
    assert {name for name in named if name.endswith(".py")} <= files


def _is_room(path: Path) -> bool:
    return (path / "__init__.py").exists()


def test_outside_board_nobody_knows_a_kind() -> None:
    """No isinstance of a board or machine, no import of a kind's package: capabilities are asked by name."""
    kinds = {f"armkin.board.{path.stem}" for path in (SOURCE / "armkin/board/kinds").glob("*.py")} - {
        "armkin.board.__init__"
    }
    found = []
    for module in (name for name in MODULES if not name.startswith("armkin.board.")):
        for node in tree_nodes(MODULES[module]):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "isinstance":
                asked = ast.unparse(node.args[1])
                if any(word in asked for word in ("Machine", "Foreign", "Configuration", "Backend", "FirmwareBoard")):
                    found.append(f"{module}: {ast.unparse(node)}")
        # `stop` ends sessions of our firmware without knowing the arm, and what was flashed is asked what it is
        if module not in ("armkin.cli.commands.stop", "armkin.flash.upload_firmware"):
            found += [f"{module}: {name}" for name in _imports_of(module) if name.startswith(tuple(kinds))]
    assert not found


def test_a_new_kind_is_one_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file in board/kinds/ alone, and robot files, their schema and `board_of` know the kind."""
    from armkin import board_catalogue
    from armkin.board import kinds
    from armkin.model.build_arm import arm_of_file
    from armkin.robot_file import parse_robot_file
    from armkin.robot_file.robot_schema import json_schema

    text = (SOURCE / "armkin/board/kinds/grbl.py").read_text()
    (tmp_path / "gcode_box.py").write_text(text.replace('ForeignBoard("grbl"', 'ForeignBoard("gcode_box"'))
    monkeypatch.setattr(kinds, "__path__", [*kinds.__path__, str(tmp_path)])
    board_catalogue.own_kinds.cache_clear()
    try:
        robot = (
            (SOURCE.parent / "tests/robots/three_dof_grbl.yaml").read_text().replace("kind: grbl", "kind: gcode_box")
        )
        board = kinds.board_of(arm_of_file(parse_robot_file(robot)))
        assert (board.kind, type(board).__module__) == ("gcode_box", "armkin.board.kinds.gcode_box")
        assert "gcode_box" in json_schema()["$defs"]["Board"]["properties"]["kind"]["enum"]
    finally:
        board_catalogue.own_kinds.cache_clear()
