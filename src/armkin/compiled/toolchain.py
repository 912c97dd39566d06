"""The system's C compiler, and the folder of what it has built.

What is built is kept in the user's cache folder, by content: the name is the sha256 of the source, the
compiler, its flags and the processor. A library is loaded only from a folder and a file that belong to this
user and that nobody else can write; where that folder cannot be had, every process builds its own.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import platform
import shutil
import stat
import subprocess
import tempfile
from functools import cache
from pathlib import Path

from armkin.errors import MissingExtraError

# No fast-math: sums keep their order, infinities and what is not a number keep their meaning. That errno is not
# set and no floating-point trap is awaited lets loops with square roots and comparisons become vectors.
FLAGS = ["-std=c99", "-march=native", "-fno-math-errno", "-fno-trapping-math", "-ffp-contract=off"]
FLAGS += ["-shared", "-fPIC"]


@cache
def compiler() -> str:
    """The compiler's path: that of $CC, or the first of cc, gcc, clang.

    Raises MissingExtraError if there is none.
    """
    wanted = os.environ.get("CC", "").strip()
    for name in [wanted] if wanted else ["cc", "gcc", "clang"]:
        if (path := shutil.which(name)) is not None:
            return path
    if wanted:
        raise MissingExtraError(f"CC names the C compiler '{wanted}', which is not there; unset CC, or install it")
    raise MissingExtraError(
        "a C compiler is needed and none is installed: "
        "apt install gcc libc6-dev (Debian, Ubuntu), dnf install gcc (Fedora), xcode-select --install (macOS)"
    )


def load(source: str, content: str, level: int = 3) -> ctypes.CDLL:
    """A C file as a loaded library: from the cache, or built now.

    content: what the library must hold as `arm_content`; level: of optimisation. Raises MissingExtraError
    without a compiler, or if it fails.
    """
    command = [compiler(), f"-O{level}", *FLAGS]
    key = "\0".join([source, *command, _version(command[0]), _processor()])
    name = f"{hashlib.sha256(key.encode()).hexdigest()}.so"
    folder = _folder()
    if folder is not None:
        kept = folder / name
        found = _trusted(kept, content)
        if found is not None:
            return found
        _build(command, source, kept)
        found = _trusted(kept, content)
        if found is not None:
            return found
    with tempfile.TemporaryDirectory(prefix="armkin-") as own:
        _build(command, source, Path(own) / name)
        return ctypes.CDLL(os.path.join(own, name))


def _build(command: list[str], source: str, library: Path) -> None:
    """Compile beside the library and give it its name when it is whole."""
    with tempfile.TemporaryDirectory(prefix=".build-", dir=library.parent) as folder:
        path = Path(folder)
        (path / "arm.c").write_text(source, encoding="utf-8")
        words = [*command, "arm.c", "-o", "arm.so", "-lm"]
        done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode:
            said = next((line for line in done.stderr.splitlines() if "error" in line), done.stderr.strip()[:200])
            raise MissingExtraError(
                f"the C compiler {command[0]} failed: {said}\n"
                "it needs the C library's headers (Debian, Ubuntu: apt install gcc libc6-dev)"
            )
        os.chmod(path / "arm.so", 0o700)
        os.replace(path / "arm.so", library)


def _folder() -> Path | None:
    """The cache folder, made if need be; None if it is not this user's alone."""
    home = os.environ.get("XDG_CACHE_HOME", "")
    base = Path(home) if os.path.isabs(home) else Path.home() / ".cache"
    folder = base / "armkin" / "compiled"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        # who can write a folder above can put another in its place
        own = all(_is_ours(path, path == folder) for path in (folder, folder.parent, base))
    except (OSError, RuntimeError):  # no home, a file in the way, a full or read-only disk
        return None
    return folder if own and os.access(folder, os.W_OK) else None


def _is_ours(path: Path, alone: bool = True) -> bool:
    """Whether a file or folder is no link, belongs to this user (or, not `alone`, to root), and others cannot write."""
    status = os.lstat(path) if alone else os.stat(path)
    owner = status.st_uid == os.geteuid() or (not alone and status.st_uid == 0)
    return owner and not stat.S_ISLNK(status.st_mode) and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _trusted(library: Path, content: str) -> ctypes.CDLL | None:
    """A library of the cache, if it may be loaded and is what it should be."""
    try:
        if not _is_ours(library):
            return None
        found = ctypes.CDLL(str(library))
        held = (ctypes.c_char * (len(content) + 1)).in_dll(found, "arm_content").value
    except (OSError, ValueError):
        return None
    return found if held == content.encode() else None


@cache
def _version(path: str) -> str:
    return subprocess.run([path, "--version"], capture_output=True, text=True, check=False).stdout


@cache
def _processor() -> str:
    """What -march=native goes by: a home folder may be shared by unlike computers."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return f"{platform.machine()} {platform.processor()} {platform.node()}"
    told = ("model name", "flags", "Features", "CPU part")
    return "\n".join(sorted({line for line in lines if line.startswith(told)}))
