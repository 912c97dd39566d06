"""avrdude, where it is on PATH."""

import os
import shutil
import subprocess
import threading
from collections.abc import Callable
from pathlib import Path

from armkin.errors import LinkError

_PROGRAMMERS = {"atmega328p": "arduino", "atmega2560": "wiring"}
_BAR = 50  # marks of avrdude's progress bar
_MAX_SECONDS = 120.0  # time [s] that an upload may take; an Uno takes 7


def find_avrdude() -> str | None:
    """The path of avrdude; None if it is not installed."""
    return shutil.which("avrdude")


def write_image(
    program: str, chip: str, port: str, baud: int, image: Path, tick: Callable[[float], None] = lambda share: None
) -> None:
    """Write an image and compare it with what the flash then holds; tick: is told the share that is done.

    Raises LinkError with avrdude's own words.
    """
    command = [program, "-D", "-c", _PROGRAMMERS[chip], "-p", chip, "-P", port, "-b", str(baud)]
    command += ["-U", f"flash:w:{image}:i"]
    try:
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    except OSError as error:
        raise LinkError(f"avrdude does not start: {error.strerror}") from None
    timer = threading.Timer(_MAX_SECONDS, process.kill)
    timer.start()
    with process:
        try:
            text = _read_output(process, tick)
        except BaseException:
            process.kill()
            raise
        finally:
            in_time = timer.is_alive()
            timer.cancel()
    if not in_time:
        raise LinkError(f"avrdude did not end within {_MAX_SECONDS:.0f} s")
    if process.returncode:
        lines = [line for line in text.splitlines() if line.strip() and "#" not in line]
        complaints = [line for line in lines if "rror" in line and "ioctl" not in line]
        complaint = (complaints or lines[-1:] or ["it failed"])[0]
        raise LinkError(f"avrdude: {complaint.removeprefix('avrdude').lstrip(': ')}")


def _read_output(process: subprocess.Popen[bytes], tick: Callable[[float], None]) -> str:
    """What avrdude says until its end; it draws a bar while it writes, and one while it compares."""
    assert process.stderr is not None
    output = b""
    while piece := os.read(process.stderr.fileno(), 4096):
        output += piece
        if b"#" in piece:
            tick(min(1.0, output.partition(b"Writing |")[2].count(b"#") / (2 * _BAR)))
    return output.decode(errors="replace")
