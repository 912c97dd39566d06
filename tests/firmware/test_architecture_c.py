"""The layers of the firmware and of its emulators: no module reaches itself, by its includes or by its calls."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterable, Mapping
from pathlib import Path

import pytest
from emulator import BUILD, FIRMWARE, build_simulator

SOURCE = FIRMWARE / "src"
INCLUDE = re.compile(r'^\s*#include "([^"]+)"', re.M)
IMPORT = re.compile(r"^import .* from '\./([^']+)\.mjs';$", re.M)

# Room of src -> its compiler. The PC's has no files of its own: there the core alone is compiled.
COMPILERS = {
    "pc": ["gcc", "-DBOARD_uno_cnc_shield"],
    "avr": ["avr-gcc", "-mmcu=atmega328p", "-DF_CPU=16000000UL", "-DBOARD_uno_cnc_shield"],
    "rp2040": ["arm-none-eabi-gcc", "-mcpu=cortex-m0plus", "-mthumb", "-DBOARD_pico6"],
}
C_LIBRARY = {"memcpy", "memset", "memcmp", "memmove"}
HAL = re.compile(r"hal_\w+|dda_direction")  # what core/hal.h and chip.h ask of a chip


def includes_of(folder: Path) -> dict[str, set[str]]:
    """What each module (X.h and X.c together, "core/motion") below a folder includes of the same folder."""
    includes: dict[str, set[str]] = {}
    for file in sorted([*folder.rglob("*.h"), *folder.rglob("*.c")]):
        name = file.relative_to(folder).with_suffix("").as_posix()
        paths = [(file.parent / header).resolve() for header in INCLUDE.findall(file.read_text())]
        uses = {path.relative_to(folder).with_suffix("").as_posix() for path in paths}
        includes.setdefault(name, set()).update(uses)
    return {name: (uses & set(includes)) - {name} for name, uses in includes.items()}


def calls_of(objects: Iterable[Path]) -> tuple[dict[str, set[str]], set[str]]:
    """Which other object each one takes a function or a variable from; and the names that none of them defines."""
    defines: dict[str, str] = {}
    wants: dict[str, set[str]] = {}
    for file in objects:
        table = subprocess.run(["nm", "-P", "-g", str(file)], capture_output=True, text=True, check=True).stdout
        wants[file.stem] = set()
        for name, kind, *_ in (line.split() for line in table.splitlines()):
            if kind == "U":
                wants[file.stem].add(name)
            else:
                defines[name] = file.stem
    uses = {module: {defines[name] for name in names if name in defines} - {module} for module, names in wants.items()}
    return uses, set().union(*wants.values()) - set(defines)


def circular_modules(uses: Mapping[str, set[str]]) -> list[str]:
    """Modules that reach themselves, and those above them; empty if there are none."""
    left = dict(uses)
    while left:
        ready = [name for name, needs in left.items() if not needs & set(left)]
        if not ready:
            return sorted(left)
        for name in ready:
            del left[name]
    return []


def all_below(uses: Mapping[str, set[str]], name: str) -> set[str]:
    """All that a module reaches."""
    reached, next_names = set[str](), {name}
    while next_names:
        reached |= next_names
        next_names = set().union(*(uses[user] for user in next_names)) - reached
    return reached - {name}


def compile_objects(room: str, sources: Iterable[Path], into: Path) -> list[Path]:
    """One object a source, nothing inlined across them."""
    command = [*COMPILERS[room], "-std=gnu11", "-O1", "-c", *map(str, sources)]
    subprocess.run(command, cwd=into, check=True, capture_output=True)
    return sorted(into.glob("*.o"))


def test_a_circle_is_found(tmp_path: Path) -> None:
    """Three files that include nothing but call each other in a round, by declarations of their own."""
    for name, callee in [("a", "b"), ("b", "c"), ("c", "a")]:
        (tmp_path / f"{name}.c").write_text(f"void {callee}(void); void {name}(void) {{ {callee}(); }}")
    uses, missing = calls_of(compile_objects("pc", sorted(tmp_path.glob("*.c")), tmp_path))
    assert uses == {"a": {"b"}, "b": {"c"}, "c": {"a"}}
    assert (circular_modules(uses), missing) == (["a", "b", "c"], set())
    assert circular_modules(uses | {"c": set()}) == []
    assert all_below(uses, "a") == {"b", "c"}


@pytest.mark.parametrize("folder", ["src", "sim"])
def test_no_module_includes_itself(folder: str) -> None:
    assert circular_modules(includes_of(FIRMWARE / folder)) == []


def test_no_module_of_the_core_calls_itself(tmp_path: Path) -> None:
    uses, missing = calls_of(compile_objects("pc", sorted((SOURCE / "core").glob("*.c")), tmp_path))
    assert circular_modules(uses) == []
    assert {name for name in missing if not HAL.fullmatch(name)} <= C_LIBRARY, "the core calls the chip by hal.h alone"
    includes = includes_of(SOURCE)
    for module, used in uses.items():
        assert {f"core/{callee}" for callee in used} <= all_below(includes, f"core/{module}"), module


@pytest.mark.parametrize("room", ["avr", "rp2040"])
def test_no_module_of_a_chip_calls_itself(room: str, tmp_path: Path) -> None:
    uses, _ = calls_of(compile_objects(room, sorted((SOURCE / room).glob("*.c")), tmp_path))
    assert circular_modules(uses) == []


def test_no_module_of_the_emulator_calls_itself() -> None:
    build_simulator()
    sources = sorted((FIRMWARE / "sim").glob("*.c"))
    uses, _ = calls_of(BUILD / "sim" / f"{file.stem}.o" for file in sources)
    assert circular_modules(uses) == []
    includes = includes_of(FIRMWARE / "sim")
    for module, used in uses.items():
        assert used <= all_below(includes, module), module


def test_no_module_of_the_picos_emulator_imports_itself() -> None:
    files = sorted((FIRMWARE / "sim" / "rp2040").glob("*.mjs"))
    uses = {file.stem: set(IMPORT.findall(file.read_text())) for file in files}
    assert set().union(*uses.values()) == set(uses) - {"board"}, "every file is found, and board.mjs stands at the top"
    assert circular_modules(uses) == []


def test_only_the_protocol_ends_sessions() -> None:
    for file in sorted((SOURCE / "core").glob("*.[ch]")):
        if file.stem != "protocol":
            assert "session" not in re.sub(r"//.*", "", file.read_text()), file.name


def test_the_core_knows_no_chip() -> None:
    for file in sorted((SOURCE / "core").glob("*.[ch]")):
        text = file.read_text()
        assert "__AVR__" not in text, file.name
        assert "avr/" not in text, file.name
        assert "16000000" not in text, file.name
