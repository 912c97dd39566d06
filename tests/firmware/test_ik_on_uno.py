"""The generated solver runs on the chip of an Uno, in the emulator: the branches of Python, its cycles and bytes."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from emulator import EmulatedBoard

import armkin
from armkin.export.c.c_program import identifier, program
from armkin.formula.c_and_js_code import number_text

HERE = Path(__file__).parent
ROBOTS = HERE.parents[1] / "robots"
QUESTIONS = 6


def build_program(arm: armkin.Arm, target: np.ndarray, folder: Path) -> tuple[Path, dict[str, int]]:
    """The program with the solver of an arm, and bytes: flash and RAM of the solver's own object and of the whole."""
    texts, prefix = program(arm, "arm.c", None, single=True), identifier(arm.name)
    (folder / "arm.c").write_text(texts.source)
    (folder / "arm.h").write_text(texts.header)
    rows = ", ".join("{" + ", ".join(number_text(float(v), True) for v in row) + "}" for row in target)
    near = ", ".join(number_text(float(v), True) for v in arm.home)
    (folder / "questions.h").write_text(
        f"enum {{ QUESTIONS = {len(target)} }};\n"
        f"static const REAL targets[QUESTIONS][TARGET] = {{{rows}}};\nstatic const REAL near[JOINTS] = {{{near}}};\n"
    )
    names = {"IK": "ik", "FK": "fk", "REAL": "real", "SOLUTION": "solution"}
    defines = [f"-D{name}={prefix}_{constant}" for name, constant in names.items()]
    defines += [f"-D{name}={prefix.upper()}_{name}" for name in ("JOINTS", "TARGET", "BRANCHES")]
    common = ["avr-gcc", "-mmcu=atmega328p", "-DF_CPU=16000000UL", "-std=c99", "-Os", "-Wall", "-Wextra", "-Werror"]
    common += [f"-I{folder}", "-ffunction-sections", "-fdata-sections"]
    subprocess.run([*common, "-c", folder / "arm.c", "-o", folder / "arm.o"], check=True)
    words = [*common, *defines, "-Wl,--gc-sections", HERE / "ik_on_uno.c", folder / "arm.o", "-lm"]
    subprocess.run([*map(str, words), "-o", str(folder / "ik.elf")], check=True)
    return folder / "ik.elf", section_sizes(folder / "arm.o", "solver") | section_sizes(folder / "ik.elf", "program")


def section_sizes(path: Path, name: str) -> dict[str, int]:
    listing = subprocess.run(["avr-size", path], capture_output=True, text=True, check=True).stdout
    code, data, bss = map(int, re.findall(r"\d+", listing.splitlines()[1])[:3])
    return {f"{name}_flash": code + data, f"{name}_ram": data + bss}


def chip_answers(arm: armkin.Arm, target: np.ndarray, folder: Path) -> dict[str, Any]:
    """What the chip says: found (QUESTIONS, branches, n) and its counts, cycles, bytes."""
    elf, told = build_program(arm, target, folder)
    count, branches = len(target), armkin.ik(arm, target).q.shape[1]
    with EmulatedBoard("uno_cnc_shield", speed="step", elf=elf) as board:

        def peek(name: str, kind: str, size: int) -> np.ndarray:
            size *= np.dtype(kind).itemsize
            start = int(board.control(f"peek {name} 1")["address"])
            parts = ((start + k, min(200, size - k)) for k in range(0, size, 200))
            told = "".join(str(board.control(f"peek {address} {length}")["bytes"]) for address, length in parts)
            return np.frombuffer(bytes.fromhex(told), kind)

        for _ in range(100):
            board.run(0.02)
            if peek("all_done", "<u1", 1)[0]:
                break
        width = 4 * arm.n + 2 + 2 + 4  # int has two bytes on this chip
        raw = peek("found", "<u1", count * branches * width).reshape(count, branches, width)
        q = np.ascontiguousarray(raw[:, :, : 4 * arm.n]).view("<f4")
        return told | {
            "q": q,
            "counts": peek("found_count", "<u1", count),
            "ik_cycles": peek("ik_cycles", "<u4", count),
            "fk_cycles": peek("fk_cycles", "<u4", count),
            "stack_left": int(peek("stack_left", "<u2", 1)[0]),
        }


def regular_targets(arm: armkin.Arm) -> np.ndarray:
    """Positions with all their branches, far from singular postures."""
    rng = np.random.default_rng(8)
    T = armkin.fk(arm, rng.uniform([-1, -1, -2.4], [1, 1, -0.4], (200, 3)))
    target = T[:, :3, 3]
    solutions = armkin.ik(arm, target)
    return target[solutions.valid.all(axis=1)][:QUESTIONS]


@pytest.fixture(scope="module")
def on_uno(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    arm = armkin.load(ROBOTS / "three_dof.yaml")
    return chip_answers(arm, regular_targets(arm), tmp_path_factory.mktemp("uno"))


def test_an_uno_finds_the_branches_of_python(on_uno: dict[str, Any]) -> None:
    arm = armkin.load(ROBOTS / "three_dof.yaml")
    solutions = armkin.ik(arm, regular_targets(arm))
    np.testing.assert_array_equal(on_uno["counts"], solutions.valid.sum(axis=1))
    np.testing.assert_allclose(on_uno["q"], solutions.q, atol=2e-5)


def test_its_cycles_and_bytes_are_those_of_the_documents(on_uno: dict[str, Any]) -> None:
    text = (HERE.parents[1] / "docs" / "c.md").read_text()
    figures = {
        r"\| all branches \| ([\d,]+) cycles": on_uno["ik_cycles"].max(),
        r"\| fk \| ([\d,]+) cycles": on_uno["fk_cycles"].max(),
        r"([\d,]+) bytes of flash": on_uno["program_flash"],
        r"([\d,]+) bytes of stack": 2048 - on_uno["program_ram"] - on_uno["stack_left"],
    }
    for pattern, measured in figures.items():
        match = re.search(pattern, text)
        assert match, pattern
        assert float(match[1].replace(",", "")) == pytest.approx(float(measured), rel=0.03), pattern
