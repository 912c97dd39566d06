"""The pages in docs/ say what the code is."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import armkin
from armkin.errors import UsageError
from armkin.inverse.solvers import solver_of_arm
from armkin.robot_file import catalogue
from slow import SLOW

ROOT = Path(__file__).parents[1]
HOUSE, SOLVER = ROOT / "docs" / "architecture.md", ROOT / "docs" / "solver.md"


@pytest.mark.parametrize("page", [HOUSE, SOLVER, ROOT / "CONTRIBUTING.md"], ids=lambda page: page.name)
def test_every_file_that_a_page_names_is_there(page: Path) -> None:
    named = set(re.findall(r"`((?:[a-z_]+/)+(?:[a-z_]+\.(?:py|c|h|md|yaml))?)`", page.read_text()))
    assert len(named) > 10
    missing = {
        name
        for name in named
        if "yours" not in name and not any((top / name).exists() for top in (ROOT / "src" / "armkin", ROOT))
    }
    assert not missing


def test_links_between_pages_lead_somewhere() -> None:
    for page in (ROOT / "docs").rglob("*.md"):
        for target in re.findall(r"\]\(([^)#:]+)\)", page.read_text()):
            assert (page.parent / target).exists(), f"{page.name}: {target}"


def test_the_solvers_table_has_every_class_in_its_order() -> None:
    files = re.findall(r"\| `(inverse/[a-z_/]+)\.py` \|", SOLVER.read_text())
    order = [_module_of(function) for function in solver_of_arm._CLASSES]
    assert [{"inverse/elimination/method": "inverse/solvers/general"}.get(name, name) for name in files] == order


def _module_of(function: object) -> str:
    name = str(getattr(function, "__module__", "")).removeprefix("armkin.").replace(".", "/")
    return "inverse/solvers/tool_axis" if name == "inverse/solvers/solver_of_arm" else name


def test_the_methods_of_the_shipped_robots_are_on_the_page() -> None:
    text = SOLVER.read_text()
    names = set()
    for robot in catalogue.robot_names():
        try:
            names.add(armkin.method(armkin.load(robot))[0])
        except UsageError:
            continue  # no task fits it, or it has more joints than constraints
    assert len(names) >= 6
    assert not {name for name in names if f"`{name}`" not in text}


def test_the_sources_of_the_formulas_stand_in_the_code_too() -> None:
    code = "".join(path.read_text() for path in (ROOT / "src/armkin/inverse").rglob("*.py"))
    text = SOLVER.read_text()
    for author in ("Pieper", "Hawkins", "Siciliano", "Raghavan", "Manocha", "Richter-Gebert"):
        assert author in text
        assert author in code


def test_tests_that_are_called_slow_are_there() -> None:
    for name, functions in SLOW.items():
        text = (ROOT / "tests" / name).read_text()
        assert all(f"def {function}(" in text for function in functions), name


def test_the_man_page_is_what_the_commands_are() -> None:
    from runpy import run_path

    made = run_path(str(ROOT / "scripts/man.py"))
    assert made["PAGE"].read_text() == made["page"](), "scripts/man.py writes it"
