"""The scene that a port was last used with: a note beside its lock, so that no motion forgets the table."""

from __future__ import annotations

import os
from contextlib import suppress

from armkin.board.ports.port_lock import note_path

_MAX_BYTES = 4096  # length [bytes], at most, of a file's name


def write_scene(port: str, scene: str) -> None:
    """Note the scene's file."""
    path = _scene_note_path(port)
    with suppress(OSError):
        os.unlink(path)  # whatever stands there, and be it a link to somewhere else
    with open(path, "x", encoding="utf-8") as file:
        file.write(os.path.abspath(scene))


def last_scene(port: str) -> str:
    """The file that was noted last; empty if there is none."""
    try:
        with open(_scene_note_path(port), encoding="utf-8") as file:
            return file.read(_MAX_BYTES)
    except (OSError, ValueError):
        return ""


def forget_scene(port: str) -> None:
    """Forget it."""
    with suppress(OSError):
        os.unlink(_scene_note_path(port))


def _scene_note_path(port: str) -> str:
    return f"{note_path(port)}.scene"
