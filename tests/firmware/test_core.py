"""The firmware's own tests on this computer, and its builds: by make for each board, and as the Arduino IDE does it."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from emulator import BUILD, FIRMWARE, MCU, EmulatedBoard, build_firmware, run_make
from golden import read_talks

ARDUINO = Path("/usr/share/arduino/hardware/arduino/avr")  # Debian's arduino-core-avr
FLASH, RAM = {"atmega328p": 32_256, "atmega2560": 253_952}, {"atmega328p": 2048, "atmega2560": 8192}


def test_the_core_keeps_its_promises_under_sanitizers(sample: Callable[[int, int], int]) -> None:
    # unit tests, golden vectors; with --long a million random and a million damaged frames
    run_make("-C", str(FIRMWARE), "check", f"FRAMES={sample(1_000_000, 60_000)}", f"LIVES={sample(1000, 100)}")


def test_random_lives_take_the_branches_of_what_guards_a_motion() -> None:
    command = ["make", "-s", "-C", str(FIRMWARE), "coverage", "LIVES=400"]
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    taken = {m[1]: float(m[2]) for line in lines if (m := re.search(r"core/(\w+)\.c ([\d.]+)%", line))}
    assert min(taken[name] for name in ("config", "home", "inputs")) > 85, taken


@pytest.mark.parametrize("board", MCU)
def test_every_board_builds_without_warnings_and_fits(board: str) -> None:
    elf = build_firmware(board)  # -Wall -Wextra -Werror
    assert (BUILD / f"{board}.hex").read_text().startswith(":10")
    sizes = subprocess.run(["avr-size", "-A", str(elf)], capture_output=True, text=True, check=True).stdout
    section = {m[1]: int(m[2]) for m in re.finditer(r"^\.(\w+)\s+(\d+)", sizes, re.M)}
    assert section["text"] + section["data"] < FLASH[MCU[board]]
    assert (
        section["data"] + section["bss"] + section["noinit"] < RAM[MCU[board]]
    )  # test_stack_bound: what the rest takes


def test_flash_says_which_port_is_missing() -> None:
    completed = subprocess.run(["make", "-C", str(FIRMWARE), "flash"], capture_output=True, text=True, check=False)
    assert completed.returncode != 0
    assert "say which port: make flash PORT=" in completed.stdout + completed.stderr


def test_an_unknown_board_is_refused_by_name() -> None:
    completed = subprocess.run(["make", "-C", str(FIRMWARE), "BOARD=uno"], capture_output=True, text=True, check=False)
    assert completed.returncode != 0
    assert "BOARD is one of: uno_cnc_shield mega_ramps14 uno_servos pico6" in completed.stderr


def build_like_the_ide(folder: Path, mcu: str, variant: str, name: str) -> Path:
    """All of src/ and the sketch with the IDE's flags (platform.txt), linked with the Arduino core in an archive."""
    common = [f"-mmcu={mcu}", "-DF_CPU=16000000L", "-DARDUINO=10819", f"-DARDUINO_{name}", "-DARDUINO_ARCH_AVR"]
    common += [f"-I{ARDUINO}/cores/arduino", f"-I{ARDUINO}/variants/{variant}"]
    sections = ["-c", "-Os", "-ffunction-sections", "-fdata-sections", "-flto"]
    c = ["avr-gcc", *sections, "-std=gnu11", "-fno-fat-lto-objects", *common]
    # gcc 5 needs DECIMAL_DIG spelled out for the core's WString.cpp
    cpp = ["avr-g++", *sections, "-w", "-std=gnu++11", "-fpermissive", "-fno-exceptions", "-fno-threadsafe-statics"]
    cpp += ["-DDECIMAL_DIG=__DECIMAL_DIG__", *common]
    sketch = folder / "firmware.ino.cpp"
    sketch.write_text("#include <Arduino.h>\n" + (FIRMWARE / "firmware.ino").read_text())
    shutil.copytree(FIRMWARE / "src", folder / "src")
    (folder / "core").mkdir()
    commands = [[*cpp, str(sketch), "-o", str(folder / "sketch.o")]]
    for source in sorted((folder / "src").rglob("*.c")):
        warnings = ["-Wall", "-Wextra", "-Werror", "-Wno-type-limits"]
        commands.append([*c, *warnings, str(source), "-o", str(folder / f"{source.parent.name}_{source.stem}.o")])
    for source in sorted((ARDUINO / "cores/arduino").glob("*.c*")):
        compiler = c if source.suffix == ".c" else cpp
        commands.append([*compiler, "-w", str(source), "-o", str(folder / "core" / f"{source.name}.o")])
    for command in commands:
        subprocess.run(command, check=True)
    archive = folder / "core.a"
    subprocess.run(["avr-gcc-ar", "rcs", str(archive), *map(str, (folder / "core").glob("*.o"))], check=True)
    elf = folder / "firmware.elf"
    link = ["avr-gcc", "-Os", "-flto", "-fuse-linker-plugin", "-Wl,--gc-sections", f"-mmcu={mcu}", "-o", str(elf)]
    subprocess.run([*link, *map(str, sorted(folder.glob("*.o"))), str(archive), "-lm"], check=True)
    return elf


def test_the_arduino_ide_builds_the_same_firmware(tmp_path: Path) -> None:
    elf = build_like_the_ide(tmp_path, "atmega328p", "standard", "AVR_UNO")
    symbols = subprocess.run(["avr-nm", str(elf)], capture_output=True, text=True, check=True).stdout
    assert not re.search(r"\bmillis\b", symbols)  # nothing of the Arduino core, whose interrupts would shake the pulses
    talk = next(t for t in read_talks() if t.name == "move.talk")
    with EmulatedBoard("uno_cnc_shield", speed="step", elf=elf) as board:
        assert talk.replay(board) > 10


def test_the_arduino_ide_builds_for_the_mega(tmp_path: Path) -> None:
    elf = build_like_the_ide(tmp_path, "atmega2560", "mega", "AVR_MEGA2560")
    assert elf.stat().st_size > 0
