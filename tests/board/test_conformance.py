"""Every kind of board passes the suite that ships for kinds of others; ours as its model in this process."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from typing import Any

import pytest

import armkin
from armkin.board import conformance
from armkin.board.backend.board import Board
from armkin.board.conformance import Emulated, Start
from armkin.board.feetech import registers
from armkin.board.firmware.configuration import configure
from armkin.board.kinds import board_of
from armkin.board.klipper.axes import axes_of
from armkin.board.sim.servo_bus import Servo
from armkin.model.build import build
from armkin.robot_file import parse
from starting_elsewhere import KINDS

GRBL = (
    *(b"G92 X0 Y0 Z0\n", b"G10 L2 P1 X10 Y10\n", b"G55\n", b"G20G91\n", b"G91G1X3F900\n"),
    *(b"\x18", b"!", b"G1X5", b"\x91\x91"),
)


def ours(board: Board, sim: Any) -> Emulated:
    axes = configure(board.arm).axes
    noise = (b"G1 X5 F500\n", b"\x00\x01\x02\x00" * 8, bytes(range(256)), b"\x00")
    foreign = [partial(sim.write, data) for data in noise]
    return Emulated(board, sim, lambda: [sim.board.motors.counts()[axis] for axis in axes], foreign=foreign)


def grbl(board: Board, sim: Any, hal: bool = False) -> Emulated:
    sim.step = 0.01
    if hal:
        sim.__init__(axes=sim.axes, settings={**sim.settings, 384: 1}, hal=True)
        sim.step = 0.01
    base, boot = [0, 0, 0], sim.boot

    def booted(*, power: bool = True) -> None:
        if power:
            base[:] = [a + b for a, b in zip(base, sim.steps[:3], strict=True)]
        boot(power=power)

    sim.boot = booted
    return Emulated(
        board,
        sim,
        lambda: [a + b for a, b in zip(base, sim.steps[:3], strict=True)],
        reset=booted,
        foreign=[partial(sim.write, data) for data in GRBL],
    )


def grblhal(board: Board, sim: Any) -> Emulated:
    return grbl(board, sim, hal=True)


def klipper(board: Board, sim: Any) -> Emulated:
    axes = axes_of(board.arm)
    sim.step = 0.01

    def say(script: str) -> Callable[[], None]:
        request = {"id": 900, "method": "gcode/script", "params": {"script": script}}
        return lambda: sim.write(json.dumps(request).encode() + b"\x03")

    return Emulated(
        board,
        sim,
        lambda: [round((sim.at[axis.section] - axis.at_home) * axis.steps) for axis in axes],
        reset=sim.restart,
        foreign=[say("G91"), say("M220 S50"), say("M84"), say("FOO"), sim.shutdown],
    )


def feetech(board: Board, sim: Any) -> Emulated:
    for k, count in enumerate(armkin.pulses(board.arm, board.arm.home), 1):
        sim.servos[k] = Servo(k, count)

    def stick() -> None:
        sim.servos[2].advance = lambda seconds: None

    def nudge() -> None:
        sim.servos[1].set(registers.GOAL_POSITION, round(sim.servos[1].at) + 60)

    return Emulated(
        board, sim, lambda: [sim.servos[k].at for k in (1, 2, 3)], foreign=[nudge], stall=stick, tolerance=24
    )


EMULATED: dict[str, tuple[str, Callable[..., Emulated]]] = {
    "uno_cnc_shield": ("uno_cnc_shield", ours),
    "grbl": ("grbl", grbl),
    "grblHAL": ("grbl", grblhal),
    "klipper": ("klipper", klipper),
    "feetech": ("feetech", feetech),
}


def start(kind: str) -> Start:
    name, emulate = EMULATED[kind]

    def begin() -> Emulated:
        board = board_of(build(parse(KINDS[name])))
        return emulate(board, board.simulated())

    return begin


@pytest.mark.parametrize("case", conformance.CASES, ids=lambda case: case.__name__)
@pytest.mark.parametrize("kind", EMULATED)
def test_every_kind_conforms(kind: str, case: Callable[[Start], None]) -> None:
    case(start(kind))
