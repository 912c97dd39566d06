"""Images of the firmware: installed whole, or said to be missing; and the files that they are."""

from __future__ import annotations

import hashlib
import io
import sys
from pathlib import Path
from typing import cast

import pytest

from armkin.board.ports import Port, SerialPort
from armkin.errors import LinkError, MissingExtraError
from armkin.flash import avrdude, boot_drive, firmware_images, intel_hex, stk500v1, upload_firmware
from armkin.flash.firmware_images import Image
from armkin.flash.stk500v1 import Stk500v1
from armkin.flash.upload_firmware import upload
from command_line import run

UF2 = b"UF2\n" * 30_000


def test_a_clone_without_images_says_how_they_come(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(firmware_images.image, "__defaults__", (tmp_path,))
    completed = run("flash", "three_dof", "--port", "/dev/null")
    assert completed.code == 1
    assert "scripts/release builds it" in completed.err
    assert "no firmware for uno_cnc_shield" in completed.err


@pytest.mark.parametrize("sums", ["", "00 uno_servos.hex\n", "uno_servos.hex\n", "\x00\xff"])
def test_an_image_that_is_not_what_was_built_is_refused(sums: str, tmp_path: Path) -> None:
    (tmp_path / "uno_servos.hex").write_text(":00000001FF\n")
    (tmp_path / "SHA256SUMS").write_text(sums)
    with pytest.raises(MissingExtraError):
        firmware_images.image("uno_servos", tmp_path)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "which board?"),
        (("puma560",), "puma560 names no board"),
        (("--board", "uno"), "armkin has no firmware for 'uno'"),
        (("--board", "grbl"), "armkin has no firmware for 'grbl'"),
        (("three_dof", "--board", "pico6"), "three_dof's board is uno_cnc_shield, and --board says pico6"),
    ],
)
def test_what_board_it_is_has_to_be_plain(words: tuple[str, ...], message: str) -> None:
    completed = run("flash", *words, "--port", "/dev/null")
    assert completed.code == 2
    assert message in completed.err


def test_records_of_intel_hex_lie_where_they_say() -> None:
    two = ":04001000DEADBEEFB4\n:020000021000EC\n:020002001234B6\n:00000001FF\n"
    flash = intel_hex.parse_intel_hex(two)
    assert flash[0x10:0x14].hex() == "deadbeef"
    assert flash[0x10002:].hex() == "1234"
    assert set(flash[:0x10]) == {255}


@pytest.mark.parametrize("text", ["", ":", "0400", ":04001000DEADBEEFB5\n:00000001FF", ":04001000DEADBEEFB4", "hello"])
def test_what_is_no_intel_hex_is_refused(text: str) -> None:
    with pytest.raises(ValueError):
        intel_hex.parse_intel_hex(text)


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    folder = tmp_path / "RPI-RP2"
    folder.mkdir()
    (folder / "INFO_UF2.TXT").write_text("UF2 Bootloader v3.0\nModel: Raspberry Pi RP2\nBoard-ID: RPI-RP2\n")
    return folder


