"""The emulated Pico's PIO against the RP2040 datasheet: its example programs and rules, cycle by cycle.

Programs are in the datasheet's own words as its assembler encodes them; what the pins must do follows from its text.
"""

from __future__ import annotations

import json
import subprocess
from dataclasses import asdict, dataclass, field
from pathlib import Path

import pytest
from emulator import FIRMWARE, run_make

LEFT = 0  # SHIFTCTRL: both registers shift to the left
OUT_RIGHT, IN_RIGHT, AUTOPULL, AUTOPUSH = 1 << 19, 1 << 18, 1 << 17, 1 << 16


def pinctrl(
    *, out: int = 0, outs: int = 0, set_: int = 0, sets: int = 0, side: int = 0, sides: int = 0, in_: int = 0
) -> int:
    return sides << 29 | sets << 26 | outs << 20 | in_ << 15 | side << 10 | set_ << 5 | out


def wrap(bottom: int, top: int, *, optional_side: bool = False, jmp_pin: int = 0) -> int:
    return bottom << 7 | top << 12 | optional_side << 30 | jmp_pin << 24


@dataclass(frozen=True)
class Case:
    section: str  # of the datasheet
    program: list[int]
    pins: str  # GPIO `pin` from the machine's first cycle on; spaces do not count
    execctrl: int = wrap(0, 31)
    pinctrl: int = pinctrl(sets=1, outs=1)
    shiftctrl: int = OUT_RIGHT | IN_RIGHT
    clkdiv: int = 1 << 16
    tx: list[tuple[int, list[int]]] = field(
        default_factory=list
    )  # words that are there after that cycle; 0: from the start
    inputs: list[tuple[int, int]] = field(default_factory=list)  # levels from that cycle on
    before: list[int] = field(default_factory=list)  # instructions by SMx_INSTR
    pin: int = 0
    rx: list[int] = field(default_factory=list)
    stalled: int = 0  # FDEBUG
    irq: int = 0


TX_STALL = 1 << 24
SQUARE = [0xE081, 0xE101, 0xE000, 0x0001]
UART_TX = [0x9FA0, 0xF727, 0x6001, 0x0642]
WS2812 = [0x6221, 0x1123, 0x1400, 0xA442]
PWM = [0x9080, 0xA027, 0xA046, 0x00A5, 0x1806, 0xA042, 0x0083]


def repeated_bits(value: int, count: int, repeats: int) -> str:
    return "".join(str(value >> i & 1) * repeats for i in range(count))


