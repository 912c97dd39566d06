"""The AVR's tick by hand against the one that gcc makes of the same C: the same conversations, the same edges."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bare_host import WIDE, BareHost, cut_batches, image_for
from emulator import BUILD, FIRMWARE, EmulatedBoard, run_make
from golden import Talk, read_talks
from measure import counts_at_home
from numpy.typing import NDArray

from armkin.board.firmware.wire.protocol import STEP, Segment

# [cycles] that an instruction may keep a tick, and a lock of the main loop or the servo's interrupt
INSTRUCTION, LOCKED = 6, 130


def in_c(board: str) -> Path:
    """The firmware whose ticks all go the long way."""
    run_make("-C", str(FIRMWARE), f"BOARD={board}", "TICK=c")
    return BUILD / f"{board}-tick-c.elf"


def some_segments(rng: np.random.Generator, count: int, axes: int) -> list[Segment]:
    """Segments of all kinds: axes that turn, fine rates, intervals that grow, bent in blocks and with each tick."""
    out: list[Segment] = []
    for k in range(count):
        ticks, interval, sign = int(rng.integers(1, 220)), int(rng.integers(1000, 1500)), int(rng.choice([-1, 1]))
        rates = [int(r) >> 8 << 8 for r in rng.integers(-STEP + 512, STEP - 512, axes)]
        rates[k % axes] = int(rng.integers(-30000, 30000))  # fine
        quick = k % 4 == 1
        bend = min(32767, (2**18 if quick else 2**27) * int(rng.integers(20, 120)) // ticks**2) if k % 2 else 0
        add = int(rng.integers(10, 150)) * 65536 // ticks if k % 3 or bend else 0
        out.append(Segment(ticks, interval, sign * add, tuple(rates), sign * bend, quick))
    return out


def step_edges(board: str, elf: Path | None, segments: list[Segment]) -> dict[str, NDArray[np.int64]]:
    """When each STEP pin rose, and its motor's count then; the line is quiet while they do."""
    axes = 5 if board == "mega_ramps14" else 4
    wide = replace(WIDE, max_rate=60_000, max_accel=15_000_000)
    with EmulatedBoard(board, elf=elf, speed="step", trace=True) as emulated:
        host = BareHost(emulated)
        host.run(0.02)
        host.setup(image_for(board, wide), counts_at_home(board))
        pause = Segment(150, 16_000, 0, (0,) * axes)
        plan = cut_batches(tuple(range(axes)), (0,) * axes, [pause, *segments], 4)
        for batch in plan:
            host.order(batch.payload(0))
        host.run(0.45)
        status = host.status()
        assert (status.error, status.overruns, status.state) == (0, 0, 0)
        assert status.counts[:axes] == plan[-1].end
        trace = emulated.trace()
        names = list(emulated.stats()["axes"])[:axes]
        return {name: np.array(trace.positions(name)) for name in names}


@pytest.mark.parametrize("board", ["uno_cnc_shield", "mega_ramps14"])
def test_every_edge_comes_with_the_tick_that_c_makes(board: str) -> None:
    segments = some_segments(np.random.default_rng(26), 30, 5 if board == "mega_ramps14" else 4)
    by_hand, in_gcc = step_edges(board, None, segments), step_edges(board, in_c(board), segments)
    for name, (_, counts) in by_hand.items():
        assert (counts == in_gcc[name][1]).all()
    later = {name: cycles - in_gcc[name][0] for name, (cycles, _) in by_hand.items()}
    # the motions begin at different times, and edges come so much behind the interrupt
    begin = np.median(np.concatenate(list(later.values())))
    for off in (cycles - begin for cycles in later.values()):
        assert np.abs(off).max() <= LOCKED  # a tick is 1000 cycles, and an arithmetic that differs runs away
        assert np.quantile(np.abs(off), 0.9) <= INSTRUCTION


@pytest.mark.parametrize("talk", [t for t in read_talks() if t.board == "uno_cnc_shield"], ids=lambda talk: talk.name)
def test_c_answers_as_written(talk: Talk) -> None:
    with EmulatedBoard(talk.board, elf=in_c(talk.board), speed="step") as board:
        assert talk.replay(board) >= 2