def test_a_picos_boot_drive_gets_the_image(drive: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("armkin.flash.upload_firmware._RESTART", 0.0)
    flashed = upload(Image("pico6", Path("pico6.uf2"), UF2), str(drive))
    assert (drive / "pico6.uf2").read_bytes() == UF2
    assert (flashed.port, flashed.bytes, flashed.uploader) == (None, len(UF2), "UF2")


def test_the_command_says_what_it_copied(drive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "pico6.uf2").write_bytes(UF2)
    (tmp_path / "SHA256SUMS").write_text(f"{hashlib.sha256(UF2).hexdigest()}  pico6.uf2\n")
    monkeypatch.setattr(firmware_images.image, "__defaults__", (tmp_path,))
    monkeypatch.setattr("armkin.flash.upload_firmware._RESTART", 0.0)
    completed = run("flash", "--board", "pico6", "--port", drive, "--json")
    assert completed.json == {"board": "pico6", "port": None, "bytes": len(UF2), "uploader": "UF2", "firmware": None}
    assert "120000 bytes copied" in run("flash", "--board", "pico6", "--port", drive).out


def test_bytes_are_counted_from_when_the_boot_loader_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    class Loader:
        page = 4
        written = b""

        def write(self, address: int, page: bytes) -> None:
            self.written += page

        def read(self, address: int, size: int) -> bytes:
            return self.written[address : address + size]

        def leave(self) -> None: ...

    counted: list[tuple[int, int]] = []
    monkeypatch.setattr(upload_firmware, "_connect_loader", lambda chip, kind, port: (Loader(), io.BytesIO(), 115_200))
    monkeypatch.setattr(upload_firmware, "_answered_version", lambda kind, port: "3.0")
    monkeypatch.setattr(avrdude, "find_avrdude", lambda: None)
    data = b":04001000DEADBEEFB4\n:00000001FF\n"
    upload(
        Image("uno_servos", Path("uno_servos.hex"), data), "port", lambda count, total: counted.append((count, total))
    )
    assert counted == [(count, 40) for count in range(0, 41, 4)]


def test_another_folder_is_no_boot_drive(tmp_path: Path) -> None:
    with pytest.raises(LinkError, match="is no Pico's boot drive"):
        upload(Image("pico6", Path("pico6.uf2"), UF2), str(tmp_path))
    assert not list(tmp_path.iterdir())


def test_a_boot_drive_that_does_not_come_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("armkin.flash.boot_drive.mounted_drives", lambda: iter(()))
    with pytest.raises(LinkError, match="no drive RPI-RP2 appeared"):
        boot_drive.wait_for_drive(seconds=0.2)


def test_an_installed_image_is_what_its_checksum_says(tmp_path: Path) -> None:
    (tmp_path / "pico6.uf2").write_bytes(UF2)
    (tmp_path / "SHA256SUMS").write_text(f"{hashlib.sha256(UF2).hexdigest()}  pico6.uf2\n")
    assert firmware_images.image("pico6", tmp_path).data == UF2


class BootLoader:
    """A port that has one answer to whatever is written."""

    def __init__(self, answer: bytes) -> None:
        self.answer, self.left, self.heard = answer, b"", b""

    def write(self, data: bytes) -> None:
        self.heard, self.left = data, self.answer

    def read(self, timeout: float) -> bytes:
        taken, self.left = self.left, b""
        return taken


def test_an_answer_of_the_boot_loader_is_framed() -> None:
    port = BootLoader(b"\x14\x1e\x95\x0f\x10")
    assert Stk500v1(cast(Port, port)).signature().hex() == "1e950f"
    assert port.heard.hex() == "7520"


@pytest.mark.parametrize("answer", ["151e950f10", "141e950f11", "141e950f00"])
def test_an_answer_of_the_boot_loader_that_is_damaged_is_refused(answer: str) -> None:
    with pytest.raises(LinkError, match=f"the boot loader answered {bytes.fromhex(answer).hex(' ')}"):
        Stk500v1(cast(Port, BootLoader(bytes.fromhex(answer)))).signature()


@pytest.mark.parametrize(("silent", "is_found"), [(2, True), (3, False)])
def test_a_boot_loader_that_was_called_twice_and_is_silent_is_called_anew(
    silent: int, is_found: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a busy computer its first answer comes after a second call, of which it hears a part: it says no more."""

    class Late(BootLoader):
        resets = 0

        def restart(self) -> None:
            self.resets += 1

        def write(self, data: bytes) -> None:
            reply = {b"\x30\x20": b"\x14\x10", b"\x75\x20": b"\x14\x1e\x95\x0f\x10"}[data]
            self.left = b"" if data[0] == 0x75 and self.resets <= silent else reply

    monkeypatch.setattr(stk500v1, "_ANSWER_TIMEOUT", 0.01)
    port = Late(b"")
    heard = upload_firmware._identify_chip(Stk500v1, cast(SerialPort, port))
    assert (heard is not None, port.resets) == (is_found, min(silent + 1, 3))
    assert heard is None or heard[1].hex() == "1e950f"


@pytest.mark.skipif(sys.platform == "win32", reason="a shell plays avrdude")
def test_avrdude_tells_how_far_it_is(tmp_path: Path) -> None:
    program, bar, shares = tmp_path / "avrdude", "#" * 50, list[float]()
    program.write_text(
        f'#!/bin/sh\nfor bar in Reading Writing Reading; do echo "$bar | {bar} |" >&2; sleep 0.05; done\n'
    )
    program.chmod(0o755)
    avrdude.write_image(str(program), "atmega328p", "COM3", 115_200, tmp_path / "x.hex", shares.append)
    assert shares == sorted(shares)
    assert (shares[0], shares[-1]) == (0.0, 1.0)
    program.write_text(f'#!/bin/sh\necho "Reading | {bar} |\navrdude: error: no such port" >&2; exit 1\n')
    with pytest.raises(LinkError, match=r"^avrdude: error: no such port$"):
        avrdude.write_image(str(program), "atmega328p", "COM3", 115_200, tmp_path / "x.hex")
