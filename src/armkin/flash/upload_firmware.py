"""A board's image onto it: which boot loader its chip has, what answers there, and the board's own word at the end."""

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
    bytes.fromhex("1e9516"): "atmega328p",  # the 328PB
    bytes.fromhex("1e9801"): "atmega2560",
}
_LISTEN_TIME = 1.6  # time [s] after a reset in which a boot loader is asked for
_CALLS = 3  # resets after which a boot loader that answers and then says no more is given up
_TO_BOOT_DRIVE = 1200  # rate [bit/s]: opening its port so sends a Pico to its boot drive
_RESTART = 10.0  # time [s] that a Pico may take to show its serial port again

Loader = Stk500v1 | Stk500v2
Tick = Callable[[int, int], None]


class FlashResult(NamedTuple):
    """What was written, and what the board then said."""

    port: str | None  # where the board answers; None: a Pico whose port has not come yet
    bytes: int
    uploader: str  # armkin, avrdude or UF2
    firmware: str | None  # version, as the board says it


def upload(image: Image, port: str, tick: Tick = lambda written, total: None) -> FlashResult:
    """Write a board's image through a port (a Pico: or the folder of its boot drive), and ask the board what it is.

    tick: is told the bytes written and read back so far, 0 when the boot loader has been found, and how many these
    will be. Raises LinkError, saying what was written: a boot loader stays where it is, so that the same command may be
    repeated.
    """
    chip = BOARDS[image.kind].chip
    if chip not in _LOADERS:
        return _to_boot_drive(image, port, tick)
    flash = intel_hex.parse_intel_hex(image.data.decode("ascii"))
    total = 2 * len(flash)
    loader, link, baud = _connect_loader(chip, image.kind, port)
    tick(0, total)
    program = avrdude.find_avrdude()
    try:
        if program is None:
            _write_and_compare(loader, flash, tick)
    finally:
        link.close()
    if program is not None:
        try:
            avrdude.write_image(program, chip, port, baud, image.path, lambda share: tick(round(share * total), total))
        except LinkError as error:
            raise _interruption_error(str(error), "some") from None
        tick(total, total)
    return FlashResult(port, len(flash), "avrdude" if program else "armkin", _answered_version(image.kind, port))


def _connect_loader(chip: str, kind: str, port: str) -> tuple[Loader, SerialPort, int]:
    """The boot loader that answers, its open port and the port's rate."""
    expected = _LOADERS[chip]
    other_loaders = [candidate for candidate in _LOADERS.values() if candidate is not expected]
    for make, baud in [(loader, baud) for loader in (expected, *other_loaders) for baud in loader.bauds]:
        link = SerialPort(port, baud)
        try:
            if reply := _identify_chip(make, link):
                loader, signature = reply
                if _SIGNATURES.get(signature) == chip:
                    return loader, link, baud
                name = _SIGNATURES.get(signature, f"of signature {signature.hex(' ')}")
                fitting_kinds = [board.kind for board in BOARDS.values() if board.chip == name]
                raise LinkError(
                    f"the chip on {port} is an {name}; {kind} is for an {chip}: nothing was written\n"
                    f"boards with such a chip: {', '.join(fitting_kinds) or 'armkin has firmware for none with it'}"
                )
        except BaseException:
            link.close()
            raise
        link.close()
    raise LinkError(
        f"no boot loader answers on {port} after a reset: nothing was written\n"
        "is it the right port (armkin ports), an Arduino with its boot loader, and a cable that carries data?"
    )


def _identify_chip(make: type[Stk500v1] | type[Stk500v2], link: SerialPort) -> tuple[Loader, bytes] | None:
    """The boot loader behind a port, and its chip's signature; None if none answers.

    One whose answer came late has been called twice, may have heard that in part and say no more: the board is reset.
    """
    for _ in range(_CALLS):
        link.restart()
        loader = make(link)
        if not loader.answers(time.monotonic() + _LISTEN_TIME):
            return None
        with suppress(LinkError):
            return loader, loader.signature()
    return None


def _write_and_compare(loader: Loader, flash: bytes, tick: Tick) -> None:
    """Write the flash's bytes, then compare them."""
    size = loader.page
    pages = [(address, flash[address : address + size].ljust(size, b"\xff")) for address in range(0, len(flash), size)]
    address = 0
    try:
        for address, page in pages:
            loader.write(address, page)
            tick(min(address + size, len(flash)), 2 * len(flash))
        for address, page in pages:
            if loader.read(address, size) != page:
                raise LinkError(f"the flash at byte {address} is not what was written")
            tick(len(flash) + min(address + size, len(flash)), 2 * len(flash))
        loader.leave()
    except (LinkError, KeyboardInterrupt) as error:
        raise _interruption_error(str(error) or "stopped", f"{address}") from None


def _interruption_error(reason: str, progress: str) -> LinkError:
    return LinkError(
        f"{reason.splitlines()[0]}: {progress} bytes were written, so that the board has no whole program now\n"
        "its boot loader stays: the same command writes it again"
    )


def _to_boot_drive(image: Image, port: str, tick: Tick) -> FlashResult:
    """Copy an image to a board's drive; the port on which it then answers."""
    folder = Path(port)
    if not folder.is_dir():
        SerialPort(port, _TO_BOOT_DRIVE).close()
        folder = boot_drive.wait_for_drive()
    before = {port_info.device for port_info in list_ports()}
    boot_drive.copy_image(folder, image.path.name, image.data)
    tick(len(image.data), len(image.data))
    deadline = time.monotonic() + _RESTART
    while time.monotonic() < deadline:
        ports = [
            port_info.device for port_info in list_ports() if port_info.device == port or port_info.device not in before
        ]
        if ports:
            return FlashResult(ports[0], len(image.data), "UF2", _answered_version(image.kind, ports[0]))
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
