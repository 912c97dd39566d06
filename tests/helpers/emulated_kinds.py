"""Emulators of every kind of board, as the suite that all of them pass starts them; ours as its model."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from typing import Any

import armkin
from armkin.board.backend.board import Board
from armkin.board.conformance import Emulated, Start
from armkin.board.feetech import registers
from armkin.board.firmware.configuration import configure
from armkin.board.kinds import board_of
from armkin.board.klipper.extra_axes import axes_of
from armkin.board.sim.sim_servo_bus import Servo
from armkin.model.build_arm import arm_of_file
from armkin.robot_file import parse_robot_file
from other_programs import GRBL, OURS
from simulated_starts import KINDS


def emulate_ours(board: Board, sim: Any) -> Emulated:
    axes = configure(board.arm).axes
    foreign = [partial(sim.write, data) for data in OURS]
    return Emulated(board, sim, lambda: [sim.board.net[axis] for axis in axes], reset=sim.board.reset, foreign=foreign)


def emulate_grbl(board: Board, sim: Any, hal: bool = False) -> Emulated:
    sim.step = 0.01
    if hal:
        sim.__init__(axes=sim.axes, settings={**sim.settings, 384: 1}, hal=True)
        sim.step = 0.01
    base, boot = [0, 0, 0], sim.boot

    def boot_and_shift(*, power: bool = True) -> None:
        if power:
            base[:] = [a + b for a, b in zip(base, sim.steps[:3], strict=True)]
        boot(power=power)

    sim.boot = boot_and_shift
    return Emulated(
        board,
        sim,
        lambda: [a + b for a, b in zip(base, sim.steps[:3], strict=True)],
        reset=boot_and_shift,
        foreign=[partial(sim.write, data) for data in GRBL],
    )


def emulate_grblhal(board: Board, sim: Any) -> Emulated:
    return emulate_grbl(board, sim, hal=True)


def emulate_klipper(board: Board, sim: Any) -> Emulated:
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


def emulate_feetech(board: Board, sim: Any) -> Emulated:
    for k, count in enumerate(armkin.pulses(board.arm, board.arm.home), 1):
        sim.servos[k] = Servo(k, count)

    def stick() -> None:
        sim.servos[2].advance = lambda seconds: None

    def nudge() -> None:
        sim.servos[1].set(registers.GOAL_POSITION, round(sim.servos[1].position) + 60)

    def reset() -> None:
        for number, servo in sim.servos.items():
            sim.servos[number] = Servo(number, servo.position)

    return Emulated(
        board,
        sim,
        lambda: [sim.servos[k].position for k in (1, 2, 3)],
        reset=reset,
        foreign=[nudge],
        stall=stick,
        tolerance=24,
    )


def emulate_dynamixel(board: Board, sim: Any) -> Emulated:
    """Of the kind of examples/board_plugin, which must be installed."""
    torque, goal = slice(64, 65), slice(116, 120)

    def reset() -> None:
        for servo in sim.servos.values():
            servo.table[torque], servo.table[goal] = b"\0", round(servo.position).to_bytes(4, "little")

    def nudge() -> None:
        sim.servos[1].table[goal] = round(sim.servos[1].position + 60).to_bytes(4, "little")

    def stick() -> None:
        sim.servos[2].advance = lambda seconds: None

    pins = [sim.servos[k] for k in (1, 2, 3)]
    return Emulated(
        board,
        sim,
        lambda: [servo.position for servo in pins],
        reset=reset,
        foreign=[nudge, reset],
        stall=stick,
        tolerance=24,
    )


EMULATED: dict[str, tuple[str, Callable[..., Emulated]]] = {
    "uno_cnc_shield": ("uno_cnc_shield", emulate_ours),
    "grbl": ("grbl", emulate_grbl),
    "grblHAL": ("grbl", emulate_grblhal),
    "klipper": ("klipper", emulate_klipper),
    "feetech": ("feetech", emulate_feetech),
}


SAMPLES = {
    "moves_are_read_back_exactly": 20,
    "answers_that_are_lost_doubled_or_damaged_make_nothing_false": 12,
    "a_cable_that_is_pulled_makes_nothing_false": 7,
    "a_hold_keeps_the_position_and_the_next_motion_goes_on": 5,
}


def starter_of(kind: str) -> Start:
    """Begins a fresh emulator of a kind, named in EMULATED or `dynamixel`."""
    name, emulate = EMULATED.get(kind, ("feetech", emulate_dynamixel))
    text = KINDS[name] if kind in EMULATED else KINDS[name].replace(name, kind)

    def begin() -> Emulated:
        board = board_of(arm_of_file(parse_robot_file(text)))
        made: Emulated = emulate(board, board.simulated())
        return made

    return begin


def run_sample(case: Callable[..., None], kind: str) -> None:
    """A case, or some of it where all takes long: all of them are `tests/bench/bench_conformance.py`."""
    times = SAMPLES.get(case.__name__)
    case(starter_of(kind), *[times] * (times is not None))
