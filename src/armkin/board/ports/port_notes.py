"""Small files beside a port's lock that outlive the process: a motion in progress, the state of a board."""

import json
import os
from collections.abc import Mapping
from contextlib import suppress
from typing import Any


def write_note(path: str, note: Mapping[str, Any]) -> None:
    """Replace a note in one step; errors, such as a full disk, are ignored for the sake of the motion."""
    draft = f"{path}.{os.getpid()}"
    with suppress(OSError):
        remove_note(draft)
        handle = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(handle, "w", encoding="ascii") as file:
            json.dump(note, file)
        os.replace(draft, path)  # replaces a link of that name instead of following it


def read_note(path: str, max_bytes: int) -> dict[str, Any] | None:
    """The note of at most `max_bytes`, if this user wrote it; else None."""
    try:
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0))
        with os.fdopen(handle, encoding="ascii") as file:
            if hasattr(os, "getuid") and os.fstat(file.fileno()).st_uid != os.getuid():
                return None
            note = json.loads(file.read(max_bytes))
    except (OSError, ValueError, RecursionError):
        return None
    return note if isinstance(note, dict) else None


def remove_note(path: str) -> None:
    """Delete a note."""
    with suppress(OSError):
        os.unlink(path)
