"""Programs and drawings damaged at random: read, or refused with a line of the file."""

from __future__ import annotations

import re

import numpy as np
import pytest

import random_drawings
from armkin.errors import PathFileError
from armkin.path_file import csv_path, gcode, svg
from armkin.path_file.drawing import DrawingOptions
from reader_comparison import AS_IT_IS

_JUNK = [b"1e999", b"-", b"nan", b"(", b"%", b"<g>", b"\0", b"\xff\xfe", b"N1*5", b"G10 L20 P9", b"R-1", b"F0", b"P1e9",
         b"G2 X0 Y0 I0 J0\n", b"G4 P9e9\n", b"#1=5\n", b'transform="scale(0)"', b"A0 0 0 0 0 0 0", b"e"]  # fmt: skip
_MARKUP = re.compile(rb"[<>&\"\0]")


def damage_text(text: str, rng: np.random.Generator, markup: bool) -> bytes:
    """A file with one to five bytes or words put in, taken out or doubled; markup: not between an XML file's quotes."""
    raw = bytearray(text.encode())
    for _ in range(rng.integers(1, 6)):
        i, how = int(rng.integers(0, len(raw) + 1)), rng.integers(0, 4)
        if how == 0:
            put = bytes(rng.integers(32, 127, rng.integers(1, 6)).tolist())
        elif how == 1:
            put = _JUNK[rng.integers(len(_JUNK))]
        elif how == 2:
            put = bytes(raw[i : i + int(rng.integers(1, 60))])
        else:
            taken = raw[i : i + int(rng.integers(1, 20))]
            if markup or not _MARKUP.search(taken):
                del raw[i : i + len(taken)]
            continue
        inside = raw[:i].count(b'"') % 2 == 1
        if markup or (inside and not _MARKUP.search(put)):
            raw[i:i] = put
    return bytes(raw)


@pytest.mark.parametrize("kind", ["gcode", "svg", "attributes"])
def test_what_is_damaged_is_read_or_refused_with_its_line(kind: str) -> None:
    rng, refused = np.random.default_rng(24), []
    make, parse = (
        (random_drawings.random_program, gcode.parse_gcode)
        if kind == "gcode"
        else (random_drawings.random_drawing, svg.parse_svg)
    )
    for seed in range(40):
        raw = damage_text(make(seed), rng, kind != "attributes")
        try:
            parse(raw, "t", AS_IT_IS, DrawingOptions())
        except PathFileError as error:
            refused.append((str(error), raw.count(b"\n") + 1))
    assert len(refused) >= 10
    for message, lines in refused:
        match = re.match(r"t:(\d+): .", message)
        assert match, message
        assert 1 <= int(match[1]) <= lines


def test_a_cell_without_end_is_refused_with_its_line() -> None:
    """Python's own reader of CSV gives up at 131,072 characters: an internal error."""
    with pytest.raises(PathFileError, match=r"^t:2: no row of numbers: field larger than"):
        csv_path.parse_csv(b"1,2,3\n" + b"9" * 200_000 + b",1,2\n", "t")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x,y,w\n390,80,300\n", "t.csv:1: column w is unknown beside those of a target: x, y, z"),  # w was taken for z
        ("q1,x,y,z\n1,390,80,300\n", "t.csv:1: column q1 is unknown"),
        ("x,y,z,\n390,80,300,\n", "t.csv:1: column without a name is unknown"),
        ("x,y,z\n390,80,300\n1e300,80,300\n", "t.csv:3: '1e300' is beyond 1e+07"),  # was an internal error
    ],
)
def test_a_table_s_columns_and_numbers_are_those_of_a_path(text: str, message: str) -> None:
    with pytest.raises(PathFileError) as caught:
        csv_path.parse_csv(text.encode(), "t.csv")
    assert str(caught.value).startswith(message)
