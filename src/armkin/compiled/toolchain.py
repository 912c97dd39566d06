"""The system's C compiler, and the cache of compiled libraries.

Libraries are kept in the user's cache folder. Their name contains the sha256 of the source, the compiler, its flags and
the processor, and the sha256 of the library itself, so that an incomplete file is never loaded. A library is loaded
only if its folder and file belong to this user and nobody else can write them; without such a folder, every process
builds its own library.
"""

import ctypes
import hashlib
import os
import platform
import shlex
import shutil
import stat
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from functools import cache
from pathlib import Path

from armkin import user_folders
from armkin.errors import FileError, MissingExtraError

# no fast-math, so that sums keep their order, and infinities and nan their meaning; without errno and floating-point
# traps, loops with square roots and comparisons can be vectorised
FLAGS = ["-std=c99", "-march=native", "-fno-math-errno", "-fno-trapping-math", "-ffp-contract=off"]
FLAGS += ["-shared", "-fPIC"]
_DAY = 86_400.0  # day [s]
MAX_SECONDS = 60.0  # longest time [s] for optimising; three_dof takes 2, an arm by elimination 8


def announce() -> None:
    """Called before a library is built; the command line replaces it to print a message."""


def compiler_command() -> list[str]:
    """The path and options of the compiler: $CC, or the first of cc, gcc, clang.

    Raises MissingExtraError if there is none.
    """
    command = os.environ.get("CC", "").strip()
    for words in [_command_words(command)] if command else [["cc"], ["gcc"], ["clang"]]:
        if (path := shutil.which(words[0])) is not None:
            return [path, *words[1:]]
    if command:
        raise MissingExtraError(f"CC names the C compiler '{command}', which is not there; unset CC, or install it")
    raise MissingExtraError(
        "a C compiler is needed and none is installed: "
        "apt install gcc libc6-dev (Debian, Ubuntu), dnf install gcc (Fedora), xcode-select --install (macOS)"
    )


def _command_words(command: str) -> list[str]:
    """$CC split into words, such as ``ccache gcc``; a path with spaces stays one word."""
    if shutil.which(command) is not None:
        return [command]
    try:
        return shlex.split(command) or [command]
    except ValueError:  # an unmatched quote
        return [command]


