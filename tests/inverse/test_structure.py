"""How much of `inverse` a singular pose enters: files and functions, counted."""

from __future__ import annotations

import sys
from pathlib import Path
from types import FrameType

import numpy as np
import pytest

import armkin
import armkin.inverse

ROOM = str(Path(armkin.inverse.__file__).parent)
STRAIGHT = np.radians([20.0, -50.0, 70.0, 30.0, 0.0, 40.0])


def entered_functions(arm: armkin.Arm, T: np.ndarray) -> set[tuple[str, str]]:
    """Files and functions of `inverse` that a second call for a pose enters; no comprehensions."""
    armkin.ik(arm, T)
    functions: set[tuple[str, str]] = set()

    def note_call(frame: FrameType, event: str, _: object) -> None:
        code = frame.f_code
        if event == "call" and code.co_filename.startswith(ROOM) and not code.co_name.startswith("<"):
            functions.add((code.co_filename, code.co_qualname))

    sys.setprofile(note_call)
    try:
        armkin.ik(arm, T)
    finally:
        sys.setprofile(None)
    return functions


@pytest.mark.parametrize(("name", "most"), [("puma560", (14, 45)), ("ur5e", (15, 50))])
def test_a_singular_pose_enters_few_files_and_functions(name: str, most: tuple[int, int]) -> None:
    """31 files and 117 functions once. These numbers may only fall."""
    arm = armkin.load(name)
    T = armkin.fk(arm, STRAIGHT)
    assert armkin.ik(arm, T).status == armkin.Status.SINGULAR
    functions = entered_functions(arm, T)
    assert len({file for file, _ in functions}) <= most[0]
    assert len(functions) <= most[1]


def test_a_regular_pose_enters_four_files() -> None:
    arm = armkin.load("puma560")
    functions = entered_functions(arm, armkin.fk(arm, STRAIGHT + 0.3))
    assert len({file for file, _ in functions}) <= 4
    assert len(functions) <= 8
