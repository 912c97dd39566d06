"""The emulated board with a program whose every edge is known: probe.c, which takes orders of one letter."""

from __future__ import annotations

from pathlib import Path

import serial
from emulator import EmulatedBoard

PROBE = Path(__file__).with_name("probe.c")
MS = 1e-3


def stepped_board(probe: Path, board: str = "uno_cnc_shield", **options: object) -> EmulatedBoard:
    """In simulated time, with a trace."""
    return EmulatedBoard(board, elf=probe, speed="step", trace=True, **options)  # type: ignore[arg-type]


def start_probe(board: EmulatedBoard) -> EmulatedBoard:
    """Let the probe set up its UART."""
    board.run(2 * MS)
    return board


def ask_probe(port: serial.Serial, command: bytes) -> bytes:
    """The probe's answer to a letter, in real time."""
    port.write(command)
    return port.readline()
