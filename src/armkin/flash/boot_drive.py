"""The drive that a Pico is while BOOTSEL was held, or after its firmware was asked for it: a UF2 file is copied there.

Raspberry Pi Ltd, RP2040 datasheet, 2.8.4; https://github.com/microsoft/uf2 (INFO_UF2.TXT).
"""

import os
import string
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from armkin.errors import LinkError

_INFO = "INFO_UF2.TXT"
_CHIP = "RPI-RP2"  # name of the chip in the drive's line Board-ID, and of the drive
_APPEARS = 20.0  # time [s] that a system may take to mount the drive


def is_boot_drive(folder: Path) -> bool:
    """Whether a Pico waits there for its program."""
    with suppress(OSError):
        return _CHIP in (folder / _INFO).read_text("ascii", errors="replace")
    return False


def mounted_drives() -> Iterator[Path]:
    """Boot drives where systems mount them."""
    places = [Path(f"{letter}:/") for letter in string.ascii_uppercase] if sys.platform == "win32" else []
    for pattern in ("Volumes/*", "media/*", "media/*/*", "run/media/*/*"):
        places += sorted(Path("/").glob(pattern)) if sys.platform != "win32" else []
    return filter(is_boot_drive, places)


def wait_for_drive(seconds: float = _APPEARS) -> Path:
    """The boot drive, once it is mounted. Raises LinkError if none is within `seconds`, or several are."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        drives = list(mounted_drives())
        if len(drives) == 1:
            return drives[0]
        if drives:
            raise LinkError(f"{len(drives)} boot drives ({', '.join(map(str, drives))}): name one of them")
        time.sleep(0.1)
    raise LinkError(
        f"no drive {_CHIP} appeared within {seconds:.0f} s: mount it, then name its folder as the port\n"
        "a Pico without armkin's firmware shows it when BOOTSEL is held while it is plugged in"
    )


def copy_image(folder: Path, name: str, data: bytes) -> None:
    """Copy a UF2 file there. The Pico starts it, and the drive is gone, as soon as all of it has come."""
    if not is_boot_drive(folder):
        raise LinkError(
            f"{folder} is no Pico's boot drive: it has no {_INFO} that says {_CHIP}\n"
            "hold BOOTSEL while you plug the Pico in, or name the serial port of one that runs armkin"
        )
    written_count = 0
    try:
        with (folder / name).open("wb", buffering=0) as file:
            while written_count < len(data):
                written_count += file.write(data[written_count : written_count + 65536])
            with suppress(OSError):  # the drive goes when it has all
                os.fsync(file.fileno())
    except OSError as error:
        if written_count < len(data):
            raise LinkError(
                f"{folder}: {error.strerror} after {written_count} of {len(data)} bytes; "
                "the same command writes it again"
            ) from None
