"""This user's folders, where the system's habit has them: what was compiled, and what is noted of ports.

Linux: ``$XDG_CACHE_HOME`` or ``~/.cache``, ``$XDG_STATE_HOME`` or ``~/.local/state``; macOS: ``~/Library``; Windows:
``%LOCALAPPDATA%``.
"""

import os
import sys
import tempfile
from contextlib import suppress
from pathlib import Path


def compiled_folder() -> Path | None:
    """Where libraries are kept that were built for an arm; None where the user has no such place."""
    from platformdirs import user_cache_path

    folder = user_cache_path("armkin", appauthor=False) / "compiled"
    return folder if folder.is_absolute() else None  # a relative one would be whatever folder somebody stands in


def port_file_stem(key: str) -> str:
    """The beginning of the names of a port's files: its lock, and what is noted of the board behind it.

    They outlive a login, as the arm does. Where the user has no folder, as a service, they lie among temporary files.
    """
    from platformdirs import user_state_path

    folder = user_state_path("armkin", appauthor=False) / "ports"
    with suppress(OSError):  # a file in the way, a full or read-only disk
        if folder.is_absolute():
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if os.access(folder, os.W_OK):
                return str(folder / key)
    user = "user"  # on Windows the folder is the user's own
    if sys.platform != "win32":
        user = str(os.getuid())
    return os.path.join(tempfile.gettempdir(), f"armkin-{user}-{key}")
