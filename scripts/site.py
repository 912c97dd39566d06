#!/usr/bin/env python3
"""The documentation as a site: build/site, from docs/, with figures and a reference that are made here.

    pip install '.[docs]' && scripts/site.py [ARM...]

Every shipped arm gets its live page, or the arms that are named alone. mkdocs builds strictly: a link that leads
nowhere ends it.
"""

from __future__ import annotations

import inspect
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import armkin
from armkin.calibration.calibrate_arm import Calibration
from armkin.cli.app import load_command, run
from armkin.cli.commands import COMMANDS
from armkin.motion.timing.trajectory import Trajectory
from armkin.motors import Best, Rounding
from armkin.reachability.workspace_survey import Workspace
from armkin.robot_file import catalogue, json_schema

ROOT = Path(__file__).resolve().parents[1]
BUILD = ROOT / "build"
DOCS = BUILD / "docs"
FILE = re.compile(r'```\w+ title="([^"]+)"\n(.*?)```', re.S)
PAGES = {"README.md": "index.md", "CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}
PAGES["firmware/PROTOCOL.md"] = "protocol.md"
RESULTS = (Best, Calibration, Rounding, Trajectory, Workspace)  # of functions, and not exported


def main(arms: Sequence[str]) -> None:
    shutil.rmtree(DOCS, ignore_errors=True)
    shutil.copytree(ROOT / "docs", DOCS)
    for source, name in PAGES.items():
        (DOCS / name).write_text(moved((ROOT / source).read_text("utf-8"), source), "utf-8")
    for page in DOCS.rglob("*.md"):
        page.write_text(inside(page.read_text("utf-8"), page), "utf-8")
    figures()
    reference = DOCS / "reference"
    reference.mkdir()
    (reference / "commands.md").write_text("\n".join(commands()), "utf-8")
    (reference / "robot_file.md").write_text("\n".join(robot_file()), "utf-8")
    (reference / "python.md").write_text("\n".join(python()), "utf-8")
    (reference / "arms.md").write_text("\n".join(pages(arms or catalogue.robot_names())), "utf-8")
    subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "-f", str(ROOT / "mkdocs.yml")],
        check=True,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
    )


def moved(text: str, source: str) -> str:
    """A page from outside docs/, whose links are from there."""
    if source == "firmware/PROTOCOL.md":
        return re.sub(r"\]\((?!https?:|#)([^)]+)\)", "]", text)
    return text.replace("](docs/", "](")


def inside(text: str, page: Path) -> str:
    """Links to files that the site has not become plain words, those to its other pages are led there."""

    def link(match: re.Match[str]) -> str:
        words, target, anchor = match[1], match[2], match[3] or ""
        name = target.removeprefix("../")
        if name in PAGES:
            up = "../" * (len(page.relative_to(DOCS).parts) - 1)
            return f"[{words}]({up}{PAGES[name]}{anchor})"
        return match[0] if (page.parent / target).exists() or "tutorials" in page.parts else words

    return re.sub(r"(?<!!)\[([^]]+)\]\((?!https?:)([^)#\s]+)(#[^)]*)?\)", link, text)


def figures() -> None:
    """What the tutorials' commands draw, beside them: run again in a folder of their own."""
    for page in sorted((DOCS / "tutorials").glob("*.md")):
        text, folder = page.read_text("utf-8"), BUILD / "tutorials" / page.stem
        names = re.findall(r"!\[[^]]*\]\(([^)]+)\)", text)
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        for name, content in FILE.findall(text):
            (folder / name).write_text(content)
        drawn = [line[2:] for line in re.findall(r"^\$ .*", text, re.M) if "new " in line or ".png" in line]
        for command in drawn if names else ():
            words = shlex.split(command)
            subprocess.run([sys.executable, "-m", *words], cwd=folder, check=True, stdout=subprocess.DEVNULL)
        for name in names:
            shutil.copy(folder / name, page.parent / name)


def commands() -> Iterator[str]:
    """Every command's help."""
    yield "# Commands\n\nWhat `armkin COMMAND --help` prints.\n"
    for name, sentence in COMMANDS.items():
        command: Any = load_command(name)
        yield f"## {name}\n\n{sentence}\n\n```text"
        yield command.get_help(command.make_context(f"armkin {name}", [], resilient_parsing=True))
        yield "```\n"


def robot_file() -> Iterator[str]:
    """The schema's objects as tables."""
    schema = json_schema()
    yield "# Robot file\n\nEvery key, from the schema that files are held to; angles in degrees, lengths in mm.\n"
    for title, part in {"robot file": schema, **schema["$defs"]}.items():
        rows = part.get("properties")
        if rows:
            yield f"## {title}\n\n{part.get('description', '')}\n\n| key | what it is |\n|---|---|"
            for key, what in rows.items():
                needed = " (required)" if key in part.get("required", ()) else ""
                yield f"| `{key}`{needed} | {str(what.get('description', '')).replace('|', chr(92) + '|')} |"
            yield ""


def python() -> Iterator[str]:
    """The public names and the classes of results with their docstrings, and what classes define in public."""
    yield "# Python\n\nLengths in mm, angles in radians; leading axes are batch axes.\n"
    public = {name: getattr(armkin, name) for name in armkin.__all__} | {kind.__name__: kind for kind in RESULTS}
    for name, what in sorted(public.items()):
        if callable(what):
            yield f"## {name}\n"
            yield from docstring_markdown(f"armkin.{name}", what)
        for inner, member in vars(what).items() if inspect.isclass(what) else ():
            if not inner.startswith("_") and (inspect.isfunction(member) or hasattr(type(member), "__get__")):
                yield f"### {name}.{inner}\n"
                yield from docstring_markdown(f"{name}.{inner}", member)


def docstring_markdown(name: str, what: Any) -> Iterator[str]:
    """A signature, if it is called, and a docstring: its sections as tables, its examples as code."""
    if inspect.isfunction(what):
        call = re.sub(r"(: |-> )'([^']+)'", r"\1\2", f"{name}{inspect.signature(what)}")
        if len(call) > 100:  # a parameter a line
            parameters, arrow, returned = call.replace("(", "(\n    ", 1).rpartition(") -> ")
            call = re.sub(r", (?=\w+: |\*)", ",\n    ", parameters) + f",\n{arrow}{returned}"
        yield f"```python\n{call}\n```\n"
    for block in (inspect.getdoc(what) or "").split("\n\n"):
        head, _, rest = block.partition("\n")
        if head in ("Args:", "Attributes:", "Raises:"):
            yield f"| {head[:-1]} | |\n|---|---|"
            rows = re.split(r"\n(?=    \S)", rest.replace("|", "\\|"))
            yield "\n".join("| `{}` | {} |".format(*" ".join(row.split()).split(": ", 1)) for row in rows) + "\n"
        elif head == "Returns:":
            yield f"**Returns** {' '.join(rest.split())}\n"
        else:
            yield f"```pycon\n{block}\n```\n" if head.startswith(">>>") else f"{block}\n"


def pages(arms: Sequence[str]) -> Iterator[str]:
    """A live page for every arm: one HTML file that asks no server."""
    folder = DOCS / "arms"
    folder.mkdir()
    yield "# Arms\n\nEach page solves every branch in the browser: no server is asked.\n"
    for name in arms:
        if run(["export", name, "--html", "-o", str(folder / f"{name}.html")]) == 0:
            yield f"- [{name}](../arms/{name}.html): {armkin.load(name).description.splitlines()[0]}"
        else:
            yield f"- {name}: {armkin.load(name).description.splitlines()[0]}"


if __name__ == "__main__":
    main(sys.argv[1:])
