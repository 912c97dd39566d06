"""A note, beside a port's lock, of the scene that was last used with it, so that no motion omits its keep-outs."""

import os
from contextlib import suppress

from armkin.board.ports.port_lock import note_path

_MAX_BYTES = 4096  # longest file name [bytes]


def write_scene(port: str, scene: str) -> None:
    """Write the name of the scene's file."""
    path = _scene_note_path(port)
    with suppress(OSError):
        os.unlink(path)  # also removes a link to another place
    with open(path, "x", encoding="utf-8") as file:
        file.write(os.path.abspath(scene))


def last_scene(port: str) -> str:
    """The name of the last scene's file; empty if there is none."""
    try:
        with open(_scene_note_path(port), encoding="utf-8") as file:
            return file.read(_MAX_BYTES)
    except (OSError, ValueError):
        return ""


def forget_scene(port: str) -> None:
    """Delete the note."""
    with suppress(OSError):
        os.unlink(_scene_note_path(port))


def _scene_note_path(port: str) -> str:
    return f"{note_path(port)}.scene"
