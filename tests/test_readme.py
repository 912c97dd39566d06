"""README, tour and tutorials are run: their commands print what they show, and none is left out.

README and tour from the project's folder, a tutorial from an empty one, where its titled blocks become files first.
`ARMKIN_UPDATE_SNAPSHOTS=1 pytest -n 0 tests/test_readme.py` writes what the commands print into the pages.
"""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from armkin.cli.commands import COMMANDS
from command_line import ROOT, run

README, TOUR = ROOT / "README.md", ROOT / "docs/tour.md"
TUTORIALS = sorted((ROOT / "docs/tutorials").glob("*.md"))
CONSOLE = re.compile(r"```console\n(.*?)```", re.S)
PYTHON = re.compile(r"```python\n(.*?)```", re.S)
FILE = re.compile(r'```\w+ title="([^"]+)"\n(.*?)```', re.S)


@pytest.fixture(params=[README, TOUR, *TUTORIALS], ids=lambda page: page.stem)
def page(request: pytest.FixtureRequest) -> Path:
    found: Path = request.param
    return found


@contextmanager
def inside_folder(folder: Path) -> Iterator[None]:
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


def shown_commands(text: str) -> list[tuple[str, str]]:
    """Every `$ command` of the console blocks, with the output shown below it."""
    parts = (part for block in CONSOLE.findall(text) for part in re.split(r"^\$ ", block, flags=re.M)[1:])
    return [(command, output.rstrip("\n")) for command, _, output in (part.partition("\n") for part in parts)]


def printed_output(command: str, folder: Path) -> str:
    words = shlex.split(command)
    assert words[0] == "armkin", command
    completed = run(*words[1:], cwd=folder)
    assert completed.code in (0, 3), completed.err
    refused = f"{completed.err.rstrip()}\n" if completed.code == 3 and not completed.out else ""
    return f"{completed.out}{refused}".rstrip("\n")


def written_anew(text: str, outputs: dict[str, str]) -> str:
    def block(match: re.Match[str]) -> str:
        lines = [line[2:] for line in match.group(1).splitlines() if line.startswith("$ ")]
        return (
            "```console\n"
            + "\n".join(
                f"$ {line}\n{outputs[line]}\n".replace("\n\n", "\n")
                if not outputs[line]
                else f"$ {line}\n{outputs[line]}\n"
                for line in lines
            )
            + "```"
        )

    return CONSOLE.sub(block, text)


def test_commands_print_what_the_page_shows(page: Path, tmp_path: Path) -> None:
    text = page.read_text()
    folder = tmp_path if page in TUTORIALS else ROOT
    if page in TUTORIALS:
        for name, content in FILE.findall(text):
            (tmp_path / name).write_text(content)
    shown = shown_commands(text)
    assert len(shown) >= 2
    outputs = {command: printed_output(command, folder) for command, _ in shown}
    if os.environ.get("ARMKIN_UPDATE_SNAPSHOTS"):
        page.write_text(written_anew(text, outputs))
        return
    for command, output in shown:
        assert outputs[command] == output, command
    if page in TUTORIALS:
        figures = re.findall(r"!\[[^]]*\]\(([^)]+)\)", text)
        assert not [name for name in figures if not (tmp_path / name).stat().st_size > 1000], "its commands make them"


def test_python_examples_run(page: Path) -> None:
    with inside_folder(ROOT):
        for block in PYTHON.findall(page.read_text()):
            exec(block, {})


def test_every_command_is_in_the_readme() -> None:
    text = README.read_text()
    assert not [name for name in COMMANDS if f"armkin {name}" not in text and f"`{name}`" not in text]


def test_the_readme_is_short_and_its_two_commands_are_whole() -> None:
    assert len(README.read_bytes()) < 8000
    setup = README.read_text().split("## Set up")[1].split("\n## ")[0]
    first, second = re.findall(r"```sh\n(.*?)```", setup, re.S)
    assert first.count("\n") == second.count("\n") == 1
    assert first.rstrip().endswith("armkin send three_dof -30 5 -5 --port sim")
    assert "python3 -m venv" in first
    assert second == "scripts/test\n"


def test_the_gate_runs_the_readmes_own_test_command() -> None:
    gate, tests = (ROOT / ".ci/run").read_text(), (ROOT / "scripts/test").read_text()
    assert re.search(r"^scripts/test$", gate, re.M)
    for needed in ("python3-venv", "gcc-avr", "libsimavr-dev", "gcc-arm-none-eabi", "chromium", "frama-c-base"):
        assert needed in tests
    assert "pytest" in tests


def test_the_first_screen_has_a_picture_that_moves() -> None:
    """scripts/moving_picture.py makes it: a round of the tip, in at most 600 kB."""
    name = re.search(r"\]\((docs/\S+\.gif)\)", README.read_text(encoding="utf-8")[:1500])
    assert name is not None
    picture = ROOT / name[1]
    assert picture.stat().st_size <= 600_000
    with Image.open(picture) as shown:
        frames = []
        for k in range(getattr(shown, "n_frames", 1)):
            shown.seek(k)
            frames.append(np.asarray(shown.convert("L"), float))
    assert len(frames) >= 24
    assert min(np.abs(b - a).mean() for a, b in pairwise(frames)) > 0.05  # the arm moves from each to the next
    opposite = np.abs(frames[len(frames) // 2] - frames[0]).mean()
    assert np.abs(frames[-1] - frames[0]).mean() < 0.5 * opposite  # and the last leads to the first
