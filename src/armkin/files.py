"""Files that appear whole or not at all, and never in place of a robot file or of what was read."""

from __future__ import annotations

import errno
import os
import re
import stat
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import IO, Any, Literal

from armkin.errors import FileError, UsageError

_APPEND = {"w": "a", "wb": "ab"}


_ROBOT = rb"(?m)^convention[ \t]*:", rb"(?m)^joints[ \t]*:"
_DATA = (".csv", ".jsonl", ".npz", ".parquet")  # table endings: before another one it is not clear which is meant
_HEAD = 2_000_000  # size [bytes] of a file's beginning that is looked at: robot files are shorter
_kept: set[tuple[int, int]] = set()  # device and inode of the files that the running command reads


def protect_input(path: str | os.PathLike[str] | int) -> None:
    """Remember a file that is read: `write_whole` does not replace it, however it is spelled or linked.

    A number is a descriptor: 0 is what standard input comes from.
    """
    with suppress(OSError, ValueError):
        status = os.stat(path)
        if stat.S_ISREG(status.st_mode):
            _kept.add((status.st_dev, status.st_ino))


def forget_inputs() -> None:
    """Forget what was kept: a new command begins."""
    _kept.clear()


@contextmanager
def write_whole(
    path: str | os.PathLike[str], mode: Literal["w", "wb"] = "w", *, corrects: bool = False
) -> Iterator[IO[Any]]:
    """Open a file for writing that takes its name only when all of it is written.

    The text (UTF-8) or bytes go to a temporary file in the same folder, which is renamed at the end and
    removed if the block raises; a file of that name stays as it was until then. What is not a regular
    file (a pipe, /dev/null) is written as it stands, and so is what stdout or stderr are redirected to.
    corrects: the file is a robot file that somebody was asked about. Raises FileError, also for a full disk or a
    file that may not be written; else UsageError for a robot file, and for a file that the command reads.
    """
    name = os.fspath(path)
    if "\0" in name:
        raise FileError(f"{name!r}: cannot write: a name has no null bytes", file=name)
    try:
        real = os.path.realpath(name)  # through a link: what it points to is replaced, not the link
        status = os.stat(real) if os.path.exists(real) else None
        if status is not None and (not stat.S_ISREG(status.st_mode) or _is_stream(status)):
            with _open(real, _APPEND[mode] if stat.S_ISREG(status.st_mode) else mode) as file:
                yield file
            return
        if status is not None:
            _check_replaceable(name, real, status, corrects=corrects)
        import tempfile  # needed for writing alone: it takes a millisecond

        handle, temporary = tempfile.mkstemp(prefix=".armkin-", suffix=".part", dir=os.path.dirname(real))
        try:
            with _open(handle, mode) as file:
                yield file
            os.chmod(temporary, _permissions(real))
            os.replace(temporary, real)
        except BaseException:
            with suppress(OSError):
                os.unlink(temporary)
            raise
    except OSError as error:
        lost = error.errno == errno.ENOENT and os.path.dirname(name)
        why = f"there is no folder {lost}" if lost else error.strerror or error
        raise FileError(f"{name}: cannot write: {why}", file=name) from None


def check_writable(path: str | os.PathLike[str]) -> None:
    """Raise what `write_whole` would of a name: before long work, not after it."""
    name = os.fspath(path)
    if "\0" in name:
        raise FileError(f"{name!r}: cannot write: a name has no null bytes", file=name)
    real = os.path.realpath(name)
    try:
        if os.path.exists(real) and stat.S_ISREG((status := os.stat(real)).st_mode) and not _is_stream(status):
            _check_replaceable(name, real, status)
    except OSError as error:
        raise FileError(f"{name}: cannot write: {error.strerror or error}", file=name) from None
    folder = os.path.dirname(real)
    if not os.path.isdir(folder):
        raise FileError(f"{name}: cannot write: there is no folder {os.path.dirname(name)}", file=name)


def file_ending(path: str | os.PathLike[str], content: str, allowed: Sequence[str], *, may_lack: bool = False) -> str:
    """The ending of a file's name, in lower case: what the file is written as, one of `allowed`.

    content: such a file's content with its verb, for the message. may_lack: a name without an ending will do, too, and
    gives ""; so does a pipe or device, whatever its name. Raises UsageError for another ending, and for two.

    >>> file_ending("poses.NPZ", "rows are", (".csv", ".npz"))
    '.npz'
    """
    name = os.fspath(path)
    stem, end = os.path.splitext(name.lower())
    before = os.path.splitext(stem)[1]
    if may_lack and (not end or (os.path.exists(name) and not os.path.isfile(name))):
        return ""
    if end not in allowed:
        *earlier, last = allowed
        kinds, them = (f"{', '.join(earlier)} or {last}", "one of them") if earlier else (last, "that")
        raise UsageError(f"{name}: {content} written as {kinds}; end the file's name with {them}")
    if before in (*allowed, *_DATA):
        raise UsageError(f"{name}: its name has two endings, {before} and {end}; end it with one of them")
    return end


def _is_stream(status: os.stat_result) -> bool:
    """Whether a file is what stdout or stderr are redirected to: writing to /dev/stdout that goes to a log."""
    for number in (1, 2):
        with suppress(OSError):
            if os.path.samestat(status, os.fstat(number)):
                return True
    return False


def _check_replaceable(name: str, real: str, status: os.stat_result, *, corrects: bool = False) -> None:
    """Raise an error where the file is read-only, a robot file, or read by this command."""
    if not status.st_mode & 0o222:
        raise FileError(f"{name}: cannot write: it is read-only; give another name", file=name)
    if corrects:
        return
    with open(real, "rb") as file:
        head = file.read(_HEAD)
    if all(re.search(key, head) for key in _ROBOT):
        raise UsageError(f"{name} is a robot file, which no output replaces; give another name", file=name)
    if (status.st_dev, status.st_ino) in _kept:
        raise UsageError(f"{name} is what this command reads; give the output another name", file=name)


def _open(file: str | int, mode: str) -> IO[Any]:
    if "b" in mode:
        return open(file, mode)
    return open(file, mode, encoding="utf-8", newline="\n")


def _permissions(path: str) -> int:
    """Permissions of the file that is replaced, or what the umask leaves of rw-rw-rw-."""
    with suppress(OSError):
        return stat.S_IMODE(os.stat(path).st_mode)
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask
