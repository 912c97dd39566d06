"""Limit switches of the three-joint arm: in its robot file, and on the emulated board."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest
from emulator import EmulatedBoard

from command_line import ROOT, THREE_DOF

HOMING = """    homing: {{switch: {switch}, direction: {way}, at: {at}, speed: 40, backoff: 2, normally: open{order}}}
"""
AT = {"X": -4302, "Y": 3700, "Z": -2333}  # -121, 121 and -125 deg in steps from home
EDGES = {"X": -900, "Y": 1500, "Z": -1200}  # in steps from where the arm was left


def with_switches(path: Path) -> Path:
    """The three-joint arm with a limit switch on every joint."""
    text = (ROOT / THREE_DOF).read_text()
    for axis, way, switch_value, order in (
        ("X", -1, -121, ", order: 2"),
        ("Y", 1, 121, ", order: 1"),
        ("Z", -1, -125, ""),
    ):
        head, tail = text.split(f"    drive: {{axis: {axis}", 1)
        text = (
            head
            + HOMING.format(switch=axis, way=way, at=switch_value, order=order)
            + f"    drive: {{axis: {axis}"
            + tail
        )
    path.write_text(text)
    return path


def fit_switches(board: EmulatedBoard) -> None:
    """The arm was left somewhere; its switches are there, and bounce."""
    for axis, edge in EDGES.items():
        board.control(f"set-switch {axis} at {edge} {'above' if edge > 0 else 'below'} bounce 2ms")


def assert_found(pulses: Sequence[int], pins: Sequence[int]) -> None:
    """Where the board believes to be, less what the pins have done, is where the switches are."""
    for axis, believed, moved in zip("XYZ", pulses, pins, strict=True):
        assert believed - AT[axis] == pytest.approx(moved - EDGES[axis], abs=1)
