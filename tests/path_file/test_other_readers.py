"""Files at random, drawn as readers that share nothing with armkin's draw them; tests/bench/bench_drawings.py: all."""

from __future__ import annotations

import numpy as np
import pytest

import random_drawings
from armkin.errors import PathFileError
from reader_comparison import drawing_off, program_off, program_read, refusal, spoil_drawing


@pytest.mark.parametrize("seed", range(12))
def test_programs_are_read_as_another_reader_reads_them(seed: int) -> None:
    assert program_off(seed) <= 0.01


@pytest.mark.parametrize("seed", range(10))
def test_drawings_are_read_as_another_reader_reads_them(seed: int) -> None:
    assert drawing_off(seed) <= 0.01


@pytest.mark.parametrize("seed", range(8))
def test_a_broken_line_is_refused_with_its_number(seed: int) -> None:
    lines, rng = random_drawings.random_program(seed).splitlines(), np.random.default_rng(seed)
    k = int(rng.integers(2, max(3, len(lines) // 2)))
    broken = ("G1 X", "G33 X1", "G1 X1 X2", "G0 G1 X1", "G1 X#1", "G2 X1 Y1", "G1 X1..2", "G5 X1 Y1")[seed]
    lines.insert(k, broken)
    with pytest.raises(PathFileError, match=f"t.gcode:{k + 1}: "):
        program_read("\n".join(lines))


@pytest.mark.parametrize("number", range(len(random_drawings.BROKEN_ELEMENTS)))
def test_a_broken_element_is_refused_with_its_line(number: int) -> None:
    text, place, words = spoil_drawing(number, number)
    message = refusal(text)
    assert message.startswith(place)
    assert words in message
