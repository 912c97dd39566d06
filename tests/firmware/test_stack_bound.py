"""The stack's bound, from the machine code: what is left of the RAM whatever happens, and that the bound is one."""

from __future__ import annotations

import subprocess
from pathlib import Path

import measure
import pytest
from emulator import MCU, build_firmware
from stack_bound import Program, stack_bound

RAM = {"uno_cnc_shield": 2048, "uno_servos": 2048, "mega_ramps14": 8192}
FREE = {"uno_cnc_shield": 128, "uno_servos": 128, "mega_ramps14": 1024}  # bytes that nothing may ever touch


@pytest.mark.parametrize("board", RAM)
def test_ram_is_left_whatever_happens(board: str) -> None:
    got = stack_bound(build_firmware(board), RAM[board])
    assert got.free >= FREE[board], got


def test_no_run_uses_more_than_the_bound() -> None:
    got = stack_bound(build_firmware("uno_cnc_shield"), 2048)
    run = measure.measure_turning("uno_cnc_shield", 640, ticks=40, count=60)
    used = 2048 - got.variables - run.stack_free
    assert 0.7 * got.total < used <= got.total


def compile_c(code: str, into: Path) -> Path:
    """C on an Uno."""
    source, elf = into / "one.c", into / "one.elf"
    source.write_text(code)
    command = ["avr-gcc", "-Os", f"-mmcu={MCU['uno_cnc_shield']}", "-o", str(elf), str(source)]
    subprocess.run(command, check=True, capture_output=True)
    return elf


DEEPER = """
volatile char sink;
__attribute__((noinline)) static void leaf(void) { volatile char local[SIZE]; local[0] = sink; sink = local[SIZE - 1]; }
__attribute__((noinline)) static void middle(void) { leaf(); sink++; }
int main(void) { for (;;) { if (sink) middle(); leaf(); } }
__attribute__((signal, used)) void __vector_11(void) { sink++; }
"""


@pytest.mark.parametrize("size", [10, 100, 300])
def test_frames_are_counted(size: int, tmp_path: Path) -> None:
    got = stack_bound(compile_c(DEEPER.replace("SIZE", str(size)), tmp_path), 2048)
    # Y and the frame below two return addresses, besides main's own and the interrupt's
    assert got.main.size == size + 2 + 2 * 2
    assert got.main.path == ("middle", "leaf")
    assert got.total > got.main.size + 4
    assert stack_bound(compile_c(DEEPER.replace("SIZE", str(size + 50)), tmp_path), 2048).free == got.free - 50


def test_a_call_in_a_circle_has_no_bound(tmp_path: Path) -> None:
    code = "volatile int n; int f(int k) { return k ? n + f(k - 1) + f(n) : n; } int main(void) { return f(n); }"
    with pytest.raises(ValueError, match="calls itself"):
        stack_bound(compile_c(code, tmp_path), 2048)


def test_a_call_by_pointer_is_not_passed_over(tmp_path: Path) -> None:
    code = "void (*volatile p)(void); int main(void) { p(); return 0; }"
    program = Program(compile_c(code, tmp_path))
    with pytest.raises(ValueError, match="icall"):
        program.deepest(program.symbol("main"))
