"""`armkin flash` against the boot loaders that Arduinos have, on the emulated chips."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from emulator import MCU, EmulatedBoard, build_firmware

from armkin.board_catalogue import BOARDS
from armkin.flash import firmware_images
from command_line import run, run_patiently

LOADERS = Path("/usr/share/arduino/hardware/arduino/avr/bootloaders")
KINDS = ("uno_cnc_shield", "mega_ramps14")
Make = Callable[[str], EmulatedBoard]


@pytest.fixture(scope="session")
def built_images(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Images as scripts/release makes them."""
    folder = tmp_path_factory.mktemp("images")
    for kind in KINDS:
        (folder / firmware_images.file_name(kind)).write_bytes(build_firmware(kind).with_suffix(".hex").read_bytes())
    sums = subprocess.run("sha256sum *.hex > SHA256SUMS", shell=True, cwd=folder, check=True)
    assert sums.returncode == 0
    return folder


@pytest.fixture(scope="session")
def optiboot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """optiboot from its source, into a boot section of 1 kB: Debian's compiler makes more than 512 bytes of it."""
    elf = tmp_path_factory.mktemp("optiboot") / "optiboot.elf"
    options = ["-Os", "-fno-split-wide-types", "-mrelax", f"-mmcu={MCU['uno_servos']}", "-DF_CPU=16000000L"]
    options += ["-DLED_START_FLASHES=3", "-DBAUD_RATE=115200", "-nostartfiles", "-nostdlib", "-Wl,--relax"]
    places = ["-Wl,--section-start=.text=0x7c00", "-Wl,--section-start=.version=0x7ffe"]
    source = LOADERS / "optiboot/optiboot.c"
    subprocess.run(["avr-gcc", *options, *places, "-o", str(elf), str(source)], check=True, capture_output=True)
    parts = ["-j", ".text", "-j", ".data", "-j", ".version", "--set-section-flags", ".version=alloc,load"]
    subprocess.run(["avr-objcopy", *parts, "-O", "ihex", str(elf), str(elf.with_suffix(".hex"))], check=True)
    return elf.with_suffix(".hex")


@pytest.fixture(scope="session")
def loaders(optiboot: Path) -> dict[str, Path]:
    """Of each chip."""
    return {"atmega328p": optiboot, "atmega2560": LOADERS / "stk500v2/stk500boot_v2_mega2560.hex"}


@pytest.fixture
def empty_board(loaders: dict[str, Path]) -> Make:
    """A board of some kind with nothing but its boot loader."""
    return lambda kind: EmulatedBoard(kind, loader=loaders[BOARDS[kind].chip], speed="max")


@pytest.fixture(autouse=True)
def _images_installed(built_images: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("armkin.flash.firmware_images.FOLDER", built_images)
    monkeypatch.setattr(firmware_images.image, "__defaults__", (built_images,))


@pytest.fixture
def without_avrdude(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("armkin.flash.avrdude.find_avrdude", lambda: None)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("uploader", ["armkin", "avrdude"])
def test_an_empty_board_runs_armkin(
    kind: str, uploader: str, empty_board: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    if uploader == "armkin":
        monkeypatch.setattr("armkin.flash.avrdude.find_avrdude", lambda: None)
    with empty_board(kind) as board:
        completed = run_patiently("flash", "--board", kind, "--port", board.port, "--json")
        assert completed.code == 0, completed.err
        answer = completed.json
        assert (answer["board"], answer["uploader"], answer["firmware"]) == (kind, uploader, "2.0")
        assert 20_000 < answer["bytes"] < 32_000
        if kind == "uno_cnc_shield":  # and a motor turns: its second command
            assert run_patiently("send", "three_dof", 1, 90, -90, "--port", board.port, "--assume-home").code == 0
            assert board.stats()["axes"]["X"]["net"] != 0


@pytest.mark.usefixtures("without_avrdude")
def test_a_cut_in_the_middle_is_told_and_the_same_command_repeats_it(empty_board: Make) -> None:
    command = ("flash", "--board", "uno_cnc_shield", "--port")
    with empty_board("uno_cnc_shield") as board:
        board.control("after 1s cut both")
        completed = run(*command, board.port)
        assert completed.code == 5
        assert "bytes were written, so that the board has no whole program now" in completed.err
        assert "the same command writes it again" in completed.err
        board.control("restore")
        assert run_patiently(*command, board.port).code == 0


@pytest.mark.parametrize(("named", "plugged_in"), [KINDS, KINDS[::-1]])
def test_another_board_than_was_named_keeps_its_program(named: str, plugged_in: str, empty_board: Make) -> None:
    chip = BOARDS[plugged_in].chip
    with empty_board(plugged_in) as board:
        completed = run("flash", "--board", named, "--port", board.port)
        assert completed.code == 5
        assert f"the chip on {board.port} is an {chip}" in completed.err
        assert "nothing was written" in completed.err
        assert board.stats()["uart"]["received"] < 200


def test_a_port_that_another_program_holds_is_not_reset(empty_board: Make) -> None:
    from armkin.board.ports import SerialPort

    with empty_board("uno_cnc_shield") as board:
        held = SerialPort(board.port)
        resets = board.stats()["resets"]
        completed = run("flash", "--board", "uno_cnc_shield", "--port", board.port)
        assert (completed.code, board.stats()["resets"]) == (5, resets)
        assert "is in use" in completed.err
        held.close()


def test_a_board_without_a_boot_loader_is_told() -> None:
    with EmulatedBoard("uno_cnc_shield", speed="max") as board:
        completed = run("flash", "--board", "uno_cnc_shield", "--port", board.port)
        assert completed.code == 5
        assert "no boot loader answers" in completed.err


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("last", [b"", b"\x1b"])
def test_a_session_opens_while_the_real_boot_loader_listens(kind: str, last: bytes, loaders: dict[str, Path]) -> None:
    """A byte that comes meanwhile keeps the Mega's there until 5 s of silence: armkin never reached such a board.

    last: a byte after every greeting. 0x1b begins a message of the Mega's boot loader, which then takes the next four
    bytes for that message's head; one greeting in 256 ends so by chance, and what told the loader to leave was lost.
    """
    from armkin.board.firmware.wire.session import Session
    from armkin.board.ports import SerialPort

    class Port(SerialPort):
        def write(self, data: bytes) -> None:
            super().write(data + last)

    with EmulatedBoard(kind, elf=build_firmware(kind), loader=loaders[BOARDS[kind].chip], speed="max") as board:
        port = Port(board.port)
        assert Session(port).open().board == BOARDS[kind].number
        port.close()