def load_library(source: str, content: str, level: int = 3) -> ctypes.CDLL:
    """The library of a C file, loaded from the cache or built.

    content: the expected `arm_content` of the library; level: of optimisation, replaced by 0 if the compiler takes more
    than MAX_SECONDS. Raises MissingExtraError without a compiler, or if it fails; FileError without a folder for the
    build.
    """
    folder, commands = _cache_folder(), {}
    for used_level in dict.fromkeys((level, 0)):
        command = [*compiler_command(), f"-O{used_level}", *FLAGS]
        # optimising may fail on a busy computer, so that it is tried again the next day
        day = [] if used_level == level else [str(int(time.time() // _DAY))]
        key = "\0".join([source, *command, _compiler_version(command[0]), _processor_text(), *day])
        commands[name := hashlib.sha256(key.encode()).hexdigest()] = command
        if folder is not None and (library := _stored_library(folder, name, content)) is not None:
            return library
    announce()
    try:
        with tempfile.TemporaryDirectory(prefix="armkin-") as build_folder:
            library_path, name = _build(commands, source, Path(build_folder))
            if folder is not None:
                _store_library(library_path, folder, name)
                if (library := _stored_library(folder, name, content)) is not None:
                    return library
            return ctypes.CDLL(str(library_path))
    except OSError as error:  # a full disk, or a folder without execution rights
        raise FileError(
            f"no place to build the arm's code: {error}; TMPDIR may name a folder with room whose programs may run"
        ) from None


def _build(commands: dict[str, list[str]], source: str, folder: Path) -> tuple[Path, str]:
    """Compile in a private folder by the first command that ends in time; the library and the name of the command."""
    (folder / "arm.c").write_text(source, encoding="utf-8")
    for name, command in commands.items():
        run = _run_compiler(
            [*command, "arm.c", "-o", "arm.so", "-lm"], folder, MAX_SECONDS if name != [*commands][-1] else None
        )
        if run is not None:
            break
    library = folder / "arm.so"
    if run is None or run.returncode or not library.is_file():
        lines = [] if run is None else run.stderr.splitlines()
        problem = next((line for line in lines if "error" in line), "\n".join(lines).strip()[:200])
        raise MissingExtraError(
            f"the C compiler {command[0]} failed: {problem or 'it wrote no library'}\n"
            "it needs the C library's headers (Debian, Ubuntu: apt install gcc libc6-dev)"
        )
    return library, name


def _run_compiler(
    words: list[str], folder: Path | None = None, seconds: float | None = None
) -> subprocess.CompletedProcess[str] | None:
    """Run the compiler; None if it does not end in time. Raises MissingExtraError if it cannot be run."""
    try:
        return subprocess.run(
            words, cwd=folder, capture_output=True, text=True, errors="replace", check=False, timeout=seconds
        )
    except subprocess.TimeoutExpired:
        return None
    except OSError as error:
        raise MissingExtraError(f"the C compiler {words[0]} cannot be run: {error.strerror or error}") from None


def _store_library(library_path: Path, folder: Path, name: str) -> None:
    """Put a complete library into the cache; on a full disk nothing is stored."""
    content = library_path.read_bytes()
    with suppress(OSError):
        handle, temporary = tempfile.mkstemp(prefix=".build-", dir=folder)
        try:
            with open(handle, "wb") as file:
                file.write(content)
            os.chmod(temporary, 0o700)
            os.replace(temporary, folder / f"{name}-{_digest(content)}.so")
        except BaseException:
            os.unlink(temporary)
            raise


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:32]


def _cache_folder() -> Path | None:
    """The cache folder, made if missing; None if other users can write it."""
    folder = user_folders.compiled_folder()
    if folder is None:
        return None
    base = folder.parent.parent
    try:
        base.mkdir(mode=0o700, parents=True, exist_ok=True)
        for path in (folder.parent, folder):  # one by one, as `parents` ignores the mode for folders above
            path.mkdir(mode=0o700, exist_ok=True)
        # whoever can write a folder above could replace the cache folder
        are_ours = all(_is_ours(path, path == folder) for path in (folder, folder.parent, base))
    except OSError:  # a file of that name, a full disk or a read-only one
        return None
    return folder if are_ours and os.access(folder, os.W_OK) else None


def _is_ours(path: Path, only_user: bool = True) -> bool:
    """Whether a path is no link and only this user can write it; without `only_user` it may belong to root."""
    status = os.lstat(path) if only_user else os.stat(path)
    if sys.platform == "win32":  # other users cannot write a user's own folders
        return not stat.S_ISLNK(status.st_mode)
    owner = status.st_uid == os.geteuid() or (not only_user and status.st_uid == 0)
    return owner and not stat.S_ISLNK(status.st_mode) and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _stored_library(folder: Path, name: str, content: str) -> ctypes.CDLL | None:
    """A library of the cache, if it is safe to load and has the expected content."""
    for library in folder.glob(f"{name}-*.so"):
        try:
            # check the digest before loading, as loading an incomplete file ends the process
            if not _is_ours(library) or library.stem != f"{name}-{_digest(library.read_bytes())}":
                continue
            code = ctypes.CDLL(str(library))
            stored_content = (ctypes.c_char * (len(content) + 1)).in_dll(code, "arm_content").value
        except (OSError, ValueError):
            continue
        if stored_content == content.encode():
            return code
    return None


@cache
def _compiler_version(path: str) -> str:
    run = _run_compiler([path, "--version"], seconds=MAX_SECONDS)
    return "" if run is None else run.stdout


@cache
def _processor_text() -> str:
    """The processor, on which -march=native depends, as different computers may share a home folder."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return f"{platform.machine()} {platform.processor()} {platform.node()}"
    prefixes = ("model name", "flags", "Features", "CPU part")
    return "\n".join(sorted({line for line in lines if line.startswith(prefixes)}))
