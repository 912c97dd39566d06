"""What people install: a wheel and an sdist, in a clean environment, on any operating system."""

import ast
import re
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "armkin"
# Modules of the standard library that Windows does not have.
POSIX_ONLY = {"fcntl", "grp", "posix", "pty", "pwd", "readline", "resource", "syslog", "termios", "tty"}
# And what of its other modules Windows does not have.
LACKS = re.compile(
    r"\bos\.(?:getuid|geteuid|getgid|fork|killpg|setsid|getpgid|chown|fchmod|mkfifo|openpty|O_NOFOLLOW|O_NONBLOCK)\b"
    r"|\bsignal\.(?:SIG(?:HUP|KILL|ALRM|USR1|USR2|TSTP|CONT|PIPE|WINCH|QUIT)|alarm|setitimer|pthread_kill|sigwait)\b"
    r"|^ *(?:import|from) (?:fcntl|grp|pty|pwd|resource|termios|tty)\b|[\"']/tmp"
)
ASKED_FIRST = re.compile(r"sys\.platform|hasattr\(|getattr\(|suppress\((?:Import|Except)")


def build(what: str, source: Path, folder: Path) -> Path:
    """A wheel or an sdist of a source tree."""
    command = [sys.executable, "-m", "hatchling", "build", "-t", what, "-d", str(folder)]
    subprocess.run(command, cwd=source, check=True, capture_output=True)
    [path] = folder.iterdir()
    return path


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build("wheel", ROOT, tmp_path_factory.mktemp("wheel"))


def contents(path: Path) -> dict[str, bytes]:
    """Files of a wheel, less the list of their hashes."""
    with zipfile.ZipFile(path) as file:
        return {name: file.read(name) for name in file.namelist() if not name.endswith("RECORD")}


def test_the_wheel_holds_the_package_and_the_robots(wheel: Path) -> None:
    files = contents(wheel)
    sources = [path.relative_to(SOURCE.parent).as_posix() for path in SOURCE.rglob("*") if path.is_file()]
    missing = {name for name in sources if "__pycache__" not in name} - set(files)
    assert not missing
    robots = {f"armkin/robots/{path.name}" for path in (ROOT / "robots").iterdir()}
    assert robots <= set(files)
    assert not [name for name in files if name.startswith("tests")]


def test_the_sdist_makes_the_same_wheel(wheel: Path, tmp_path: Path) -> None:
    sdist = build("sdist", ROOT, tmp_path / "sdist")
    with tarfile.open(sdist) as file:
        file.extractall(tmp_path / "tree", filter="data")
    [tree] = (tmp_path / "tree").iterdir()
    assert contents(build("wheel", tree, tmp_path / "again")) == contents(wheel)


def test_a_clean_environment_runs_it_from_any_folder(wheel: Path, tmp_path: Path) -> None:
    place = tmp_path / "venv"
    venv.create(place, with_pip=False)
    bin_folder = place / ("Scripts" if sys.platform == "win32" else "bin")
    python = bin_folder / ("python.exe" if sys.platform == "win32" else "python")
    install = [sys.executable, "-m", "pip", "--python", str(python), "install", "-q", "--no-compile"]
    subprocess.run([*install, str(wheel)], check=True)

    def armkin(*words: str) -> str:
        done = subprocess.run(
            [bin_folder / "armkin", *words], cwd=tmp_path, capture_output=True, text=True, timeout=180, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert "398.3923" in armkin("fk", "three_dof", "-30", "5", "-5")
    assert "ur5e" in armkin("robots")
    assert "as planned" in armkin("send", "three_dof", "-30", "5", "-5", "--port", "sim")
    assert '"title"' in armkin("schema")
    assert "three_dof" in armkin("info", "three_dof")
    module = "import armkin; print(armkin.load('ur5e').n, armkin.__file__)"
    out = subprocess.run([python, "-c", module], cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert out.startswith("6 ")
    assert str(place.resolve()) in str(Path(out.split(maxsplit=1)[1].strip()).resolve())


def test_nothing_that_windows_lacks_is_imported_at_module_level() -> None:
    found = []
    for path in SOURCE.rglob("*.py"):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
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
            if not LACKS.search(line) or path.name == "axes.py":
                continue
            begin = next((k for k in range(number, -1, -1) if re.match(r" *(?:def|class) ", lines[k])), 0)
            if not any(ASKED_FIRST.search(before) for before in lines[begin : number + 1]):
                found.append(f"{path.name}:{number + 1}: {line.strip()}")
    assert not found
