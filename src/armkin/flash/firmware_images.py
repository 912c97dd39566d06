"""The firmware's images: built by `scripts/release`, in the wheel beside this file, each with its checksum."""

import hashlib
from pathlib import Path
from typing import NamedTuple

from armkin.board_catalogue import BOARDS
from armkin.errors import MissingExtraError

FOLDER = Path(__file__).parent / "images"
SUMS = "SHA256SUMS"  # name of the file of sums, as sha256sum writes and checks it
ENDINGS = {"rp2040": "uf2"}  # endings of a chip's images; other chips': hex


class Image(NamedTuple):
    """The program of one board."""

    kind: str  # as `board: {kind: ...}` in a robot file
    path: Path
    data: bytes


def file_name(kind: str) -> str:
    """The image's name: ``uno_servos.hex``."""
    return f"{kind}.{ENDINGS.get(BOARDS[kind].chip, 'hex')}"


def image(kind: str, folder: Path = FOLDER) -> Image:
    """The image of a board. Raises MissingExtraError where it is not installed, or is not what was built."""
    path = folder / file_name(kind)
    try:
        lines = (folder / SUMS).read_text("ascii").splitlines()
        sums = {name: digest for digest, name in (line.split() for line in lines)}
        content = path.read_bytes()
    except (OSError, ValueError):
        raise MissingExtraError(
            f"this armkin holds no firmware for {kind}: it was installed from a clone, not from a release\n"
            "pip install armkin brings it; in a clone scripts/release builds it, or make -C firmware flash compiles it"
        ) from None
    if sums.get(path.name) != hashlib.sha256(content).hexdigest():
        raise MissingExtraError(
            f"{path} is not the image that this release was built with: its checksum differs\n"
            "installing armkin again brings it back; nothing was written to the board"
        )
    return Image(kind, path, content)
