"""A board's image onto it: which boot loader its chip has, what answers there, and the board's own word at the end."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from armkin.board.firmware.wire.session import Session
from armkin.board.ports import SerialPort, list_ports
from armkin.board_catalogue import BOARDS, board_name
from armkin.errors import LinkError
from armkin.flash import avrdude, boot_drive, intel_hex
from armkin.flash.firmware_images import Image
from armkin.flash.stk500v1 import Stk500v1
from armkin.flash.stk500v2 import Stk500v2

_LOADERS: dict[str, type[Stk500v1] | type[Stk500v2]] = {"atmega328p": Stk500v1, "atmega2560": Stk500v2}
_SIGNATURES = {
    bytes.fromhex("1e950f"): "atmega328p",
    bytes.fromhex("1e9514"): "atmega328p",  # the 328 without P, on some clones
    bytes.fromhex("1e9516"): "atmega328p",  # and the PB
    bytes.fromhex("1e9801"): "atmega2560",
}
_LISTENS = 1.6  # [s] after a reset that a boot loader is asked for
_CALLS = 3  # resets after which one that answers and then says no more is given up
_TO_BOOT_DRIVE = 1200  # baud: opening its port so sends a Pico to its boot drive
_RESTART = 10.0  # [s] that a Pico may take to show its serial port again

Loader = Stk500v1 | Stk500v2
Tick = Callable[[int, int], None]


class FlashResult(NamedTuple):
    """What was written, and what the board then said."""

    port: str | None  # where the board answers; None: a Pico whose port has not come yet
    bytes: int
    uploader: str  # armkin, avrdude or UF2
    firmware: str | None  # version, as the board says it


def upload(image: Image, port: str, tick: Tick = lambda done, total: None) -> FlashResult:
    """Write a board's image through a port (a Pico: or the folder of its boot drive), and ask the board what it is.

    tick: is told the bytes written and read back so far, 0 when the boot loader has been found, and how many these
    will be. Raises LinkError, saying what was written: a boot loader stays where it is, so that the same command may be
    repeated.
    """
    chip = BOARDS[image.kind].chip
    if chip not in _LOADERS:
        return _to_boot_drive(image, port, tick)
    flash = intel_hex.read(image.data.decode("ascii"))
    total = 2 * len(flash)
    loader, link, baud = _loader(chip, image.kind, port)
    tick(0, total)
    program = avrdude.program()
    try:
        if program is None:
            _write(loader, flash, tick)
    finally:
        link.close()
    if program is not None:
        try:
            avrdude.write(program, chip, port, baud, image.path, lambda share: tick(round(share * total), total))
        except LinkError as error:
            raise _interrupted(str(error), "some") from None
        tick(total, total)
    return FlashResult(port, len(flash), "avrdude" if program else "armkin", _answered_version(image.kind, port))


def _loader(chip: str, kind: str, port: str) -> tuple[Loader, SerialPort, int]:
    """The boot loader that answers, its open port and the port's rate."""
    wanted = _LOADERS[chip]
    others = [other for other in _LOADERS.values() if other is not wanted]
    for make, baud in [(loader, baud) for loader in (wanted, *others) for baud in loader.bauds]:
        link = SerialPort(port, baud)
        try:
            if heard := _heard(make, link):
                loader, found = heard
                if _SIGNATURES.get(found) == chip:
                    return loader, link, baud
                name = _SIGNATURES.get(found, f"of signature {found.hex(' ')}")
                fitting = [board.kind for board in BOARDS.values() if board.chip == name]
                raise LinkError(
                    f"the chip on {port} is an {name}; {kind} is for an {chip}: nothing was written\n"
                    f"boards with such a chip: {', '.join(fitting) or 'armkin has firmware for none with it'}"
                )
        except BaseException:
            link.close()
            raise
        link.close()
    raise LinkError(
        f"no boot loader answers on {port} after a reset: nothing was written\n"
        "is it the right port (armkin ports), an Arduino with its boot loader, and a cable that carries data?"
    )


def _heard(make: type[Stk500v1] | type[Stk500v2], link: SerialPort) -> tuple[Loader, bytes] | None:
    """The boot loader behind a port, and its chip's signature; None if none answers.

    One whose answer came late has been called twice, may have heard that in part and say no more: the board is reset.
    """
    for _ in range(_CALLS):
        link.restart()
        loader = make(link)
        if not loader.answers(time.monotonic() + _LISTENS):
            return None
        with suppress(LinkError):
            return loader, loader.signature()
    return None


def _write(loader: Loader, flash: bytes, tick: Tick) -> None:
    """Write the flash's bytes, then compare them."""
    size = loader.page
    pages = [(at, flash[at : at + size].ljust(size, b"\xff")) for at in range(0, len(flash), size)]
    at = 0
    try:
        for at, page in pages:
            loader.write(at, page)
            tick(min(at + size, len(flash)), 2 * len(flash))
        for at, page in pages:
            if loader.read(at, size) != page:
                raise LinkError(f"the flash at byte {at} is not what was written")
            tick(len(flash) + min(at + size, len(flash)), 2 * len(flash))
        loader.leave()
    except (LinkError, KeyboardInterrupt) as error:
        raise _interrupted(str(error) or "stopped", f"{at}") from None


def _interrupted(reason: str, progress: str) -> LinkError:
    return LinkError(
        f"{reason.splitlines()[0]}: {progress} bytes were written, so that the board has no whole program now\n"
        "its boot loader stays: the same command writes it again"
    )


def _to_boot_drive(image: Image, port: str, tick: Tick) -> FlashResult:
    folder = Path(port)
    if not folder.is_dir():
        SerialPort(port, _TO_BOOT_DRIVE).close()
        folder = boot_drive.appearing()
    before = {found.device for found in list_ports()}
    boot_drive.write(folder, image.path.name, image.data)
    tick(len(image.data), len(image.data))
    end = time.monotonic() + _RESTART
    while time.monotonic() < end:
        new = [found.device for found in list_ports() if found.device == port or found.device not in before]
        if new:
            return FlashResult(new[0], len(image.data), "UF2", _answered_version(image.kind, new[0]))
        time.sleep(0.1)
    return FlashResult(None, len(image.data), "UF2", None)


def _answered_version(kind: str, port: str) -> str:
    """The firmware's version, of the board that was meant. Raises LinkError for another one, or none."""
    link = SerialPort(port)
    try:
        info = Session(link).open()
    finally:
        link.close()
    if info.board != BOARDS[kind].number:
        raise LinkError(f"written, but the board on {port} says that it is {board_name(info.board)}, not {kind}")
    return ".".join(map(str, info.firmware))
