"""What every command line must keep to, whatever it is given."""

from __future__ import annotations

import json
import math
import os
import random
import re
from collections import Counter
from typing import Any

from command_line import Result, run

ATTACKS = Counter[str]()  # inputs so far, by command
CODES = {0, 1, 2, 3, 4, 5}
NUMBERS = (
    "0 -0.0 1 -1 90 -90 180 360 1.0e-310 5.0e-324 -5.0e-324 1.0e-12 1.0e-7 0.5 1000000 1.0e+6 1.0e+7 -1.0e+7 1.0e+9 "
    "1.0e+308 -1.0e+308 1e3 017 80:16 .nan .inf -.5 1_0 0x10 true null ~ '' abc [1,2] {} 3.141592653589793 1.5708 "
    f"{'9' * 400}"
).split()


def attack(*words: object, stdin: bytes = b"") -> Result:
    """Run a command line and hold it to the contract: known exit code, no traceback, honest JSON, quiet stdout."""
    ATTACKS[str(words[0])] += 1
    completed = run(*words, stdin=stdin)
    shown = f"{words!r}\n{completed}"[:3000]
    assert completed.code in CODES, shown
    assert "internal error" not in completed.err, shown
    assert "Traceback" not in completed.err, shown
    assert "Warning" not in completed.err, shown
    if completed.code not in (0, 3):
        assert completed.err.strip(), shown
        # Rows before a malformed one have been answered; what `send` has moved it tells people alone.
        assert completed.out == "" or ("--batch" in words and (words[0] != "send" or "--json" not in words)), shown
    if "--json" in words and completed.out:
        for line in completed.out.splitlines():
            _assert_finite(json.loads(line, parse_constant=_refuse_word), shown)
    return completed


def random_generator(seed: object) -> random.Random:
    """Random numbers, the same in every run; ARMKIN_FUZZ_SEED makes others of them."""
    return random.Random(f"{seed} {os.environ.get('ARMKIN_FUZZ_SEED', '')}")


def _refuse_word(word: str) -> float:
    raise AssertionError(f"{word} in JSON")


def _assert_finite(value: Any, shown: str) -> None:
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        for part in value:
            _assert_finite(part, shown)
    elif isinstance(value, float):
        assert math.isfinite(value), shown


def spoil_text(rng: random.Random, text: str) -> str:
    """A robot file with one to three things wrong, or odd."""
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        lines = text.splitlines(keepends=True)
        k = rng.randrange(len(lines))
        kind = rng.randrange(10)
        if kind < 6:
            numbers = list(re.finditer(r"(?<![\w.])-?\d+(?:\.\d+)?(?![\w.])", text))
            if numbers:
                number = rng.choice(numbers)
                text = text[: number.start()] + rng.choice(NUMBERS) + text[number.end() :]
            continue
        if kind == 6:
            del lines[k]
        elif kind == 7:
            lines.insert(rng.randrange(len(lines)), lines[k])
        elif kind == 8:
            j = rng.randrange(len(lines))
            lines[k], lines[j] = lines[j], lines[k]
        else:
            column = rng.randrange(len(lines[k]))
            lines[k] = lines[k][:column] + rng.choice("{}[]:,#&*!|>'\"%@`\t \\x\u00e9\x07") + lines[k][column + 1 :]
        text = "".join(lines)
    return text
