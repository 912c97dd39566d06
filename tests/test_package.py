"""What people install: a wheel and an sdist, in a clean environment, on any operating system."""

import ast
import re
import subprocess
import sys
import tarfile
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest

from source_trees import MODULES, syntax_tree

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "armkin"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PYTHON = "python.exe" if sys.platform == "win32" else "python"
# Modules of the standard library that Windows does not have.
POSIX_ONLY = {"fcntl", "grp", "posix", "pty", "pwd", "readline", "resource", "syslog", "termios", "tty"}
# And what of its other modules Windows does not have.
LACKS = re.compile(
    r"\bos\.(?:getuid|geteuid|getgid|fork|killpg|setsid|getpgid|chown|fchmod|mkfifo|openpty|O_NOFOLLOW|O_NONBLOCK)\b"
    r"|\bsignal\.(?:SIG(?:HUP|KILL|ALRM|USR1|USR2|TSTP|CONT|PIPE|WINCH|QUIT)|alarm|setitimer|pthread_kill|sigwait)\b"
    r"|^ *(?:import|from) (?:fcntl|grp|pty|pwd|resource|termios|tty)\b|[\"']/tmp"
)
ASKED_FIRST = re.compile(r"sys\.platform|hasattr\(|getattr\(|suppress\((?:Import|Except)")


def build_distribution(what: str, source: Path, folder: Path) -> Path:
    """A wheel or an sdist of a source tree."""
    command = [sys.executable, "-m", "hatchling", "build", "-t", what, "-d", str(folder)]
    subprocess.run(command, cwd=source, check=True, capture_output=True)
    [path] = folder.iterdir()
    return path


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_distribution("wheel", ROOT, tmp_path_factory.mktemp("wheel"))


def wheel_contents(path: Path) -> dict[str, bytes]:
    """Files of a wheel, less the list of their hashes."""
    with zipfile.ZipFile(path) as file:
        return {name: file.read(name) for name in file.namelist() if not name.endswith("RECORD")}


def test_the_wheel_holds_the_package_and_the_robots(wheel: Path) -> None:
    files = wheel_contents(wheel)
    sources = [path.relative_to(SOURCE.parent).as_posix() for path in SOURCE.rglob("*") if path.is_file()]
    missing = {name for name in sources if "__pycache__" not in name} - set(files)
    assert not missing
    robots = {f"armkin/robots/{path.name}" for path in (ROOT / "robots").iterdir()}
    assert robots <= set(files)
    assert not [name for name in files if name.startswith("tests")]


def test_the_sdist_makes_the_same_wheel(wheel: Path, tmp_path: Path) -> None:
    sdist = build_distribution("sdist", ROOT, tmp_path / "sdist")
    with tarfile.open(sdist) as file:
        file.extractall(tmp_path / "tree", filter="data")
    [tree] = (tmp_path / "tree").iterdir()
    assert wheel_contents(build_distribution("wheel", tree, tmp_path / "again")) == wheel_contents(wheel)


@pytest.fixture(scope="module")
def programs(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The programs' folder of a new environment: the wheel, and what it asks for, in the lowest versions that it takes.

    The lowest numpy is built for Python 3.11: for another one, in the newest.
    """
    place = tmp_path_factory.mktemp("venv")
    venv.create(place, with_pip=False)
    folder = place / ("Scripts" if sys.platform == "win32" else "bin")
    install = [sys.executable, "-m", "pip", "--python", str(folder / PYTHON), "--disable-pip-version-check"]
    install += ["install", "-q", "--no-compile", str(wheel)]
    if sys.version_info < (3, 12):
        install += [dependency.replace(">=", "==") for dependency in PROJECT["dependencies"]]
    subprocess.run(install, check=True, capture_output=True)
    return folder


@pytest.mark.parametrize(
    ("words", "code", "shown"),
    [
        ("--version", 0, f"armkin {PROJECT['version']}"),
        ("--help", 0, "Usage: armkin"),
        ("fk --help", 0, "Usage: armkin fk"),
        ("fk three_dof -30 5 -5", 0, "398.3923"),
        ("ik three_dof 390 80 300 --json", 0, '"complete": true'),
        ("pulses three_dof -30 5 -5", 0, "-10144"),
        ("workspace three_dof --samples 10", 0, "three_dof"),
        ("send three_dof -30 5 -5 --port sim", 0, "as planned"),
        ("path three_dof --via 390,80,300 --via 390,20,300 --dry-run", 0, "mm of path"),
        ("robots", 0, "ur5e"),
        ("schema", 0, '"title"'),
        ("info three_dof", 0, "three_dof"),
        ("no_such", 2, "there is no command"),
        ("fk three_dof 1 2", 2, "got 2"),
    ],
)
def test_commands_work_in_a_clean_environment_from_any_folder(
    words: str, code: int, shown: str, programs: Path, tmp_path: Path
) -> None:
    command = [str(programs / "armkin"), *words.split()]
    completed = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=180, check=False)
    assert completed.returncode == code, completed.stderr
    assert shown in (completed.stdout if code == 0 else completed.stderr)


def test_the_package_is_imported_from_where_it_was_installed(programs: Path, tmp_path: Path) -> None:
    module = "import armkin; print(armkin.load('ur5e').n, armkin.__file__)"
    command = [str(programs / PYTHON), "-c", module]
    out = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert out.startswith("6 ")
    assert str(programs.parent.resolve()) in str(Path(out.split(maxsplit=1)[1].strip()).resolve())


def test_nothing_that_windows_lacks_is_imported_at_module_level() -> None:
    found = []
    for path in MODULES.values():
        for node in syntax_tree(path).body:
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [str(node.module)] if isinstance(node, ast.ImportFrom) else []
            found += [f"{path.name}: {name}" for name in names if name.split(".")[0] in POSIX_ONLY]
    assert not found


def test_what_windows_lacks_is_used_only_where_the_system_was_asked() -> None:
    """In the same function, before it, or with a way out; Klipper's socket is one of another computer's."""
    found = []
    for path in SOURCE.rglob("*.py"):
        lines = path.read_text(encoding="utf-8").splitlines()
        for number, line in enumerate(lines):
            if not LACKS.search(line) or path.name == "extra_axes.py":
                continue
            begin = next((k for k in range(number, -1, -1) if re.match(r" *(?:def|class) ", lines[k])), 0)
            if not any(ASKED_FIRST.search(before) for before in lines[begin : number + 1]):
                found.append(f"{path.name}:{number + 1}: {line.strip()}")
    assert not found
