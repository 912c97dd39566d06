"""The bounds in pyproject.toml are true: armkin works with the lowest version of every dependency."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from command_line import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


@pytest.fixture(scope="module")
def lowest(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An environment with exactly the lowest versions, and armkin in it."""
    venv = tmp_path_factory.mktemp("lowest")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", venv], check=True)
    pip = [sys.executable, "-m", "pip", "--python", str(venv / "bin/python"), "--disable-pip-version-check"]
    pip += ["install", "-q", "--no-compile"]
    names = [re.sub(r">=", "==", dependency) for dependency in PROJECT["dependencies"]]
    subprocess.run([*pip, *names], check=True, capture_output=True)
    wheel = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(wheel)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    subprocess.run([*pip, "--no-deps", *map(str, wheel.iterdir())], check=True, capture_output=True)
    return venv / "bin" / "armkin"


@pytest.mark.slow
@pytest.mark.skipif(sys.version_info[:2] != (3, 11), reason="the lowest numpy is built for Python 3.11")
@pytest.mark.skipif(sys.platform == "win32", reason="an environment's programs lie elsewhere on Windows")
def test_commands_work_with_the_lowest_versions(lowest: Path, tmp_path: Path) -> None:
    for words, code, shown in (
        ("--version", 0, f"armkin {PROJECT['version']}"),
        ("--help", 0, "Usage: armkin"),
        ("fk --help", 0, "Usage: armkin fk"),
        ("fk three_dof -30 5 -5", 0, "398.3923"),
        ("ik three_dof 390 80 300 --json", 0, '"complete": true'),
        ("pulses three_dof -30 5 -5", 0, "-10144"),
        ("workspace three_dof --samples 10", 0, "three_dof"),
        ("send three_dof -30 5 -5 --port sim", 0, "as planned"),
        ("path three_dof --via 390,80,300 --via 390,20,300 --dry-run", 0, "mm of path"),
        ("info three_dof", 0, "three_dof"),
        ("no_such", 2, "there is no command"),
        ("fk three_dof 1 2", 2, "got 2"),
    ):
        done = subprocess.run([lowest, *words.split()], capture_output=True, text=True, cwd=tmp_path)
        assert done.returncode == code, (words, done.stderr)
        assert shown in done.stdout + done.stderr, words
