"""docs/glossary.md has each term once, and the pages that people read keep to plain words."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
GLOSSARY = ROOT / "docs/glossary.md"
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
BANNED = {"hair": "say how far", "hairs": "say how far", "valley": "say multiplicity", "valleys": "say multiplicity"}
ASKED = re.compile(r"\bask(?:s|ed|ing)? (?:an|the) arm\b")


def glossary_terms() -> list[str]:
    return re.findall(r"^- \*\*([^*]+)\*\*: ", GLOSSARY.read_text(), re.M)


def test_each_term_is_defined_once_and_in_order() -> None:
    found = glossary_terms()
    assert len(found) > 30
    assert len(found) == len({term.lower() for term in found})
    assert found == sorted(found, key=str.lower)
    lines = [line for line in GLOSSARY.read_text().splitlines() if line.startswith("- ")]
    assert len(lines) == len(found), "a line without a term"


def test_each_term_is_used() -> None:
    text = "".join(page.read_text().lower() for page in PAGES if page != GLOSSARY)
    code = "".join(path.read_text().lower() for path in (ROOT / "src/armkin").rglob("*.py"))
    unused = [term for term in glossary_terms() if term.lower() not in text and term.lower() not in code]
    assert not unused


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_no_page_has_a_banned_word(page: Path) -> None:
    text = re.sub(r"`[^`]*`", "", page.read_text())  # names of files are not words
    words = set(re.findall(r"[a-z]+", text.lower()))
    assert not {word: better for word, better in BANNED.items() if word in words}
    assert not ASKED.findall(text)


def test_no_function_has_a_banned_name() -> None:
    named = re.compile(r"^ *def (told|listed|taken)\(", re.M)
    found = {path.name: named.findall(path.read_text()) for path in (ROOT / "src/armkin").rglob("*.py")}
    assert not {name: functions for name, functions in found.items() if functions}
