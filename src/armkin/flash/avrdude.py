"""avrdude, where it is on PATH."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

from armkin.errors import LinkError

_PROGRAMMERS = {"atmega328p": "arduino", "atmega2560": "wiring"}
_LONGEST = 120.0  # [s]; an Uno takes 7


def program() -> str | None:
    """Its path."""
    return shutil.which("avrdude")


def write(program: str, chip: str, port: str, baud: int, image: Path) -> None:
    """Write an image and compare it with what the flash then holds. Raises LinkError with avrdude's own words."""
    command = [program, "-q", "-D", "-c", _PROGRAMMERS[chip], "-p", chip, "-P", port, "-b", str(baud)]
    try:
        done = subprocess.run(
            [*command, "-U", f"flash:w:{image}:i"], capture_output=True, text=True, errors="replace", timeout=_LONGEST
        )
    except subprocess.TimeoutExpired:
        raise LinkError(f"avrdude did not end within {_LONGEST:.0f} s") from None
    except OSError as error:
        raise LinkError(f"avrdude does not start: {error.strerror}") from None
    if done.returncode:
        said = [line for line in done.stderr.splitlines() if "rror" in line and "ioctl" not in line]
        raise LinkError(f"avrdude: {said[0] if said else done.stderr.strip()[-200:]}")
