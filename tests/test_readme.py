"""The README is run: its commands print what it shows, and it leaves no command out."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
CONSOLE = re.compile(r"```console\n(.*?)```", re.S)
PYTHON = re.compile(r"```python\n(.*?)```", re.S)


def commands() -> list[tuple[str, str]]:
    """Every `$ command` of the console blocks, with the output shown below it."""
    found = []
    for block in CONSOLE.findall(README.read_text()):
        for part in re.split(r"^\$ ", block, flags=re.M)[1:]:
            command, _, output = part.partition("\n")
            found.append((command, output.rstrip("\n")))
    return found


def run(command: str) -> str:
    words = shlex.split(command)
    assert words[0] == "armkin"
    answer = subprocess.run(
        [sys.executable, "-m", "armkin", *words[1:]], cwd=ROOT, capture_output=True, text=True, timeout=180, check=False
    )
    assert "Traceback" not in answer.stderr
    return answer.stdout.rstrip("\n")


def update() -> None:
    """Write what the commands print into the README."""
    text = README.read_text()

    def block(match: re.Match[str]) -> str:
        lines = [line for line in match.group(1).splitlines() if line.startswith("$ ")]
        return "```console\n" + "\n".join(f"{line}\n{run(line[2:])}\n" for line in lines) + "```"

    README.write_text(CONSOLE.sub(block, text))


if os.environ.get("ARMKIN_UPDATE_SNAPSHOTS"):
    update()


@pytest.mark.parametrize(("command", "shown"), commands())
def test_commands_print_what_the_readme_shows(command: str, shown: str) -> None:
    assert run(command) == shown


def test_python_examples_run() -> None:
    here = Path.cwd()
    os.chdir(ROOT)
    try:
        for block in PYTHON.findall(README.read_text()):
            exec(block, {})
    finally:
        os.chdir(here)


def test_every_command_is_in_the_readme() -> None:
    listed = re.findall(r"^  (\w+)  +\w", run("armkin --help").split("Commands:")[1], re.M)
    text = README.read_text()
    assert len(listed) > 10
    assert not [name for name in listed if f"armkin {name}" not in text and f"`{name}`" not in text]


def test_the_gate_runs_the_readmes_own_lines() -> None:
    gate = (ROOT / ".ci/run").read_text()
    assert re.search(r"^pip install .*&& pytest$", README.read_text(), re.M)
    assert re.search(r"apt-get install -y .*gcc-avr", README.read_text())
    assert "README.md" in gate