CASES = {
    "a square wave: two cycles high, two low": Case("3.2.1", SQUARE, "0" + "1100" * 4),
    "with wrap in place of the jump": Case("3.5.2", [0xE081, 0xE101, 0xE100], "0" + "1100" * 4, wrap(1, 2)),
    "the fastest: a wrap costs nothing": Case("3.5.2", [0xE081, 0xE001, 0xE000], "0" + "10" * 6, wrap(1, 2)),
    "divided by 3": Case("3.5.5", [0xE001, 0xE000], "111000" * 3, wrap(0, 1), clkdiv=3 << 16),
    "divided by 2.5: two of its cycles in five": Case(
        "3.5.5", [0xE001, 0xE000], "11000" * 4, wrap(0, 1), clkdiv=2 << 16 | 128 << 8
    ),
    "x-- counts n + 1 turns": Case("3.4.2", [0xE025, 0x0041, 0xE001], "0" * 7 + "1", wrap(2, 2)),
    "a delay follows the stall, not the wait": Case(
        "3.4.1", [0x83A0, 0xE001], "0" * 10 + "11", wrap(1, 1), tx=[(5, [1])], stalled=TX_STALL
    ),
    "side-set happens though the instruction stalls": Case(
        "3.5.1", [0xA042, 0x90A0, 0xE000], "0" + "1" * 7, wrap(2, 2), pinctrl(sides=1), stalled=TX_STALL
    ),
    "side-set wins over OUT": Case("3.5.6", [0x7001], "1" * 4, wrap(0, 0), pinctrl(sides=1, outs=1), tx=[(0, [0])]),
    "UART, 8N1, eight cycles a bit": Case(
        "3.6.3",
        UART_TX,
        "1" * 8 + "0" * 8 + repeated_bits(0x5A, 8, 8) + "1" * 8 + "0" * 8 + repeated_bits(0xC3, 8, 8) + "1" * 8,
        wrap(0, 3, optional_side=True),
        pinctrl(sides=2, outs=1),
        tx=[(0, [0x5A, 0xC3])],
        stalled=TX_STALL,
    ),
    "WS2812: a one is 7 high, 3 low, a zero 2 high, 8 low": Case(
        "3.6.2",
        WS2812,
        "0"
        + "000"
        + "".join(("1111111" if 0xA50F00 >> 23 - i & 1 else "1100000") + "000" for i in range(24))[:-3]
        + "0" * 8,
        wrap(0, 3),
        pinctrl(sides=1),
        LEFT | AUTOPULL | 24 << 25,
        tx=[(0, [0xA50F0000])],
        stalled=TX_STALL,
    ),
    "SPI: a clock of four cycles, full duplex": Case(
        "3.6.1",
        [0x6101, 0x5101],
        "000" + "1100" * 7 + "11" + "0" * 6,
        wrap(0, 1),
        pinctrl(outs=1, sides=1, side=1, in_=2),
        LEFT | AUTOPULL | AUTOPUSH | 8 << 25 | 8 << 20,
        tx=[(0, [0x9C000000])],
        inputs=[(0, 4), (17, 0), (21, 4)],
        pin=1,
        rx=[0xF7],
        stalled=TX_STALL,
    ),
    "PWM: three cycles a step, high for the last ones": Case(
        "3.6.8",
        PWM,
        ("0" * 10 + "1" * 8) * 2 + "0",
        wrap(0, 6, optional_side=True),
        pinctrl(sides=2),
        before=[0xE024, 0xA0C1, 0xE022],  # set x 4; mov isr x; set x 2, which `pull noblock` takes from an empty FIFO
    ),
    "autopull fills and shifts in one cycle": Case(
        "3.5.4.2",
        [0x6001],
        "0" + repeated_bits(0x5, 4, 1) + repeated_bits(0xB, 4, 1) + "11",
        wrap(0, 0),
        shiftctrl=OUT_RIGHT | AUTOPULL | 4 << 25,
        tx=[(0, [5, 11])],
        stalled=TX_STALL,
    ),
    "autopull: a word that comes late costs a cycle more": Case(
        "3.5.4.2",
        [0x6001],
        "000000" + "0" + "1010",
        wrap(0, 0),
        shiftctrl=OUT_RIGHT | AUTOPULL | 4 << 25,
        tx=[(5, [5])],
        stalled=TX_STALL,
    ),
    "WAIT goes on in the cycle in which the level is there": Case(
        "3.4.3", [0x20A0, 0xE001], "0" * 7 + "11", wrap(1, 1), pinctrl(sets=1, in_=3), inputs=[(6, 8)]
    ),
    "JMP PIN": Case("3.4.2", [0x00C2, 0x0000, 0xE001], "0" * 5 + "11", wrap(2, 2, jmp_pin=4), inputs=[(4, 16)]),
    "IN, four pins a cycle, pushes itself": Case(
        "3.5.4.1",
        [0x4004],
        "0" * 9,
        wrap(0, 0),
        shiftctrl=IN_RIGHT | AUTOPUSH,
        inputs=[(i, i) for i in range(9)],
        rx=[0x76543210],
    ),
    "a full FIFO stops IN": Case(
        "3.5.4.1",
        [0x5008, 0xA042],
        "10" * 4 + "1" * 6,
        wrap(0, 1),
        pinctrl(sides=1),
        shiftctrl=IN_RIGHT | AUTOPUSH | 8 << 20,
        inputs=[(0, 0xA1)],
        rx=[0xA1000000] * 4,
        stalled=1,
    ),
    "MOV inverts and reverses": Case(
        "3.4.8", [0xE023, 0xA0C9, 0x8020, 0xA0D1, 0x8020], "0" * 5, wrap(31, 31), rx=[0xFFFFFFFC, 0xC0000000]
    ),
    "OUT EXEC runs the word in the next cycle": Case(
        "3.4.5", [0x80A0, 0x60F0, 0xE000], "00110", wrap(2, 2), tx=[(0, [0xE101])]
    ),
    "IRQ WAIT stands until somebody clears it": Case("3.4.9", [0xC020, 0xE001], "0" * 6, wrap(1, 1), irq=1),
    "pins go round behind 31": Case("3.5.6", [0xE003], "111", wrap(0, 0), pinctrl(set_=31, sets=2)),
}


@pytest.fixture(scope="module")
def came() -> dict[str, dict[str, object]]:
    run_make("-C", str(FIRMWARE / "sim" / "rp2040"))
    cases = [{**asdict(case), "cycles": len(case.pins.replace(" ", ""))} for case in CASES.values()]
    command = ["node", str(Path(__file__).with_name("pio_runner.mjs"))]
    completed = subprocess.run(command, input=json.dumps(cases), capture_output=True, text=True, check=True)
    return dict(zip(CASES, json.loads(completed.stdout), strict=True))


@pytest.mark.parametrize("name", CASES)
def test_the_emulated_pio_keeps_the_datasheets_timing(came: dict[str, dict[str, object]], name: str) -> None:
    case = CASES[name]
    assert came[name] == {"pins": case.pins, "rx": case.rx, "stalled": case.stalled, "irq": case.irq}
