"""Writes files completely or not at all, and never over a robot file or a file that the command reads."""

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
_DATA = (".csv", ".jsonl", ".npz", ".parquet")  # endings of tables; before another ending the format is ambiguous
_HEAD = 2_000_000  # size [bytes] of the beginning that is searched for a robot file's keys
_kept: set[tuple[int, int]] = set()  # device and inode of the files that the running command reads


def protect_input(path: str | os.PathLike[str] | int) -> None:
    """Remember a file that is read: `write_whole` does not replace it, however it is spelled or linked.

    A number is a file descriptor, such as 0 for standard input.
    """
    with suppress(OSError, ValueError):
        status = os.stat(path)
        if stat.S_ISREG(status.st_mode):
            _kept.add((status.st_dev, status.st_ino))


def forget_inputs() -> None:
    """Forget the files of the previous command."""
    _kept.clear()


@contextmanager
def write_whole(
    path: str | os.PathLike[str], mode: Literal["w", "wb"] = "w", *, corrects: bool = False
) -> Iterator[IO[Any]]:
    """Open a file for writing that gets its name only after it is written completely.

    The text (UTF-8) or bytes go to a temporary file in the same folder, which is renamed at the end and
    removed if the block raises; an existing file stays unchanged until then. Pipes, devices and files to
    which stdout or stderr are redirected are written directly.
    corrects: the file is a robot file that the user has agreed to replace. Raises FileError, also for a full disk or a
    file that may not be written; else UsageError for a robot file, and for a file that the command reads.
    """
    name = os.fspath(path)
    if "\0" in name:
        raise FileError(f"{name!r}: cannot write: a name has no null bytes", file=name)
    try:
        real = os.path.realpath(name)  # replace the target of a link, not the link
        status = os.stat(real) if os.path.exists(real) else None
        if status is not None and (not stat.S_ISREG(status.st_mode) or _is_stream(status)):
            with _open(real, _APPEND[mode] if stat.S_ISREG(status.st_mode) else mode) as file:
                yield file
            return
        if status is not None:
            _check_replaceable(name, real, status, corrects=corrects)
        import tempfile  # imported here, as it takes a millisecond and is needed only for writing

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
        missing_folder = error.errno == errno.ENOENT and os.path.dirname(name)
        reason = f"there is no folder {missing_folder}" if missing_folder else error.strerror or error
        raise FileError(f"{name}: cannot write: {reason}", file=name) from None


def check_writable(path: str | os.PathLike[str]) -> None:
    """Raise the errors of `write_whole` for a name, before a long computation instead of after it."""
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
    """The ending of a file's name in lower case, which has to be one of `allowed`.

    content: such a file's content with its verb, for the message. may_lack: a name without an ending will do, too, and
    gives ""; so does a pipe or device, whatever its name. Raises UsageError for another ending, and for two.

    >>> file_ending("poses.NPZ", "rows are", (".csv", ".npz"))
    '.npz'
    """
    name = os.fspath(path)
    stem, ending = os.path.splitext(name.lower())
    inner_ending = os.path.splitext(stem)[1]
    if may_lack and (not ending or (os.path.exists(name) and not os.path.isfile(name))):
        return ""
    if ending not in allowed:
        *earlier, last = allowed
        kinds, pronoun = (f"{', '.join(earlier)} or {last}", "one of them") if earlier else (last, "that")
        raise UsageError(f"{name}: {content} written as {kinds}; end the file's name with {pronoun}")
    if inner_ending in (*allowed, *_DATA):
        raise UsageError(f"{name}: its name has two endings, {inner_ending} and {ending}; end it with one of them")
    return ending


def _is_stream(status: os.stat_result) -> bool:
    """Whether stdout or stderr are redirected to a file, which is then written through /dev/stdout."""
    for number in (1, 2):
        with suppress(OSError):
            if os.path.samestat(status, os.fstat(number)):
                return True
    return False


def _check_replaceable(name: str, real: str, status: os.stat_result, *, corrects: bool = False) -> None:
    """Raise an error if the file is read-only, a robot file, or an input of this command."""
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
    """Permissions of the replaced file, or rw-rw-rw- reduced by the umask."""
    with suppress(OSError):
        return stat.S_IMODE(os.stat(path).st_mode)
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask
