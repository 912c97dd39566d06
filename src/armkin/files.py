"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import IO, Any, Literal

from armkin.errors import FileError


@contextmanager
def whole(path: str | os.PathLike[str], mode: Literal["w", "wb"] = "w") -> Iterator[IO[Any]]:
    """Open a file for writing that takes its name only when all of it is written.

    The text (UTF-8) or bytes go to a temporary file in the same folder, which is renamed at the end and
    removed if the block raises; a file of that name stays as it was until then. What is not a regular
    file (a pipe, /dev/null) is written as it stands. Raises FileError, also for a full disk.
    """
    name = os.fspath(path)
    if "\0" in name:
        raise FileError(f"{name!r}: cannot write: a name has no null bytes", file=name)
    try:
        real = os.path.realpath(name)  # through a link: what it points to is replaced, not the link
        if os.path.exists(real) and not stat.S_ISREG(os.stat(real).st_mode):
            with _open(real, mode) as file:
                yield file
            return
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
        raise FileError(f"{name}: cannot write: {error.strerror or error}", file=name) from None


def _open(file: str | int, mode: Literal["w", "wb"]) -> IO[Any]:
    if mode == "wb":
        return open(file, "wb")
    return open(file, "w", encoding="utf-8", newline="\n")


def _permissions(path: str) -> int:
    """Those of the file that is replaced, or what the umask leaves of rw-rw-rw-."""
    with suppress(OSError):
        return stat.S_IMODE(os.stat(path).st_mode)
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask
